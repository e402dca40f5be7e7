"""Render layer: products to be rendered, for our renderer and any other that reads UsdRender."""

from pxr import Gf, Sdf, Usd, UsdGeom, UsdRender

from authoring.layers.layer import add_sublayers, new_layer
from authoring.layers.surveys import camera_path
from authoring.surveys.path import CameraPath
from usd_schemas import tokens

CLASSES = "./classes.usdc"  # arrays of a hundred words are not suited to a text layer
_TYPES = {"rgb": "color3f", "depth": "float", "semantic": "int", "instance": "int", "normal": "normal3f"}
_MEANING = {
    "rgb": "Radiance [1], linear.",
    "depth": "Planar depth along the camera's viewing axis [m]; +inf where the sky is.",
    "semantic": "Class id by the table on this prim; 0 where the sky is.",
    "instance": "Instance id; 0 where the sky is.",
    "normal": "Geometric unit normal in world axes [1].",
}


def render_layer(paths: list[CameraPath]) -> Sdf.Layer:
    """Author RenderSettings, one RenderProduct per survey, and the render variables; their classes are in a sublayer.

    Args:
        paths: Surveys in the order of their products.

    Returns:
        A layer in memory, to be written as `render.usda`.
    """
    layer = new_layer("Render")
    _author(Usd.Stage.Open(layer, Usd.Stage.LoadAll), paths)
    add_sublayers(layer, [CLASSES])
    return layer


def _author(stage: Usd.Stage, paths: list[CameraPath]) -> None:
    UsdGeom.Scope.Define(stage, tokens.RENDER)
    for path in (tokens.RENDER_PRODUCTS, tokens.RENDER_VARS):
        UsdGeom.Scope.Define(stage, path)
    variables = [_author_variable(stage, name) for name in tokens.RENDER_VAR_NAMES]
    settings = UsdRender.Settings.Define(stage, tokens.RENDER_SETTINGS)
    targets = []
    for path in paths:
        product = UsdRender.Product.Define(stage, f"{tokens.RENDER_PRODUCTS}/{path.id}")
        product.CreateProductTypeAttr(UsdRender.Tokens.raster)
        product.CreateProductNameAttr(f"{path.id}.######")
        product.CreateResolutionAttr(Gf.Vec2i(path.calibration.width, path.calibration.height))
        product.CreateCameraRel().SetTargets([camera_path(path.id)])
        product.CreateOrderedVarsRel().SetTargets(variables)
        targets.append(product.GetPath())
    settings.CreateProductsRel().SetTargets(targets)
    for first in paths[:1]:  # a scene that is only sampled has no flight
        settings.CreateResolutionAttr(Gf.Vec2i(first.calibration.width, first.calibration.height))
        settings.CreateCameraRel().SetTargets([camera_path(first.id)])


def _author_variable(stage: Usd.Stage, name: str) -> Sdf.Path:
    variable = UsdRender.Var.Define(stage, f"{tokens.RENDER_VARS}/{name}")
    variable.CreateDataTypeAttr(_TYPES[name])
    variable.CreateSourceNameAttr(name)
    variable.CreateSourceTypeAttr(UsdRender.Tokens.raw)
    prim = variable.GetPrim()
    prim.SetDocumentation(_MEANING[name])
    return prim.GetPath()
