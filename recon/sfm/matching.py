"""Image pairs: which images show the same surfaces, their matches, and the verifying geometry; runs in children."""

import math
import shutil
from collections.abc import Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pycolmap

from groundwork.child import run_child
from groundwork.files import write_text
from groundwork.progress import Progress
from recon.settings import SparseSettings
from recon.sfm.database import DATABASE, copy_images, count_rows, merge_pairs, paired
from render.capture import Capture

SHARE = "match_share"
"""Name of the stage of a child that matches a share of the pairs."""

_CHILD = "recon.sfm.sparse_child"
_NAMES = "pairs.txt"  # in the folder of a share that is at work
# Pairs of a batch ("share"). COLMAP builds an index of each image of a batch, which takes as long as matching 1.5
# pairs, and the start of a child takes a second; therefore batches are few, large, and equally many per process.
_SHARE, _LEAST_SHARE = 512, 64
_LOOK = 0.5  # [s] interval at which the progress of the batches is read
_LEAP = 32  # [images] the first distance; each further one is twice as large
_LEAPER = 4  # every fourth image is paired with distant ones: as exact as with all, in a quarter of the time
_SAME_PLACE = 2  # decimals [m] up to which two fixes count as the same
_NO_LIMIT = 1e9  # [m] spatial pairing drops pairs that are farther apart than this


def match(
    capture: Capture, features: Path, folder: Path, settings: SparseSettings, seed: int, progress: Progress
) -> dict[str, Any]:
    """Match image pairs and verify them geometrically, in a copy of the database of features.

    COLMAP's linear algebra is not thread-safe: with two threads, each of 28 runs on 53 images gave other matches for 2
    to 12 of the 547 pairs, and none at all for some of these (COLMAP 4.2.1). Therefore the pairs are split into
    batches, each matched by a process of one thread, with as many processes at a time as `threads` states; a batch is
    saved as soon as it is done.

    Args:
        capture: Photographs.
        features: Folder of the database of features.
        folder: Receives the database of matches; pairs that an interrupted run matched are already in it, or in its
            batches.
        settings: Pairing, and the number of processes.
        seed: Seed of the verification.
        progress: Listener.

    Returns:
        `pairing` used, number of `pairs` tried, `verified` ones, and `overlapping`: whether each image is in
        a verified pair.

    Raises:
        ChildError: A batch exceeded a limit or crashed; the results of the others stay.
    """
    path = folder / DATABASE
    done = _take_over(features / DATABASE, path)
    kind = choose_pairing(capture, settings)
    pairs = _name_pairs(path, kind, settings)
    progress.stage("matching", len(pairs))
    left = [pair for pair in pairs if pycolmap.image_pair_to_pair_id(*pair) not in done]
    work = _Work(features, folder, settings, seed)
    for failure in _match_shares(left, len(pairs) - len(left), work, progress)[:1]:
        raise failure
    progress.advance(len(pairs))
    return {"pairing": kind, "pairs": len(pairs), **_verified(capture, path)}


def match_share(pairs: Iterable[tuple[int, int]], features: Path, folder: Path, seed: int) -> None:
    """Match and verify some pairs, in a separate small database.

    Args:
        pairs: Ids of the images of each.
        features: Folder of the database of features.
        folder: Existing folder that receives the database of these images and matches.
        seed: Seed of the verification.
    """
    pairs = tuple(pairs)
    path, names = folder / DATABASE, folder / _NAMES
    pycolmap.Database.open(path).close()
    copy_images(features / DATABASE, path, {image for pair in pairs for image in pair})
    write_text(names, "".join(f"{one} {other}\n" for one, other in pairs))
    verification = pycolmap.TwoViewGeometryOptions()
    verification.ransac.random_seed = seed
    pycolmap.match_image_pairs(
        path,
        pycolmap.FeatureMatchingOptions(num_threads=1),
        pycolmap.ImportedPairingOptions(match_list_path=names),
        verification,
        pycolmap.Device.cpu,
    )


def _take_over(features: Path, path: Path) -> set[int]:
    """Continue the database of matches of an interrupted run, or copy that of the features; return its pairs.

    Results of interrupted batches are merged too: a pair is finished when its geometry is written, and its result does
    not depend on its batch.
    """
    done = paired(path)
    if not done:
        for left in path.parent.glob(f"{path.name}*"):
            left.unlink()
        shutil.copyfile(features, path)  # not atomic: an incomplete copy contains no pairs
    for share in sorted(path.parent.glob("share*")):
        found = paired(share / DATABASE)
        if found:
            merge_pairs(share / DATABASE, path)
        done |= found
        shutil.rmtree(share)
    return done


@dataclass(frozen=True)
class _Work:
    """What the children need: folder of the features, folder of the matches, settings, seed of the verification."""

    features: Path
    folder: Path
    settings: SparseSettings
    seed: int


