"""What a DCC did to sun and cameras: a turned or dimmed sun comes home, and what cannot come home is named."""

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux

from authoring.edits.matching import object_name
from authoring.edits.placements import write_transform
from usd_schemas import tokens
from usd_schemas.flat_scene import Sun
from usd_schemas.read_lights import read_lights
from usd_schemas.stage_reader import stage_to_world

F64 = NDArray[np.float64]
_TYPES = Sdf.ValueTypeNames

TURNED = 1e-4  # [rad] single precision turns a sun by less
DIMMED = 0.005  # share of its radiance
_DECIMALS = 9
_STRENGTH = ("inputs:color", "inputs:intensity", "inputs:exposure", "inputs:enableColorTemperature")


def harvest_sun(layer: Sdf.Layer, scene: Usd.Stage, edited: Usd.Stage) -> str:
    """Write a changed sun into the light that the scene has selected; another light keeps its own.

    The sky's picture stays, with the glow where the sun was.

    Args:
        layer: Edits layer.
        scene: The scene without earlier edits.
        edited: What a DCC made of it, in any unit and up axis.

    Returns:
        Name of the light; empty where nothing changed.
    """
    ours, theirs = (read_lights(stage, stage_to_world(stage), lambda line: None)[0] for stage in (scene, edited))
    suns = [[prim for prim in stage.Traverse() if prim.IsA(UsdLux.DistantLight)] for stage in (scene, edited)]
    if ours is None or theirs is None:
        return ""
    prim, before, after = suns[0][0], _strength(suns[0][0]), _strength(suns[1][0])
    path = _home(scene, prim.GetPath())
    former = layer.GetPrimAtPath(path)
    if former is not None:
        for spec in list(former.properties):
            if spec.name.startswith("xformOp") or spec.name in _STRENGTH:
                former.RemoveProperty(spec)
    turned, dimmed = _angle(ours, theirs) > TURNED, not np.allclose(before, after, rtol=DIMMED)
    if turned:
        write_transform(layer, path, prim, _turned(prim, np.array(ours.direction), np.array(theirs.direction)))
    if dimmed:
        spec = Sdf.CreatePrimInLayer(layer, path)
        strength = float(after.max())
        color = [round(value / strength, 6) if strength > 0 else 1.0 for value in after.tolist()]
        kinds = (_TYPES.Color3f, _TYPES.Float, _TYPES.Float, _TYPES.Bool)
        values = (Gf.Vec3f(*color), round(strength, 6), 0.0, False)
        for name, kind, value in zip(_STRENGTH, kinds, values, strict=True):
            Sdf.AttributeSpec(spec, name, kind).default = value
    return prim.GetName() if turned or dimmed else ""


def left_out(scene: Usd.Stage, edited: Usd.Stage) -> list[str]:
    """Name the new cameras and lights of an edited stage, each with what to do about it.

    Args:
        scene: The scene.
        edited: What a DCC made of it.
    """
    known = {prim.GetName() for prim in scene.Traverse() if prim.IsA(UsdGeom.Camera) or prim.HasAPI(UsdLux.LightAPI)}
    lines, suns = [], 0
    for prim in edited.Traverse():
        name = object_name(prim)
        if prim.IsA(UsdGeom.Camera) and not {name, prim.GetParent().GetName()} & known:
            lines.append(f"camera {name} is new: its flight is rendered from the edited file, not from the scene: "
                         f"falsework render EDITED --survey {prim.GetName()}")  # fmt: skip
        elif prim.HasAPI(UsdLux.LightAPI) and not prim.IsA(UsdLux.DomeLight):
            suns += prim.IsA(UsdLux.DistantLight)
            if not prim.IsA(UsdLux.DistantLight) or suns > 1:
                lines.append(f"light {name} is new: a scene has one sun and one sky; turn the sun instead")
    return sorted(lines)


def _strength(prim: Usd.Prim) -> F64:
    """Read colour times intensity; Blender says of every light that it has a colour temperature, of white."""
    light, time = UsdLux.LightAPI(prim), Usd.TimeCode.EarliestTime()
    color = np.array(light.GetColorAttr().Get(time)) * light.GetIntensityAttr().Get(time)
    kelvin = light.GetColorTemperatureAttr()
    if light.GetEnableColorTemperatureAttr().Get(time) and kelvin.HasAuthoredValue():
        color = color * np.array(UsdLux.BlackbodyTemperatureAsRgb(float(kelvin.Get(time))))
    return color * 2.0 ** light.GetExposureAttr().Get(time)


def _home(scene: Usd.Stage, path: Sdf.Path) -> Sdf.Path:
    environment = scene.GetPrimAtPath(tokens.ENVIRONMENT)
    chosen = environment.GetVariantSet("light").GetVariantSelection() if environment else ""
    if not chosen or not path.HasPrefix(environment.GetPath()):
        return path
    return path.ReplacePrefix(environment.GetPath(), environment.GetPath().AppendVariantSelection("light", chosen))


def _angle(one: Sun, two: Sun) -> float:
    a, b = np.array(one.direction), np.array(two.direction)
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))


def _turned(prim: Usd.Prim, before: F64, after: F64) -> F64:
    """Turn a light's transform by the shortest way from one direction to another.

    Source: Rodrigues' formula for the rotation between two unit vectors.
    """
    local = np.array(UsdGeom.Xformable(prim).GetLocalTransformation()).T
    axis = np.cross(before, after)
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    turn = np.eye(3) + cross + cross @ cross / max(1 + float(before @ after), 1e-9)
    local[:3, :3] = np.round(turn @ local[:3, :3], _DECIMALS)
    return local
