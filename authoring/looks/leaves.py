"""The texture of leaf cards: a grid of cells, each with the cut-out image of a twig, a tuft or a stalk of one plant."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from authoring.looks.noise import Tile, snap
from authoring.looks.seasons import SUMMER, Season
from authoring.looks.sheet import Color, Sheet
from authoring.site.sprays import ROWS, SPRAYS

F64 = NDArray[np.float64]

_FINE = 2  # texels drawn for each one kept, along a side
_SHIFT = 4  # bits of a texel's fraction in the corners of what is drawn
_STEM: Color = (0.060, 0.046, 0.032)
_TURNS = 1_109  # seed of how far each leaf has turned
_TURNED = 0.55, 1.3  # least and most of it: on one tree there are leaves of last month and of the next [1]
# Mean linear colors of sunlit leaves: 5 to 7 % red, 8 to 12 % green, 2 to 4 % blue.
_TINTS: dict[str, Color] = {
    "oak": (0.066, 0.098, 0.028),
    "lime": (0.090, 0.128, 0.034),
    "willow": (0.100, 0.125, 0.056),
    "scrub": (0.076, 0.094, 0.036),
    "spruce": (0.034, 0.055, 0.026),
    "pine": (0.048, 0.070, 0.030),
    "twigs": (0.085, 0.070, 0.052),
    "grass": (0.080, 0.108, 0.036),
    "herbs": (0.080, 0.112, 0.036),
    "reed": (0.105, 0.120, 0.046),
}
# What a season makes of the tints: factors, and which kinds it changes; needles stay as they are.
_SEASONS: dict[Season, dict[str, Color]] = {
    "summer": {},
    "spring": {
        **dict.fromkeys(("oak", "lime", "willow", "scrub", "herbs"), (1.50, 1.58, 1.05)),
        "grass": (1.10, 1.28, 0.92),
        "reed": (1.30, 1.05, 1.30),
    },
    "autumn": {
        "oak": (2.1, 0.92, 0.75),
        "lime": (2.7, 1.55, 0.80),
        "willow": (1.9, 1.30, 0.70),
        "scrub": (2.0, 0.85, 0.80),
        "grass": (1.45, 1.15, 1.10),
        "herbs": (1.7, 1.10, 1.20),
        "reed": (1.8, 1.35, 1.40),
    },
    "winter": {
        "oak": (1.55, 0.72, 1.50),
        "lime": (1.05, 0.54, 1.20),
        "willow": (1.05, 0.62, 0.80),
        "scrub": (1.25, 0.72, 1.20),
        "grass": (1.50, 0.98, 1.30),
        "herbs": (1.55, 0.82, 1.30),
        "reed": (1.75, 1.25, 1.70),
    },
}


@dataclass
class _Cell:
    """A cell while it is drawn: colors and opacity, the first row at the top, and a random stream.

    `turned` is the color that leaves turn to in the season, `turns` a stream that says how far each has turned.
    """

    color: NDArray[np.float32]
    opacity: NDArray[np.uint8]
    rng: np.random.Generator
    turned: F64
    turns: np.random.Generator

    def fill(self, outline: F64, color: F64) -> None:
        """Fill a convex outline, in parts of the cell with the origin at its lower left, shape (N, 2), float64."""
        import cv2

        side = len(self.opacity)
        place = np.column_stack([outline[:, 0], 1.0 - outline[:, 1]]) * side * (1 << _SHIFT)
        corners = np.round(place).astype(np.int32)
        cv2.fillConvexPoly(self.color, corners, tuple(float(value) for value in snap(color)), shift=_SHIFT)
        cv2.fillConvexPoly(self.opacity, corners, 255.0, shift=_SHIFT)

    def line(self, start: F64, end: F64, width: tuple[float, float], color: F64) -> None:
        """Draw a straight, tapering line; widths and places in parts of the cell."""
        along = (end - start) / max(float(np.hypot(*(end - start))), 1e-6)
        aside = np.array([-along[1], along[0]])
        low, high = 0.5 * width[0] * aside, 0.5 * width[1] * aside
        self.fill(np.stack([start - low, end - high, end + high, start + low]), color)


def leaves(tile: Tile, season: Season = SUMMER) -> Sheet:
    """Draw the texture of leaf cards: leafy twigs, branches with needles, tufts of grass, herbs, reed, in 4 x 4 cells.

    Args:
        tile: Its size; it does not repeat.
        season: The season of the colors; the outlines are the same in every season.
    """
    import cv2

    side = _FINE * tile.pixels // ROWS
    draws = {"spruce": _branch, "pine": _brush, "grass": _blades, "herbs": _herbs, "reed": _reeds, "twigs": _twigs}
    albedo = np.zeros((tile.pixels, tile.pixels, 3), np.float32)
    opacity = np.zeros((tile.pixels, tile.pixels), np.float32)
    for kind, numbers in SPRAYS.items():
        tint = np.array(_TINTS[kind])
        turned = tint * np.array(_SEASONS[season].get(kind, (1.0, 1.0, 1.0)))
        for number in numbers:
            own = np.random.default_rng([int(tile.rng.integers(2**31)), number])
            turns = np.random.default_rng([_TURNS, number])
            blank = np.zeros((side, side, 3), np.float32), np.zeros((side, side), np.uint8)
            cell = _Cell(*blank, own, turned, turns)
            draws[kind](cell, turned, kind) if kind in draws else _leafy(cell, tint, kind)
            seen = cell.opacity > 0
            cell.color[~seen] = np.mean(cell.color[seen], axis=0, dtype=np.float64) if seen.any() else turned
            row, column = ROWS - 1 - number // ROWS, number % ROWS
            half = side // _FINE
            place = np.s_[row * half : (row + 1) * half, column * half : (column + 1) * half]
            albedo[place] = cv2.resize(cell.color, (half, half), interpolation=cv2.INTER_AREA)
            opacity[place] = cv2.resize(cell.opacity, (half, half), interpolation=cv2.INTER_AREA) / np.float32(255)
    return Sheet(snap(albedo), np.full(opacity.shape, 0.62, np.float32), opacity=snap(opacity))


def _leafy(cell: _Cell, tint: F64, kind: str) -> None:
    """Draw a spray of leaves round a branch; those drawn first lie deeper and are darker."""
    rng = cell.rng
    length, slim, count = {"lime": (0.074, 0.34, 430), "willow": (0.105, 0.14, 470), "scrub": (0.058, 0.30, 560)}.get(
        kind, (0.076, 0.29, 430)
    )
    foot = np.array([0.5, 0.08])
    for turn in rng.uniform(-1.1, 1.1, 7):
        end = foot + rng.uniform(0.4, 0.75) * np.array([np.sin(turn), np.cos(turn)])
        cell.line(foot, np.clip(end, 0.06, 0.94), (0.018, 0.006), np.array(_STEM))
    knots = 0.5 + 0.25 * rng.normal(size=(22, 2))
    for number in range(count):
        depth = number / count
        knot = knots[rng.integers(len(knots))] if rng.random() < 0.6 else 0.5 + rng.uniform(-0.42, 0.42, 2)
        spot = knot + 0.075 * rng.normal(size=2)
        away = spot - 0.5
        if np.hypot(*away) > 0.46 - 0.05 * rng.random():
            continue
        way = np.arctan2(away[0], away[1] + 0.25) + rng.normal(0.0, 0.7)
        shade = (0.40 + 0.85 * depth) * rng.uniform(0.82, 1.2)
        warm = np.array([1.0 + 0.10 * rng.normal(), 1.0, 1.0 + 0.12 * rng.normal()])
        color = tint + cell.turns.uniform(*_TURNED) * (cell.turned - tint)
        _leaf(cell, spot, way, length * rng.uniform(0.7, 1.2), slim, color * shade * np.clip(warm, 0.5, 1.7))


def _leaf(cell: _Cell, foot: F64, way: float, length: float, slim: float, color: F64) -> None:
    """Draw a leaf as two halves, one lighter, which meet at its rib."""
    along = np.array([np.sin(way), np.cos(way)])
    aside = np.array([along[1], -along[0]])
    bow = np.array([0.0, 0.72, 1.0, 0.84, 0.42, 0.0])
    rib = foot + length * np.linspace(0.0, 1.0, 6)[:, None] * along
    for side, light in ((1.0, 1.14), (-1.0, 0.84)):
        edge = rib + side * slim * length * bow[:, None] * aside
        cell.fill(np.vstack([rib[[0, -1]], edge[-2:0:-1]]), color * light)


def _branch(cell: _Cell, tint: F64, kind: str) -> None:
    """Draw a spruce's branch, its stem up the cell, with needled side shoots in a long triangle."""
    rng = cell.rng
    cell.line(np.array([0.5, 0.0]), np.array([0.5, 0.97]), (0.022, 0.006), np.array(_STEM))
    order = rng.permutation(64)
    for rank, number in enumerate(order):
        share = (number // 2 + rng.random()) / 32
        side = 1.0 if number % 2 else -1.0
        start = np.array([0.5, 0.03 + 0.90 * share])
        reach = (0.46 * (1.0 - share) ** 0.8 + 0.05) * rng.uniform(0.75, 1.1)
        way = side * rng.uniform(0.85, 1.15)
        end = start + reach * np.array([np.sin(way), np.cos(way)])
        end = np.clip(end, 0.02, 0.985)
        shade = (0.5 + 0.6 * rank / 64) * rng.uniform(0.85, 1.2)
        _needles(cell, start, end, 0.036, 0.010, tint * shade)


def _needles(cell: _Cell, start: F64, end: F64, length: float, step: float, color: F64) -> None:
    """Draw a shoot with needles on both sides."""
    rng = cell.rng
    reach = float(np.hypot(*(end - start)))
    along = (end - start) / max(reach, 1e-6)
    cell.line(start, end, (0.012, 0.008), 0.6 * color)
    for at in np.arange(0.0, reach, step):
        for side in (-1.0, 1.0):
            aside = np.array([-along[1], along[0]]) * side
            tip = (0.75 * aside + 0.66 * along) * length * rng.uniform(0.7, 1.15)
            foot = start + at * along
            cell.line(foot, foot + tip, (0.011, 0.005), color * rng.uniform(0.75, 1.4))


def _brush(cell: _Cell, tint: F64, kind: str) -> None:
    """Draw tufts of long needles at the ends of twigs."""
    rng = cell.rng
    foot = np.array([0.5, 0.04])
    for number in range(46):
        spot = 0.5 + 0.40 * np.sqrt(rng.random()) * _direction(rng.uniform(0.0, 2 * np.pi))
        cell.line(foot + 0.3 * (spot - foot), spot, (0.010, 0.006), np.array(_STEM))
        shade = (0.45 + 0.65 * number / 46) * rng.uniform(0.85, 1.2)
        for way in rng.uniform(0.0, 2 * np.pi, 30):
            tip = spot + 0.085 * rng.uniform(0.6, 1.1) * (_direction(way) + np.array([0.0, 0.25]))
            cell.line(spot, tip, (0.010, 0.004), tint * shade * rng.uniform(0.75, 1.3))


def _twigs(cell: _Cell, tint: F64, kind: str) -> None:
    """Draw bare twigs that fork."""
    rng = cell.rng
    stack = [(np.array([0.5, 0.02]), 0.0, 0.30, 0.026)]
    while stack:
        foot, way, reach, width = stack.pop()
        end = foot + reach * _direction(np.pi / 2 - way)
        cell.line(foot, end, (width, 0.6 * width), tint * rng.uniform(0.7, 1.2))
        if width > 0.006:
            for side in (-1.0, 1.0, 0.3 * rng.normal()):
                at = foot + rng.uniform(0.55, 1.0) * (end - foot)
                stack.append((at, way + side * rng.uniform(0.3, 0.7), reach * rng.uniform(0.62, 0.8), 0.6 * width))


def _blade(cell: _Cell, foot: float, height: float, bend: float, width: float, color: F64) -> None:
    """Draw a blade of grass in four pieces, lighter towards its tip."""
    share = np.linspace(0.0, 1.0, 5)
    line = np.column_stack([foot + bend * share**2, height * (share - 0.16 * abs(bend) * share**3)])
    wide = width * (1.0 - 0.93 * share)
    for k in range(4):
        cell.line(line[k], line[k + 1], (wide[k], wide[k + 1]), color * (0.55 + 0.22 * k))


def _blades(cell: _Cell, tint: F64, kind: str) -> None:
    """Draw many blades from a common foot, some of them dry, some with seed heads."""
    rng = cell.rng
    for number in range(150):
        depth = number / 150
        foot = 0.5 + 0.34 * np.clip(rng.normal(0.0, 0.5), -1.0, 1.0)
        height, bend = rng.uniform(0.35, 0.97) * (1.0 - 0.25 * depth), rng.normal(0.5 * (foot - 0.5), 0.13)
        bend = np.clip(bend, 0.03 - foot, 0.97 - foot)
        dry = np.array([1.45, 1.12, 1.05]) if rng.random() < 0.16 else np.array([1.0, 1.0, 1.0])
        color = tint * dry * (0.5 + 0.65 * depth) * rng.uniform(0.8, 1.2)
        _blade(cell, foot, height, bend, rng.uniform(0.013, 0.024), color)
        if number % 11 == 0:
            tip = np.array([foot + bend, height * (1.0 - 0.16 * abs(bend))])
            _leaf(cell, tip - np.array([0.0, 0.05]), 0.4 * bend, 0.09, 0.12, np.array([0.20, 0.165, 0.085]))


def _herbs(cell: _Cell, tint: F64, kind: str) -> None:
    """Draw leafy stalks with flowers among grass."""
    rng = cell.rng
    _blades(cell, 0.9 * tint, kind)
    for number in range(12):
        foot, height = rng.uniform(0.25, 0.75), rng.uniform(0.5, 0.93)
        lean = rng.uniform(-0.12, 0.12)
        top = np.array([foot + lean, height])
        cell.line(np.array([foot, 0.0]), top, (0.014, 0.008), 0.8 * tint)
        for at in np.arange(0.12, 0.85, 0.11):
            spot = np.array([foot + at * lean, at * height])
            _leaf(cell, spot, rng.choice((-1.0, 1.0)) * rng.uniform(0.7, 1.3), 0.10, 0.22, tint * rng.uniform(0.7, 1.3))
        bloom = ((0.42, 0.41, 0.36), (0.42, 0.33, 0.06), (0.26, 0.16, 0.30))[number % 3]
        for way in rng.uniform(-1.2, 1.2, 9):
            _leaf(cell, top + 0.035 * _direction(np.pi / 2 - way), way, 0.028, 0.42, np.array(bloom))


def _reeds(cell: _Cell, tint: F64, kind: str) -> None:
    """Draw tall stalks with long hanging leaves and brown plumes."""
    rng = cell.rng
    for number in range(34):
        foot, height = 0.5 + rng.uniform(-0.36, 0.36), rng.uniform(0.62, 0.95)
        lean = rng.uniform(-0.07, 0.07)
        color = tint * (0.55 + 0.6 * number / 34) * rng.uniform(0.85, 1.2)
        top = np.array([foot + lean, height])
        cell.line(np.array([foot, 0.0]), top, (0.014, 0.008), color)
        for at in rng.uniform(0.15, 0.85, 6):
            side, spot = rng.choice((-1.0, 1.0)), np.array([foot + at * lean, at * height])
            _leaf(cell, spot, side * rng.uniform(0.25, 0.8), rng.uniform(0.15, 0.27), 0.055, color * 1.1)
        if number % 3 == 0:
            _leaf(cell, top - np.array([0.0, 0.05]), lean, 0.12, 0.16, np.array([0.115, 0.078, 0.050]))


def _direction(angle: float) -> F64:
    return np.array([np.cos(angle), np.sin(angle)])
