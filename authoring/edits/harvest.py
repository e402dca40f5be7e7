"""Changes made to a scene in another program (a DCC), as a sparse layer: `edits/user.usda` holds only these."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from pxr import Sdf, Usd, UsdGeom, UsdShade

from authoring.edits import additions
from authoring.edits.additions import ADDITIONS, Labeling, write_binding
from authoring.edits.bodies import bound_materials
from authoring.edits.cameras import harvest_cameras
from authoring.edits.daylight import find_sun, harvest_sun
from authoring.edits.edits_left_out import edits_left_out
from authoring.edits.lamps import harvest_lamps
from authoring.edits.matching import Matches, expand_instances, match_stages
from authoring.edits.materials import (
    Place,
    Textures,
    bound_name,
    changed_inputs,
    materials_by_name,
    name_of,
    write_inputs,
)
from authoring.edits.placements import hidden_prims, moved_prims, write_transform, write_visibility
from authoring.edits.shapes import is_body, read_surface, write_reshaped
from authoring.layers.change import change_layer, check_editable
from authoring.layers.root import edits_layer
from authoring.layers.selection import AXES
from authoring.scenes.manifest import refresh_manifest
from authoring.shapes.component import FIRST_EDIT_ID
from groundwork.errors import InputError, MissingError
from groundwork.files import write_bytes
from groundwork.foreign_file import read_regular
from usd_schemas import tokens
from usd_schemas.apis import read_component
from usd_schemas.registration import register_schemas

register_schemas()

EDITS = "edits/user.usda"


@dataclass
class Harvest:
    """The changes found, by name of prim or material, in the order of the scene.

    Attributes:
        moved: Prims with another transform, and a sun with another direction or intensity.
        reshaped: Meshes with other points, faces, normals or texture coordinates.
        recoloured: Materials with other values or textures, and meshes bound to another material.
        added: New objects and their labels.
        removed: Prims that were deactivated.
        missing: Prims that the edited stage lacks and that are kept.
        cameras: New cameras, and those of surveys with other poses, with their number of poses.
        lights: New lights and their types.
        hidden: Prims that were hidden, or shown again.
        left_out: One line for each thing that is not imported, with its name.
    """

    moved: list[str] = field(default_factory=list)
    reshaped: list[str] = field(default_factory=list)
    recoloured: list[str] = field(default_factory=list)
    added: dict[str, str] = field(default_factory=dict)
    removed: list[str] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)
    cameras: dict[str, int] = field(default_factory=dict)
    lights: dict[str, str] = field(default_factory=dict)
    hidden: list[str] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)


def harvest_edits(edited: Path, scene: Path, labels: Labeling, remove: bool = False) -> Harvest:
    """Compare an edited stage with the scene that it came from, and rewrite the scene's edits layer.

    The scene is opened without its earlier edits, so that importing the same file twice changes nothing. Earlier edits
    of things that no program exports (other variants, other lights) are kept.

    Args:
        edited: USD file that another program exported.
        scene: Root layer of the scene.
        labels: Labels of new objects.
        remove: Deactivate prims that the edited stage lacks, instead of only reporting it.

    Returns:
        The changes found and written.

    Raises:
        InputError: Not readable, a stored scene, not one with an edits layer, or a texture is missing.
    """
    before, layer, target = _open_scene(scene)
    check_editable(target)
    after = _open(edited)
    expand_instances(after)
    chosen = _follow_choices(before, after)
    matches = match_stages(before, after)
    if not matches.pairs:
        raise InputError(
            "has no prim with a userProperties:falseworkId of the scene",
            where=edited,
            hint="Import the scene into the other program, and export it from there with custom properties",
        )
    former = _former_ids(layer)
    place = _placer(before)
    found = Harvest(missing=[path.name for path in matches.missing])
    _forget(layer, place, before, matches)
    for path, transform in moved_prims(before, after, matches.pairs).items():
        write_transform(layer, place(path), before.GetPrimAtPath(path), transform)
        found.moved.append(path.name)
    for path, visible in hidden_prims(before, matches.pairs).items():
        write_visibility(layer, place(path), visible)
        found.hidden.append(path.name)
    sun, edited_sun = find_sun(before, after)
    turned = harvest_sun(layer, before, sun, edited_sun)
    found.moved += [turned] if turned else []
    for path, prim in _bodies(before, matches):
        if write_reshaped(layer, place(path), read_surface(before.GetPrimAtPath(path)), read_surface(prim)):
            found.reshaped.append(path.name)
    copies, names = _recolor(layer, place, before, after, matches, Textures(scene.parent))
    found.recoloured.extend(names)
    copies |= _add(layer, before, matches, labels, former, found)
    taken = {prim.GetName() for prim in before.Traverse()} | found.added.keys()
    found.cameras, cameras_left = harvest_cameras(layer, before, after, taken)
    found.left_out = [*chosen, *cameras_left, *edits_left_out(before, after, matches)]
    found.lights, more = harvest_lamps(layer, before, after, edited_sun, taken)
    copies |= more
    if remove:
        for path in matches.missing:
            Sdf.CreatePrimInLayer(layer, place(path)).SetInfo("active", False)
        found.removed, found.missing = found.missing, []
    _write(layer, copies, target)
    return found


def _open_scene(scene: Path) -> tuple[Usd.Stage, Sdf.Layer, Path]:
    """Open a scene without its edits, and a copy of these."""
    full = _open(scene)
    target = scene.resolve().parent / EDITS
    own = next((layer for layer in full.GetLayerStack(False) if Path(layer.realPath or ".").resolve() == target), None)
    if own is None:
        raise InputError(f"has no sublayer ./{EDITS}", where=scene, hint="Name the scene.usda of a scene")
    chosen = {
        (prim, name): full.GetPrimAtPath(prim).GetVariantSet(name).GetVariantSelection()
        for prim, name in ((tokens.BRIDGE, "look"), (tokens.BACKGROUND, "background"), (tokens.ENVIRONMENT, "light"))
        if full.GetPrimAtPath(prim)
    }
    layer = edits_layer()
    layer.TransferContent(own)
    full.MuteLayer(own.identifier)
    full.SetEditTarget(full.GetSessionLayer())
    for (prim, name), selection in chosen.items():
        if selection:
            full.GetPrimAtPath(prim).GetVariantSet(name).SetVariantSelection(selection)
    return full, layer, target


def _open(path: Path) -> Usd.Stage:
    if not path.is_file():
        raise MissingError("no such file", where=path)
    try:
        return Usd.Stage.Open(str(path))
    except Exception as error:
        raise InputError("not readable as a USD stage", where=path, hint="Check the file") from error


def _placer(scene: Usd.Stage) -> Place:
    """Choose the target of edits of a prim: for materials and backgrounds, the selected variant."""
    homes = []
    for prim, name, scope in (
        (tokens.BRIDGE, "look", f"{tokens.BRIDGE}/BridgeLooks"),
        (tokens.BACKGROUND, "background", tokens.BACKGROUND),
    ):
        owner = scene.GetPrimAtPath(prim)
        selected = owner.GetVariantSet(name).GetVariantSelection() if owner else ""
        if selected:
            homes.append((Sdf.Path(scope), Sdf.Path(prim), Sdf.Path(prim).AppendVariantSelection(name, selected)))

    def place(path: Sdf.Path) -> Sdf.Path:
        for scope, owner, variant in homes:
            if path.HasPrefix(scope) and path != owner:
                return path.ReplacePrefix(owner, variant)
        return path

    return place


def _worn(place: Place, path: Sdf.Path) -> Sdf.Path:
    """Choose the target of a mesh's binding: the look, when the mesh is part of the bridge."""
    bridge = Sdf.Path(tokens.BRIDGE)
    if not path.HasPrefix(bridge):
        return place(path)
    look = place(Sdf.Path(f"{tokens.BRIDGE}/BridgeLooks")).GetParentPath()
    return path.ReplacePrefix(bridge, look)


