"""The sun, the sky and the lamps of a stage, in the units of UsdLux.

Intensity times 2^exposure times color is the radiance of a light's surface; with `normalize` it is divided by the area
of that surface in stage units, or for a DistantLight by pi sin^2(angle / 2), so that it becomes the irradiance of a
surface that faces it.

A DistantLight shines along its local -z. A DomeLight shows a latitude-longitude picture as the OpenEXR specification
and UsdLux define it: the pole is +y of the dome's space, the middle column of the picture lies towards +z, a quarter of
the width left of it towards +x: direction = (cos lat sin lon, sin lat, cos lat cos lon) with lon = pi (1 - 2 u) and
lat = pi (1/2 - v), u from the left and v from the top. `Dome.rotation` turns directions of that space to the world, the
stage's up axis included. A plain DomeLight keeps its pole along the stage's y, so that a stage with z up must rotate it
by 90 degrees about x (`UsdLux.DomeLight.OrientToStageUpAxis`); DomeLight_1 needs no rotation.
"""

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom, UsdLux

from usd_schemas.flat_scene import Dome, SphereLight, Sun
from usd_schemas.reading.labels import Warn
from usd_schemas.reading.shader_inputs import asset_file
from usd_schemas.reading.traversal import EARLIEST, composed_prims, guarded

F64 = NDArray[np.float64]
L = TypeVar("L", Sun, Dome)

_SKIES = ("DomeLight", "DomeLight_1")
_PANELS = ("RectLight", "DiskLight")
_UNLIT = ("CylinderLight", "GeometryLight", "PortalLight", "PluginLight")
_ROUND = 0.01  # relative difference of scales above which a sphere counts as stretched [1]
_POLE_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])  # dome's +y to the stage's +z


@dataclass(frozen=True)
class Lights:
    """The lights of a stage.

    Attributes:
        sun: The first visible DistantLight, or None.
        dome: The first visible DomeLight, or None.
        spheres: Every visible SphereLight, RectLight and DiskLight.
    """

    sun: Sun | None
    dome: Dome | None
    spheres: tuple[SphereLight, ...]


def read_lights(stage: Usd.Stage, stage_to_world: F64, warn: Warn) -> Lights:
    """Read the first visible DistantLight and DomeLight, and every visible SphereLight, RectLight and DiskLight.

    Args:
        stage: Composed stage.
        stage_to_world: Stage units to meters with z up [m per stage unit], shape (4, 4), float64.
        warn: Called with one line for each light that is left out.
    """
    suns: list[Sun] = []
    domes: list[Dome] = []
    spheres: list[SphereLight] = []
    left_out: dict[str, list[str]] = {}
    turn = stage_to_world[:3, :3] / np.linalg.norm(stage_to_world[:3, 0])
    for prim in composed_prims(stage):
        kind = str(prim.GetTypeName())
        if kind not in ("DistantLight", "SphereLight", *_SKIES, *_PANELS, *_UNLIT):
            continue
        with guarded(prim, warn, "the light is left out"):
            if UsdGeom.Imageable(prim).ComputeVisibility(EARLIEST) == UsdGeom.Tokens.invisible:
                continue
            if shines_on_nothing(prim):
                continue
            if kind == "DistantLight" and not suns:
                suns += _possible(_read_sun(prim, turn), prim, warn)
            elif kind in _SKIES and not domes:
                domes += _possible(_read_dome(prim, turn, warn), prim, warn)
            elif kind in ("SphereLight", *_PANELS):
                lamp = (_read_sphere if kind == "SphereLight" else _read_panel)(prim, stage_to_world, warn)
                spheres += [lamp] if lamp is not None else []
            else:
                left_out.setdefault(kind, []).append(str(prim.GetPath()))
    for kind, paths in sorted(left_out.items()):
        warn(f"{paths[0]}: {kind} is left out" + (f" (and {len(paths) - 1} more)" if len(paths) > 1 else ""))
    return Lights(suns[0] if suns else None, domes[0] if domes else None, tuple(spheres))


def _possible(light: L, prim: Usd.Prim, warn: Warn) -> list[L]:
    """Return a sun or dome in a list, which is empty if its numbers are impossible."""
    told = [np.ravel(value) for value in vars(light).values() if isinstance(value, tuple | float | np.ndarray)]
    if np.isfinite(np.concatenate(told)).all() and min(light.radiance) >= 0.0:
        return [light]
    warn(f"{prim.GetPath()}: its radiance is negative, or a number is not finite: the light is left out")
    return []


def shines_on_nothing(prim: Usd.Prim) -> bool:
    """Check whether a light has neither diffuse nor specular light; false for a sky, which is seen itself.

    Args:
        prim: A light.
    """
    light = UsdLux.LightAPI(prim)
    parts = light.GetDiffuseAttr().Get(EARLIEST), light.GetSpecularAttr().Get(EARLIEST)
    return parts == (0.0, 0.0) and prim.GetTypeName() not in _SKIES


def _radiance(prim: Usd.Prim) -> tuple[float, float, float]:
    light = UsdLux.LightAPI(prim)
    color = np.array(light.GetColorAttr().Get(EARLIEST), np.float64)
    if light.GetEnableColorTemperatureAttr().Get(EARLIEST):
        kelvin = float(light.GetColorTemperatureAttr().Get(EARLIEST))
        color = color * np.array(UsdLux.BlackbodyTemperatureAsRgb(kelvin))
    strength = light.GetIntensityAttr().Get(EARLIEST) * 2.0 ** light.GetExposureAttr().Get(EARLIEST)
    red, green, blue = (color * strength).tolist()
    return red, green, blue


