"""Camera poses and points from verified matches, by COLMAP's incremental or global mapper; runs in a child.

The mapper works with tie points; after that, all other matches are triangulated too.
"""

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pycolmap

from groundwork.progress import Progress
from recon.photos.photos import FOCAL_GUESSED, fix_sigmas
from recon.settings import SparseSettings
from recon.sfm.colmap_model import check_whole
from recon.sfm.database import DATABASE
from recon.sfm.doubtful import doubtful_pairs
from recon.sfm.growth import MOST_MOVED, grow
from recon.sfm.misplaced import Fixes
from recon.sfm.runaways import leave_out, runaways
from recon.sfm.start import SUSPICIOUS, contradicted_images, starting_pair
from recon.sfm.tie_points import write_tie_points
from render.capture import Capture

MODEL = "model"
_MODELS = "models"
_LOSS_SCALE = 0.5  # [px] error from which on the weight of a match decreases
_ROUNDS = 10  # of the last adjustment, which begins with the mapper's result
_TIES = "ties.db"
# Looser limits for the initial pair where COLMAP's own limits find none: views of a walk straight ahead, which meet at
# small angles. 28 of 29 photographs of such a walk along a street have a model then.
_STRAIGHT_AHEAD = {"init_max_forward_motion": 1.0, "init_min_tri_angle": 8.0}  # [1], [deg]; COLMAP: 0.95 and 16
_POINT_ROUNDS = 5  # of the adjustment of points whose cameras are fixed: each point has three unknowns


def map_images(
    capture: Capture, matches: Path, folder: Path, settings: SparseSettings, seed: int, progress: Progress
) -> dict[str, Any]:
    """Run the mapper and keep its largest model.

    Args:
        capture: Photographs.
        matches: Folder of the database of matches.
        folder: Receives the model; files of an interrupted run are removed.
        settings: Mapper.
        seed: Seed of every draw.
        progress: Listener.

    Returns:
        `mapper`; `tie_points`: whether the mapper used tie points instead of all matches; `models`: number of images
        and points of each, largest first (of those that are not kept, of tie points alone); `elsewhere`: files of the
        images that are in a smaller model; where images were missing, `growth`: see `grow`; `runaways`: files of the
        removed runaway cameras; `doubtful`: number of pairs that were not used: see `doubtful_pairs`.
    """
    models, final, ties = folder / _MODELS, folder / MODEL, folder / _TIES
    for path in (models, final):
        shutil.rmtree(path, ignore_errors=True)
        path.mkdir()
    _clear_ties(folder)
    kind = choose_mapper(capture, settings)
    wrong = _doubtful_pairs(capture, matches / DATABASE, progress)
    thinned = write_tie_points(matches / DATABASE, ties, settings.tie_points, seed, wrong)
    source = ties if thinned else matches / DATABASE
    if kind == "global":
        ranked, growth = _ranked(_map_globally(capture, source, settings, seed, progress)), dict[str, float]()
    else:
        ranked, growth = _map_and_grow(capture, source, models, settings, seed, progress)
    _clear_ties(folder)
    in_largest, away = set[str](), set[str]()
    in_any = {name for model in ranked for name in _registered(model)}
    if ranked:
        largest = ranked[0]
        progress.stage("last adjustment", 0)
        adjust_robustly(largest, _threads(settings))
        if thinned or growth.get("added"):  # growth makes no two-view points
            progress.stage("points of all matches", 0)
            largest = _triangulate_all(capture, largest, matches / DATABASE, models, settings, seed)
            adjust_robustly(largest, _threads(settings))
            ranked[0] = largest
        away = _leave_runaways_out(largest, settings, progress)
        in_any -= away - {name for model in ranked[1:] for name in _registered(model)}
        largest.write_binary(final)
        check_whole(final)
        in_largest = _registered(largest)
    shutil.rmtree(models)
    return {
        "mapper": kind,
        "tie_points": thinned,
        "models": [{"images": model.num_reg_images(), "points": model.num_points3D()} for model in ranked],
        "elsewhere": sorted(in_any - in_largest),
        **({"growth": growth} if growth else {}),
        **({"runaways": sorted(away)} if away else {}),
        **({"doubtful": len(wrong)} if wrong else {}),
    }


def _doubtful_pairs(capture: Capture, database: Path, progress: Progress) -> set[int]:
    progress.stage("tie points", 0)
    wrong = doubtful_pairs(database, _fixes(capture))
    if wrong:
        progress.note(
            f"{len(wrong)} pairs of images not used: taken far apart, they match the background or look-alikes"
        )
    return wrong


def _fixes(capture: Capture) -> Fixes:
    """List the positions that were measured with their height; the others would contradict the model."""
    known = np.isfinite(fix_sigmas(capture)[:, 2]).tolist()
    return {image.file: image.gps for image, kept in zip(capture.images, known, strict=True) if kept and image.gps}


def _registered(model: pycolmap.Reconstruction) -> set[str]:
    return {image.name for image in model.images.values() if image.has_pose}


