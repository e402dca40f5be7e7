"""Taxonomy layer: another active table of classes, added and removed as a sublayer.

The layer contains no opinions about other prims. It stores classes and the map from labels to them on the semantic
render variable; readers of the stage derive each class from the prim's `component`. So labels are unchanged, one file
fits every scene, and backgrounds and edits that are added later are classified as well, including prims that another
program exported with only the `userProperties:` copies.
"""

from pxr import Sdf

from authoring.layers.layer import new_stage
from usd_schemas import tokens
from usd_schemas.apis import apply_taxonomy
from usd_schemas.taxonomies import Taxonomy


def taxonomy_layer(table: Taxonomy) -> Sdf.Layer:
    """Author the layer that activates a table.

    Args:
        table: Classes, and the map from labels to them.

    Returns:
        A layer in memory.
    """
    stage = new_stage("Render")
    apply_taxonomy(stage.OverridePrim(tokens.SEMANTIC_VAR), table)
    return stage.GetRootLayer()
