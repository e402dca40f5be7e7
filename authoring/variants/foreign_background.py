"""A world of the user's as a background: re-rooted, in metres with z up, without its cameras and lights."""

from pathlib import Path

from pxr import Gf, Kind, Sdf, Usd, UsdGeom, UsdLux, UsdRender

from authoring.foreign.usd_file import adopt, flatten_foreign, open_foreign, safe_name
from authoring.layers.layer import export, new_layer
from authoring.layers.provenance import author_provenance
from authoring.variants.arcs import add_background
from authoring.variants.foreign_place import HERE, Point, check_place
from groundwork.canonical import file_digest
from groundwork.files import whole_folder
from usd_schemas import tokens
from usd_schemas.components import component_classes
from usd_schemas.guard.layer_walk import Warn

# The ids of another scene would collide with those of this one.
_IDS = (
    tokens.USER_FALSEWORK_ID, tokens.USER_INSTANCE_ID, "falsework:component:instanceId",
    "falsework:component:instanceIds",
)  # fmt: skip
# No world has a part of a bridge in it, whatever its prims are called.
_LABELS = (
    tokens.USER_CLASS, tokens.USER_COMPONENT, "falsework:component:kind", "semantics:labels:class",
    "semantics:labels:component",
)  # fmt: skip


def import_background(scene: Path, file: Path, warn: Warn, origin: Point = HERE) -> str:
    """Bring in a world as the background of a scene, and offer it there; a former one of the same name is replaced.

    Args:
        scene: Root layer of the scene.
        file: USD file.
        warn: Called with one line about what is left out, and one about what stands in the way.
        origin: Point of the file's world that becomes the scene's origin, where the bridge begins [m], z up.

    Returns:
        Name of the background.

    Raises:
        InputError: Not readable, a material or texture is missing, or it stands more than 10 km off.
    """
    name = safe_name(file.stem)
    stage = open_foreign(file)
    check_place(stage, file, scene, origin, warn)
    root = new_layer("Background")
    spec = Sdf.CreatePrimInLayer(root, "/Background")
    spec.specifier, spec.typeName = Sdf.SpecifierDef, "Xform"
    spec.SetInfo("kind", Kind.Tokens.component)
    spec.SetInfo("assetInfo", {"name": name})
    made = {"file": file.name, "sha256": file_digest(file)}
    if origin != HERE:
        made["origin"] = " ".join(f"{value:.15g}" for value in origin)
    author_provenance(root, "/Background", made)
    root.subLayerPaths = ["./world.usdc"]
    with whole_folder(scene.parent / "background" / name) as fresh:
        export(_background(stage, name, flatten_foreign(stage, file, fresh), origin, warn), fresh / "world.usdc")
        export(root, fresh / f"{name}.usda")
    add_background(scene, name, f"./background/{name}/{name}.usda")
    return name


def _background(stage: Usd.Stage, name: str, flat: Sdf.Layer, origin: Point, warn: Warn) -> Sdf.Layer:
    dropped = _dropped(stage)
    if dropped:
        warn(f"left out of the background: {', '.join(str(path) for path in dropped)}")
    for path in dropped:
        flat.GetPrimAtPath(path).SetInfo("active", False)
    layer = new_layer("Background")
    world = Sdf.CreatePrimInLayer(layer, f"/Background/Background_{name}")
    for spec in (layer.GetPrimAtPath("/Background"), world):
        spec.specifier, spec.typeName = Sdf.SpecifierDef, "Xform"
    adopt(flat, layer, world.path)
    _convert(world, stage, origin)
    _strip_ids(layer)
    return layer


def _dropped(stage: Usd.Stage) -> list[Sdf.Path]:
    """List what is no part of a world: cameras, lights and render settings."""
    kinds = (UsdGeom.Camera, UsdRender.SettingsBase, UsdRender.Var)
    return [
        prim.GetPath()
        for prim in stage.Traverse()
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
    metres = UsdGeom.GetStageMetersPerUnit(stage)
    if metres != 1.0:
        order.append("xformOp:scale:unitsResolve")
        Sdf.AttributeSpec(world, order[-1], Sdf.ValueTypeNames.Double3).default = Gf.Vec3d(metres)
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
