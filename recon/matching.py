"""Which images show the same thing: pairs, their matches, and the geometry that verifies them; runs in a child."""

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pycolmap

from groundwork.progress import Progress
from recon.extraction import DATABASE
from recon.settings import SparseSettings
from render.capture import Capture

_NO_LIMIT = 1e9  # [m] spatial pairing drops pairs that are farther apart than this


def match(
    capture: Capture, features: Path, folder: Path, settings: SparseSettings, seed: int, progress: Progress
) -> dict[str, Any]:
    """Match image pairs and verify them geometrically, in a copy of the database of features.

    Args:
        capture: Photographs.
        features: Folder of the database of features.
        folder: Receives the database of matches; what an interrupted run left is cleared away.
        settings: Pairing.
        seed: Seed of the verification.
        progress: Listener.

    Returns:
        `pairing` used, number of `pairs` tried, `verified` ones, and `overlapping`: whether each image is in one.
    """
    path = folder / DATABASE
    for left in folder.glob(f"{DATABASE}*"):
        left.unlink()
    copy = path.with_name(f".{DATABASE}.partial")
    shutil.copyfile(features / DATABASE, copy)  # not atomic: somebody looks for the other name
    copy.replace(path)
    # One thread, whatever the machine: COLMAP's linear algebra does not bear two callers at once. With two threads
    # each of 28 runs on 53 images matched 2 to 12 of the 547 pairs otherwise, some to nothing (COLMAP 4.2.1).
    # Matching and verification still overlap.
    matching = pycolmap.FeatureMatchingOptions(num_threads=1)
    verification = pycolmap.TwoViewGeometryOptions()
    verification.ransac.random_seed = seed
    kind = choose_pairing(capture, settings)
    ways = _ways(kind, settings)
    with pycolmap.Database.open(path) as database:
        pairs = [pair for way in ways for pair in way.generator(way.options, database).all_pairs()]
    count = len({frozenset(pair) for pair in pairs})  # spatial pairing names most pairs from both sides
    progress.stage("matching", count)
    for way in ways:
        way.run(path, matching, way.options, verification, pycolmap.Device.cpu)
    return {"pairing": kind, "pairs": count, **_verified(capture, path)}


@dataclass(frozen=True)
class _Way:
    """One of COLMAP's ways to name pairs: what names them, what matches them, and the options of both."""

    generator: Any
    run: Callable[..., None]
    options: Any


def _ways(kind: str, settings: SparseSettings) -> list[_Way]:
    if kind == "spatial":
        spatial = pycolmap.SpatialPairingOptions(
            ignore_z=False, max_num_neighbors=settings.neighbours, max_distance=_NO_LIMIT, num_threads=1
        )
        return [_Way(pycolmap.SpatialPairGenerator, pycolmap.match_spatial, spatial)]
    if kind == "sequential":  # the next ones; and those 2, 4, 8 … further on, for flights that come back
        following, leaps = (
            pycolmap.SequentialPairingOptions(overlap=settings.overlap, quadratic_overlap=far, num_threads=1)
            for far in (False, True)
        )
        return [_Way(pycolmap.SequentialPairGenerator, pycolmap.match_sequential, way) for way in (following, leaps)]
    return [_Way(pycolmap.ExhaustivePairGenerator, pycolmap.match_exhaustive, pycolmap.ExhaustivePairingOptions())]


def choose_pairing(capture: Capture, settings: SparseSettings) -> str:
    """Settle what `auto` means for a capture.

    Args:
        capture: Photographs.
        settings: Pairing.

    Returns:
        `spatial`, `sequential` or `exhaustive`.
    """
    if settings.pairing != "auto":
        return settings.pairing
    if all(image.gps is not None for image in capture.images):
        return "spatial"
    return "exhaustive" if len(capture.images) <= settings.exhaustive_below else "sequential"


def _verified(capture: Capture, path: Path) -> dict[str, Any]:
    with pycolmap.Database.open(path) as database:
        names = {image.image_id: image.name for image in database.read_all_images()}
        pairs, inliers = database.read_two_view_geometry_num_inliers()
    good = [pycolmap.pair_id_to_image_pair(pair) for pair, number in zip(pairs, inliers, strict=True) if number]
    overlapping = {names[image] for pair in good for image in pair}
    return {"verified": len(good), "overlapping": [image.file in overlapping for image in capture.images]}
