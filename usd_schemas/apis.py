"""Typed access to Falsework's applied API schemas and to semantic labels on prims."""

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSemantics, Vt

from groundwork.canonical import canonical_json
from groundwork.foreign_file import parse_json
from usd_schemas import tokens
from usd_schemas.components import class_of
from usd_schemas.distortion import NO_DISTORTION, Distortion
from usd_schemas.pinhole import Pinhole
from usd_schemas.registration import register_schemas
from usd_schemas.taxonomies import Taxonomy

register_schemas()

COMPONENT_API = "FalseworkComponentAPI"
ENVIRONMENT_API = "FalseworkEnvironmentAPI"
PARAMETERS_API = "FalseworkParametersAPI"
_VISIBILITY = "falsework:environment:visibility"
LABEL_APIS = tuple(f"SemanticsLabelsAPI:{name}" for name in (tokens.COMPONENT_TAXONOMY, tokens.CLASS_TAXONOMY))
_TYPES = Sdf.ValueTypeNames
_DISTORTION = ("k1", "k2", "p1", "p2")


@dataclass(frozen=True)
class ComponentFacts:
    """Values of `FalseworkComponentAPI` on a prim.

    Attributes:
        kind: Component kind; empty when not authored.
        instance_id: Instance id; 0 when not authored.
        instance_ids: On a PointInstancer, one id for each point, or empty.
        parameters: Dimensions and other facts.
    """

    kind: str = ""
    instance_id: int = 0
    instance_ids: tuple[int, ...] = ()
    parameters: dict[str, object] = field(default_factory=dict)


class Opinion(NamedTuple):
    """An attribute value to author, on a stage or directly in a layer.

    Attributes:
        name: Its name.
        kind: Type of its value.
        value: Its value.
        custom: Whether no schema declares it.
        uniform: Whether it must not vary with time.
    """

    name: str
    kind: Sdf.ValueTypeName
    value: object
    custom: bool = False
    uniform: bool = False


def component_opinions(facts: ComponentFacts) -> list[Opinion]:
    """List the attributes of the component API for a prim; the schema itself is `COMPONENT_API`.

    Args:
        facts: The values; empty entries are left out.
    """
    found = [Opinion("falsework:component:kind", _TYPES.Token, facts.kind, uniform=True)]
    if facts.instance_id:
        found.append(Opinion("falsework:component:instanceId", _TYPES.Int, facts.instance_id, uniform=True))
    if facts.instance_ids:
        ids = Vt.IntArray(facts.instance_ids)
        found.append(Opinion("falsework:component:instanceIds", _TYPES.IntArray, ids, uniform=True))
    if facts.parameters:
        text = canonical_json(facts.parameters)
        found.append(Opinion("falsework:component:parameters", _TYPES.String, text, uniform=True))
    return found


def apply_component(prim: Usd.Prim, facts: ComponentFacts) -> None:
    """Author the component API on a prim.

    Args:
        prim: Mesh, Xform, PointInstancer or GeomSubset.
        facts: What to write; empty entries are left out.
    """
    prim.ApplyAPI(COMPONENT_API)
    _author(prim, component_opinions(facts))


def read_component(prim: Usd.Prim) -> ComponentFacts:
    """Read the component API of a prim; the attributes are read even if the schema itself was lost in another program.

    Args:
        prim: Any prim.
    """
    text = _get(prim, "falsework:component:parameters")
    found = parse_json(str(text), prim.GetPath()) if text else {}
    return ComponentFacts(
        kind=str(_get(prim, "falsework:component:kind") or ""),
        instance_id=int(_get(prim, "falsework:component:instanceId") or 0),
        instance_ids=tuple(int(value) for value in _get(prim, "falsework:component:instanceIds") or ()),
        parameters=found if isinstance(found, dict) else {},
    )


def apply_environment(prim: Usd.Prim, visibility: float) -> None:
    """Author the environment API on a prim.

    Args:
        prim: The scope that holds sun and sky.
        visibility: Distance at which haze leaves 2 % of the contrast [m].
    """
    prim.ApplyAPI(ENVIRONMENT_API)
    _set(prim, _VISIBILITY, _TYPES.Double, visibility)


