"""The sky: an analytic clear sky by turbidity, with clouds on a level sheet."""

import numpy as np
from numpy.typing import NDArray

from authoring.light.sun import LUMINANCE

F64 = NDArray[np.float64]

_HORIZON = 0.02  # sine of the height below which the sky is that of the horizon
_LOWEST_SUN = 1.0  # [deg] below which the formulae do not hold
_COEFFICIENTS = {  # slope over turbidity and value at turbidity 0 of Perez's a to e, for luminance and chromaticity
    "Y": ((0.1787, -1.4630), (-0.3554, 0.4275), (-0.0227, 5.3251), (0.1206, -2.5771), (-0.0670, 0.3703)),
    "x": ((-0.0193, -0.2592), (-0.0665, 0.0008), (-0.0004, 0.2125), (-0.0641, -0.8989), (-0.0033, 0.0452)),
    "y": ((-0.0167, -0.2608), (-0.0950, 0.0092), (-0.0079, 0.2102), (-0.0441, -1.6537), (-0.0109, 0.0529)),
}
_ZENITH = {  # rows: turbidity squared, turbidity, 1; columns: sun's distance from the zenith [rad] cubed down to 1
    "x": (
        (0.00166, -0.00375, 0.00209, 0.0),
        (-0.02903, 0.06377, -0.03202, 0.00394),
        (0.11693, -0.21196, 0.06052, 0.25886),
    ),
    "y": (
        (0.00275, -0.00610, 0.00317, 0.0),
        (-0.04214, 0.08970, -0.04153, 0.00516),
        (0.15346, -0.26756, 0.06670, 0.26688),
    ),
}
_SRGB_FROM_XYZ = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])


def sky_directions(rows: int) -> F64:
    """List the world direction of every texel of the sky texture.

    Args:
        rows: Rows of the texture; it is twice as wide.

    Returns:
        Unit vectors, world axes [1], shape (rows, 2 * rows, 3), float64.
    """
    latitude = (np.pi / 2 - (np.arange(rows) + 0.5) / rows * np.pi)[:, None]
    longitude = (np.pi - (np.arange(2 * rows) + 0.5) / rows * np.pi)[None, :]
    level = np.cos(latitude)
    x, y, z = np.broadcast_arrays(level * np.sin(longitude), np.sin(latitude), level * np.cos(longitude))
    return np.stack([x, -z, y], axis=-1)


def solid_angles(rows: int) -> F64:
    """Find the solid angle of a texel in each row of the sky texture [sr], shape (rows, 1), float64."""
    edges = np.sin(np.pi / 2 - np.arange(rows + 1) / rows * np.pi)
    return ((edges[:-1] - edges[1:]) * (np.pi / rows))[:, None]


def clear_sky(directions: F64, sun: F64, turbidity: float) -> F64:
    """Find the radiance of a cloudless sky.

    Source: Preetham, Shirley and Smits, A practical analytic model for daylight, SIGGRAPH 1999, appendix A.2: Perez's
    formula for luminance and chromaticity.

    Args:
        directions: Unit vectors, world axes [1], shape (..., 3), float64; below the horizon counts as on it.
        sun: Unit vector towards the sun [1], shape (3,), float64.
        turbidity: Linke's turbidity [1].

    Returns:
        Linear sRGB [kcd/m2], shape (..., 3), float64.
    """
    up = np.maximum(directions[..., 2], _HORIZON)
    cosine = np.clip(directions @ sun, -1, 1)
    zenith = np.pi / 2 - max(float(np.arcsin(np.clip(sun[2], -1, 1))), np.radians(_LOWEST_SUN))
    at_zenith = _zenith(zenith, turbidity)
    value = {}
    for name, rows in _COEFFICIENTS.items():
        a, b, c, d, e = (slope * turbidity + start for slope, start in rows)
        angle = np.arccos(cosine)
        here = (1 + a * np.exp(b / up)) * (1 + c * np.exp(d * angle) + e * cosine**2)
        there = (1 + a * np.exp(b)) * (1 + c * np.exp(d * zenith) + e * np.cos(zenith) ** 2)
        value[name] = at_zenith[name] * here / there
    luminance, x, y = np.maximum(value["Y"], 0.05), value["x"], value["y"]
    colour = np.stack([x / y, np.ones_like(x), (1 - x - y) / y], axis=-1) @ _SRGB_FROM_XYZ.T
    colour = np.maximum(colour, 0.02)
    return luminance[..., None] * colour / (colour @ LUMINANCE)[..., None]


