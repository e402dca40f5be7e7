"""Default places of a scanner: the stations that see most of the bridge, or a path along the deck."""

import numpy as np
from numpy.typing import NDArray

from groundwork.errors import InputError
from recon.sampling.camera_views import TOUCH
from recon.sampling.sample_mesh import draw_uniform
from recon.sampling.sampler_settings import TerrestrialSettings
from recon.sampling.scene_surface import SceneSurface, whole
from usd_schemas.flat_scene import FlatScene
from usd_schemas.raycast import RayScene

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
Bool = NDArray[np.bool_]

DECK = ("deck", "slab", "sleeper", "track")  # classes that carry traffic
_FIRM = ("ground", "road", "rail_bed", "embankment", "riverbank", "")  # kinds for a tripod; empty: unknown kind
_AROUND = 15.0  # [m] beside the bridge
_SPOTS = 400  # candidate places on one level
_LEVELS = 6  # surfaces one above the other
_SLOPE = 0.85  # least upward component of the normal where a tripod stands
_FREE = 0.6  # [m] radius about the mirror without any surface
_TARGETS = 1500  # points on the bridge
_GRAZING = 75.0  # [deg] targets seen at a greater angle of incidence do not count
_WORTH = 0.005  # share of the bridge that a further station must add
_LOOKS = 26  # directions that test whether a place lies inside a body
_INSIDE = 0.3  # share of them that may hit the back of a face
_SLICE = 1.0  # [m] length of a slice along the deck
_FULL = 0.5  # a slice with a smaller share of the mean number of points is ignored
_ROUND = 5  # number of slices over which the path is smoothed
_FLAT = 0.9  # least upward component of the normal of a carriageway


def place_stations(
    scene: FlatScene,
    surface: SceneSurface,
    bridge: Bool,
    rays: RayScene,
    settings: TerrestrialSettings,
    rng: np.random.Generator,
) -> F64:
    """Choose stations on firm ground and on the deck one by one, each where it sees most of what no other has seen.

    Args:
        scene: The stage.
        surface: Its surface.
        bridge: Which triangles are the bridge, shape (T,), bool.
        rays: The surface for ray casting.
        settings: Number and range of the stations.
        rng: Source of the target points on the bridge.

    Returns:
        Positions of the mirror [m], shape (S, 3), float64.

    Raises:
        InputError: There is no place for a tripod, or none from which the bridge is visible.
    """
    spots = _spots(scene, surface, bridge, rays, settings.height)
    rows, places = draw_uniform(_TARGETS, surface, whole(bridge & (surface.areas > 0)), rng)
    targets = np.einsum("nk,nki->ni", places, surface.corners[rows])
    seen = np.array([_sees(spot, targets, surface.normals[rows], rays, settings) for spot in spots])
    hint = "Give the stations with --set positions=[[x, y, z]]"
    if not seen.any():
        raise InputError("no firm ground from which a scanner would see the bridge", field="stations", hint=hint)
    chosen: list[int] = []
    missing = np.ones(len(targets), bool)
    while len(chosen) < settings.stations:
        gain = (seen & missing).sum(axis=1)
        best = int(gain.argmax())
        if chosen and gain[best] < _WORTH * len(targets):
            break
        chosen.append(best)
        missing &= ~seen[best]
    return spots[chosen]


def deck_way(scene: FlatScene, surface: SceneSurface, height: float, run_up: float) -> F64:
    """Find the path of a vehicle along the middle of the deck.

    The tops of deck and track are cut into slices across their longest direction.

    Args:
        scene: The stage.
        surface: Its surface.
        height: Height of the scanner above the deck [m].
        run_up: Length of the straight extension at both ends [m].

    Returns:
        Corners of the path [m], shape (P, 3), float64.

    Raises:
        InputError: The stage has no deck, or one that is too short.
    """
    carrying = np.isin(surface.instances, [row.id for row in scene.instances if row.base_class in DECK])
    top = carrying & (surface.normals[:, 2] > _FLAT) & (surface.areas > 0)
    if not top.any():
        raise InputError("has no deck to drive on", field="path", value="deck", hint="Name a survey of the stage")
    rng = np.random.default_rng(0)  # the choice of samples changes the path by centimeters
    rows, places = draw_uniform(20_000, surface, whole(top), rng)
    points = np.einsum("nk,nki->ni", places, surface.corners[rows])
    middle = points[:, :2].mean(axis=0)
    _, _, axes = np.linalg.svd(points[:, :2] - middle, full_matrices=False)
    axes[0] *= 1.0 if axes[0, 0] >= 0 else -1.0
    along, across = ((points[:, :2] - middle) @ axes.T).T
    slices = max(1, round((along.max() - along.min()) / _SLICE))
    width = (along.max() - along.min()) / slices
    number = np.minimum(((along - along.min()) / width).astype(np.int64), slices - 1)
    found = []
    for row in range(slices):
        own = number == row
        if own.sum() >= _FULL * len(points) / slices:  # near the corners of a skew end the middle is uncertain
            side = 0.5 * (across[own].min() + across[own].max())
            found.append([along.min() + (row + 0.5) * width, side, np.percentile(points[own, 2], 75)])
    if len(found) < 2:
        raise InputError("its deck is too short to drive on", field="path", hint="Name a survey of the stage")
    smooth = _smoothed(np.array(found))
    plan = middle + smooth[:, :2] @ axes
    way = np.column_stack([plan, smooth[:, 2] + height])
    if not run_up:
        return way
    behind = min(_ROUND, len(way) - 1)
    starts = [way[0] - way[behind], way[-1] - way[-1 - behind]]
    before, after = (step / np.linalg.norm(step) * run_up for step in starts)
    return np.concatenate([way[:1] + before, way, way[-1:] + after])


