"""A noise model of a sensor: fitted to its clouds of bridges with known truth, and applied to exact clouds.

The model describes a sensor without simulating it: the error by range and incidence, the share of empty cubes, and the
point density of the others. It is the cheap baseline that a simulated sensor has to beat.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from groundwork.errors import InputError
from groundwork.files import read_json
from recon.cloud import Cloud, read_cloud

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
Bools = NDArray[np.bool_]

FORMAT_VERSION = 1
RANGES = (0.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0)  # [m] lower ends of the bins
COSINES = (0.0, 0.17, 0.5, 0.87)  # [1] lower ends of the bins: 80, 60 and 30 degrees off the normal
CUBE = 0.5  # [m] edge of the cubes that are tested for gaps
_LEVELS = 257  # quantiles per distribution; with fewer, its tails would be too heavy
_FEWEST = 200  # least number of values in a bin; else the distribution of all bins is used
_SEEN = 5  # least number of points of the exact cloud in a cube that is tested for gaps
_WAY = 2.0  # [m] spacing of the sensor positions along a scanner's path


@dataclass(frozen=True, eq=False)
class SensorNoise:
    """The fitted model, one row for each bin of range and incidence.

    Attributes:
        errors: Quantiles of the distance to the true surface [m], shape (B, L), float64.
        gaps: Share of the cubes without any point [1], shape (B,), float64.
        density: Quantiles of the ratio of points to those of the exact cloud, in cubes that are not empty [1], shape
            (B, L), float64.
    """

    errors: F64
    gaps: F64
    density: F64

    def as_json(self) -> dict[str, Any]:
        """Return it as JSON."""
        return {
            "format": "falsework.noise",
            "format_version": FORMAT_VERSION,
            **{name: values.tolist() for name, values in vars(self).items()},
        }


def noise_from_json(record: Mapping[str, Any]) -> SensorNoise:
    """Create it from the result of `as_json`.

    Args:
        record: The JSON object.
    """
    return SensorNoise(*(np.array(record[name], np.float64) for name in ("errors", "gaps", "density")))


def sensor_places(folder: Path) -> F64:
    """Read the positions of a cloud's sensor.

    Args:
        folder: A cloud: scanned from stations or along a path, or reconstructed from photographs.

    Returns:
        Stations, positions along the path, or camera centers [m], shape (S, 3), float64.

    Raises:
        InputError: It was sampled without a sensor, or its record of the sensor is invalid.
    """
    try:
        places = _places(folder)
    except (AttributeError, IndexError, KeyError, TypeError, ValueError):
        places = np.full((1, 3), np.nan)
    if places is None:
        raise InputError(
            "has no sensor positions, so its noise cannot be fitted",
            where=folder,
            field="arms",
            hint="After ~, name the clouds of a laser scanner or a reconstruction",
        )
    if not len(places) or not np.isfinite(places).all():
        raise InputError(
            "does not contain the positions of its sensor",
            where=folder,
            field="statistics",
            hint="Make the cloud again",
        )
    return places


def _places(folder: Path) -> F64 | None:
    """Read the positions of a sensor of any kind; None if there was none."""
    statistics = read_json(folder / "cloud.json").get("statistics", {})
    if "stations" in statistics:
        return np.array(statistics["stations"], np.float64).reshape(-1, 3)
    if "path" in statistics:
        corners = np.array(statistics["path"], np.float64).reshape(-1, 3)
        steps = np.linalg.norm(np.diff(corners, axis=0), axis=1)
        ways = np.concatenate([[0.0], np.cumsum(steps)])
        at = np.linspace(0.0, ways[-1], max(2, int(ways[-1] / _WAY) + 1))
        return np.column_stack([np.interp(at, ways, corners[:, axis]) for axis in range(3)])
    if (folder / "cameras_sfm.json").is_file():
        poses = read_json(folder / "cameras_sfm.json")["poses"]
        if poses:
            return np.array([np.array(row["camera_to_world"])[:3, 3] for row in poses])
    return None


def fit_noise(pairs: Sequence[tuple[Path, Path]]) -> SensorNoise:
    """Fit the noise of clouds to exact clouds of the same bridges.

    Args:
        pairs: For each bridge the exact cloud and the noisy one.

    Raises:
        InputError: No bridge has both, or the noisy cloud has no sensor.
    """
    if not pairs:
        raise InputError("no training bridge has both clouds", field="arms", hint="After ~, name another cloud")
    bins = len(RANGES) * len(COSINES)
    errors: list[list[F64]] = [[] for _ in range(bins)]
    ratios: list[list[F64]] = [[] for _ in range(bins)]
    empty, cubes = np.zeros(bins), np.zeros(bins)
    for exact_folder, like_folder in pairs:
        places = sensor_places(like_folder)
        exact, like = read_cloud(exact_folder), read_cloud(like_folder)
        found, off = _bins(like, places), like.columns["surface_distance"].astype(np.float64)
        known = np.isfinite(off)
        for number in np.unique(found[known]):
            errors[number].append(_thinned(off[known & (found == number)]))
        counts, place = _count(exact.columns["coord"], like.columns["coord"])
        of_cube = _bin_of_cubes(_bins(exact, places), place, len(counts), bins)
        sure = counts[:, 0] >= _SEEN
        for number in np.unique(of_cube[sure]):
            mine = counts[sure & (of_cube == number)]
            cubes[number] += len(mine)
            empty[number] += (mine[:, 1] == 0).sum()
            filled = mine[mine[:, 1] > 0]
            ratios[number].append(np.repeat(filled[:, 1] / filled[:, 0], filled[:, 0]))  # as each point meets it
    share = np.where(cubes >= _FEWEST, empty / np.maximum(cubes, 1), empty.sum() / max(cubes.sum(), 1))
    return SensorNoise(_quantiles(errors), share, _quantiles(ratios))


def with_noise(exact: Cloud, noise: SensorNoise, places: F64, seed: int) -> tuple[I64, F64]:
    """Apply the errors, gaps and density of a sensor to an exact cloud.

    Args:
        exact: Points on the surface, at least as dense as the sensor's, with normals.
        noise: The fitted model.
        places: Positions of the sensor [m], shape (S, 3), float64.
        seed: Seed of all draws.

    Returns:
        Rows of the points that are kept, ascending, shape (N,), int64, and their displaced positions [m], shape (N, 3),
        float64.
    """
    rng = np.random.default_rng(seed)
    found = _bins(exact, places)
    coord = exact.columns["coord"].astype(np.float64)
    counts, place = _count(coord, coord[:0])
    of_cube = _bin_of_cubes(found, place, len(counts), len(noise.gaps))
    levels = np.linspace(0.0, 1.0, _LEVELS)
    wanted = _drawn(noise.density[of_cube], rng.random(len(counts)), levels) * counts[:, 0]
    stay = np.maximum(np.floor(wanted + rng.random(len(counts))), 1.0)  # at least one: gaps have a share of their own
    stay[rng.random(len(counts)) < noise.gaps[of_cube]] = 0.0
    order = np.lexsort((rng.random(len(coord)), place))
    rank = np.arange(len(coord)) - np.searchsorted(place[order], place[order])
    rows = np.sort(order[rank < stay[place[order]]])
    off = _drawn(noise.errors[found[rows]], rng.random(len(rows)), levels)
    sides = np.where(rng.random(len(rows)) < 0.5, -1.0, 1.0)
    return rows, coord[rows] + (off * sides)[:, None] * exact.columns["normal"][rows].astype(np.float64)


def _bins(cloud: Cloud, places: F64) -> I64:
    """Find the bin of each point by distance and angle to the nearest position of the sensor."""
    coord = cloud.columns["coord"].astype(np.float64)
    distance, nearest = KDTree(places).query(coord)
    towards = (places[nearest] - coord) / np.maximum(distance, 1e-9)[:, None]
    cosine = np.abs(np.einsum("ni,ni->n", towards, cloud.columns["normal"].astype(np.float64)))
    far = np.searchsorted(RANGES, distance, side="right") - 1
    square = np.searchsorted(COSINES, np.nan_to_num(cosine), side="right") - 1
    return (far * len(COSINES) + square).astype(np.int64)


def _count(exact: NDArray[Any], like: NDArray[Any]) -> tuple[I64, I64]:
    """Count the points of both clouds in the cubes of the first one; return also the cube of each of its points."""
    low = np.minimum(exact.min(axis=0), like.min(axis=0)) if len(like) else exact.min(axis=0)
    cells = [np.floor((points - low) / CUBE).astype(np.int64) for points in (exact, like)]
    wide = np.concatenate(cells).max(axis=0) + 1
    keys = [np.ravel_multi_index((cell[:, 0], cell[:, 1], cell[:, 2]), tuple(wide)) for cell in cells]
    names, place = np.unique(keys[0], return_inverse=True)
    at = np.minimum(np.searchsorted(names, keys[1]), len(names) - 1)
    hit = at[names[at] == keys[1]] if len(like) else at[:0]
    counts = np.column_stack([np.bincount(place, minlength=len(names)), np.bincount(hit, minlength=len(names))])
    return counts.astype(np.int64), place.reshape(-1)


def _bin_of_cubes(bins: I64, place: I64, cubes: int, count: int) -> I64:
    """Choose for each cube the bin of most of its points."""
    votes = np.bincount(place * count + bins, minlength=cubes * count).reshape(cubes, count)
    return votes.argmax(axis=1)


def _thinned(values: F64, most: int = 20_000) -> F64:
    """Take evenly spaced ones of the sorted values: enough for their quantiles."""
    ordered = np.sort(values)
    return ordered[:: max(1, len(ordered) // most)]


def _quantiles(values: Sequence[Sequence[F64]]) -> F64:
    """Compute each bin's quantiles; a bin with few values gets those of all bins."""
    levels = np.linspace(0.0, 1.0, _LEVELS)
    joined = [np.concatenate(part) if part else np.zeros(0) for part in values]
    whole = np.concatenate(joined)
    common = np.quantile(whole, levels) if len(whole) else np.zeros(_LEVELS)
    return np.array([np.quantile(part, levels) if len(part) >= _FEWEST else common for part in joined])


def _drawn(quantiles: F64, chances: F64, levels: F64) -> F64:
    """Draw from distributions given by quantiles, one row each, by inversion."""
    at = chances * (len(levels) - 1)
    low = np.minimum(at.astype(np.int64), len(levels) - 2)
    rows = np.arange(len(chances))
    return quantiles[rows, low] + (at - low) * (quantiles[rows, low + 1] - quantiles[rows, low])