def _zenith(zenith: float, turbidity: float) -> dict[str, float]:
    """Find luminance [kcd/m2] and chromaticity straight overhead, the sun at a distance from it [rad]."""
    chi = (4 / 9 - turbidity / 120) * (np.pi - 2 * zenith)
    powers = np.array([zenith**3, zenith**2, zenith, 1.0])
    of_turbidity = np.array([turbidity**2, turbidity, 1.0])
    found = {name: float(of_turbidity @ np.array(table) @ powers) for name, table in _ZENITH.items()}
    return {"Y": float((4.0453 * turbidity - 4.9710) * np.tan(chi) - 0.2155 * turbidity + 2.4192), **found}


def clouded(sky: F64, directions: F64, sun: F64, cover: float, rng: np.random.Generator) -> F64:
    """Draw two layers of clouds before a sky; they thin out in the haze over the horizon.

    Args:
        sky: Clear sky, linear sRGB, shape (H, W, 3), float64.
        directions: Unit vectors of its texels, world axes [1], shape (H, W, 3), float64.
        sun: Unit vector towards the sun [1], shape (3,), float64.
        cover: Share of the sky behind clouds [1].
        rng: Random stream of the clouds.

    Returns:
        Linear sRGB, shape (H, W, 3), float64.
    """
    luminance = sky @ LUMINANCE
    angle = np.arccos(np.clip(directions @ sun, -1, 1))
    haze = np.exp(-6.0 * np.maximum(directions[..., 2], _HORIZON))[..., None] * (1 - cover)
    opacity, lit = _clouds(directions, sun, cover, rng)
    white = 0.9 * np.median(luminance[: len(luminance) // 2]) * (1.2 + 1.5 * lit + 1.2 * np.exp(-2.5 * angle))
    cloud = white[..., None] * (np.array([0.93, 0.97, 1.04]) * (1 - lit[..., None]) + lit[..., None])
    mask = opacity[..., None] * (1 - 0.8 * haze)
    return sky * (1 - mask) + cloud * mask


def _clouds(directions: F64, sun: F64, cover: float, rng: np.random.Generator) -> tuple[F64, F64]:
    """Clouds on a level sheet: their opacity, and how much of the sun reaches each of them (0 grey, 1 white)."""
    plane = directions[..., :2] / (np.abs(directions[..., 2:]) + 0.10)
    lattices = rng.integers(0, 1 << 16, (7, 64, 64)) / 65_536
    drift = rng.integers(0, 1 << 16, 2) / 1024
    field = _heap(lattices, plane + drift)
    towards = _heap(lattices, plane + drift + 0.10 * sun[:2] / max(float(np.hypot(sun[0], sun[1])), 0.1))
    spread = float(field.std())
    edge = float(np.quantile(field[: len(field) // 2], 1 - cover)) if cover > 0 else np.inf
    depth = np.clip((field - edge) / (1.1 * spread), 0, 1)
    lit = np.clip(0.62 + 0.9 * (field - towards) / spread - 0.30 * depth, 0, 1)
    opacity = 0.92 * depth * (2 - depth)
    closed = np.clip((cover - 0.8) / 0.2, 0, 1)  # an overcast sky has no thin places
    return opacity + (0.96 - opacity) * closed, lit * (1 - 0.6 * closed)


def _heap(lattices: F64, place: F64) -> F64:
    field = np.zeros(place.shape[:2])
    for octave, lattice in enumerate(lattices):
        field += (_lattice_noise(lattice, place * 1.1 * 2.03**octave + 7.3 * octave) - 0.5) * 0.57**octave
    return field


def _lattice_noise(lattice: F64, place: F64) -> F64:
    cell = np.floor(place).astype(int)
    part = place - cell
    part = part * part * (3 - 2 * part)
    column, row = cell[..., 0] % 64, cell[..., 1] % 64
    right, down = (column + 1) % 64, (row + 1) % 64
    u, v = part[..., 0], part[..., 1]
    top = lattice[row, column] * (1 - u) + lattice[row, right] * u
    bottom = lattice[down, column] * (1 - u) + lattice[down, right] * u
    return top * (1 - v) + bottom * v