def read_visibility(prim: Usd.Prim) -> float | None:
    """Read the visibility [m] of a prim; None if it has none or an impossible one.

    Args:
        prim: Any prim; the attribute is read even if the schema itself was lost in another program.
    """
    value = _get(prim, _VISIBILITY) if prim else None
    return float(value) if isinstance(value, int | float) and value > 0.0 else None


def label_opinions(component: str, instance_id: int) -> list[Opinion]:
    """List the labels of a prim, and their copies as user properties for other programs; the schemas are `LABEL_APIS`.

    Args:
        component: Component kind.
        instance_id: Instance id; 0 writes no copy of it.
    """
    name = class_of(component)
    found = [
        Opinion(f"semantics:labels:{tokens.COMPONENT_TAXONOMY}", _TYPES.TokenArray, Vt.TokenArray([component])),
        Opinion(f"semantics:labels:{tokens.CLASS_TAXONOMY}", _TYPES.TokenArray, Vt.TokenArray([name])),
        Opinion(tokens.USER_COMPONENT, _TYPES.String, component, custom=True),
        Opinion(tokens.USER_CLASS, _TYPES.String, name, custom=True),
    ]
    if instance_id:
        found.append(Opinion(tokens.USER_INSTANCE_ID, _TYPES.Int, instance_id, custom=True))
    return found


def apply_labels(prim: Usd.Prim, component: str, instance_id: int) -> None:
    """Label a prim: LabelsAPI in the taxonomies `component` and `class`, and copies as user properties.

    Args:
        prim: A leaf prim, or an override of one in another layer.
        component: Component kind.
        instance_id: Instance id; 0 writes no copy of it.
    """
    opinions = label_opinions(component, instance_id)  # first, so that an unknown kind leaves the prim unchanged
    for taxonomy in (tokens.COMPONENT_TAXONOMY, tokens.CLASS_TAXONOMY):
        UsdSemantics.LabelsAPI.Apply(prim, taxonomy)
    _author(prim, opinions)


def direct_label(prim: Usd.Prim, taxonomy: str) -> str:
    """Read the label of a prim itself, from LabelsAPI or from its copy as a user property.

    Args:
        prim: Any prim.
        taxonomy: `component` or `class`.

    Returns:
        The label, or an empty string.
    """
    labels = _get(prim, f"semantics:labels:{taxonomy}")
    if labels:
        return str(labels[0])
    mirror = {tokens.COMPONENT_TAXONOMY: tokens.USER_COMPONENT, tokens.CLASS_TAXONOMY: tokens.USER_CLASS}.get(taxonomy)
    return str(_get(prim, mirror) or "") if mirror else ""


def apply_taxonomy(prim: Usd.Prim, table: Taxonomy) -> None:
    """Author a table of classes: its rows, and the map from labels to them.

    The map is stored on the stage, so that it also applies to prims that are loaded or added later, and a reader does
    not need our tables.

    Args:
        prim: The semantic render variable, or an override of it in another layer.
        table: The table to use.
    """
    colors = Vt.Vec3iArray([Gf.Vec3i(*row.color) for row in table.rows])
    for name, kind, value in (
        (tokens.TAXONOMY_NAME, _TYPES.Token, table.name),
        (tokens.CLASS_NAMES, _TYPES.TokenArray, Vt.TokenArray([row.name for row in table.rows])),
        (tokens.CLASS_IDS, _TYPES.IntArray, Vt.IntArray([row.id for row in table.rows])),
        (tokens.CLASS_COLORS, _TYPES.Int3Array, colors),
        (tokens.LABEL_NAMES, _TYPES.TokenArray, Vt.TokenArray(list(table.classes))),
        (tokens.LABEL_CLASSES, _TYPES.TokenArray, Vt.TokenArray(list(table.classes.values()))),
    ):
        prim.CreateAttribute(name, kind, True, Sdf.VariabilityUniform).Set(value)


