"""A user's choices for reading a stage: camera, frames, purposes, variants, size, subdivision."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from groundwork.errors import InputError

DRAWN_PURPOSES = ("default", "render")
PURPOSES = ("default", "render", "proxy", "guide")
MOST_FRAMES = 100_000
LARGEST_SIDE = 32_768  # [px]
MOST_REFINEMENTS = 4  # of subdivision surfaces: each makes four times the faces
_IMPOSSIBLE = {
    "camera": "not a camera",
    "purposes": "not a USD purpose",
    "frames": "not time codes",
    "variants": "not a variant",
    "width": "image size out of range",
    "height": "image size out of range",
    "subdivision": "number of refinements out of range",
}
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


def check_choices(choices: StageChoices, *, are_options: bool = True) -> None:
    """Refuse choices that are impossible for any stage.

    Args:
        choices: The user's choices; those of a script may be of any type.
        are_options: Name them in an error as options of the command line, not as fields.

    Raises:
        InputError: A value of a wrong type, an unknown purpose, an invalid size, time code or number of refinements.
    """

    def want(right: bool, field: str, value: object, allowed: str) -> None:
        if not right:
            option = {"purposes": "--purpose", "frames": "--frame", "variants": "--variant"}.get(field, f"--{field}")
            raise InputError(_IMPOSSIBLE[field], field=option if are_options else field, value=value, allowed=allowed)

    want(isinstance(choices.camera, str), "camera", choices.camera, "a name or a prim path")
    for purpose in _listed(choices.purposes):
        want(purpose in PURPOSES, "purposes", purpose, ", ".join(PURPOSES))
    frames = _listed(choices.frames)
    for code in frames:
        want(_is_number(code) and math.isfinite(code), "frames", code, "a list of time codes")
    want(len(frames) <= MOST_FRAMES, "frames", len(frames), f"up to {MOST_FRAMES} time codes")
    for variant in _listed(choices.variants):
        words = _listed(variant)
        is_one = len(words) == 3 and all(isinstance(word, str) for word in words) and words[0].startswith("/")
        want(is_one, "variants", variant, "a list of prim path, set and name")
    for name, side in (("width", choices.width), ("height", choices.height)):
        want(type(side) is int and 0 <= side <= LARGEST_SIDE, name, side, f"1 to {LARGEST_SIDE} px")
    level = choices.subdivision
    want(type(level) is int and 0 <= level <= MOST_REFINEMENTS, "subdivision", level, f"0 to {MOST_REFINEMENTS}")


def _listed(value: Any) -> Sequence[Any]:
    """Return a list or tuple; anything else as one item, so that it is judged as such."""
    return value if isinstance(value, list | tuple) else (value,)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
