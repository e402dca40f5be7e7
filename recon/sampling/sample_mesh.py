"""Conductor of mesh sampling: points on a stage's surface, uniform by area."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from groundwork.errors import InputError
from groundwork.progress import Progress
from recon.cloud import MESH, Cloud, write_cloud
from recon.formats.laz import check_las_classes, write_laz
from recon.formats.ply import write_ply
from recon.sampling.camera_views import count_views
from recon.sampling.sampled_cloud import Samples, annotate_samples
from recon.sampling.sampler_settings import MeshSettings
from recon.sampling.scene_surface import Fragments, SceneSurface, bounds_of, bridge_triangles, clip, lay_out, whole
from recon.sampling.surface_look import SurfaceLook, encode_srgb
from usd_schemas.flat_scene import FlatScene
from usd_schemas.raycast import RayScene

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

MOST_POINTS = 20_000_000
_BATCH = 1_000_000  # points drawn and tested at once
_PATIENCE = 50  # give up after drawing this many times the wanted number of points


@dataclass(frozen=True, eq=False)
class Drawn:
    """Points of the surface.

    Attributes:
        rows: Triangle of each, shape (N,), int64.
        places: Barycentric coordinates in it [1], shape (N, 3), float64.
        colors: sRGB base colors, shape (N, 3), uint8.
        views: Cameras that see it, if requested, shape (N,), uint16.
    """

    rows: I64
    places: F64
    colors: NDArray[np.uint8]
    views: NDArray[np.uint16]


def sample_mesh(scene: FlatScene, folder: Path, settings: MeshSettings, progress: Progress) -> Cloud:
    """Sample the surface of a stage and write it as a cloud.

    Args:
        scene: A composed stage.
        folder: Existing empty folder.
        settings: What to do.
        progress: Listener.

    Raises:
        InputError: No surface, no camera although views are required, no point that enough cameras see, or a class id
            that LAS cannot hold.
    """
    check_las_classes([row.id for row in scene.classes])
    progress.stage("sample", 0)
    surface = lay_out(scene)
    look = SurfaceLook(scene, surface)
    # Loading the ray caster takes longer than everything else: done only if needed.
    used = settings.min_views or settings.noise or settings.normal_noise
    rays = RayScene(surface.corners, surface.instances) if used else None
    pieces, area = _pieces(scene, surface, settings)
    wanted = settings.points if settings.points is not None else round(settings.density * area)
    if not 1 <= wanted <= MOST_POINTS:
        raise InputError(
            f"{area:.1f} m² at this density give {wanted} points",
            field="density",
            value=settings.density,
            allowed=f"1 to {MOST_POINTS} points",
        )
    rng = np.random.default_rng(settings.seed)

    def draw(count: int) -> Drawn:
        rows, places = draw_uniform(count, surface, pieces, rng)
        colors, kept = look.at(rows, places)
        views = np.zeros(count, np.uint16)
        if settings.min_views and rays is not None:
            points = np.einsum("nk,nki->ni", places, surface.corners[rows])
            views = count_views(points, scene, settings.survey, rays, progress)
            kept &= views >= settings.min_views
        return Drawn(rows[kept], places[kept], encode_srgb(colors[kept]), views[kept])

    found, drawn = _enough(wanted, settings.points is not None, draw)
    for name in look.unread:
        progress.note(f"{name}: not readable as a texture; its points have the color of the material")
    progress.stage("write", 0)
    facts = {
        "area": area,
        "density": drawn / area,
        "kept_share": len(found.rows) / drawn,
        "settings": settings.model_dump(mode="json"),
    }
    samples = _moved(found, surface, settings, rng)
    if settings.voxel:
        samples = samples.thinned(settings.voxel, np.random.default_rng([settings.seed, 1]).random(len(samples.points)))
    cloud = annotate_samples(samples, scene, surface, rays, MESH, facts)
    write_cloud(folder, cloud)
    write_laz(folder / "cloud.laz", cloud)
    write_ply(folder / "cloud.ply", cloud)
    return cloud


def draw_uniform(count: int, surface: SceneSurface, pieces: Fragments, rng: np.random.Generator) -> tuple[I64, F64]:
    """Draw points uniformly by area, independently of each other.

    Source: G. Turk, Generating random points in triangles, Graphics Gems (1990): the square root makes the density
        uniform.

    Args:
        count: Number of points.
        surface: A surface.
        pieces: The pieces of it to draw from; at least one has an area.
        rng: Source of randomness.

    Returns:
        Triangle of each point, shape (N,), int64, and its barycentric coordinates [1], shape (N, 3), float64.
    """
    total = np.cumsum(pieces.areas(surface))
    chosen = np.searchsorted(total, rng.random(count) * total[-1], side="right")
    chosen = np.minimum(chosen, len(total) - 1)
    root, second = np.sqrt(rng.random(count)), rng.random(count)
    weights = np.column_stack([1.0 - root, root * (1.0 - second), root * second])
    return pieces.rows[chosen], np.einsum("nk,nki->ni", weights, pieces.barycentric[chosen])


def _pieces(scene: FlatScene, surface: SceneSurface, settings: MeshSettings) -> tuple[Fragments, float]:
    bridge = bridge_triangles(scene, surface)
    alone = settings.scope == "bridge"
    pieces = whole(bridge) if alone else clip(surface, bounds_of(surface, bridge, settings.reach))
    areas = pieces.areas(surface)
    kept = areas > 0
    if not kept.any():
        raise InputError("the stage has no surface to sample")
    return Fragments(pieces.rows[kept], pieces.barycentric[kept]), float(areas[kept].sum())


def _enough(wanted: int, exact: bool, draw: Callable[[int], Drawn]) -> tuple[Drawn, int]:
    """Draw until enough points are kept; with a density, rejected points are not replaced.

    Returns the points and how many were drawn for them.
    """
    found: list[Drawn] = []
    kept = drawn = 0
    while drawn < wanted or (exact and kept < wanted and drawn < _PATIENCE * wanted):
        missing = wanted - drawn
        if missing <= 0:
            missing = round(1.05 * (wanted - kept) * drawn / max(kept, 1)) + 64
        found.append(draw(min(_BATCH, missing)))
        drawn, kept = drawn + min(_BATCH, missing), kept + len(found[-1].rows)
    if kept < (wanted if exact else 1):
        raise InputError(
            f"only {kept} of {drawn} points on the surface are seen",
            field="points",
            value=wanted,
            hint="Ask for fewer points, or lower min_views",
        )
    columns = {name: np.concatenate([getattr(part, name) for part in found])[:wanted] for name in vars(found[0])}
    return Drawn(**columns), drawn


def _moved(found: Drawn, surface: SceneSurface, settings: MeshSettings, rng: np.random.Generator) -> Samples:
    """Displace points as a measurement would."""
    true_points = np.einsum("nk,nki->ni", found.places, surface.corners[found.rows])
    normals, points = surface.normals[found.rows], true_points.copy()
    if settings.normal_noise:
        points += settings.normal_noise * rng.standard_normal(len(points))[:, None] * normals
    if settings.noise:
        points += settings.noise * rng.standard_normal(points.shape)
    error = np.linalg.norm(points - true_points, axis=1)
    unknown = np.full(len(points), np.nan)
    return Samples(points, true_points, found.rows, normals, found.colors, error, unknown, found.views, {})