@dataclass(frozen=True)
class SurveyFacts:
    """Values of the survey, GPS and calibration schemas of a camera.

    Attributes:
        kind: Kind of survey.
        id: Survey id.
        seed: Seed of its path.
        spacing: Distance between neighboring images [m].
        image_names: Stem of each image's file.
        calibration: Exact intrinsics, or None.
        sensor_width: Width of the sensor [m].
        gps: Measured positions [m], shape (N, 3), float64, or None.
        gps_sigma: Standard deviation along x, y, z [m].
        capture_times: Seconds since the first image [s], shape (N,), float64, or None.
        distortion: Distortion of the lens.
        readout_time: Time from the first row of an image to its last [s]; 0 for a global shutter.
        camera_make: Maker of the camera, or empty.
        camera_model: Name of the camera, or empty.
        attitude: Measured yaw, pitch, roll [deg], shape (N, 3), float64, or None.
        attitude_sigma: Standard deviation of yaw, pitch, roll [deg].
    """

    kind: str = ""
    id: str = ""
    seed: int = 0
    spacing: float = 0.0
    image_names: tuple[str, ...] = ()
    calibration: Pinhole | None = None
    sensor_width: float = 0.036
    gps: NDArray[np.float64] | None = None
    gps_sigma: tuple[float, float, float] = (0.0, 0.0, 0.0)
    capture_times: NDArray[np.float64] | None = None
    distortion: Distortion = NO_DISTORTION
    readout_time: float = 0.0
    camera_make: str = ""
    camera_model: str = ""
    attitude: NDArray[np.float64] | None = None
    attitude_sigma: tuple[float, float, float] = (0.0, 0.0, 0.0)


def apply_survey(camera: UsdGeom.Camera, facts: SurveyFacts) -> None:
    """Author the survey, GPS and calibration schemas on a camera.

    Args:
        camera: The survey's camera; image i is time code i.
        facts: What to write.
    """
    prim = camera.GetPrim()
    prim.ApplyAPI("FalseworkSurveyAPI")
    _set(prim, "falsework:survey:kind", _TYPES.Token, facts.kind)
    _set(prim, "falsework:survey:id", _TYPES.Token, facts.id)
    _set(prim, "falsework:survey:seed", _TYPES.Int, facts.seed)
    _set(prim, "falsework:survey:spacing", _TYPES.Double, facts.spacing)
    _set(prim, "falsework:survey:imageNames", _TYPES.StringArray, Vt.StringArray(facts.image_names))
    if facts.capture_times is not None:
        attribute = prim.CreateAttribute("falsework:survey:captureTime", _TYPES.Double, False)
        for code, seconds in enumerate(facts.capture_times):
            attribute.Set(float(seconds), code)
    if facts.calibration is not None:
        _apply_calibration(prim, facts, facts.calibration)
    if facts.gps is not None:
        prim.ApplyAPI("FalseworkGpsAPI")
        _set(prim, "falsework:gps:sigma", _TYPES.Double3, Gf.Vec3d(*facts.gps_sigma))
        _sample(prim, "falsework:gps:localPosition", facts.gps)
    if facts.attitude is not None:
        prim.ApplyAPI("FalseworkGpsAPI")
        _set(prim, "falsework:gps:attitudeSigma", _TYPES.Double3, Gf.Vec3d(*facts.attitude_sigma))
        _sample(prim, "falsework:gps:attitude", facts.attitude)


