"""One more survey for an existing scene."""

from pathlib import Path

from pxr import Gf, Sdf, Usd, UsdRender

from authoring.layers.change import check_editable
from authoring.layers.layer import export
from authoring.layers.surveys import camera_path, survey_layer
from authoring.scenes.manifest import read_recipe, refresh_manifest
from authoring.surveys.existing import existing_flight
from authoring.surveys.path import CameraPath
from authoring.surveys.registry import plan_survey, record_flight
from authoring.surveys.settings import AnySurvey, StageSettings
from authoring.surveys.stage_subject import stage_subject
from groundwork.errors import InputError
from usd_schemas import tokens
from usd_schemas.reading.choices import StageChoices
from usd_schemas.reading.stage_reader import read_stage

# A flight must not depend on the background, which may hide plants of the site.
ALONE = StageChoices(variants=((tokens.BACKGROUND, "background", "none"),))


def add_survey(scene: Path, settings: AnySurvey, seed: int | None = None) -> CameraPath:
    """Plan a survey of the current scene, edits included, and add it as a layer with its RenderProduct.

    Args:
        scene: Root layer of an editable scene of ours.
        settings: Settings of the survey; a former one of the same id is replaced.
        seed: Seed of the flight; that of the scene when None.

    Returns:
        The flight.

    Raises:
        InputError: A stored scene, one without a recipe, or a flight that is not possible.
    """
    check_editable(scene)
    _check_id(scene.parent / "surveys", settings.id)
    seed = read_recipe(scene.parent).seed if seed is None else seed
    if isinstance(settings, StageSettings):
        path = record_flight(settings, existing_flight(settings, read_stage(scene)), seed)
    else:
        path = plan_survey(settings, stage_subject(read_stage(scene, choices=ALONE)), seed)
    folder = scene.parent
    export(survey_layer(path), folder / f"surveys/{path.id}.usdc")
    surveys = Sdf.Layer.FindOrOpen(str(folder / "surveys/surveys.usda"))
    file = f"./{path.id}.usdc"
    if file not in list(surveys.subLayerPaths):
        surveys.subLayerPaths.append(file)
        export(surveys, folder / "surveys/surveys.usda")
    _add_product(folder / "render.usda", path)
    root = Sdf.Layer.FindOrOpen(str(scene))
    if len(path.poses) - 1 > root.endTimeCode:
        root.endTimeCode = float(len(path.poses) - 1)
        export(root, scene)
    refresh_manifest(folder)
    return path


def _check_id(surveys: Path, wanted: str) -> None:
    """Refuse an id that differs from another survey's only by case, which some disks do not tell apart."""
    others = sorted(path.stem for path in surveys.glob("*.usdc"))
    for other in others:
        if other.lower() == wanted.lower() and other != wanted:
            raise InputError("differs from another survey only by case", field="survey.id", value=wanted, allowed=other)


def _add_product(file: Path, path: CameraPath) -> None:
    layer = Sdf.Layer.FindOrOpen(str(file))
    stage = Usd.Stage.Open(layer, Usd.Stage.LoadAll)
    settings = UsdRender.Settings.Get(stage, tokens.RENDER_SETTINGS)
    product = UsdRender.Product.Define(stage, f"{tokens.RENDER_PRODUCTS}/{path.id}")
    product.CreateProductTypeAttr(UsdRender.Tokens.raster)
    product.CreateProductNameAttr(f"{path.id}.######")
    product.CreateResolutionAttr(Gf.Vec2i(path.calibration.width, path.calibration.height))
    product.CreateCameraRel().SetTargets([camera_path(path.id)])
    product.CreateOrderedVarsRel().SetTargets([f"{tokens.RENDER_VARS}/{name}" for name in tokens.RENDER_VAR_NAMES])
    targets = list(settings.GetProductsRel().GetTargets())
    if product.GetPath() not in targets:
        settings.GetProductsRel().SetTargets([*targets, product.GetPath()])
    export(layer, file)
