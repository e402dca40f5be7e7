"""Cameras that another program added or moved; each is stored as a flight, for a survey of kind `stage`."""

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom

from authoring.edits.matching import free_name, object_name
from usd_schemas import tokens
from usd_schemas.flat_scene import CameraTrack
from usd_schemas.pinhole import USD_FROM_CAMERA, UsdLens
from usd_schemas.reading.cameras import read_cameras
from usd_schemas.reading.stage_reader import stage_to_world

F64 = NDArray[np.float64]
_TYPES = Sdf.ValueTypeNames

MOVED = 1e-3  # [m], and entries of the rotation; ten times the error of single precision through several parents
LENS = 1e-3  # relative: a lens whose field of view differs by more is another lens
FAR = 5000.0  # [m] far end of the clipping range, as for our own surveys
_DECIMALS = 9


def harvest_cameras(
    layer: Sdf.Layer, scene: Usd.Stage, edited: Usd.Stage, taken: set[str]
) -> tuple[dict[str, int], list[str]]:
    """Write the cameras that the scene does not have under `/World/Surveys`, one time code per pose.

    A survey's own camera that is not on its flight counts as such a camera too: the survey is not changed, because its
    GPS record and times were drawn for its flight.

    Args:
        layer: Edits layer, without the cameras of earlier edits.
        scene: The scene without earlier edits.
        edited: The same stage as exported by another program, in any unit and up axis.
        taken: Names of prims; those of the new cameras are added to it.

    Returns:
        Number of poses by name of each new camera, and one line for each that cannot be imported.
    """
    left_out: list[str] = []
    ours = {camera.path.rpartition("/")[2]: camera for camera in read_cameras(scene, stage_to_world(scene), _ignore)}
    added = {}
    for track in read_cameras(edited, stage_to_world(edited), left_out.append):
        prim = edited.GetPrimAtPath(track.path)
        known = next((ours[name] for name in (object_name(prim), prim.GetName()) if name in ours), None)
        if known is not None and _on_flight(track.poses, known.poses) and _same_view(track.lens, known.lens):
            continue
        name = free_name(object_name(prim), taken)
        taken.add(name)
        _write_camera(layer, scene, edited, name, track)
        added[name] = len(track.poses)
    return added, sorted(left_out)


def _ignore(line: str) -> None:
    """Ignore warnings about the scene itself: they are not about the edited file."""


def _on_flight(poses: F64, flight: F64) -> bool:
    """Check whether every pose is one of a flight: other programs export all frames, or only the current one."""
    apart = np.abs(poses[:, None] - flight[None]).max(axis=(2, 3))
    return bool((apart.min(axis=1) <= MOVED).all())


def _same_view(one: UsdLens, other: UsdLens) -> bool:
    """Check whether two lenses have equal fields of view; other programs change the sensor's height."""
    wide, as_wide = (lens.horizontal_aperture / max(lens.focal_length, 1e-9) for lens in (one, other))
    return bool(np.isclose(wide, as_wide, rtol=LENS))


def _write_camera(layer: Sdf.Layer, scene: Usd.Stage, edited: Usd.Stage, name: str, track: CameraTrack) -> None:
    surveys = Sdf.CreatePrimInLayer(layer, tokens.SURVEYS)
    if not scene.GetPrimAtPath(tokens.SURVEYS):
        surveys.specifier, surveys.typeName = Sdf.SpecifierDef, "Scope"
    spec = Sdf.CreatePrimInLayer(layer, f"{tokens.SURVEYS}/{name}")
    spec.specifier, spec.typeName = Sdf.SpecifierDef, "Camera"
    to_scene = np.linalg.inv(stage_to_world(scene))
    unit = float(np.linalg.norm(to_scene[:3, 0]))  # scene units per meter
    ratio = UsdGeom.GetStageMetersPerUnit(edited) * unit
    lens = track.lens
    values = {
        "focalLength": lens.focal_length,
        "horizontalAperture": lens.horizontal_aperture,
        "verticalAperture": lens.vertical_aperture,
        "horizontalApertureOffset": lens.horizontal_offset,
        "verticalApertureOffset": lens.vertical_offset,
    }
    for attribute, value in values.items():
        Sdf.AttributeSpec(spec, attribute, _TYPES.Float).default = round(ratio * value, _DECIMALS)
    Sdf.AttributeSpec(spec, "clippingRange", _TYPES.Float2).default = Gf.Vec2f(track.near * unit, FAR * unit)
    matrix = Sdf.AttributeSpec(spec, "xformOp:transform", _TYPES.Matrix4d)
    for code, pose in enumerate(track.poses):
        placed = to_scene @ pose @ USD_FROM_CAMERA
        placed[:3, :3] /= unit
        rows = np.round(placed.T, _DECIMALS) + 0.0
        layer.SetTimeSample(matrix.path, code, Gf.Matrix4d(*rows.ravel().tolist()))
    order = Sdf.AttributeSpec(spec, "xformOpOrder", _TYPES.TokenArray, Sdf.VariabilityUniform)
    order.default = ["xformOp:transform"]
    Sdf.AttributeSpec(spec, tokens.USER_FALSEWORK_ID, _TYPES.String, declaresCustom=True).default = name