def read_survey(prim: Usd.Prim, count: int) -> SurveyFacts:
    """Read the survey, GPS and calibration schemas of a camera.

    Args:
        prim: A camera.
        count: Number of images, time codes 0 to count - 1.
    """
    times = prim.GetAttribute("falsework:survey:captureTime")
    return SurveyFacts(
        kind=str(_get(prim, "falsework:survey:kind") or ""),
        id=str(_get(prim, "falsework:survey:id") or ""),
        seed=int(_get(prim, "falsework:survey:seed") or 0),
        spacing=float(_get(prim, "falsework:survey:spacing") or 0.0),
        image_names=tuple(str(name) for name in _get(prim, "falsework:survey:imageNames") or ()),
        calibration=_read_calibration(prim),
        sensor_width=_number(prim, "falsework:cal:sensorWidth") or 0.036,
        gps=_samples(prim, "falsework:gps:localPosition", count),
        gps_sigma=_triple(prim, "falsework:gps:sigma"),
        capture_times=np.array([times.Get(c) for c in range(count)]) if times and times.GetNumTimeSamples() else None,
        distortion=Distortion(*(_number(prim, f"falsework:cal:{name}") for name in _DISTORTION)),
        readout_time=_number(prim, "falsework:cal:readoutTime"),
        camera_make=str(_get(prim, "falsework:cal:cameraMake") or ""),
        camera_model=str(_get(prim, "falsework:cal:cameraModel") or ""),
        attitude=_samples(prim, "falsework:gps:attitude", count),
        attitude_sigma=_triple(prim, "falsework:gps:attitudeSigma"),
    )


def _apply_calibration(prim: Usd.Prim, facts: SurveyFacts, camera: Pinhole) -> None:
    prim.ApplyAPI("FalseworkCalibrationAPI")
    distorts = not facts.distortion.is_identity
    _set(prim, "falsework:cal:model", _TYPES.Token, "OPENCV" if distorts else "SIMPLE_PINHOLE")
    _set(prim, "falsework:cal:imageSize", _TYPES.Int2, Gf.Vec2i(camera.width, camera.height))
    for name, value in (("fx", camera.fx), ("fy", camera.fy), ("cx", camera.cx), ("cy", camera.cy)):
        _set(prim, f"falsework:cal:{name}", _TYPES.Double, value)
    _set(prim, "falsework:cal:sensorWidth", _TYPES.Double, facts.sensor_width)
    for name in _DISTORTION if distorts else ():
        _set(prim, f"falsework:cal:{name}", _TYPES.Double, getattr(facts.distortion, name))
    if facts.readout_time:
        _set(prim, "falsework:cal:readoutTime", _TYPES.Double, facts.readout_time)
    for name, text in (("cameraMake", facts.camera_make), ("cameraModel", facts.camera_model)):
        if text:
            _set(prim, f"falsework:cal:{name}", _TYPES.String, text)


def _read_calibration(prim: Usd.Prim) -> Pinhole | None:
    size = _get(prim, "falsework:cal:imageSize")
    values = [_get(prim, f"falsework:cal:{name}") for name in ("fx", "fy", "cx", "cy")]
    if size is None or None in values:
        return None
    fx, fy, cx, cy = (float(value or 0.0) for value in values)
    return Pinhole(int(size[0]), int(size[1]), fx, fy, cx, cy)


def _sample(prim: Usd.Prim, name: str, rows: NDArray[np.float64]) -> None:
    attribute = prim.CreateAttribute(name, _TYPES.Double3, False)
    for code, row in enumerate(rows):
        attribute.Set(Gf.Vec3d(*(float(value) for value in row)), code)


def _samples(prim: Usd.Prim, name: str, count: int) -> NDArray[np.float64] | None:
    attribute = prim.GetAttribute(name)
    if not attribute or not attribute.GetNumTimeSamples():
        return None
    return np.array([attribute.Get(code) for code in range(count)])


def _number(prim: Usd.Prim, name: str) -> float:
    return float(_get(prim, name) or 0.0)


def _triple(prim: Usd.Prim, name: str) -> tuple[float, float, float]:
    x, y, z = _get(prim, name) or (0.0, 0.0, 0.0)
    return float(x), float(y), float(z)


def _set(prim: Usd.Prim, name: str, kind: Sdf.ValueTypeName, value: object) -> None:
    prim.CreateAttribute(name, kind, False, Sdf.VariabilityUniform).Set(value)


def _author(prim: Usd.Prim, opinions: list[Opinion]) -> None:
    for name, kind, value, custom, uniform in opinions:
        variability = Sdf.VariabilityUniform if uniform else Sdf.VariabilityVarying
        prim.CreateAttribute(name, kind, custom, variability).Set(value)


def _get(prim: Usd.Prim, name: str) -> Any:
    attribute = prim.GetAttribute(name)
    return attribute.Get() if attribute else None
