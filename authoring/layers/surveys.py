"""Survey layers: one time-sampled Camera per survey, one integer time code per image."""

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, UsdGeom

from authoring.layers.layer import add_sublayers, new_layer, new_stage
from authoring.surveys.path import CameraPath
from usd_schemas import tokens
from usd_schemas.apis import SurveyFacts, apply_survey
from usd_schemas.pinhole import USD_FROM_CAMERA, lens_from_pinhole

CLIPPING = (0.1, 5000.0)  # [m]
DECIMALS = 9  # matrices are rounded to it, so that every CPU writes the same


def camera_path(survey: str) -> str:
    """Find the prim path of a survey's camera.

    Args:
        survey: Survey id.
    """
    return f"{tokens.SURVEYS}/{survey}/{survey}_Camera"


def survey_layer(path: CameraPath) -> Sdf.Layer:
    """Author one survey.

    Args:
        path: Its cameras, calibration and GPS record.

    Returns:
        A layer in memory, to be written as `surveys/<id>.usdc`.
    """
    stage = new_stage("World")
    stage.OverridePrim(tokens.WORLD)
    UsdGeom.Scope.Define(stage, tokens.SURVEYS)
    _author_id(UsdGeom.Xform.Define(stage, f"{tokens.SURVEYS}/{path.id}"), path.id)
    camera = UsdGeom.Camera.Define(stage, camera_path(path.id))
    _author_id(camera, f"{path.id}_Camera")
    lens = lens_from_pinhole(path.calibration, path.sensor_width)
    camera.CreateFocalLengthAttr(round(lens.focal_length, DECIMALS))
    camera.CreateHorizontalApertureAttr(round(lens.horizontal_aperture, DECIMALS))
    camera.CreateVerticalApertureAttr(round(lens.vertical_aperture, DECIMALS))
    camera.CreateHorizontalApertureOffsetAttr(round(lens.horizontal_offset, DECIMALS))
    camera.CreateVerticalApertureOffsetAttr(round(lens.vertical_offset, DECIMALS))
    camera.CreateClippingRangeAttr(Gf.Vec2f(*CLIPPING))
    operation = camera.AddTransformOp()
    for code, pose in enumerate(path.poses):
        operation.Set(_usd_matrix(pose), code)
    apply_survey(camera, _facts(path))
    return stage.GetRootLayer()


def surveys_layer(surveys: list[str]) -> Sdf.Layer:
    """Author the layer with all surveys as sublayers.

    Args:
        surveys: Survey ids.

    Returns:
        A layer in memory, to be written as `surveys/surveys.usda`.
    """
    layer = new_layer("World")
    add_sublayers(layer, [f"./{survey}.usdc" for survey in surveys])
    return layer


def _facts(path: CameraPath) -> SurveyFacts:
    return SurveyFacts(
        kind=path.kind,
        id=path.id,
        seed=path.seed,
        spacing=round(path.spacing, 6),
        image_names=tuple(f"{code:06d}" for code in range(len(path.poses))),
        calibration=path.calibration,
        sensor_width=path.sensor_width,
        gps=np.round(path.gps, 3),
        gps_sigma=path.gps_sigma,
        capture_times=np.round(path.times, 3),
        distortion=path.distortion,
        readout_time=path.readout_time,
        camera_make=path.make,
        camera_model=path.model,
        attitude=np.round(path.attitude, 3),
        attitude_sigma=path.attitude_sigma,
    )


def _usd_matrix(camera_to_world: NDArray[np.float64]) -> Gf.Matrix4d:
    rows = np.round((camera_to_world @ USD_FROM_CAMERA).T, DECIMALS) + 0.0
    return Gf.Matrix4d(*rows.reshape(-1).tolist())


def _author_id(prim: UsdGeom.Xformable, name: str) -> None:
    prim.GetPrim().CreateAttribute(tokens.USER_FALSEWORK_ID, Sdf.ValueTypeNames.String, True).Set(name)
