"""What a row of the tables of surfaces says."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from authoring.looks.noise import Tile
from authoring.looks.sheet import Sheet

# [m] of a tile of the detail, 2048 texels: the first is longer than what one picture shows, the last gives 0.7 mm a
# texel. Incommensurate with each other and with the sheets.
DETAIL_PERIODS = (31.0, 6.7, 1.43)

SIDE = 8.192  # [m] of a sheet of a bridge: 4 mm a texel at 2048
FULL = 2048  # texels along the side of such a sheet

NO_SHINE = 1.0  # refractive index of what has no surface that light could be mirrored at: `Recipe.matt` [1]

ROUGH = (0.42, 0.30, 0.44)  # strong enough that a patch differs from itself one sheet on
SMOOTH = (0.12, 0.12, 0.14)
FAINT = (0.06, 0.06, 0.08)

# Contrast of the grain of a bridge's surfaces, of `grain_texture`: newly made, after decades, and of coated metal.
NEW_GRAIN = (0.06, 0.08, 0.10)
GRAIN = (0.30, 0.28, 0.30)


@dataclass(frozen=True)
class Recipe:
    """How one surface is made.

    Attributes:
        draw: Draws the sheet.
        meters: Length of the sheet's sides [m].
        detail: Contrast of the fine detail at each of `DETAIL_PERIODS` [1].
        patchy: On the site's ground: carries the patchy macro texture on `st1`.
        relief: Write a normal map.
        pixels: Texels along a side where the settings ask for `FULL` [px].
        contrast: Exponent of the drawn albedo about its mean [1]: below 1 its darks and lights come closer, so that
            sheet and fine detail together stay below an RMS contrast of 20 %.
        picture: Which fine detail: `detail`, with specks of many sizes, or `grain`, a mottle of all sizes.
        matt: Without a shine of its own: the measured albedo of grass or earth holds all light that it reflects.
        cut_out: The sheet is a chart of things that are cut out: it does not repeat, and carries no fine detail.
    """

    draw: Callable[[Tile], Sheet]
    meters: float
    detail: tuple[float, float, float]
    patchy: bool = False
    relief: bool = False
    pixels: int = FULL // 2
    contrast: float = 1.0
    picture: Literal["detail", "grain"] = "detail"
    cut_out: bool = False
    matt: bool = False
