"""Conductor of laser scanning: cast rays from a tripod, vehicle or aircraft at a stage, and write a labeled cloud."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundwork.errors import InputError
from groundwork.progress import Progress
from recon.cloud import LIDAR_AIRBORNE, LIDAR_MOBILE, LIDAR_TERRESTRIAL, Cloud, write_cloud
from recon.formats.laz import check_las_classes, write_laz
from recon.formats.ply import write_ply
from recon.sampling.airborne import airborne_rays, pulses_on, strips_over
from recon.sampling.echoes import Target
from recon.sampling.sampled_cloud import Samples, annotate_samples
from recon.sampling.sampler_settings import AirborneSettings, AnyScanner, TerrestrialSettings
from recon.sampling.scan_pattern import Rays, mobile_rays, tripod_rays
from recon.sampling.scan_places import deck_way, place_stations
from recon.sampling.scene_surface import SceneSurface, bounds_of, bridge_triangles, lay_out, made_of
from recon.sampling.surface_look import SurfaceLook, encode_srgb
from recon.sampling.thinning import one_in_each_cube
from usd_schemas.flat_scene import FlatScene
from usd_schemas.raycast import RayScene

F64 = NDArray[np.float64]
Bool = NDArray[np.bool_]
Columns = dict[str, NDArray[Any]]

SOURCE = {"terrestrial": LIDAR_TERRESTRIAL, "mobile": LIDAR_MOBILE, "airborne": LIDAR_AIRBORNE}
MOST_RAYS = 2_000_000_000
MOST_POINTS = 20_000_000
WATER, PLANTS = ("water",), ("tree", "shrub")  # component kinds: water is a mirror; leaves let a pulse through
_LOOSE = 4_000_000  # points collected before they are thinned


def sample_lidar(scene: FlatScene, folder: Path, settings: AnyScanner, progress: Progress) -> Cloud:
    """Scan a stage and write the returns as a cloud.

    Args:
        scene: A composed stage.
        folder: Existing empty folder.
        settings: The scanner.
        progress: Listener.

    Raises:
        InputError: No place for the scanner, an unknown path, too many rays, no return, or a class id that LAS cannot
            hold.
    """
    check_las_classes([row.id for row in scene.classes])
    progress.stage("places", 0)
    surface = lay_out(scene)
    look = SurfaceLook(scene, surface)
    rays = RayScene(surface.corners, surface.instances)
    bridge = bridge_triangles(scene, surface)
    rng = np.random.default_rng(settings.seed)
    shots, total, facts = _pattern(scene, surface, bridge, rays, settings, rng)
    if total > MOST_RAYS:
        raise InputError(
            f"the scan has {total} rays",
            **_dense(settings),
            allowed=f"at most {MOST_RAYS} rays",
            hint="Choose larger steps, or fewer stations or strips",
        )
    water, plants = made_of(scene, surface, WATER), made_of(scene, surface, PLANTS)
    target = Target(surface, look, rays, water, plants)
    box = bounds_of(surface, bridge, settings.reach if settings.scope == "near" else 0.0)
    inside = bridge if settings.scope == "bridge" else None

    progress.stage("scan", total)
    scanned = _Scanned(target, surface, box, inside)
    measure = partial(_scan, scanned=scanned, settings=settings, rng=rng)
    parts = _scan_all(shots, measure, settings, progress)
    points = sum(len(part["rows"]) for part in parts)
    if not points:
        raise InputError("the scanner gets no point in the scope", field="scope", value=settings.scope)
    for name in look.unread:
        progress.note(f"{name}: not readable as a texture; its points have the color of the material")
    progress.stage("write", 0)
    mixed = sum(int(part.pop("mixed").sum()) for part in parts)
    facts |= {"rays": total, "mixed_share": mixed / points, "settings": settings.model_dump(mode="json")}
    samples = _joined(parts, settings.kind == "terrestrial")
    cloud = annotate_samples(samples, scene, surface, rays, SOURCE[settings.kind], facts)
    write_cloud(folder, cloud)
    write_laz(folder / "cloud.laz", cloud)
    write_ply(folder / "cloud.ply", cloud)
    return cloud


def _pattern(
    scene: FlatScene,
    surface: SceneSurface,
    bridge: Bool,
    rays: RayScene,
    settings: AnyScanner,
    rng: np.random.Generator,
) -> tuple[Iterator[Rays], int, dict[str, Any]]:
    """Place the scanner: its rays, their number, and facts for the statistics."""
    if isinstance(settings, TerrestrialSettings):
        stations = np.array(settings.positions, np.float64).reshape(-1, 3)
        if not len(stations):
            stations = place_stations(scene, surface, bridge, rays, settings, rng)
        heights = int((settings.highest - settings.lowest) / settings.angular_step + 0.5) + 1
        total = len(stations) * max(1, round(360.0 / settings.angular_step)) * heights
        return tripod_rays(stations, settings, rng), total, {"stations": np.round(stations, 4).tolist()}
    if isinstance(settings, AirborneSettings):
        box = bounds_of(surface, bridge, settings.reach if settings.scope == "near" else 0.0)
        strips = strips_over(box, float(bounds_of(surface, bridge, 0.0)[1, 2]), settings, rng)
        facts = {"strips": np.round(strips, 4).tolist()}
        return airborne_rays(strips, settings, rng), pulses_on(strips, settings), facts
    if settings.path == "deck":
        way = deck_way(scene, surface, settings.height, settings.run_up)
    else:
        way = _survey_way(scene, settings.path)
    length = float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum())
    turns = length / settings.speed * settings.rate
    total = (int(turns * max(1, round(360.0 / settings.angular_step))) + 1) * settings.beams
    facts = {"path": np.round(way, 4).tolist(), "path_length": length, "duration": length / settings.speed}
    return mobile_rays(way, settings, rng), total, facts


def _dense(settings: AnyScanner) -> dict[str, Any]:
    """Name the setting that determines the density of a scan."""
    field = "pulses_per_line" if isinstance(settings, AirborneSettings) else "angular_step"
    return {"field": field, "value": getattr(settings, field)}


def _survey_way(scene: FlatScene, survey: str) -> F64:
    """Return the camera centers of a survey as a path, without repeated positions."""
    for product in scene.products:
        if product.name == survey and scene.cameras[product.camera].path:
            centers = scene.cameras[product.camera].poses[:, :3, 3]
            moved = np.linalg.norm(np.diff(centers, axis=0), axis=1) > 1e-6
            way = centers[np.concatenate([[True], moved])]
            if len(way) > 1:
                return way
            raise InputError(
                "the camera of this survey does not move",
                field="path",
                value=survey,
                hint="Name another survey, or deck",
            )
    names = ", ".join(product.name for product in scene.products if scene.cameras[product.camera].path)
    raise InputError("no such survey on the stage", field="path", value=survey, allowed=f"deck, {names}")


def _scan_all(
    shots: Iterator[Rays],
    measure: Callable[[Rays], Columns],
    settings: AnyScanner,
    progress: Progress,
) -> list[Columns]:
    """Measure in chunks; if the cloud is thinned to one point per cube, thin it in between to bound the memory."""
    ranks = np.random.default_rng([settings.seed, 1])  # a separate stream: thinning changes no point that is kept
    parts: list[Columns] = []
    done = loose = 0
    for chunk in shots:
        parts.append(measure(chunk))
        count = len(parts[-1]["rows"])
        done, loose = done + len(chunk.origins), loose + count
        progress.advance(done)
        if settings.voxel:
            parts[-1]["rank"] = ranks.random(count)
            if loose > _LOOSE:
                parts, loose = _thinned(parts, settings.voxel), 0
        if sum(len(part["rows"]) for part in parts) > MOST_POINTS:
            raise InputError(
                f"the scan gives more than {MOST_POINTS} points",
                **_dense(settings),
                hint="Choose larger steps, or fewer stations or strips, or thin the cloud with voxel",
            )
    return _thinned(parts, settings.voxel) if settings.voxel and parts else parts


def _thinned(parts: list[Columns], size: float) -> list[Columns]:
    """Concatenate the chunks and keep one point in each cube."""
    columns = {name: np.concatenate([part.pop(name) for part in parts]) for name in list(parts[0])}
    rows = one_in_each_cube(columns["points"], size, columns["rank"])
    return [{name: columns.pop(name)[rows] for name in list(columns)}]


@dataclass(frozen=True)
class _Scanned:
    """What is scanned: the target, the surface, the wanted box, and the wanted triangles (None: all)."""

    target: Target
    surface: SceneSurface
    box: F64
    only: Bool | None


def _scan(chunk: Rays, scanned: _Scanned, settings: AnyScanner, rng: np.random.Generator) -> Columns:
    """Measure along the rays that can hit the wanted part; return its columns."""
    box, only, surface = scanned.box, scanned.only, scanned.surface
    aimed = meets_box(chunk, box)
    chunk = Rays(chunk.origins[aimed], chunk.directions[aimed], chunk.errors[aimed], chunk.station[aimed])
    found = scanned.target.echoes(chunk, settings, rng)
    origins, directions = chunk.origins[found.shots], chunk.directions[found.shots]
    true_points = origins + found.distances[:, None] * directions
    wanted = ((true_points >= box[0]) & (true_points <= box[1])).all(axis=1)
    if only is not None:
        wanted &= only[found.rows]
    points = origins + chunk.errors[found.shots] + found.measured[:, None] * directions
    normals = surface.normals[found.rows]
    turned = np.einsum("ni,ni->n", normals, directions) > 0  # towards the scanner, whichever side it hit
    columns = {
        "points": points,
        "true_points": true_points,
        "rows": found.rows,
        "mixed": found.mixed,
        "normals": np.where(turned[:, None], -normals, normals).astype(np.float32),
        "colors": encode_srgb(found.colors),
        "uncertainty": np.abs(found.measured - found.distances),
        "distances": found.distances,
        "intensity": found.intensities.astype(np.float32),
        "range": found.measured.astype(np.float32),
        "station": chunk.station[found.shots],
    }
    return {name: values[wanted] for name, values in columns.items()}


def meets_box(rays: Rays, box: F64) -> Bool:
    """Tell which rays intersect a box; the others need not be cast.

    Args:
        rays: Shots.
        box: Lower and upper corner [m], shape (2, 3), float64.

    Returns:
        Whether each does, shape (N,), bool.

    Source: T. Kay and J. Kajiya, Ray tracing complex scenes, SIGGRAPH 1986 (slabs).
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        cuts = (box[:, None] - rays.origins) / rays.directions
    first = np.fmax.reduce(np.fmin(cuts[0], cuts[1]), axis=1)
    last = np.fmin.reduce(np.fmax(cuts[0], cuts[1]), axis=1)
    return (first <= last) & (last >= 0.0)


def _joined(parts: list[Columns], stations: bool) -> Samples:
    """Concatenate the chunks column by column, freeing each, to save memory."""
    columns = {name: np.concatenate([part.pop(name) for part in parts]) for name in list(parts[0])}
    further = {name: columns[name] for name in ("intensity", "range", *(("station",) if stations else ()))}
    return Samples(
        columns["points"],
        columns["true_points"],
        columns["rows"],
        columns["normals"],
        columns["colors"],
        columns["uncertainty"],
        columns["uncertainty"] / columns["distances"],
        np.zeros(len(columns["rows"]), np.uint16),
        further,
    )
