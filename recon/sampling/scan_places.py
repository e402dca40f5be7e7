"""Default places of a scanner: stations that see most, or a way along the deck."""

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
_FIRM = ("ground", "road", "rail_bed", "embankment", "riverbank", "")  # what a tripod stands on; empty: nobody knows
_AROUND = 15.0  # [m] beside the bridge
_SPOTS = 400  # places that are looked at on one level
_LEVELS = 6  # surfaces above each other
_SLOPE = 0.85  # upward part of the normal of a place to stand
_FREE = 0.6  # [m] round the mirror
_TARGETS = 1500  # points on the bridge
_GRAZING = 75.0  # [deg] a target that is met at a greater angle does not count
_WORTH = 0.005  # share of the bridge that one more station must add
_LOOKS = 26  # directions that tell whether a place lies inside a body
_INSIDE = 0.3  # share of them that may meet the back of a face
_SLICE = 1.0  # [m] along the deck
_FULL = 0.5  # share of the points of a mean slice that one needs
_ROUND = 5  # slices that the way is smoothed over
_FLAT = 0.9  # upward part of the normal of a carriageway


def place_stations(
    scene: FlatScene,
    surface: SceneSurface,
    bridge: Bool,
    rays: RayScene,
    settings: TerrestrialSettings,
    rng: np.random.Generator,
) -> F64:
    """Choose stations on firm ground and on the deck, one after the other, each where it sees most that is new.

    Args:
        scene: The stage.
        surface: Its surface.
        bridge: Which triangles are the bridge, shape (T,), bool.
        rays: The surface for ray casting.
        settings: How many, and what a station can see.
        rng: Source of the points of the bridge that are to be seen.

    Returns:
        Where the mirror stands [m], shape (S, 3), float64.

    Raises:
        InputError: There is no place to stand, or none from which the bridge is seen.
    """
    spots = _spots(scene, surface, bridge, rays, settings.height)
    rows, places = draw_uniform(_TARGETS, surface, whole(bridge & (surface.areas > 0)), rng)
    targets = np.einsum("nk,nki->ni", places, surface.corners[rows])
    seen = np.array([_sees(spot, targets, surface.normals[rows], rays, settings) for spot in spots])
    hint = "Give the stations with --set positions=[[x, y, z]]"
    if not seen.any():
        raise InputError("no firm place from which a scanner would see the bridge", field="stations", hint=hint)
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
    """Find the way of a vehicle along the middle of the deck.

    The tops of deck and track are cut into slices across the longest direction of them.

    Args:
        scene: The stage.
        surface: Its surface.
        height: Height of the scanner above the deck [m].
        run_up: How far the way goes on straight at both ends [m].

    Returns:
        Corners of the way [m], shape (P, 3), float64.

    Raises:
        InputError: The stage has no deck.
    """
    carrying = np.isin(surface.instances, [row.id for row in scene.instances if row.base_class in DECK])
    top = carrying & (surface.normals[:, 2] > _FLAT) & (surface.areas > 0)
    if not top.any():
        raise InputError("has no deck to drive on", field="path", value="deck", hint="Name a survey of the stage")
    rng = np.random.default_rng(0)  # where the samples lie moves the way by centimetres
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
        if own.sum() >= _FULL * len(points) / slices:  # the corner of a skew end says little about the middle
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
    """Run a mean along a way; its ends stay."""
    width = min(_ROUND, len(way) - (1 - len(way) % 2))
    half = width // 2
    before, after = 2 * way[:1] - way[half:0:-1], 2 * way[-1:] - way[-2 : -2 - half : -1]
    padded = np.concatenate([before, way, after])
    return np.stack([np.convolve(padded[:, axis], np.full(width, 1.0 / width), "valid") for axis in range(3)], axis=1)


def _spots(scene: FlatScene, surface: SceneSurface, bridge: Bool, rays: RayScene, height: float) -> F64:
    """Look for places where a tripod can stand, on every level round the bridge."""
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
    """Keep the mirrors between which and their floor there is nothing, such as another layer of the deck."""
    distances, _, _ = rays.cast(spots, np.broadcast_to([0.0, 0.0, -1.0], spots.shape))
    return np.abs(distances - height) < 0.01


def _free(spots: F64, surface: SceneSurface, rays: RayScene) -> Bool:
    """Keep the mirrors that nothing is close to and that do not stand inside a body."""
    distances, _ = rays.distance(spots)
    turn = np.arange(_LOOKS) * np.pi * (3.0 - np.sqrt(5.0))  # the golden angle spreads directions evenly
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
