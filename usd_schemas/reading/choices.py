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


def check_choices(choices: StageChoices) -> None:
    """Refuse choices that are impossible for any stage.

    Args:
        choices: The user's choices.

    Raises:
        InputError: An unknown purpose, or an invalid size.
    """
    for purpose in choices.purposes:
        if purpose not in PURPOSES:
            raise InputError("not a USD purpose", field="--purpose", value=purpose, allowed=", ".join(PURPOSES))
    for name, side in (("--width", choices.width), ("--height", choices.height)):
        if not 0 <= side <= LARGEST_SIDE:
            raise InputError("image size out of range", field=name, value=side, allowed=f"1 to {LARGEST_SIDE} px")
