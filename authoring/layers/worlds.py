"""A background among the choices of a scene: its variant, and the class of its changes, which the site inherits."""

from dataclasses import dataclass

from pxr import Sdf

from authoring.layers.on_site import ON_SITE, ROOT
from usd_schemas import tokens


@dataclass(frozen=True)
class WorldFiles:
    """The files of a background, relative to the root layer.

    Attributes:
        world: The surroundings; empty for an empty world.
        on_site: What it changes on the site; empty for nothing.
    """

    world: str
    on_site: str = ""


def offer_background(layer: Sdf.Layer, name: str, files: WorldFiles) -> None:
    """Author a background as a variant; a former one of the same name is replaced.

    The site's arc is only authored when a world needs it. The class is referenced, not part of the payload: the site
    then looks the same whether the payload is loaded or not.

    Args:
        layer: Root layer of a scene, with the variant set.
        name: Name of the background.
        files: Its files.
    """
    variants = layer.GetPrimAtPath(tokens.BACKGROUND).variantSets["background"]
    if name in variants.variants:
        variants.RemoveVariant(variants.variants[name])
    spec = Sdf.VariantSpec(variants, name).primSpec
    spec.payloadList.prependedItems = [Sdf.Payload(files.world)] if files.world else []
    if files.on_site:
        changes = Sdf.PrimSpec(spec, ROOT, Sdf.SpecifierClass)
        changes.referenceList.prependedItems = [Sdf.Reference(files.on_site)]
        layer.GetPrimAtPath(tokens.SITE).inheritPathList.prependedItems = [Sdf.Path(ON_SITE)]
