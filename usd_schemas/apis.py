"""Typed access to Falsework's applied API schemas and to semantic labels on prims."""

import json
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSemantics, Vt

from groundwork.canonical import canonical_json
from usd_schemas import tokens
from usd_schemas.components import class_of
from usd_schemas.pinhole import Pinhole
from usd_schemas.registration import register_schemas
from usd_schemas.taxonomies import Taxonomy

register_schemas()

_TYPES = Sdf.ValueTypeNames


@dataclass(frozen=True)
class ComponentFacts:
    """What `FalseworkComponentAPI` says about a prim.

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


def apply_component(prim: Usd.Prim, facts: ComponentFacts) -> None:
    """Author the component API on a prim.

    Args:
        prim: Mesh, Xform, PointInstancer or GeomSubset.
        facts: What to write; empty entries are left out.
    """
    prim.ApplyAPI("FalseworkComponentAPI")
    _set(prim, "falsework:component:kind", _TYPES.Token, facts.kind)
    if facts.instance_id:
        _set(prim, "falsework:component:instanceId", _TYPES.Int, facts.instance_id)
    if facts.instance_ids:
        _set(prim, "falsework:component:instanceIds", _TYPES.IntArray, Vt.IntArray(facts.instance_ids))
    if facts.parameters:
        _set(prim, "falsework:component:parameters", _TYPES.String, canonical_json(facts.parameters))


def read_component(prim: Usd.Prim) -> ComponentFacts:
    """Read the component API of a prim; attributes count even where the schema itself was lost on the way.

    Args:
        prim: Any prim.
    """
    text = _get(prim, "falsework:component:parameters")
    return ComponentFacts(
        kind=str(_get(prim, "falsework:component:kind") or ""),
        instance_id=int(_get(prim, "falsework:component:instanceId") or 0),
        instance_ids=tuple(int(value) for value in _get(prim, "falsework:component:instanceIds") or ()),
        parameters=json.loads(str(text)) if text else {},
    )


def apply_labels(prim: Usd.Prim, component: str, instance_id: int) -> None:
    """Label a prim: LabelsAPI in the taxonomies `component` and `class`, and the mirrors that DCCs keep.

    Args:
        prim: A leaf prim, or an override of one in another layer.
        component: Component kind.
        instance_id: Instance id; 0 writes no mirror of it.
    """
    name = class_of(component)
    for taxonomy, label in ((tokens.COMPONENT_TAXONOMY, component), (tokens.CLASS_TAXONOMY, name)):
        UsdSemantics.LabelsAPI.Apply(prim, taxonomy).CreateLabelsAttr([label])
    _mirror(prim, tokens.USER_COMPONENT, _TYPES.String, component)
    _mirror(prim, tokens.USER_CLASS, _TYPES.String, name)
    if instance_id:
        _mirror(prim, tokens.USER_INSTANCE_ID, _TYPES.Int, instance_id)


def direct_label(prim: Usd.Prim, taxonomy: str) -> str:
    """Read the label that a prim itself carries, from LabelsAPI or from the mirror that DCCs keep.

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

    The map travels with the stage, so that it also holds for what is loaded or added later, and a reader without our
    tables needs nothing else.

    Args:
        prim: The semantic render variable, or an override of it in another layer.
        table: The table that shall be in force.
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
    """What the survey, GPS and calibration schemas say about a camera.

    Attributes:
        kind: Kind of survey.
        id: Survey id.
        seed: Seed of its path.
        spacing: Distance between neighbouring images [m].
        image_names: Stem of each image's file.
        calibration: Exact intrinsics, or None.
        sensor_width: Width of the sensor [m].
        gps: Measured positions [m], shape (N, 3), float64, or None.
        gps_sigma: Standard deviation along x, y, z [m].
        capture_times: Seconds since the first image [s], shape (N,), float64, or None.
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
        _apply_calibration(prim, facts.calibration, facts.sensor_width)
    if facts.gps is not None:
        prim.ApplyAPI("FalseworkGpsAPI")
        _set(prim, "falsework:gps:sigma", _TYPES.Double3, Gf.Vec3d(*facts.gps_sigma))
        attribute = prim.CreateAttribute("falsework:gps:localPosition", _TYPES.Double3, False)
        for code, position in enumerate(facts.gps):
            attribute.Set(Gf.Vec3d(*(float(value) for value in position)), code)


def read_survey(prim: Usd.Prim, count: int) -> SurveyFacts:
    """Read the survey, GPS and calibration schemas of a camera.

    Args:
        prim: A camera.
        count: Number of images, time codes 0 to count - 1.
    """
    gps = prim.GetAttribute("falsework:gps:localPosition")
    times = prim.GetAttribute("falsework:survey:captureTime")
    sigma = _get(prim, "falsework:gps:sigma") or (0.0, 0.0, 0.0)
    return SurveyFacts(
        kind=str(_get(prim, "falsework:survey:kind") or ""),
        id=str(_get(prim, "falsework:survey:id") or ""),
        seed=int(_get(prim, "falsework:survey:seed") or 0),
        spacing=float(_get(prim, "falsework:survey:spacing") or 0.0),
        image_names=tuple(str(name) for name in _get(prim, "falsework:survey:imageNames") or ()),
        calibration=_read_calibration(prim),
        sensor_width=float(_get(prim, "falsework:cal:sensorWidth") or 0.036),
        gps=np.array([gps.Get(code) for code in range(count)]) if gps and gps.GetNumTimeSamples() else None,
        gps_sigma=(float(sigma[0]), float(sigma[1]), float(sigma[2])),
        capture_times=np.array([times.Get(c) for c in range(count)]) if times and times.GetNumTimeSamples() else None,
    )


def _apply_calibration(prim: Usd.Prim, camera: Pinhole, sensor_width: float) -> None:
    prim.ApplyAPI("FalseworkCalibrationAPI")
    _set(prim, "falsework:cal:model", _TYPES.Token, "SIMPLE_PINHOLE")
    _set(prim, "falsework:cal:imageSize", _TYPES.Int2, Gf.Vec2i(camera.width, camera.height))
    for name, value in (("fx", camera.fx), ("fy", camera.fy), ("cx", camera.cx), ("cy", camera.cy)):
        _set(prim, f"falsework:cal:{name}", _TYPES.Double, value)
    _set(prim, "falsework:cal:sensorWidth", _TYPES.Double, sensor_width)


def _read_calibration(prim: Usd.Prim) -> Pinhole | None:
    size = _get(prim, "falsework:cal:imageSize")
    values = [_get(prim, f"falsework:cal:{name}") for name in ("fx", "fy", "cx", "cy")]
    if size is None or None in values:
        return None
    fx, fy, cx, cy = (float(value or 0.0) for value in values)
    return Pinhole(int(size[0]), int(size[1]), fx, fy, cx, cy)


def _set(prim: Usd.Prim, name: str, kind: Sdf.ValueTypeName, value: object) -> None:
    prim.CreateAttribute(name, kind, False, Sdf.VariabilityUniform).Set(value)


def _mirror(prim: Usd.Prim, name: str, kind: Sdf.ValueTypeName, value: object) -> None:
    prim.CreateAttribute(name, kind, True).Set(value)


def _get(prim: Usd.Prim, name: str) -> Any:
    attribute = prim.GetAttribute(name)
    return attribute.Get() if attribute else None
