"""Root layer: metadata and composition arcs only, short enough to read and edit."""

import numpy as np
from numpy.typing import NDArray
from pxr import Kind, Sdf, UsdGeom, Vt

from authoring.layers.assets import Pieces
from authoring.layers.layer import add_sublayers, new_layer
from authoring.layers.worlds import WorldFiles, offer_background
from authoring.shapes.component import Component
from usd_schemas import tokens

SUBLAYERS = ("./edits/user.usda", "./render.usda", "./surveys/surveys.usda", "./lighting.usda")


def root_layer(
    look: str, background: str, backgrounds: dict[str, WorldFiles], images: int, frame: NDArray[np.float64]
) -> Sdf.Layer:
    """Author `scene.usda`.

    Args:
        look: Selected look.
        background: Selected background.
        backgrounds: Files of each background.
        images: Number of images of the longest survey.
        frame: Least and largest corner of the region shown in viewports [m], shape (2, 3), float64: the land extends to
            the horizon, too far to find the bridge.

    Returns:
        A layer in memory, to be written as `scene.usda`.
    """
    layer = new_layer("World")
    layer.pseudoRoot.SetInfo("renderSettingsPrimPath", tokens.RENDER_SETTINGS)
    layer.startTimeCode, layer.endTimeCode = 0.0, float(max(images - 1, 0))
    add_sublayers(layer, list(SUBLAYERS))
    _frame(_define(layer, tokens.WORLD, Kind.Tokens.assembly), frame)
    _define(layer, tokens.SITE, Kind.Tokens.component).referenceList.prependedItems = [
        Sdf.Reference("./site/site.usda")
    ]
    bridge = _define(layer, tokens.BRIDGE, Kind.Tokens.assembly)
    bridge.referenceList.prependedItems = [Sdf.Reference("./bridge/bridge.usda")]
    bridge.variantSelections["look"] = look
    surroundings = _define(layer, tokens.BACKGROUND, Kind.Tokens.component)
    surroundings.variantSetNameList.prependedItems = ["background"]
    surroundings.variantSelections["background"] = background
    Sdf.VariantSetSpec(surroundings, "background")
    for name, files in sorted(backgrounds.items()):
        offer_background(layer, name, files)
    _label_background(surroundings)
    return layer


def bounds_of(pieces: Pieces) -> NDArray[np.float64]:
    """Bound the components among some pieces.

    Args:
        pieces: Components and scatters, one component at least.

    Returns:
        Least and largest corner [m], shape (2, 3), float64.
    """
    points = np.concatenate([piece.mesh.points for piece in pieces if isinstance(piece, Component)])
    return np.stack([points.min(axis=0), points.max(axis=0)])


def edits_layer() -> Sdf.Layer:
    """Author the empty layer for a user's edits, the strongest of all."""
    return new_layer("World")


def _define(layer: Sdf.Layer, path: str, kind: str) -> Sdf.PrimSpec:
    spec = Sdf.CreatePrimInLayer(layer, path)
    spec.specifier, spec.typeName = Sdf.SpecifierDef, "Xform"
    spec.SetInfo("kind", kind)
    return spec


def _frame(spec: Sdf.PrimSpec, frame: NDArray[np.float64]) -> None:
    spec.SetInfo("apiSchemas", Sdf.TokenListOp.Create(["GeomModelAPI"]))
    hint = Sdf.AttributeSpec(spec, UsdGeom.Tokens.extentsHint, Sdf.ValueTypeNames.Float3Array)
    hint.default = Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(np.round(frame, 3), np.float32))


def _label_background(spec: Sdf.PrimSpec) -> None:
    # An imported world has no labels; unlabeled prims are background.
    spec.SetInfo("apiSchemas", Sdf.TokenListOp.Create([f"SemanticsLabelsAPI:{tokens.CLASS_TAXONOMY}"]))
    label = Sdf.AttributeSpec(spec, f"semantics:labels:{tokens.CLASS_TAXONOMY}", Sdf.ValueTypeNames.TokenArray)
    label.default = Vt.TokenArray(["background"])