def _rotation(prim: Usd.Prim) -> F64:
    matrix = UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(EARLIEST)
    rotation = np.array(matrix).T[:3, :3]
    with np.errstate(all="ignore"):  # flattened or too large: `_possible` judges the result
        return rotation / np.linalg.norm(rotation, axis=0)


def _read_sun(prim: Usd.Prim, turn: F64) -> Sun:
    x, y, z = (turn @ _rotation(prim)[:, 2]).tolist()
    angle = float(UsdLux.DistantLight(prim).GetAngleAttr().Get(EARLIEST))
    disc = np.pi * np.sin(np.deg2rad(min(max(angle, 0.0), 180.0)) / 2) ** 2
    red, green, blue = _radiance(prim)
    given = 1.0 if _is_normalized(prim) or disc == 0.0 else float(disc)
    return Sun((x, y, z), (red * given, green * given, blue * given), angle)


def _is_normalized(prim: Usd.Prim) -> bool:
    return bool(UsdLux.LightAPI(prim).GetNormalizeAttr().Get(EARLIEST))


def _read_sphere(prim: Usd.Prim, stage_to_world: F64, warn: Warn) -> SphereLight | None:
    """Read a SphereLight; None if it emits no light."""
    matrix = stage_to_world @ np.array(UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(EARLIEST)).T
    scales = np.linalg.norm(matrix[:3, :3], axis=0)
    unit = float(np.linalg.norm(stage_to_world[:3, 0]))
    radius = float(UsdLux.SphereLight(prim).GetRadiusAttr().Get(EARLIEST)) * float(np.cbrt(np.prod(scales)))
    color = np.array(_radiance(prim))
    # Normalized: color / (4 pi (radius / unit)^2) is the radiance, so that the intensity is finite for a point too.
    intensity = color * (unit**2 / 4 if _is_normalized(prim) else np.pi * radius**2)
    path = prim.GetPath()
    if not (np.isfinite(matrix).all() and np.isfinite(intensity).all() and intensity.max() > 0.0):
        warn(f"{path}: a SphereLight that emits no light: left out")
        return None
    if np.ptp(scales) > _ROUND * scales.max():
        warn(f"{path}: a stretched SphereLight is read as a sphere of the same volume")
    if prim.HasAPI(UsdLux.ShapingAPI):
        warn(f"{path}: the shaping of a SphereLight is left out: it shines in all directions")
    x, y, z = matrix[:3, 3].tolist()
    red, green, blue = intensity.tolist()
    return SphereLight((x, y, z), radius, (red, green, blue))


def _read_panel(prim: Usd.Prim, stage_to_world: F64, warn: Warn) -> SphereLight | None:
    """Read a RectLight, or a DiskLight as a square of the same area; None if it emits no light."""
    kind, path = str(prim.GetTypeName()), prim.GetPath()
    matrix = stage_to_world @ np.array(UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(EARLIEST)).T
    if kind == "DiskLight":
        radius = float(UsdLux.DiskLight(prim).GetRadiusAttr().Get(EARLIEST))
        width = height = radius * float(np.sqrt(np.pi))
    else:
        light = UsdLux.RectLight(prim)
        width, height = (float(one.Get(EARLIEST)) for one in (light.GetWidthAttr(), light.GetHeightAttr()))
    across, up = matrix[:3, 0] * abs(width) / 2, matrix[:3, 1] * abs(height) / 2
    if np.cross(up, across) @ matrix[:3, 2] > 0.0:  # a mirrored panel still shines along its own -z
        across = -across
    area = 4 * float(np.linalg.norm(np.cross(across, up)))
    unit = float(np.linalg.norm(stage_to_world[:3, 0]))
    intensity = np.array(_radiance(prim)) * (unit**2 if _is_normalized(prim) else area)
    if not (np.isfinite(matrix).all() and np.isfinite(intensity).all() and intensity.max() > 0.0 < area):
        warn(f"{path}: a {kind} that emits no light: left out")
        return None
    if prim.HasAPI(UsdLux.ShapingAPI):
        warn(f"{path}: the shaping of a {kind} is left out: it shines in all directions of its side")
    texture = prim.GetAttribute("inputs:texture:file")
    if texture and texture.HasAuthoredValue():
        warn(f"{path}: the texture of a {kind} is left out: it shines uniformly")
    x, y, z = matrix[:3, 3].tolist()
    red, green, blue = intensity.tolist()
    (a, b, c), (d, e, f) = across.tolist(), up.tolist()
    return SphereLight((x, y, z), float(np.sqrt(area / np.pi)), (red, green, blue), ((a, b, c), (d, e, f)))


def _read_dome(prim: Usd.Prim, turn: F64, warn: Warn) -> Dome:
    rotation = turn @ _rotation(prim)
    if prim.GetTypeName() == "DomeLight_1":
        pole = str(prim.GetAttribute("poleAxis").Get() or "scene")
        up = UsdGeom.GetStageUpAxis(prim.GetStage()) if pole == "scene" else pole
        rotation = rotation @ _POLE_UP if up == UsdGeom.Tokens.z else rotation
    attribute = prim.GetAttribute("inputs:texture:file")
    value = attribute.Get(EARLIEST) if attribute else None
    layout = str(prim.GetAttribute("inputs:texture:format").Get(EARLIEST))
    file = asset_file(value)
    if value is not None and value.path and not file:
        warn(f"{prim.GetPath()}: no texture {value.path}: the dome has one color")
    elif file and layout not in ("automatic", "latlong"):
        warn(f"{prim.GetPath()}: texture format {layout} is read as latlong")
    rows = tuple((float(a), float(b), float(c)) for a, b, c in rotation.tolist())
    return Dome(_radiance(prim), file, rows)
