"""Choice of the viewpoint for one picture of a whole bridge: three-quarter views, scored by ray casting."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from authoring.surveys.subject import LAND
from groundwork.errors import InputError
from usd_schemas import tokens
from usd_schemas.flat_scene import Draws, FlatScene, world_triangles
from usd_schemas.pinhole import Pinhole, look_at
from usd_schemas.raycast import RayScene

F64 = NDArray[np.float64]

_TURNS = (30.0, 42.0, 55.0)  # [deg] of a three-quarter view, from the perpendicular to the bridge
_SLOPES = (3.0, 6.0, 9.0, 13.0)  # [deg] elevation of views from the air
_EYE = 1.7  # [m] eye height of views from the ground
VIEWS: dict[str, tuple[tuple[float, ...], tuple[float, ...]]] = {
    "auto": (_TURNS, (0.0, *_SLOPES)),
    "ground": (_TURNS, (0.0,)),
    "air": (_TURNS, _SLOPES),
    "side": ((0.0,), (0.0, 5.0, 12.0)),
}
"""Choices of a user: angles from the perpendicular to the bridge, and elevations [deg]; 0: eye height."""

_SAMPLES = 700  # points of the bridge that should be visible
_RASTER = 40  # rays across the picture
_DIRECTIONS = 600  # directions whose outermost points of the bridge represent the whole
_MARGIN = 1.07  # margin between the bridge and the edge of the picture
_REACH = 5.0  # [lengths of the bridge] beyond which nothing is an obstacle
_SMALL = 0.4  # [m] radius of things too small to hide anything: tufts, stones
_ROOM = 2.5  # [m] free radius around the eye
_BEST_SHARE = 0.12  # good share of the picture for a bridge
_BEST_SKY = (0.15, 0.5)  # good share of sky: a horizon in the upper half
_FRONT_LIGHT = 55.0  # [deg] good angle between the azimuths of sun and eye: faces are lit, and shadows show their depth


@dataclass(frozen=True)
class Subject:
    """The bridge of a picture, and possible obstacles.

    Attributes:
        points: On the bridge, spread evenly over its surfaces [m], shape (N, 3), float64.
        outline: Outermost corners of its triangles [m], shape (K, 3), float64.
        bridge: Instance ids of its members, sorted, shape (M,), uint32.
        rays: Ray caster of everything near it.
        land: Ray caster of ground and water only.
        square: Unit vector in plan perpendicular to the bridge [1], shape (2,), float64.
        length: Its length in plan [m].
        sun: Azimuth of the sun, counter-clockwise from +x [rad], or None.
    """

    points: F64
    outline: F64
    bridge: NDArray[np.uint32]
    rays: RayScene
    land: RayScene
    square: F64
    length: float
    sun: float | None


def best_view(scene: FlatScene, camera: Pinhole, view: str) -> F64:
    """Choose the camera that shows the whole bridge with the fewest obstacles.

    Args:
        scene: Any scene with a bridge.
        camera: Intrinsics.
        view: Key of `VIEWS`.

    Returns:
        camera_to_world [m], shape (4, 4), float64.

    Raises:
        InputError: Nothing in the scene is labeled as a part of a bridge.
    """
    subject = subject_of(scene)
    turns, slopes = VIEWS[view]
    signed = sorted({sign * turn for turn in turns for sign in (-1.0, 1.0)})
    poses = [
        fitted_pose(subject, camera, side, turn, slope) for side in (1.0, -1.0) for turn in signed for slope in slopes
    ]
    return poses[int(np.argmax(judge_poses(subject, camera, np.stack(poses))))]


def subject_of(scene: FlatScene) -> Subject:
    """Collect the bridge of a scene and its surroundings.

    Args:
        scene: Any scene with a bridge.

    Raises:
        InputError: Nothing in it is labeled as a part of a bridge.
    """
    rows = scene.instances
    bridge = [row.id for row in rows if row.path.startswith(f"{tokens.BRIDGE}/")]
    bridge = bridge or [row.id for row in rows if row.base_class not in ("background", "")]
    own, _, _ = world_triangles(_drawn(scene, np.isin(scene.draws.instance, bridge)))
    if len(own) == 0:
        raise InputError("no bridge to show in the stage", hint="Label its prims: userProperties:class")
    low, high = own.reshape(-1, 3).min(axis=0), own.reshape(-1, 3).max(axis=0)
    middle, size = 0.5 * (low + high), float(np.linalg.norm((high - low)[:2]))
    near = _near(scene, middle, _REACH * size, np.isin(scene.draws.instance, bridge))
    corners, ids, _ = world_triangles(near)
    land = np.isin(ids, [row.id for row in rows if row.component in LAND])
    floor = corners[land] if land.any() else np.empty((0, 3, 3))
    ground = RayScene(floor, np.zeros(len(floor), np.uint32))
    points = _spread(own, _SAMPLES)
    points = points[_over_land(points, ground)] if land.any() else points
    flat = points[:, :2] - points[:, :2].mean(axis=0)
    along = np.linalg.eigh(flat.T @ flat)[1][:, 1]
    sun = None if scene.sun is None else float(np.arctan2(scene.sun.direction[1], scene.sun.direction[0]))
    outline = own.reshape(-1, 3)
    outline = outline[_over_land(outline, ground)] if land.any() else outline
    square = np.array([-along[1], along[0]])
    return Subject(
        points,
        _outmost(outline),
        np.unique(bridge).astype(np.uint32),
        RayScene(corners, ids),
        ground,
        square,
        size,
        sun,
    )


def _drawn(scene: FlatScene, chosen: NDArray[np.bool_]) -> FlatScene:
    return replace(scene, draws=Draws(**{name: rows[chosen] for name, rows in vars(scene.draws).items()}))


def _near(scene: FlatScene, middle: F64, reach: float, always: NDArray[np.bool_]) -> FlatScene:
    """Leave out triangles that are far away, or of things too small to hide anything."""
    geometry, draws = scene.geometry, scene.draws
    low, high = np.zeros((2, len(geometry.part_first), 3))
    for part in np.unique(draws.part):
        first = geometry.part_first[part]
        points = geometry.positions[geometry.triangles[first : first + geometry.part_count[part]]].reshape(-1, 3)
        if len(points):
            low[part], high[part] = points.min(axis=0), points.max(axis=0)
    center, half = 0.5 * (low + high), 0.5 * np.linalg.norm(high - low, axis=1)
    turn, place = draws.transform[:, :3, :3], draws.transform[:, :3, 3]
    at = np.einsum("nij,nj->ni", turn, center[draws.part]) + place
    radius = half[draws.part] * np.linalg.norm(turn, axis=1).max(axis=1)
    return _drawn(scene, always | ((radius > _SMALL) & (np.linalg.norm(at - middle, axis=1) - radius < reach)))


def _spread(corners: F64, count: int) -> F64:
    """Sample points at equal steps of the area of triangles [m], shape (T, 3, 3), in their order."""
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    total = np.cumsum(area)
    rows = np.searchsorted(total, (np.arange(count) + 0.5) / count * total[-1])
    shares = np.modf(np.outer(np.arange(1, count + 1), [0.7548776662466927, 0.5698402909980532]))[0]
    shares[shares.sum(axis=1) > 1.0] = 1.0 - shares[shares.sum(axis=1) > 1.0]
    a, b, c = (corners[rows, k] for k in range(3))
    return a + shares[:, :1] * (b - a) + shares[:, 1:] * (c - a)


def _outmost(points: F64) -> F64:
    """Keep the outermost points in many directions; a view that contains these points contains all."""
    steps = np.arange(_DIRECTIONS) + 0.5
    height, turn = 1.0 - 2.0 * steps / _DIRECTIONS, np.pi * (1.0 + 5.0**0.5) * steps
    radius = np.sqrt(1.0 - height * height)
    aside = np.stack([radius * np.cos(turn), radius * np.sin(turn), height])
    return points[np.unique(np.argmax(points @ aside, axis=0))]


def _over_land(points: F64, land: RayScene) -> NDArray[np.bool_]:
    """Tell which of the points [m], shape (N, 3), are above ground and water."""
    return _height(land, points[:, :2]) < points[:, 2]


def _height(land: RayScene, places: F64) -> F64:
    """Find the height of the land [m] at places in plan [m], shape (N, 2); -inf where there is none."""
    top = 5000.0
    origins = np.concatenate([places, np.full((len(places), 1), top)], axis=1)
    return top - land.cast(origins, np.tile([0.0, 0.0, -1.0], (len(places), 1)))[0]


def fitted_pose(subject: Subject, camera: Pinhole, side: float, turn: float, slope: float) -> F64:
    """Compute the camera from which the bridge just fits into the picture.

    Args:
        subject: The bridge.
        camera: Intrinsics.
        side: 1: left of the bridge, -1: right [1].
        turn: Angle of the view from the perpendicular to the bridge [deg].
        slope: Downward angle of the view to the middle of the bridge [deg]; 0: eye height above the ground.

    Returns:
        camera_to_world [m], shape (4, 4), float64.
    """
    points = subject.outline
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    angle = np.radians(turn)
    cosine, sine = np.cos(angle), np.sin(angle)
    plan = np.array([[cosine, -sine], [sine, cosine]]) @ (side * subject.square)
    aside = np.array([*plan, np.tan(np.radians(slope))])
    distance, eye = subject.length, middle
    for _ in range(1 if slope else 4):
        direction = aside / np.linalg.norm(aside)
        distance = _fitting(points, middle, direction, camera)
        eye = middle + distance * direction
        if not slope:
            ground = float(_height(subject.land, eye[None, :2])[0])
            eye[2] = (ground if np.isfinite(ground) else float(points[:, 2].min())) + _EYE
            aside = eye - middle
    return look_at(eye, _aim(points, middle, eye, camera))


def _fitting(points: F64, middle: F64, direction: F64, camera: Pinhole) -> float:
    local = (points - middle) @ look_at(middle + direction, middle)[:3, :3]
    slope = 0.5 * np.array([camera.width / camera.fx, camera.height / camera.fy]) / _MARGIN
    return float(np.max(np.abs(local[:, :2]) / slope - local[:, 2:]))


def _aim(points: F64, middle: F64, eye: F64, camera: Pinhole) -> F64:
    """Aim so that the bridge has equal margins left and right, and a little more above than below."""
    local = (points - eye) @ look_at(eye, middle)[:3, :3]
    places = local[:, :2] / local[:, 2:]
    low, high = places.min(axis=0), places.max(axis=0)
    spare = max(float(camera.height / camera.fy - (high - low)[1]), 0.0)
    target = 0.5 * (low + high) - np.array([0.0, 0.12 * spare])
    return eye + look_at(eye, middle)[:3, :3] @ np.array([*target, 1.0])


def judge_poses(subject: Subject, camera: Pinhole, poses: F64) -> F64:
    """Score each camera; higher is better.

    Args:
        subject: The bridge and its surroundings.
        camera: Intrinsics.
        poses: camera_to_world [m], shape (N, 4, 4), float64.

    Returns:
        Scores [1], shape (N,), float64.
    """
    hidden = np.stack([_hidden(subject, pose[:3, 3]) for pose in poses])
    never = hidden.all(axis=0)  # points inside an embankment are hidden from everywhere
    lost = hidden[:, ~never].mean(axis=1) if not never.all() else np.ones(len(poses))
    marks = [-4.0 * share + _composition(subject, camera, pose) for share, pose in zip(lost, poses, strict=True)]
    return np.array(marks)


def _hidden(subject: Subject, eye: F64) -> NDArray[np.bool_]:
    """Tell which points of the bridge are hidden by anything but the bridge; shape (N,)."""
    distance, _, ids = subject.rays.cast(np.tile(eye, (len(subject.points), 1)), subject.points - eye)
    return (distance < 0.999) & ~np.isin(ids, subject.bridge)


def _composition(subject: Subject, camera: Pinhole, pose: F64) -> float:
    """Score the free room around the eye, the shares of bridge and sky in the picture, near objects, the light."""
    eye = pose[:3, 3]
    across = (np.arange(_RASTER) + 0.5) / _RASTER * camera.width
    down = (np.arange(_RASTER // 2) + 0.5) / (_RASTER // 2) * camera.height
    u, v = (grid.ravel() for grid in np.meshgrid(across, down))
    rays = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(len(u))], axis=1)
    depth, _, ids = subject.rays.cast(np.tile(eye, (len(u), 1)), rays @ pose[:3, :3].T)
    own = np.isin(ids, subject.bridge)
    reach = float(np.median(depth[own])) if own.any() else subject.length
    close = float(((depth < 0.3 * reach) & ~own & (v < 0.6 * camera.height)).mean())  # foreground may be below
    turns = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    around = np.stack([np.cos(turns), np.sin(turns), np.zeros(12)], axis=1)
    room = float(subject.rays.cast(np.tile(eye, (12, 1)), around)[0].min())
    sky = float(np.isinf(depth).mean())
    mark = min(float(own.mean()) / _BEST_SHARE, 1.0) - 3.0 * close - (2.0 if room < _ROOM else 0.0)
    mark -= 3.0 * max(_BEST_SKY[0] - sky, sky - _BEST_SKY[1], 0.0)
    if subject.sun is not None:
        middle = subject.points.mean(axis=0)
        seen_from = np.arctan2(eye[1] - middle[1], eye[0] - middle[0])
        off = abs((seen_from - subject.sun + np.pi) % (2.0 * np.pi) - np.pi)
        mark += 0.4 * float(np.cos(off - np.radians(_FRONT_LIGHT)))
    return mark
