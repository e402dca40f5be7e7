"""Semantics layer: what every leaf prim is called, and nothing else, so that another table is another file."""

from pxr import Sdf

from authoring.component import Component, Scatter
from authoring.layers.geometry import Asset
from authoring.layers.layer import new_outlined_stage
from usd_schemas.apis import apply_labels


def semantics_layer(asset: Asset, pieces: tuple[Component | Scatter, ...]) -> Sdf.Layer:
    """Author the labels of an asset as overrides of its leaf prims.

    Args:
        asset: Where it stands.
        pieces: Components and scatters.

    Returns:
        A layer in memory, to be written as `semantics.usdc`.
    """
    stage = new_outlined_stage(asset.root, {asset.prim(piece): "" for piece in pieces})
    for piece in pieces:
        ids = (piece.instance_id,) if isinstance(piece, Component) else piece.instance_ids
        apply_labels(stage.OverridePrim(asset.prim(piece)), piece.kind, ids[0] if len(ids) == 1 else 0)
    return stage.GetRootLayer()
