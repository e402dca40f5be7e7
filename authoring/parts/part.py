"""From nameless surfaces to the bridge's components: ids, texture offsets and the atlas."""

from dataclasses import dataclass, field

import numpy as np

from authoring.atlas import pack_atlas
from authoring.component import FIRST_BRIDGE_ID, Component, Mesh
from authoring.sweep import Surface

SUPERSTRUCTURE = "Superstructure"
SUBSTRUCTURE = "Substructure"
FURNITURE = "Furniture"

_OFFSET_RANGE = 8.192  # [m]
# The plastic number's powers: offsets of consecutive ids lie as far apart as they can (R2 sequence).
_OFFSET_STEP = (0.7548776662466927, 0.5698402909980532)
_FLIP_STEP = 0.41421356237309515


@dataclass(frozen=True)
class Part:
    """A member that has a place and a meaning, but no id yet.

    Attributes:
        name: Leaf prim name, unique in the stage.
        kind: Component kind.
        role: Material role.
        group: Name of the Xform that it stands under.
        surface: Closed surface in world space.
        parameters: Dimensions [m] and counts.
    """

    name: str
    kind: str
    role: str
    group: str
    surface: Surface
    parameters: dict[str, object] = field(default_factory=dict)


def number_parts(parts: list[Part]) -> tuple[Component, ...]:
    """Give every part its id, its own texture offset and its place in the atlas.

    Args:
        parts: All members of a bridge in their lasting order.

    Returns:
        Components with ids from FIRST_BRIDGE_ID on.
    """
    atlas = pack_atlas([part.surface for part in parts])
    return tuple(
        Component(
            name=part.name,
            kind=part.kind,
            role=part.role,
            group=part.group,
            mesh=_mesh(part.surface, st1, FIRST_BRIDGE_ID + number),
            instance_id=FIRST_BRIDGE_ID + number,
            parameters=part.parameters,
        )
        for number, (part, st1) in enumerate(zip(parts, atlas, strict=True))
    )


def _mesh(surface: Surface, st1: np.ndarray, instance_id: int) -> Mesh:
    offset = np.array([_OFFSET_RANGE * (instance_id * step % 1.0) for step in _OFFSET_STEP])
    flip = np.array([-1.0 if instance_id * _FLIP_STEP % 1.0 < 0.5 else 1.0, 1.0])  # what runs down still does
    return Mesh(
        points=surface.points,
        face_counts=surface.face_counts,
        corners=surface.corners,
        normals=surface.normals.astype(np.float32),
        st=(surface.st * flip + offset).astype(np.float32),
        st1=st1.astype(np.float32),
    )
