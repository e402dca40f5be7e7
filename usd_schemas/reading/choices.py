"""A user's choices for reading a stage: camera, frames, purposes, variants, size, subdivision."""

import math
from collections.abc import Mapping, Sequence, Set
from dataclasses import asdict, dataclass
from itertools import islice
from numbers import Integral, Real
from typing import Any, NoReturn

from groundwork.errors import InputError

DRAWN_PURPOSES = ("default", "render")
PURPOSES = ("default", "render", "proxy", "guide")
MOST_FRAMES = 100_000
LARGEST_SIDE = 32_768  # [px]
MOST_REFINEMENTS = 4  # of subdivision surfaces: each makes four times the faces
_IMPOSSIBLE = {
    "camera": "not a camera",
    "purpose": "not a USD purpose",
    "frame": "not time codes",
    "variant": "not a variant",
    "width": "image size out of range",
    "height": "image size out of range",
    "subdivision": "number of refinements out of range",
}
_SIDE = f"0 (as authored) to {LARGEST_SIDE} px"
_MOST_LISTED = MOST_FRAMES + 1  # items that are read of a list, which may have no end
_ROUNDED = 1e-9  # [frames] rounding error allowed, so that a step such as 0.1 reaches its last frame


@dataclass(frozen=True)
class StageChoices:
    """Options for reading a stage, which override its own settings.

    Attributes:
        camera: Name or prim path of the one camera; empty for all products.
        frames: Time codes of the images [time codes]; empty for those of each camera.
        purposes: Purposes of USD (`render`, `proxy` …) that are drawn.
        variants: Prim path, variant set and name of each variant to select.
        width: Image width [px]; 0: from the product, or from the height.
        height: Image height [px]; 0: from the product, or from the width.
        subdivision: Number of refinements of subdivision surfaces; 0: their control meshes.
    """

    camera: str = ""
    frames: tuple[float, ...] = ()
    purposes: tuple[str, ...] = DRAWN_PURPOSES
    variants: tuple[tuple[str, str, str], ...] = ()
    width: int = 0
    height: int = 0
    subdivision: int = 1

    def as_json(self) -> dict[str, Any]:
        """Return JSON for `choices_from`."""
        return asdict(self)


AS_AUTHORED = StageChoices()


def choices_from(values: dict[str, Any] | None) -> StageChoices:
    """Create choices from JSON.

    Args:
        values: Result of `as_json`, or None for the stage's own settings.
    """
    if not values:
        return AS_AUTHORED
    return StageChoices(
        str(values["camera"]),
        tuple(float(value) for value in values["frames"]),
        tuple(values["purposes"]),
        tuple((str(path), str(name), str(chosen)) for path, name, chosen in values["variants"]),
        int(values["width"]),
        int(values["height"]),
        int(values["subdivision"]),
    )


def frames_of(words: Sequence[str]) -> tuple[float, ...]:
    """Parse time codes from words such as `12`, `1:48` or `1:48:2`; the end of a range is included.

    Args:
        words: What the user wrote.

    Returns:
        Time codes, each once [time codes].

    Raises:
        InputError: Neither a number nor a range, or too many.
    """
    found: dict[float, None] = {}
    for word in words:
        try:
            first, *others = (float(part) for part in word.split(":"))
            last, step = (*others, *(first, 1.0)[len(others) :])
            count = math.floor((last - first) / step + _ROUNDED) + 1
        except (ValueError, OverflowError, ZeroDivisionError):
            first, step, count = 0.0, 1.0, 0
        if not (0 < count <= MOST_FRAMES and math.isfinite(first) and step > 0.0):
            allowed = "a time code, or FIRST:LAST or FIRST:LAST:STEP"
            raise InputError("not a frame, nor a range of frames", field="--frame", value=word, allowed=allowed)
        found.update(dict.fromkeys(first + step * number for number in range(count)))
    return tuple(found)


