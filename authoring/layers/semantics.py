"""Semantics layer: only the labels of leaf prims, so that other tables are other files."""

from collections.abc import Iterator

from pxr import Sdf

from authoring.layers.geometry import Asset
from authoring.layers.layer import new_layer
from authoring.layers.repeats import are_instances, instance_name
from authoring.layers.specs import apply_schemas, author, prim_spec
from authoring.shapes.component import Component, Scatter
from usd_schemas.apis import LABEL_APIS, label_opinions


def semantics_layer(asset: Asset, pieces: tuple[Component | Scatter, ...]) -> Sdf.Layer:
    """Author the labels of an asset as overrides of its leaf prims.

    Args:
        asset: Paths of its parts.
        pieces: Components and scatters.

    Returns:
        A layer in memory, to be written as `semantics.usda`.
    """
    layer = new_layer(asset.root)
    with Sdf.ChangeBlock():
        for piece in pieces:
            for path, number in _labeled(asset, piece):
                prim = prim_spec(layer, path)
                apply_schemas(prim, LABEL_APIS)
                author(prim, label_opinions(piece.kind, number))
    return layer


def _labeled(asset: Asset, piece: Component | Scatter) -> Iterator[tuple[str, int]]:
    """List the prims with the label of a piece, each with its id; 0 for a PointInstancer of many."""
    path = asset.prim(piece)
    if isinstance(piece, Component):
        yield path, piece.instance_id
    elif are_instances(piece):
        for row, number in enumerate(piece.instance_ids):
            yield f"{path}/{instance_name(piece, row)}", number
    else:
        yield path, piece.instance_ids[0] if len(piece.instance_ids) == 1 else 0
