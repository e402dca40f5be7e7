"""The input of surveys from any stage, ours or another program's."""

import numpy as np

from authoring.surveys.subject import LAND, Subject
from groundwork.errors import InputError
from usd_schemas import tokens
from usd_schemas.flat_scene import FlatScene, world_triangles
from usd_schemas.raycast import RayScene


def stage_subject(scene: FlatScene) -> Subject:
    """Collect bridge and site of a stage.

    On a scene of ours the background is left out, because a flight must not depend on it. On other stages everything is
    an obstacle, and the bridge is all prims with a class other than background.

    Args:
        scene: The composed stage.

    Raises:
        InputError: Nothing in it is labeled as a part of a bridge.
    """
    corners, owners, draws = world_triangles(scene)
    mirrored = np.linalg.det(scene.draws.transform[:, :3, :3]) < 0.0
    corners = np.where(mirrored[draws][:, None, None], corners[:, ::-1], corners)  # outwards again
    ids = owners.astype(np.int32)
    rows = scene.instances
    bridge = [row.id for row in rows if row.path.startswith(f"{tokens.BRIDGE}/")]
    far = [row.id for row in rows if row.path.startswith(f"{tokens.BACKGROUND}/")] if bridge else []
    bridge = bridge or [row.id for row in rows if row.base_class not in ("background", "")]
    if not np.isin(ids, bridge).any():
        raise InputError(
            "no prim of the stage has the label of a bridge part", hint="Label its prims with userProperties:class"
        )
    kept, own = ~np.isin(ids, far), np.isin(ids, bridge)
    land = np.isin(ids, [row.id for row in rows if row.component in LAND]) & kept
    land = land if land.any() else kept & ~own
    bearings = [row.id for row in rows if row.base_class == "bearing"]
    seats = [corners[ids == number].reshape(-1, 3) for number in bearings if (ids == number).any()]
    return Subject(
        bridge=corners[own],
        bridge_ids=ids[own],
        seats=np.array([0.5 * (seat.min(axis=0) + seat.max(axis=0)) for seat in seats]).reshape(-1, 3),
        surface=RayScene(corners[own], owners[own]),
        obstacles=RayScene(corners[kept], owners[kept]),
        obstacle_ids=ids[kept],
        ground=RayScene(corners[land], owners[land]),
    )