def _bodies(scene: Usd.Stage, matches: Matches) -> Iterator[tuple[Sdf.Path, Usd.Prim]]:
    for path, prim in sorted(matches.pairs.items()):
        if scene.GetPrimAtPath(path).IsA(UsdGeom.Mesh) and is_body(prim):
            yield path, prim


def _follow_choices(before: Usd.Stage, after: Usd.Stage) -> list[str]:
    """Compare with the look, background and light that the edited stage selects, if it still has the variant sets."""
    lines = []
    for axis, path in AXES.items():
        ours, theirs = before.GetPrimAtPath(path), after.GetPrimAtPath(path)
        if not ours or not theirs or axis not in theirs.GetVariantSets().GetNames():
            continue
        wanted, variants = theirs.GetVariantSet(axis).GetVariantSelection(), ours.GetVariantSet(axis)
        if not wanted or wanted == variants.GetVariantSelection():
            continue
        if wanted in variants.GetVariantNames():
            variants.SetVariantSelection(wanted)
            lines.append(
                f"{axis}={wanted} is selected in the file, so the edits apply to it; select it in the scene with: "
                f"scene set {axis}={wanted}"
            )
        else:
            lines.append(f"{axis}={wanted} is selected in the file, but the scene has no such variant")
    return lines


def _recolor(
    layer: Sdf.Layer,
    place: Place,
    before: Usd.Stage,
    after: Usd.Stage,
    matches: Matches,
    textures: Textures,
) -> tuple[dict[str, str], list[str]]:
    """Import colors and materials; returns the copied textures, and the names of changed prims."""
    copies: dict[str, str] = {}
    names: list[str] = []
    ours, theirs = materials_by_name(before), materials_by_name(after)
    for name in sorted(ours.keys() & theirs.keys()):
        changed = changed_inputs(ours[name], theirs[name], textures)
        if changed:
            copies |= write_inputs(layer, place, ours[name], changed)
            names.append(name)
    for path, prim in _bodies(before, matches):
        worn = next(iter(bound_materials(prim).values()), None)
        if worn is not None and name_of(worn) != bound_name(before.GetPrimAtPath(path)):
            copies |= _wear(layer, _worn(place, path), worn, ours)
            names.append(path.name)
    return copies, names


