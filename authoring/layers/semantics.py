"""Semantics layer: what every leaf prim is called, and nothing else, so that another table is another file."""

from pxr import Sdf

from authoring.layers.geometry import Asset
from authoring.layers.layer import new_layer
from authoring.layers.specs import apply_schemas, author, prim_spec
from authoring.shapes.component import Component, Scatter
from usd_schemas.apis import LABEL_APIS, label_opinions


def semantics_layer(asset: Asset, pieces: tuple[Component | Scatter, ...]) -> Sdf.Layer:
    """Author the labels of an asset as overrides of its leaf prims.

    Args:
        asset: Where it stands.
        pieces: Components and scatters.

    Returns:
        A layer in memory, to be written as `semantics.usda`.
    """
    layer = new_layer(asset.root)
    with Sdf.ChangeBlock():
        for piece in pieces:
            ids = (piece.instance_id,) if isinstance(piece, Component) else piece.instance_ids
            prim = prim_spec(layer, asset.prim(piece))
            apply_schemas(prim, LABEL_APIS)
            author(prim, label_opinions(piece.kind, ids[0] if len(ids) == 1 else 0))
    return layer