def _smoothed(way: F64) -> F64:
    """Smooth a path by a moving average; its ends are fixed."""
    width = min(_ROUND, len(way) - (1 - len(way) % 2))
    half = width // 2
    before, after = 2 * way[:1] - way[half:0:-1], 2 * way[-1:] - way[-2 : -2 - half : -1]
    padded = np.concatenate([before, way, after])
    return np.stack([np.convolve(padded[:, axis], np.full(width, 1.0 / width), "valid") for axis in range(3)], axis=1)


def _spots(scene: FlatScene, surface: SceneSurface, bridge: Bool, rays: RayScene, height: float) -> F64:
    """Find places for a tripod on every level around the bridge."""
    flat = surface.corners[bridge].reshape(-1, 3)
    low, high = flat.min(axis=0) - _AROUND, flat.max(axis=0) + _AROUND
    size = high - low
    spacing = np.sqrt(size[0] * size[1] / _SPOTS)
    across = [np.arange(low[i] + spacing / 2, high[i], spacing) for i in range(2)]
    grid = np.stack(np.meshgrid(*across, indexing="ij"), axis=-1).reshape(-1, 2)
    firm = np.isin(
        surface.instances, [row.id for row in scene.instances if row.component in _FIRM or row.base_class in DECK]
    )
    firm &= surface.normals[:, 2] > _SLOPE
    starts = np.column_stack([grid, np.full(len(grid), high[2] + 1.0)])
    found = []
    for _ in range(_LEVELS):
        distances, row, _ = rays.cast(starts, np.broadcast_to([0.0, 0.0, -1.0], starts.shape))
        hit = np.isfinite(distances)
        starts, distances, row = starts[hit], distances[hit], row[hit]
        floor = starts - distances[:, None] * [0.0, 0.0, 1.0]
        found.append(floor[firm[row]] + [0.0, 0.0, height])
        starts = floor - [0.0, 0.0, 0.02]
    spots = np.concatenate(found)
    spots = spots[_above_floor(spots, rays, height)]
    return spots[_free(spots, surface, rays)] if len(spots) else spots


def _above_floor(spots: F64, rays: RayScene, height: float) -> Bool:
    """Keep the mirror positions with nothing between them and their floor, such as another layer of the deck."""
    distances, _, _ = rays.cast(spots, np.broadcast_to([0.0, 0.0, -1.0], spots.shape))
    return np.abs(distances - height) < 0.01


def _free(spots: F64, surface: SceneSurface, rays: RayScene) -> Bool:
    """Keep the mirror positions that are not close to anything and not inside a body."""
    distances, _ = rays.distance(spots)
    turn = np.arange(_LOOKS) * np.pi * (3.0 - np.sqrt(5.0))  # the golden angle distributes directions evenly
    heights = 1.0 - (2.0 * np.arange(_LOOKS) + 1.0) / _LOOKS
    flat = np.sqrt(1.0 - heights**2)
    looks = np.column_stack([flat * np.cos(turn), flat * np.sin(turn), heights])
    _, rows, _ = rays.cast(np.repeat(spots, _LOOKS, axis=0), np.tile(looks, (len(spots), 1)))
    towards = np.einsum("ni,ni->n", surface.normals[rows], np.tile(looks, (len(spots), 1)))
    back = ((rows >= 0) & (towards > 0)).reshape(len(spots), _LOOKS).mean(axis=1)
    return (distances >= _FREE) & (back <= _INSIDE)


def _sees(spot: F64, targets: F64, normals: F64, rays: RayScene, settings: TerrestrialSettings) -> Bool:
    """Tell which targets a station measures well."""
    ways = targets - spot
    lengths = np.linalg.norm(ways, axis=1)
    cosines = np.abs(np.einsum("ni,ni->n", ways, normals)) / lengths
    elevation = np.rad2deg(np.arcsin(np.clip(ways[:, 2] / lengths, -1.0, 1.0)))
    found, _, _ = rays.cast(np.broadcast_to(spot, ways.shape), ways)
    good = (lengths >= settings.min_range) & (lengths <= min(settings.max_range, settings.range_at_10_percent))
    good &= (cosines >= np.cos(np.deg2rad(_GRAZING))) & (elevation >= settings.lowest) & (elevation <= settings.highest)
    return good & (found * lengths >= lengths - TOUCH)