def _leave_runaways_out(model: pycolmap.Reconstruction, settings: SparseSettings, progress: Progress) -> set[str]:
    """Remove runaway cameras and adjust the rest, until there are no more; name the removed ones."""
    names: set[str] = set()
    while away := runaways(model):
        names |= {model.image(number).name for number in away}
        leave_out(model, away)
        adjust_robustly(model, _threads(settings))
    if names:
        progress.note(f"left out, because their cameras are far away from all others: {', '.join(sorted(names))}")
    return names


def choose_mapper(capture: Capture, settings: SparseSettings) -> str:
    """Choose the mapper that `auto` stands for.

    The global mapper fails where the focal length is far off, and does not use GPS positions.

    Args:
        capture: Photographs.
        settings: Mapper.

    Returns:
        `incremental` or `global`.
    """
    if settings.mapper != "auto":
        return settings.mapper
    many, guessed = len(capture.images) >= settings.global_from, capture.facts.get("focal") == FOCAL_GUESSED
    return "global" if many and not guessed and not settings.use_gps_in_mapping else "incremental"


def adjust_robustly(model: pycolmap.Reconstruction, threads: int) -> None:
    """Run bundle adjustment once more, with a robust loss.

    COLMAP's incremental mapper minimizes squared errors, so that a few matches that are off by pixels shift every
    camera. The robust loss halves the distance between the demo's cameras and the truth.
    Source: Triggs et al., Bundle Adjustment: A Modern Synthesis (2000), on robust cost functions; Cauchy's.

    Args:
        model: What a mapper made; changed in place.
        threads: Of the solver; one for the same bytes each time.
    """
    options = pycolmap.BundleAdjustmentOptions(print_summary=False)
    options.ceres.loss_function_type = pycolmap.LossFunctionType.CAUCHY
    options.ceres.loss_function_scale = _LOSS_SCALE
    options.ceres.use_gpu = False
    options.ceres.solver_options.max_num_iterations = _ROUNDS
    options.ceres.solver_options.num_threads = threads
    pycolmap.bundle_adjustment(model, options)
    model.update_point_3d_errors()


def transform(model: Path, out: Path, similarity: dict[str, Any]) -> int:
    """Write a model in world units.

    Args:
        model: Folder that holds the model.
        out: Folder to write it to.
        similarity: `scale`, `rotation` 3x3 row-major, `translation` [m].

    Returns:
        Number of points.
    """
    moved = pycolmap.Reconstruction(model)
    rotation = pycolmap.Rotation3d(np.array(similarity["rotation"]))
    moved.transform(pycolmap.Sim3d(similarity["scale"], rotation, np.array(similarity["translation"])))
    out.mkdir()
    moved.write_binary(out)
    check_whole(out)
    return moved.num_points3D()


def _map_and_grow(
    capture: Capture, database: Path, models: Path, settings: SparseSettings, seed: int, progress: Progress
) -> tuple[list[pycolmap.Reconstruction], dict[str, float]]:
    """Map one image after the other; again, and with fewer matches, where images are misplaced or missing."""
    ranked = _ranked(_map_incrementally(capture, database, models, settings, seed, progress))
    ranked = _begun_anew(capture, database, models, ranked, _mapper_options(settings, seed), progress)
    growth = _grow_largest(capture, database, models, ranked, _mapper_options(settings, seed), progress)
    return ranked, growth


def _map_incrementally(
    capture: Capture, database: Path, models: Path, settings: SparseSettings, seed: int, progress: Progress
) -> dict[int, pycolmap.Reconstruction]:
    total, done = len(capture.images), 0

    def count(images: int) -> None:
        nonlocal done
        done += images
        progress.advance(min(done, total))

    found: dict[int, pycolmap.Reconstruction] = {}
    for stage, motion in (("mapping", {}), ("mapping, from forward-looking views", _STRAIGHT_AHEAD)):
        options = _mapper_options(settings, seed)
        for name, value in motion.items():
            setattr(options.mapper, name, value)
        done = 0
        progress.stage(stage, total)
        found = pycolmap.incremental_mapping(
            database,
            capture.folder,
            models,
            options,
            initial_image_pair_callback=lambda: count(2),
            next_image_callback=lambda: count(1),
        )
        if any(model.num_reg_images() > 2 and model.num_points3D() for model in found.values()):
            break
    return found


def _begun_anew(
    capture: Capture,
    database: Path,
    models: Path,
    ranked: list[pycolmap.Reconstruction],
    options: pycolmap.IncrementalPipelineOptions,
    progress: Progress,
) -> list[pycolmap.Reconstruction]:
    """Map again from images that GPS does not contradict, if it contradicts many; the better result is kept."""
    fixes = _fixes(capture)
    if not ranked or not (wrong := contradicted_images(ranked[0], fixes)):
        return ranked
    if len(wrong) <= SUSPICIOUS * len(capture.images) or (pair := starting_pair(ranked[0], wrong)) is None:
        return ranked
    progress.stage("mapping, from another pair", 0)
    options.init_image_id1, options.init_image_id2 = pair
    again = _ranked(pycolmap.incremental_mapping(database, capture.folder, models, options))
    if not again or _placed(again[0], fixes) <= _placed(ranked[0], fixes):
        return ranked
    progress.note(f"GPS contradicted {len(wrong)} images: mapped again from another pair of images")
    return again


