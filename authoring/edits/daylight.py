"""Edits of the sun in another program: its direction and strength are written to the selected light."""

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux

from authoring.edits.matching import is_blender, object_name
from authoring.edits.placements import write_transform
from usd_schemas import tokens
from usd_schemas.reading.stage_reader import stage_to_world

F64 = NDArray[np.float64]
_TYPES = Sdf.ValueTypeNames

TURNED = 1e-4  # [rad] single precision changes its direction by less
DIMMED = 0.005  # smallest change, as a share of its radiance
_DECIMALS = 9
_BLENDER_STOPS = 2.0  # `blender/open_scene.py` corrects Blender's fourfold sun by an exposure, which Blender exports
_STRENGTH = ("inputs:color", "inputs:intensity", "inputs:exposure", "inputs:enableColorTemperature")


def find_sun(scene: Usd.Stage, edited: Usd.Stage) -> tuple[Usd.Prim | None, Usd.Prim | None]:
    """Find the sun of a scene and its edited counterpart: the light of its name, else the first that replaced it.

    Args:
        scene: The scene without earlier edits.
        edited: The same stage as exported by another program.
    """
    ours, theirs = _suns(scene), _suns(edited)
    named = [prim for prim in theirs if ours and object_name(prim) == ours[0].GetName()]
    return next(iter(ours), None), next(iter(named or theirs), None)


def harvest_sun(layer: Sdf.Layer, scene: Usd.Stage, prim: Usd.Prim | None, edited: Usd.Prim | None) -> str:
    """Write a changed sun into the light that the scene has selected; other lights are unchanged.

    The image of the sky is not changed: its glow stays where the sun was.

    Args:
        layer: Edits layer.
        scene: The scene without earlier edits.
        prim: Its sun.
        edited: That sun in the edited stage, in any unit and up axis.

    Returns:
        Name of the light; empty where nothing changed.
    """
    if prim is None or edited is None:
        return ""
    ours, theirs = _direction(prim), _direction(edited)
    before, after = _strength(prim), _strength(edited)
    path = _home(scene, prim.GetPath())
    former = layer.GetPrimAtPath(path)
    if former is not None:
        for spec in list(former.properties):
            if spec.name.startswith("xformOp") or spec.name in _STRENGTH:
                former.RemoveProperty(spec)
    turned, dimmed = _angle(ours, theirs) > TURNED, not np.allclose(before, after, rtol=DIMMED)
    if turned:
        write_transform(layer, path, prim, _turned(prim, ours, theirs))
    if dimmed:
        spec = Sdf.CreatePrimInLayer(layer, path)
        strength = float(after.max())
        color = [round(value / strength, 6) if strength > 0 else 1.0 for value in after.tolist()]
        kinds = (_TYPES.Color3f, _TYPES.Float, _TYPES.Float, _TYPES.Bool)
        values = (Gf.Vec3f(*color), round(strength, 6), 0.0, False)
        for name, kind, value in zip(_STRENGTH, kinds, values, strict=True):
            Sdf.AttributeSpec(spec, name, kind).default = value
    return prim.GetName() if turned or dimmed else ""


def _strength(prim: Usd.Prim) -> F64:
    """Read color times intensity; Blender writes a color temperature, that of white, on every light."""
    light, time = UsdLux.LightAPI(prim), Usd.TimeCode.EarliestTime()
    color = np.array(light.GetColorAttr().Get(time)) * light.GetIntensityAttr().Get(time)
    kelvin = light.GetColorTemperatureAttr()
    if light.GetEnableColorTemperatureAttr().Get(time) and kelvin.HasAuthoredValue():
        color = color * np.array(UsdLux.BlackbodyTemperatureAsRgb(float(kelvin.Get(time))))
    exposure = light.GetExposureAttr()
    stops = float(exposure.Get(time))
    if exposure.HasAuthoredValue() and is_blender(prim.GetStage()):
        stops += _BLENDER_STOPS
    return color * 2.0**stops


def _home(scene: Usd.Stage, path: Sdf.Path) -> Sdf.Path:
    environment = scene.GetPrimAtPath(tokens.ENVIRONMENT)
    chosen = environment.GetVariantSet("light").GetVariantSelection() if environment else ""
    if not chosen or not path.HasPrefix(environment.GetPath()):
        return path
    return path.ReplacePrefix(environment.GetPath(), environment.GetPath().AppendVariantSelection("light", chosen))


def _suns(stage: Usd.Stage) -> list[Usd.Prim]:
    return [
        prim
        for prim in stage.Traverse()
        if prim.IsA(UsdLux.DistantLight) and UsdGeom.Imageable(prim).ComputeVisibility() != UsdGeom.Tokens.invisible
    ]


def _direction(sun: Usd.Prim) -> F64:
    """Find the unit vector towards a sun [1], world axes, shape (3,), float64."""
    matrix = np.array(UsdGeom.Xformable(sun).ComputeLocalToWorldTransform(Usd.TimeCode.EarliestTime())).T
    towards = stage_to_world(sun.GetStage())[:3, :3] @ matrix[:3, 2]
    return towards / np.linalg.norm(towards)


def _angle(a: F64, b: F64) -> float:
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))


def _turned(prim: Usd.Prim, before: F64, after: F64) -> F64:
    """Turn a light's transform by the smallest rotation from one direction to another.

    Source: Rodrigues' formula for the rotation between two unit vectors.
    """
    local = np.array(UsdGeom.Xformable(prim).GetLocalTransformation()).T
    axis = np.cross(before, after)
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    turn = np.eye(3) + cross + cross @ cross / max(1 + float(before @ after), 1e-9)
    local[:3, :3] = np.round(turn @ local[:3, :3], _DECIMALS)
    return local
