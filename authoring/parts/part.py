"""Parts without ids, and the bridge's components that are made from them: ids, texture offsets and the atlas."""

from dataclasses import dataclass, field

import numpy as np

from authoring.shapes.component import F64, FIRST_BRIDGE_ID, I64, Component, Mesh
from authoring.solids.atlas import pack_atlas
from authoring.solids.extrusion import Prism, extruded
from authoring.solids.sweep import Surface

SUPERSTRUCTURE = "Superstructure"
SUBSTRUCTURE = "Substructure"
FURNITURE = "Furniture"

_OFFSET_RANGE = 8.192  # [m]
# The plastic number's powers: offsets of consecutive ids are as far apart as possible (R2 sequence).
_OFFSET_STEP = (0.7548776662466927, 0.5698402909980532)
_FLIP_STEP = 0.41421356237309515
_DIGITS = 9  # decimals of parameters in meters


@dataclass(frozen=True)
class Part:
    """A member with position and labels, but without an id.

    Attributes:
        name: Leaf prim name, unique in the stage.
        kind: Component kind.
        role: Material role.
        group: Name of its parent Xform.
        solid: Closed surface in world space, or a prism that is built together with all others.
        parameters: Dimensions [m] and counts.
    """

    name: str
    kind: str
    role: str
    group: str
    solid: Surface | Prism
    parameters: dict[str, object] = field(default_factory=dict)

    @property
    def surface(self) -> Surface:
        """Its closed surface; for many parts, `surfaces_of` is faster."""
        return surfaces_of([self])[0]


def number_parts(parts: list[Part]) -> tuple[Component, ...]:
    """Assign to every part an id, a texture offset and a place in the atlas.

    Args:
        parts: All members of a bridge in a fixed order.

    Returns:
        Components with ids from FIRST_BRIDGE_ID on.
    """
    surfaces = surfaces_of(parts)
    atlas = pack_atlas(surfaces)
    ids = FIRST_BRIDGE_ID + np.arange(len(parts))
    return tuple(
        Component(part.name, part.kind, part.role, part.group, mesh, number, _rounded(part.parameters))
        for part, mesh, number in zip(parts, _meshes(surfaces, atlas, ids), ids.tolist(), strict=True)
    )


def surfaces_of(parts: list[Part]) -> list[Surface]:
    """Find the surfaces of parts; prisms are built together.

    Args:
        parts: Any number.
    """
    built = iter(extruded([part.solid for part in parts if isinstance(part.solid, Prism)]))
    return [next(built) if isinstance(part.solid, Prism) else part.solid for part in parts]


def _rounded(parameters: dict[str, object]) -> dict[str, object]:
    """Round dimensions, because their last digits differ between CPUs."""
    return {key: round(value, _DIGITS) if isinstance(value, float) else value for key, value in parameters.items()}


def _meshes(surfaces: list[Surface], atlas: list[F64], ids: I64) -> list[Mesh]:
    """Shift every member's texture, and mirror that of some along the member: stains still run downwards."""
    offsets = np.stack([_OFFSET_RANGE * (ids * step % 1.0) for step in _OFFSET_STEP], axis=1)
    flips = np.where(ids * _FLIP_STEP % 1.0 < 0.5, -1.0, 1.0)
    flips = np.stack([flips, np.ones(len(ids))], axis=1)
    return [
        Mesh(
            points=surface.points,
            face_counts=surface.face_counts,
            corners=surface.corners,
            normals=surface.normals.astype(np.float32),
            st=(surface.st * flip + offset).astype(np.float32),
            st1=st1.astype(np.float32),
        )
        for surface, st1, flip, offset in zip(surfaces, atlas, flips, offsets, strict=True)
    ]