def _match_shares(left: list[tuple[int, int]], finished: int, work: _Work, progress: Progress) -> list[BaseException]:
    """Distribute the remaining pairs to child processes, and merge their results, even if some fail."""
    folder, settings = work.folder, work.settings
    whole, seen, failures = folder / DATABASE, 0, list[BaseException]()
    rounds = max(1, math.ceil(len(left) / (_SHARE * settings.threads)))
    size = max(_LEAST_SHARE, math.ceil(len(left) / (rounds * settings.threads)))
    with ThreadPoolExecutor(settings.threads) as pool:
        waiting = {
            pool.submit(_run_share, left[first : first + size], folder / f"share{first}", work)
            for first in range(0, len(left), size)
        }
        try:
            while waiting:
                seen = max(seen, finished + _begun(folder))
                progress.advance(seen)
                ended, waiting = wait(waiting, _LOOK, FIRST_COMPLETED)
                for future in ended:
                    failure = future.exception()
                    if failure is not None:
                        failures.append(failure)
                        waiting = {other for other in waiting if not other.cancel()}  # running batches are merged too
                        continue
                    share = future.result()
                    merge_pairs(share / DATABASE, whole)
                    finished += count_rows(share / DATABASE, "two_view_geometries")
                    shutil.rmtree(share)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return failures


def _run_share(pairs: list[tuple[int, int]], share: Path, work: _Work) -> Path:
    """Match a batch in a child process, on one thread; the parent of this process enforces the time limit."""
    share.mkdir()
    images = len({image for pair in pairs for image in pair})
    run_child(
        _CHILD,
        {"stage": SHARE, "pairs": pairs, "before": str(work.features), "folder": str(share), "seed": work.seed},
        time_limit=math.inf,
        memory_limit=work.settings.memory_limit + work.settings.memory_per_image * images,
        environment={"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
    )
    return share


def _begun(folder: Path) -> int:
    """Count the pairs of running batches; a database that is being filled is not opened: COLMAP does not wait."""
    return sum(count_rows(names.parent / DATABASE, "two_view_geometries") for names in folder.glob(f"share*/{_NAMES}"))


def _name_pairs(database: Path, kind: str, settings: SparseSettings) -> list[tuple[int, int]]:
    """List the pairs as COLMAP generates them, each once; spatial pairing generates most of them from both sides."""
    named: dict[frozenset[int], tuple[int, int]] = {}
    with pycolmap.Database.open(database) as opened:
        for generator, options in _ways(kind, settings):
            for pair in generator(options, opened).all_pairs():
                named.setdefault(frozenset(pair), pair)
        images = sorted(image.image_id for image in opened.read_all_images())
        if kind == "spatial" and named and not _is_connected(named.values(), len(images)):
            for generator, options in _ways("sequential", settings):  # connects stations that are far apart
                for pair in generator(options, opened).all_pairs():
                    named.setdefault(frozenset(pair), pair)
    if kind == "spatial" and named and len(images) >= settings.leaps_from:
        for pair in _leaps(images):
            named.setdefault(frozenset(pair), pair)
    return list(named.values())


def _is_connected(pairs: Iterable[tuple[int, int]], count: int) -> bool:
    """Tell whether the images form one connected component of the graph of pairs."""
    partners: dict[int, list[int]] = {}
    for one, other in pairs:
        partners.setdefault(one, []).append(other)
        partners.setdefault(other, []).append(one)
    front = [next(iter(partners))]
    reached = set(front)
    while front:
        found = set(partners[front.pop()]) - reached
        reached |= found
        front.extend(found)
    return len(reached) == count


def _leaps(images: list[int]) -> Iterator[tuple[int, int]]:
    """Pair every fourth image with some far ahead on the path: with neighboring pairs only, a long model bends."""
    leap = _LEAP
    while leap < len(images):
        yield from zip(images[::_LEAPER], images[leap::_LEAPER], strict=False)
        leap *= 2


def _ways(kind: str, settings: SparseSettings) -> list[tuple[Any, Any]]:
    """Return COLMAP's pair generators and their options."""
    if kind == "spatial":
        spatial = pycolmap.SpatialPairingOptions(
            ignore_z=False, max_num_neighbors=settings.neighbours, max_distance=_NO_LIMIT, num_threads=1
        )
        return [(pycolmap.SpatialPairGenerator, spatial)]
    if kind == "sequential":  # the next ones, and those 2, 4, 8 … further on, for flights that return
        following, leaps = (
            pycolmap.SequentialPairingOptions(overlap=settings.overlap, quadratic_overlap=far, num_threads=1)
            for far in (False, True)
        )
        return [(pycolmap.SequentialPairGenerator, following), (pycolmap.SequentialPairGenerator, leaps)]
    return [(pycolmap.ExhaustivePairGenerator, pycolmap.ExhaustivePairingOptions())]


def choose_pairing(capture: Capture, settings: SparseSettings) -> str:
    """Choose the pairing that `auto` stands for.

    Args:
        capture: Photographs.
        settings: Pairing.

    Returns:
        `spatial`, `sequential` or `exhaustive`.
    """
    if settings.pairing != "auto":
        return settings.pairing
    places = [image.gps for image in capture.images]
    if all(place is not None for place in places):
        _, alike = np.unique(np.round(np.array(places, float), _SAME_PLACE), axis=0, return_counts=True)
        if alike.max() <= settings.neighbours:  # a GPS fix shared by many images does not determine which are near
            return "spatial"
    return "exhaustive" if len(capture.images) <= settings.exhaustive_below else "sequential"


def _verified(capture: Capture, path: Path) -> dict[str, Any]:
    with pycolmap.Database.open(path) as database:
        names = {image.image_id: image.name for image in database.read_all_images()}
        pairs, inliers = database.read_two_view_geometry_num_inliers()
    good = [pycolmap.pair_id_to_image_pair(pair) for pair, number in zip(pairs, inliers, strict=True) if number]
    overlapping = {names[image] for pair in good for image in pair}
    return {"verified": len(good), "overlapping": [image.file in overlapping for image in capture.images]}