def _wear(
    layer: Sdf.Layer, path: Sdf.Path, worn: UsdShade.Material, ours: dict[str, UsdShade.Material]
) -> dict[str, str]:
    """Bind a prim to a material of the scene, or to a copy of one that the scene lacks or that is in a world."""
    known, world = ours.get(name_of(worn)), Sdf.Path(tokens.BACKGROUND)
    stays = known is not None and (path.HasPrefix(world) or not known.GetPath().HasPrefix(world))
    if known is not None and stays:
        write_binding(layer, path, known.GetPath())
        return {}
    copy, copies = additions.write_material(layer, worn if known is None else known)
    write_binding(layer, path, copy)
    return copies


def _add(
    layer: Sdf.Layer,
    before: Usd.Stage,
    matches: Matches,
    labels: Labeling,
    former: dict[str, int],
    found: Harvest,
) -> dict[str, str]:
    copies: dict[str, str] = {}
    ours = materials_by_name(before)
    used = {number for prim in before.Traverse() for number in _numbers(prim)} | set(former.values())
    number = FIRST_EDIT_ID
    for name, prim in matches.added.items():
        if name not in former:
            while number in used:
                number += 1
            used.add(number)
        label = labels.label(name, prim)
        additions.write_addition(layer, name, prim, label, former.get(name, number), before)
        home = Sdf.Path(f"{ADDITIONS}/{name}")
        for subset, worn in bound_materials(prim).items():
            copies |= _wear(layer, home.AppendChild(subset) if subset else home, worn, ours)
        found.added[name] = label
    return copies


def _numbers(prim: Usd.Prim) -> tuple[int, ...]:
    facts = read_component(prim)
    return (facts.instance_id, *facts.instance_ids)


def _former_ids(layer: Sdf.Layer) -> dict[str, int]:
    """Read the ids that objects added earlier have; their ids do not change."""
    root = layer.GetPrimAtPath(ADDITIONS)
    found = {}
    for spec in root.nameChildren if root else ():
        number = spec.attributes.get("falsework:component:instanceId")
        if number is not None:
            found[spec.name] = int(number.default)
    return found


def _forget(layer: Sdf.Layer, place: Place, scene: Usd.Stage, matches: Matches) -> None:
    """Remove from earlier edits what the edited stage replaces: matched prims, materials and additions."""
    doomed = [Sdf.Path(ADDITIONS), *(place(material.GetPath()) for material in materials_by_name(scene).values())]
    for path in matches.pairs:
        doomed += [place(path), _worn(place, path)]
    for path in doomed:
        spec = layer.GetPrimAtPath(path)
        if spec is None:
            continue
        for prop in list(spec.properties):
            spec.RemoveProperty(prop)
        if path.StripAllVariantSelections() == Sdf.Path(ADDITIONS) or "Looks" in path.GetParentPath().name:
            del spec.nameParent.nameChildren[spec.name]
    for scope in (tokens.SURVEYS, tokens.ENVIRONMENT):
        holder = layer.GetPrimAtPath(scope)
        for spec in list(holder.nameChildren) if holder else ():
            if spec.specifier == Sdf.SpecifierDef and tokens.USER_FALSEWORK_ID in spec.attributes:
                del holder.nameChildren[spec.name]  # a camera or light of earlier edits is in the edited file again
    layer.RemoveInertSceneDescription()


def _write(layer: Sdf.Layer, copies: dict[str, str], target: Path) -> None:
    for prim in (tokens.BRIDGE, tokens.BACKGROUND, tokens.ENVIRONMENT):
        spec = layer.GetPrimAtPath(prim)
        if spec and list(spec.variantSets):
            spec.variantSetNameList.prependedItems = sorted(spec.variantSets.keys())
    textures = target.parent / "textures"
    for name, source in sorted(copies.items()):
        textures.mkdir(parents=True, exist_ok=True)
        write_bytes(target.parent / name, read_regular(Path(source)))
    change_layer(target, lambda former: former.TransferContent(layer))
    refresh_manifest(target.parent.parent)