def variants_of(words: Sequence[str]) -> tuple[tuple[str, str, str], ...]:
    """Parse variants from words such as `/World/House:roof=tiles`.

    Args:
        words: What the user wrote.

    Raises:
        InputError: A word has another form.
    """
    found = []
    for word in words:
        place, equals, chosen = word.partition("=")
        path, colon, name = place.partition(":")
        if not (path.startswith("/") and colon and name and equals):
            raise InputError("not a variant", field="--variant", value=word, allowed="/PRIM/PATH:SET=NAME")
        found.append((path, name, chosen))
    return tuple(found)


def checked_choices(choices: StageChoices) -> StageChoices:
    """Convert a script's choices to their types, and refuse those that are impossible for any stage.

    Numbers may be numpy's, lists any iterable (a set is sorted), and names and prim paths an `Sdf.Path`.

    Args:
        choices: The user's choices, of any type.

    Returns:
        The same choices, of the types that `StageChoices` states.

    Raises:
        InputError: A value of a wrong type, an unknown purpose, an invalid size, time code or number of refinements;
            it is named as an option of the command line.
    """
    purposes = _listed(choices.purposes, "purpose", f"a list of {', '.join(PURPOSES)}")
    for purpose in purposes:
        if purpose not in PURPOSES:
            _refuse("purpose", purpose, ", ".join(PURPOSES))
    codes = _listed(choices.frames, "frame", "a list of time codes")
    if len(codes) > MOST_FRAMES:
        raise InputError("too many time codes", field="--frame", allowed=f"up to {MOST_FRAMES}")
    chosen = _listed(choices.variants, "variant", "a list of (prim path, set, name)")
    return StageChoices(
        _text(choices.camera, "camera", "a name or a prim path"),
        tuple(_time_code(code) for code in codes),
        tuple(str(purpose) for purpose in purposes),
        tuple(_variant(one) for one in chosen),
        _whole(choices.width, "width", LARGEST_SIDE, _SIDE),
        _whole(choices.height, "height", LARGEST_SIDE, _SIDE),
        _whole(choices.subdivision, "subdivision", MOST_REFINEMENTS, f"0 to {MOST_REFINEMENTS}"),
    )


def _refuse(option: str, value: object, allowed: str) -> NoReturn:
    raise InputError(_IMPOSSIBLE[option], field=f"--{option}", value=value, allowed=allowed) from None


def _listed(value: Any, option: str, allowed: str) -> tuple[Any, ...]:
    """Return the items of any iterable but text and tables."""
    if isinstance(value, str | bytes | Mapping):
        _refuse(option, value, allowed)
    try:
        items = tuple(islice(iter(value), _MOST_LISTED))
    except TypeError:  # a number, or an array without an axis
        _refuse(option, value, allowed)
    if not isinstance(value, Set):
        return items
    try:
        return tuple(sorted(items))
    except TypeError:  # of several types; one of them is refused later
        return tuple(sorted(items, key=repr))


def _text(value: Any, option: str, allowed: str) -> str:
    if not isinstance(value, str):
        from pxr import Sdf  # heavy, and rarely needed

        if not isinstance(value, Sdf.Path):
            _refuse(option, value, allowed)
    return str(value)


def _time_code(value: Any) -> float:
    try:
        code = float(value) if isinstance(value, Real) and not isinstance(value, bool) else math.nan
    except OverflowError:
        code = math.inf
    if not math.isfinite(code):
        _refuse("frame", value, "a list of time codes")
    return code


def _variant(value: Any) -> tuple[str, str, str]:
    allowed = "(prim path, set, name)"
    words = [_text(word, "variant", allowed) for word in _listed(value, "variant", allowed)]
    if len(words) != 3 or not words[0].startswith("/"):
        _refuse("variant", value, allowed)
    path, name, chosen = words
    return path, name, chosen


def _whole(value: Any, option: str, most: int, allowed: str) -> int:
    if not isinstance(value, Integral) or isinstance(value, bool) or not 0 <= int(value) <= most:
        _refuse(option, value, allowed)
    return int(value)
