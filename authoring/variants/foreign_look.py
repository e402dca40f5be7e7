"""Materials of the user as a look: those named like roles are used for them; the other roles are from another look."""

from functools import partial
from pathlib import Path

from pxr import Sdf, Usd, UsdShade

from authoring.foreign.asset_paths import localize
from authoring.foreign.corrections import correct
from authoring.foreign.usd_file import flatten_foreign, holder_of, open_foreign, safe_name
from authoring.layers.layer import export, new_layer
from authoring.layers.provenance import author_provenance
from authoring.looks.roles import LOOKS, sheet_role
from authoring.variants.arcs import add_look
from authoring.variants.staging import Staged, check_asset, fresh_folder
from groundwork.canonical import file_digest
from groundwork.errors import InputError
from usd_schemas import tokens
from usd_schemas.guard.layer_walk import Warn


def stage_look(scene: Path, file: Path, warn: Warn) -> Staged:
    """Prepare a look from the materials of a USD file; the scene is unchanged until it is committed.

    Args:
        scene: Root layer of the scene.
        file: USD file with materials named like the roles, `Role_PierConcrete` and so on, anywhere in it; the further
            sheets of a role use the same material unless the file has them, too.
        warn: Called with one line about the roles missing in the file, and one about findings of USD's own
            validators.

    Returns:
        The look; a former one of the same name is replaced.

    Raises:
        InputError: Not readable, it has no material of a role, or a texture is missing.
    """
    name = safe_name(file.stem)
    if name.lower() in LOOKS:
        raise InputError("has the name of a look of Falsework", where=file, value=name, hint="Rename it")
    stage = open_foreign(file, warn)
    roles = _roles(scene)
    materials = {
        prim.GetName(): prim.GetPath()
        for prim in stage.Traverse()
        if prim.IsA(UsdShade.Material) and prim.GetName() in {*tokens.ROLES, *roles}
    }
    if not materials.keys() & roles:
        raise InputError("has no material with the name of a role", where=file, allowed=", ".join(sorted(roles)))
    sheets = {name: role for name in roles - materials.keys() if (role := sheet_role(name)) in materials}
    others = _fallbacks(scene, roles - materials.keys() - sheets.keys(), name)
    place = scene.parent / "bridge/looks" / name
    fresh = fresh_folder(place)
    offer = partial(add_look, scene.parent / "bridge/bridge.usda", name, f"./looks/{name}/look.usda", others)
    staged = Staged(name, fresh, place, offer)
    try:
        layer = _look(flatten_foreign(stage), materials, file)
        localize(layer, fresh, file, partial(holder_of, stage), warn)
        correct(layer)
        for sheet, role in sorted(sheets.items()):
            spec = Sdf.CreatePrimInLayer(layer, f"/Look/{sheet}")
            spec.specifier, spec.typeName = Sdf.SpecifierDef, "Material"
            spec.specializesList.prependedItems = [Sdf.Path(f"/Look/{role}")]
        author_provenance(layer, "/Look", {"file": file.name, "sha256": file_digest(file)}, is_ours=False)
        export(layer, fresh / "look.usda")
        check_asset(scene, "look", fresh / "look.usda", file, warn)
    except BaseException:
        staged.discard()
        raise
    if others:
        warn(
            f"{file.name} has no material for these roles, which are taken from other looks: "
            f"{', '.join(sorted(others))}"
        )
    return staged


def _roles(scene: Path) -> set[str]:
    stage = Usd.Stage.Open(str(scene))
    looks = stage.GetPrimAtPath(f"{tokens.BRIDGE}/BridgeLooks")
    if not looks:
        raise InputError(f"has no {tokens.BRIDGE}/BridgeLooks", where=scene, hint="Name the scene.usda of a scene")
    return {prim.GetName() for prim in looks.GetChildren()}


def _look(flat: Sdf.Layer, materials: dict[str, Sdf.Path], file: Path) -> Sdf.Layer:
    layer = new_layer("Look")
    layer.customLayerData, layer.documentation = flat.customLayerData, flat.documentation
    root = Sdf.CreatePrimInLayer(layer, "/Look")
    root.specifier, root.typeName = Sdf.SpecifierDef, "Scope"
    for role, path in sorted(materials.items()):
        place = root.path.AppendChild(role)
        Sdf.CopySpec(flat, path, layer, place)
        outside: list[Sdf.Path] = []

        def look(spec_path: Sdf.Path, place: Sdf.Path = place, outside: list[Sdf.Path] = outside) -> None:
            spec = layer.GetObjectAtPath(spec_path)
            if isinstance(spec, Sdf.AttributeSpec):
                outside.extend(one for one in spec.connectionPathList.GetAppliedItems() if not one.HasPrefix(place))

        layer.Traverse(place, look)
        if outside:
            raise InputError(
                "is connected to a prim outside the material",
                where=file,
                field=str(path),
                value=str(outside[0]),
                hint="Put the whole shader network below the material",
            )
    return layer


def _fallbacks(scene: Path, missing: set[str], name: str) -> dict[str, str]:
    stage = Usd.Stage.Open(str(scene), Usd.Stage.LoadNone)
    variants = stage.GetPrimAtPath(tokens.BRIDGE).GetVariantSet("look")
    order = [variants.GetVariantSelection(), *sorted(variants.GetVariantNames())]
    found: dict[str, str] = {}
    for look in order:
        file = scene.parent / f"bridge/looks/{look}/look.usda"
        layer = Sdf.Layer.FindOrOpen(str(file)) if look != name and file.is_file() else None
        for role in missing - found.keys():
            if layer is not None and layer.GetPrimAtPath(f"/Look/{role}"):
                found[role] = f"./looks/{look}/look.usda"
    return found
