"""Taxonomy layer: another table of classes in force, switched in as a sublayer and out again.

The layer says nothing about any prim. It lays classes and the map from labels to them on the semantic render variable,
and whoever reads the stage derives each class from the prim's `component`. So the labels stay as they are, one file
fits every scene, a background or an edit that comes later is classed as well, and what a DCC brings back with nothing
but the `userProperties:` mirrors is too.
"""

from pxr import Sdf

from authoring.layers.layer import new_stage
from usd_schemas import tokens
from usd_schemas.apis import apply_taxonomy
from usd_schemas.taxonomies import Taxonomy


def taxonomy_layer(table: Taxonomy) -> Sdf.Layer:
    """Author the layer that puts a table in force.

    Args:
        table: Classes, and the map from labels to them.

    Returns:
        A layer in memory.
    """
    stage = new_stage("Render")
    apply_taxonomy(stage.OverridePrim(tokens.SEMANTIC_VAR), table)
    return stage.GetRootLayer()
