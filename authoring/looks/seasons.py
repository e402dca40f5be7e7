"""The seasons: what colors of grass, fields and woods are in each, as factors of those in summer."""

from typing import Literal, get_args

from authoring.looks.sheet import Color

Season = Literal["spring", "summer", "autumn", "winter"]
SEASONS: tuple[Season, ...] = get_args(Season)
SUMMER: Season = "summer"  # as all surfaces are drawn

Shades = dict[Season, Color]

# Grass is fresh in spring, pale in autumn, dull and half dead in a winter without snow. Fields that are ripe in summer
# stand green in spring, and are stubble after it.
TURF: Shades = {"spring": (1.05, 1.22, 0.90), "autumn": (1.32, 1.06, 1.08), "winter": (1.22, 0.92, 1.15)}
TALL_GRASS: Shades = {"spring": (0.62, 0.98, 0.72), "autumn": (0.96, 0.86, 0.90), "winter": (0.84, 0.70, 0.86)}
CEREALS: Shades = {"spring": (1.05, 1.20, 0.90), "autumn": (1.20, 1.02, 1.05), "winter": (1.15, 0.86, 1.10)}
RIPE: Shades = {"spring": (0.36, 0.58, 0.46), "autumn": (0.88, 0.82, 0.92), "winter": (0.62, 0.60, 0.78)}
# Hearts of crowns lie in the shade of all kinds of leaves, of needles too: between them.
HEARTS: Shades = {"spring": (1.35, 1.40, 1.0), "autumn": (1.9, 1.05, 0.85), "winter": (1.20, 0.68, 1.25)}
# A wood's broad leaves, from the crowns that turn least to those that turn most.
WOODS: dict[Season, tuple[Color, Color]] = {
    "spring": ((1.20, 1.25, 1.00), (1.75, 1.70, 1.05)),
    "autumn": ((1.55, 1.00, 0.85), (3.10, 1.45, 0.85)),
    "winter": ((1.25, 0.66, 1.50), (1.50, 0.80, 1.95)),
}
