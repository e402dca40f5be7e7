"""A user's world as a background: under a new root prim, in meters with z up, without its cameras and lights."""

from functools import partial
from pathlib import Path

from pxr import Gf, Kind, Sdf, Usd, UsdGeom, UsdLux, UsdRender

from authoring.backgrounds.registry import BACKGROUNDS
from authoring.foreign.asset_paths import localize
from authoring.foreign.corrections import correct
from authoring.foreign.usd_file import adopt, flatten_foreign, holder_of, open_foreign, safe_name
from authoring.layers.identity import name_asset
from authoring.layers.layer import export, new_layer
from authoring.layers.provenance import author_provenance
from authoring.layers.worlds import WorldFiles
from authoring.variants.arcs import add_background
from authoring.variants.foreign_place import HERE, Point, check_place
from authoring.variants.staging import Staged, check_asset, fresh_folder
from groundwork.canonical import file_digest
from groundwork.errors import InputError
from usd_schemas import tokens
from usd_schemas.components import component_classes
from usd_schemas.guard.layer_walk import Warn

# The ids of another scene would collide with those of this one.
_IDS = (
    tokens.USER_FALSEWORK_ID,
    tokens.USER_INSTANCE_ID,
    "falsework:component:instanceId",
    "falsework:component:instanceIds",
)
# A world contains no parts of a bridge, whatever the names of its prims.
_LABELS = (
    tokens.USER_CLASS,
    tokens.USER_COMPONENT,
    "falsework:component:kind",
    "semantics:labels:class",
    "semantics:labels:component",
)


def stage_background(scene: Path, file: Path, warn: Warn, origin: Point = HERE) -> Staged:
    """Prepare a background from a user's world; the scene is unchanged until it is committed.

    Args:
        scene: Root layer of the scene.
        file: USD file.
        warn: Called with one line about things left out, one about objects in the keep-out volume, and one about
            findings of USD's own validators.
        origin: Point of the file's world that becomes the scene's origin, where the bridge begins [m], z up.

    Returns:
        The background; a former one of the same name is replaced.

    Raises:
        InputError: Not readable, a material or texture is missing, or it is more than 10 km away.
    """
    name = safe_name(file.stem)
    if name.lower() in BACKGROUNDS:
        raise InputError("has the name of a world of Falsework", where=file, value=name, hint="Rename it")
    stage = open_foreign(file, warn)
    check_place(stage, file, scene, origin, warn)
    place = scene.parent / "background" / name
    fresh = fresh_folder(place)
    offer = partial(add_background, scene, name, WorldFiles(f"./background/{name}/{name}.usda"))
    staged = Staged(name, fresh, place, offer)
    try:
        layer = _background(stage, name, origin, warn)
        localize(layer, fresh, file, partial(holder_of, stage), warn)
        correct(layer)
        export(layer, fresh / "world.usdc")
        export(_root(name, file, origin), fresh / f"{name}.usda")
        check_asset(scene, "background", fresh / f"{name}.usda", file, warn)
    except BaseException:
        staged.discard()
        raise
    return staged


def _root(name: str, file: Path, origin: Point) -> Sdf.Layer:
    root = new_layer("Background")
    spec = Sdf.CreatePrimInLayer(root, "/Background")
    spec.specifier, spec.typeName = Sdf.SpecifierDef, "Xform"
    spec.SetInfo("kind", Kind.Tokens.component)
    made = {"file": file.name, "sha256": file_digest(file)}
    name_asset(root, "/Background", name, f"{name}.usda", made["sha256"][:12])
    if origin != HERE:
        made["origin"] = " ".join(f"{value:.15g}" for value in origin)
    author_provenance(root, "/Background", made, is_ours=False)
    root.subLayerPaths = ["./world.usdc"]
    return root


def _background(stage: Usd.Stage, name: str, origin: Point, warn: Warn) -> Sdf.Layer:
    flat = flatten_foreign(stage)
    dropped = _dropped(flat)
    if dropped:
        warn(f"left out of the background: {', '.join(str(path) for path in dropped)}")
    for path in dropped:
        if (spec := flat.GetPrimAtPath(path)) is not None:
            del spec.nameParent.nameChildren[spec.name]
    layer = new_layer("Background")
    layer.customLayerData, layer.documentation = flat.customLayerData, flat.documentation
    world = Sdf.CreatePrimInLayer(layer, f"/Background/Background_{name}")
    for spec in (layer.GetPrimAtPath("/Background"), world):
        spec.specifier, spec.typeName = Sdf.SpecifierDef, "Xform"
    adopt(flat, layer, world.path)
    _convert(world, stage, origin)
    _strip_ids(layer)
    return layer


def _dropped(flat: Sdf.Layer) -> list[Sdf.Path]:
    """List prims that are not part of a world, also in prototypes: cameras, lights, render settings."""
    kinds = (UsdGeom.Camera, UsdRender.SettingsBase, UsdRender.Var)
    stage = Usd.Stage.Open(flat)
    return [
        prim.GetPath()
        for prim in Usd.PrimRange.Stage(stage, Usd.PrimAllPrimsPredicate)
        if prim.HasAPI(UsdLux.LightAPI) or any(prim.IsA(kind) for kind in kinds)
    ]


def _convert(world: Sdf.PrimSpec, stage: Usd.Stage, origin: Point) -> None:
    order = []
    if origin != HERE:
        order.append("xformOp:translate:reOrigin")
        Sdf.AttributeSpec(world, order[-1], Sdf.ValueTypeNames.Double3).default = -Gf.Vec3d(*origin)
    if UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.y:
        order.append("xformOp:rotateX:unitsResolve")
        Sdf.AttributeSpec(world, order[-1], Sdf.ValueTypeNames.Double).default = 90.0
    meters = UsdGeom.GetStageMetersPerUnit(stage)
    if meters != 1.0:
        order.append("xformOp:scale:unitsResolve")
        Sdf.AttributeSpec(world, order[-1], Sdf.ValueTypeNames.Double3).default = Gf.Vec3d(meters)
    if order:
        listing = Sdf.AttributeSpec(world, "xformOpOrder", Sdf.ValueTypeNames.TokenArray, Sdf.VariabilityUniform)
        listing.default = order


def _strip_ids(layer: Sdf.Layer) -> None:
    prims: list[Sdf.Path] = []
    layer.Traverse(Sdf.Path.absoluteRootPath, lambda path: prims.append(path) if path.IsPrimPath() else None)
    for path in prims:
        spec = layer.GetPrimAtPath(path)
        for name in (*_IDS, *(label for label in _LABELS if _names_a_bridge(spec, label))):
            if name in spec.properties:
                spec.RemoveProperty(spec.properties[name])


def _names_a_bridge(spec: Sdf.PrimSpec, name: str) -> bool:
    attribute = spec.attributes.get(name)
    value = attribute.default if attribute is not None else None
    word = value if isinstance(value, str) else next(iter(value or ()), "")
    return bool(word) and component_classes().get(word, word) != "background"