def _placed(model: pycolmap.Reconstruction, fixes: Fixes) -> int:
    return model.num_reg_images() - len(contradicted_images(model, fixes))


def _ranked(found: dict[int, pycolmap.Reconstruction]) -> list[pycolmap.Reconstruction]:
    order = sorted(found, key=lambda row: (-found[row].num_reg_images(), -found[row].num_points3D(), row))
    return [found[row] for row in order]


def _grow_largest(
    capture: Capture,
    database: Path,
    scratch: Path,
    ranked: list[pycolmap.Reconstruction],
    options: pycolmap.IncrementalPipelineOptions,
    progress: Progress,
) -> dict[str, float]:
    """Where images are missing, replace the largest model by the grown one; return the figures of `grow`."""
    total = len(capture.images)
    fixes = _fixes(capture)
    if not ranked or ranked[0].num_reg_images() == total or not ranked[0].num_points3D() or not fixes:
        return {}
    progress.stage("mapping, with fewer matches", 0)
    before = ranked[0].num_reg_images()
    ranked[0], facts = grow(ranked[0], database, capture.folder, scratch, options, fixes)
    after = ranked[0].num_reg_images()
    if facts["added"]:
        progress.note(f"images added with fewer matches: {before} of {total} images became {after}")
    if facts["misplaced"]:
        progress.note(
            f"images added with fewer matches: {facts['misplaced']:.0f} removed again, because GPS does not "
            "confirm them"
        )
    if facts["moved"] > MOST_MOVED:
        progress.note(
            f"images added with fewer matches deformed the model of {after} images (by {facts['moved']:.1%}): not used"
        )
    return facts


def _triangulate_all(
    capture: Capture,
    model: pycolmap.Reconstruction,
    database: Path,
    scratch: Path,
    settings: SparseSettings,
    seed: int,
) -> pycolmap.Reconstruction:
    """Triangulate all matches, with the cameras fixed."""
    options = _incremental_options(settings, seed)
    options.ba_global_max_refinements = 1
    options.ba_global_max_num_iterations = _POINT_ROUNDS
    return pycolmap.triangulate_points(model, database, capture.folder, scratch, options=options)


def _mapper_options(settings: SparseSettings, seed: int) -> pycolmap.IncrementalPipelineOptions:
    options = _incremental_options(settings, seed)
    options.use_prior_position = settings.use_gps_in_mapping
    return options


def _incremental_options(settings: SparseSettings, seed: int) -> pycolmap.IncrementalPipelineOptions:
    options = pycolmap.IncrementalPipelineOptions(random_seed=seed, min_model_size=3)
    options.num_threads = options.mapper.num_threads = _threads(settings)
    options.mapper.random_seed = options.triangulation.random_seed = seed
    options.triangulation.ignore_two_view_tracks = not settings.two_view_tracks
    options.triangulation.min_angle = options.mapper.filter_min_tri_angle = settings.min_triangulation_angle
    return options


def _map_globally(
    capture: Capture, database: Path, settings: SparseSettings, seed: int, progress: Progress
) -> dict[int, pycolmap.Reconstruction]:
    options = pycolmap.GlobalPipelineOptions(random_seed=seed, min_model_size=3)
    mapper = options.mapper
    options.num_threads = mapper.num_threads = _threads(settings)
    mapper.bundle_adjustment.ceres.solver_options.num_threads = _threads(settings)
    mapper.random_seed = mapper.rotation_averaging.random_seed = seed
    mapper.global_positioning.random_seed = mapper.retriangulation.random_seed = seed
    mapper.global_positioning.use_gpu = mapper.bundle_adjustment.ceres.use_gpu = False
    mapper.retriangulation.ignore_two_view_tracks = not settings.two_view_tracks
    mapper.retriangulation.min_angle = mapper.min_tri_angle_deg = settings.min_triangulation_angle
    options.image_path = str(capture.folder)  # folder from which it reads the points' colors
    progress.stage("mapping, all images at once", 0)
    done = 0

    def count_one() -> None:
        nonlocal done
        done += 1
        progress.advance(done)

    manager = pycolmap.ReconstructionManager()
    with pycolmap.Database.open(database) as opened:
        pipeline = pycolmap.GlobalPipeline(options, opened, manager)
        pipeline.add_callback(pycolmap.GlobalPipelineCallback.MODEL_UPDATE_CALLBACK, count_one)
        pipeline.run()
    return {number: manager.get(number) for number in range(manager.size())}


def _clear_ties(folder: Path) -> None:
    for left in folder.glob(f"{_TIES}*"):  # a killed run leaves its journal, too
        left.unlink()


def _threads(settings: SparseSettings) -> int:
    return 1 if settings.deterministic else settings.threads
