"""Warnings about features of a stage that are not supported: one line for each kind."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from pxr import Usd, UsdGeom, UsdLux, UsdShade

from usd_schemas.flat_scene import CameraTrack
from usd_schemas.reading.flat_geometry import Flattened, world_bounds
from usd_schemas.reading.labels import Warn
from usd_schemas.reading.lights import shines_on_nothing
from usd_schemas.reading.shader_inputs import GLASS, find_source, number_of, shine_by_ior
from usd_schemas.reading.traversal import EARLIEST, composed_prims, guarded

_DRAW_MODES = ("cards", "bounds", "origin")
_LINKS = ("lightLink", "shadowLink")
_FARTHEST = 4999.0  # [m] that of our own surveys is at 5000 m, and needs no line


def note_unread(stage: Usd.Stage, warn: Warn) -> None:
    """Report unsupported features, each kind once, with the first prim and the number of others.

    Args:
        stage: Composed stage.
        warn: Called with one line for each kind.
    """
    found: dict[str, list[str]] = {}
    for prim in composed_prims(stage):
        with guarded(prim, warn):
            for kind in _unread(prim):
                found.setdefault(kind, []).append(str(prim.GetPath()))
    for kind, paths in sorted(found.items()):
        warn(f"{paths[0]}: {kind}" + (f" (and {len(paths) - 1} more)" if len(paths) > 1 else ""))


def note_far(stage: Usd.Stage, cameras: tuple[CameraTrack, ...], flat: Flattened, unit: float, warn: Warn) -> None:
    """Report cameras that would not show all that is drawn, because of their far clipping plane, in one line.

    Args:
        stage: Composed stage.
        cameras: Its cameras.
        flat: What is drawn, at the first moment.
        unit: Length of the stage's unit [m].
        warn: Called with the line.
    """
    ranges = [(camera, _value(stage.GetPrimAtPath(camera.path), "clippingRange")) for camera in cameras]
    told = [(camera, float(both[1]) * unit) for camera, both in ranges if both is not None]
    told = [(camera, far) for camera, far in told if camera.near < far < _FARTHEST]
    if not told:
        return
    ends = np.array(world_bounds(flat))
    corners = np.array([[ends[bit, axis] for axis, bit in enumerate(bits)] for bits in np.ndindex(2, 2, 2)])
    short = []
    for camera, far in told:
        depths = np.einsum("nci,ni->nc", corners - camera.poses[:, None, :3, 3], camera.poses[:, :3, 2])
        short += [camera.path] if depths.max() > far else []
    if short:
        more = f" (and {len(short) - 1} more)" if len(short) > 1 else ""
        warn(f"{short[0]}: its far clipping plane is left out: what lies beyond is drawn{more}")


def _unread(prim: Usd.Prim) -> Iterator[str]:
    mode = _value(prim, "model:drawMode")
    if mode in _DRAW_MODES:
        yield f"model:drawMode {mode} is left out: its geometry is drawn"
    if prim.IsA(UsdGeom.Camera):
        yield from _of_camera(UsdGeom.Camera(prim))
    if prim.HasAPI(UsdLux.LightAPI) or prim.HasAPI(UsdLux.MeshLightAPI):
        yield from _of_light(prim)
    if prim.GetTypeName() == "Shader":
        yield from _of_shader(UsdShade.Shader(prim))
    if prim.IsA(UsdGeom.Gprim):
        opacity = UsdGeom.PrimvarsAPI(prim).GetPrimvar("displayOpacity")
        values = opacity.Get(EARLIEST) if opacity and opacity.HasAuthoredValue() else None
        if values is not None and len(values) and min(values) < 1.0:
            yield "displayOpacity is left out: drawn opaque"


def _of_camera(camera: UsdGeom.Camera) -> Iterator[str]:
    told = {
        name: camera.GetPrim().GetAttribute(name).Get(EARLIEST) for name in ("fStop", "shutter:open", "shutter:close")
    }
    if (told["fStop"] or 0.0) > 0.0 and camera.GetFStopAttr().HasAuthoredValue():
        yield "fStop is left out: everything is sharp"
    if told["shutter:open"] != told["shutter:close"]:
        yield "the shutter's interval is left out: there is no motion blur"
    if camera.GetClippingPlanesAttr().Get(EARLIEST):
        yield "clippingPlanes are left out"


def _of_shader(shader: UsdShade.Shader) -> Iterator[str]:
    if shader.GetShaderId() != "UsdPreviewSurface" or number_of(find_source(shader, "useSpecularWorkflow"), 0.0):
        return
    index, metallic = find_source(shader, "ior"), find_source(shader, "metallic")
    told = index.shader or number_of(index, GLASS) != GLASS
    if told and shine_by_ior(shader) is None and (metallic.shader or number_of(metallic, 0.0) != 1.0):
        yield "ior is left out: drawn as 1.5"


def _of_light(prim: Usd.Prim) -> Iterator[str]:
    if prim.HasAPI(UsdLux.MeshLightAPI):
        yield "MeshLightAPI is left out: the mesh is drawn, but emits no light"
    for name in _LINKS:
        root, targets = _value(prim, f"collection:{name}:includeRoot"), []
        for side in ("includes", "excludes"):
            relation = prim.GetRelationship(f"collection:{name}:{side}")
            targets += relation.GetTargets() if relation else []
        if targets or root is False:
            what = "shines on" if name == "lightLink" else "is shadowed by"
            yield f"{name} is left out: the light {what} everything"
    filters = prim.GetRelationship("light:filters")
    if filters and filters.GetTargets():
        yield "light:filters are left out"
    if not shines_on_nothing(prim):
        for name in ("diffuse", "specular"):
            if _value(prim, f"inputs:{name}") not in (None, 1.0):
                yield f"inputs:{name} is left out"
    if _value(prim, "inputs:shadow:enable") is False:
        yield "inputs:shadow:enable is left out"


def _value(prim: Usd.Prim, name: str) -> Any:
    attribute = prim.GetAttribute(name)
    return attribute.Get(EARLIEST) if attribute and attribute.HasAuthoredValue() else None
