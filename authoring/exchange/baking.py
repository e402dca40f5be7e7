"""The shared data of all steps of one baking."""

from dataclasses import dataclass
from pathlib import Path

from pxr import Usd

from authoring.exchange.bake_lookup import TextureLookup
from usd_schemas.guard.layer_walk import Warn


@dataclass(frozen=True, eq=False)
class Baking:
    """A flattened stage whose textures are baked.

    Attributes:
        stage: Flattened stage; its root layer is changed.
        folder: Folder of that layer; receives the textures.
        textures: Lookup of the stage's textures.
        warn: Called with one line for each property of a material that is not read.
    """

    stage: Usd.Stage
    folder: Path
    textures: TextureLookup
    warn: Warn
