"""Which images show the same thing: pairs, their matches, and the geometry that verifies them; runs in children."""

import shutil
from collections.abc import Iterable
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from pathlib import Path
from typing import Any

import pycolmap

from groundwork.child import run_child
from groundwork.files import write_text
from groundwork.progress import Progress
from recon.database import DATABASE, copy_images, count_rows, paired, take_pairs
from recon.settings import SparseSettings
from render.capture import Capture

SHARE = "match_share"
"""Name of the stage of a child that matches a share of the pairs."""

_CHILD = "recon.sparse_child"
_SHARE, _LEAST_SHARE = 128, 32  # pairs of a share: half a minute at most; a child's own start takes a second of it
_ROUNDS = 3  # of shares for each process, so that none waits long for the last
_LOOK = 0.5  # [s] how often the shares are asked how far they are
_NO_LIMIT = 1e9  # [m] between the images of a pair; [s] for a share: the parent's own limit holds for all of them


def match(
    capture: Capture, features: Path, folder: Path, settings: SparseSettings, seed: int, progress: Progress
) -> dict[str, Any]:
    """Match image pairs and verify them geometrically, in a copy of the database of features.

    COLMAP's linear algebra does not bear two callers at once: with two threads each of 28 runs on 53 images matched 2
    to 12 of the 547 pairs otherwise, some to nothing (COLMAP 4.2.1). So the pairs are dealt out in shares to as many
    processes as there are to be threads, one thread each, and a share is safe as soon as it is done.

    Args:
        capture: Photographs.
        features: Folder of the database of features.
        folder: Receives the database of matches; shares that an interrupted run has finished are in it.
        settings: Pairing, and the number of processes.
        seed: Seed of the verification.
        progress: Listener.

    Returns:
        `pairing` used, number of `pairs` tried, `verified` ones, and `overlapping`: whether each image is in one.

    Raises:
        ChildError: A share ran into a limit or died; the others stay.
    """
    path = folder / DATABASE
    if not path.is_file():
        copy = path.with_name(f".{DATABASE}.partial")
        shutil.copyfile(features / DATABASE, copy)  # not atomic: the name says that it is whole
        copy.replace(path)
    kind = choose_pairing(capture, settings)
    pairs = _name_pairs(path, kind, settings)
    progress.stage("matching", len(pairs))
    _match_shares(pairs, features, folder, settings, seed, progress)
    return {"pairing": kind, "pairs": len(pairs), **_verified(capture, path)}


def match_share(pairs: Iterable[tuple[int, int]], features: Path, folder: Path, seed: int) -> None:
    """Match and verify some pairs, in a small database of their own.

    Args:
        pairs: Ids of the images of each.
        features: Folder of the database of features.
        folder: Existing folder that receives the database of these images and matches.
        seed: Seed of the verification.
    """
    pairs = tuple(pairs)
    path, names = folder / DATABASE, folder / "pairs.txt"
    pycolmap.Database.open(path).close()
    copy_images(features / DATABASE, path, {image for pair in pairs for image in pair})
    write_text(names, "".join(f"{one} {other}\n" for one, other in pairs))
    verification = pycolmap.TwoViewGeometryOptions()
    verification.ransac.random_seed = seed
    pycolmap.match_image_pairs(
        path, pycolmap.FeatureMatchingOptions(num_threads=1), pycolmap.ImportedPairingOptions(match_list_path=names),
        verification, pycolmap.Device.cpu,
    )  # fmt: skip


def _match_shares(
    pairs: list[tuple[int, int]], features: Path, folder: Path, settings: SparseSettings, seed: int, progress: Progress
) -> None:
    """Deal the pairs that are left out to children, and bring home what each found."""
    whole = folder / DATABASE
    for unfinished in folder.glob("share*"):
        shutil.rmtree(unfinished)
    done = paired(whole)
    left = [pair for pair in pairs if pycolmap.image_pair_to_pair_id(*pair) not in done]
    finished = len(pairs) - len(left)
    size = min(_SHARE, max(_LEAST_SHARE, -(-len(left) // (_ROUNDS * settings.threads))))

    def run(share: Path, pairs: list[tuple[int, int]]) -> Path:
        share.mkdir()
        request = {"stage": SHARE, "pairs": pairs, "before": str(features), "folder": str(share), "seed": seed}
        alone = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        run_child(_CHILD, request, time_limit=_NO_LIMIT, memory_limit=settings.memory_limit, environment=alone)
        return share

    with ThreadPoolExecutor(settings.threads) as pool:
        waiting: set[Future[Path]] = {
            pool.submit(run, folder / f"share{first}", left[first : first + size])
            for first in range(0, len(left), size)
        }
        try:
            while waiting:
                ended, waiting = wait(waiting, _LOOK, FIRST_COMPLETED)
                for future in sorted(ended, key=_failed):  # what is done comes home before another's failure is told
                    share = future.result()
                    take_pairs(share / DATABASE, whole)
                    finished += count_rows(share / DATABASE, "two_view_geometries")
                    shutil.rmtree(share)
                begun = sum(count_rows(path, "two_view_geometries") for path in folder.glob(f"share*/{DATABASE}"))
                progress.advance(finished + begun)
        finally:
            pool.shutdown(cancel_futures=True)


def _failed(ended: Future[Path]) -> bool:
    return ended.exception() is not None


def _name_pairs(database: Path, kind: str, settings: SparseSettings) -> list[tuple[int, int]]:
    """List the pairs as COLMAP names them, each once; spatial pairing names most of them from both sides."""
    named: dict[frozenset[int], tuple[int, int]] = {}
    with pycolmap.Database.open(database) as opened:
        for generator, options in _ways(kind, settings):
            for pair in generator(options, opened).all_pairs():
                named.setdefault(frozenset(pair), pair)
    return list(named.values())


def _ways(kind: str, settings: SparseSettings) -> list[tuple[Any, Any]]:
    """Give COLMAP's generators of pairs and their options."""
    if kind == "spatial":
        spatial = pycolmap.SpatialPairingOptions(
            ignore_z=False, max_num_neighbors=settings.neighbours, max_distance=_NO_LIMIT, num_threads=1
        )
        return [(pycolmap.SpatialPairGenerator, spatial)]
    if kind == "sequential":  # the next ones; and those 2, 4, 8 … further on, for flights that come back
        following, leaps = (
            pycolmap.SequentialPairingOptions(overlap=settings.overlap, quadratic_overlap=far, num_threads=1)
            for far in (False, True)
        )
        return [(pycolmap.SequentialPairGenerator, following), (pycolmap.SequentialPairGenerator, leaps)]
    return [(pycolmap.ExhaustivePairGenerator, pycolmap.ExhaustivePairingOptions())]


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
