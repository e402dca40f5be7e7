"""Changes by another program that cannot be imported: one line each, so that no change is lost without a message."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from pxr import Sdf, Usd, UsdGeom, UsdLux, UsdRender, UsdShade

from authoring.edits.bodies import bound_materials
from authoring.edits.matching import Matches, has_faces, is_blender, object_name, stable_id
from authoring.edits.materials import bound_name, materials_by_name, taken_inputs
from authoring.edits.shapes import is_body
from usd_schemas import tokens

_TIME = Usd.TimeCode.EarliestTime()
_NAMED = 12  # names in a line; the others are counted
_SAME = 1e-4  # relative: error of single precision
_TAKEN = (  # properties of matched prims that the other modules of this folder import
    "xformOp",
    "points",
    "faceVertex",
    "normals",
    "extent",
    "primvars:st:",
    "primvars:st1:",
    "primvars:normals",
    "material:binding",
    "visibility",
    "userProperties:blender",
)
_TAKEN_WHOLE = {"primvars:st", "primvars:st1", tokens.USER_FALSEWORK_ID}
_SUN = ("inputs:color", "inputs:intensity", "inputs:exposure", "inputs:enableColorTemperature")
_LENS = ("focalLength", "horizontalAperture", "verticalAperture", "clippingRange", "fStop", "focusDistance", "shutter:")
_LABELS = (tokens.USER_COMPONENT, tokens.USER_CLASS, tokens.USER_INSTANCE_ID)
_PLAIN = (
    UsdGeom.Xform,
    UsdGeom.Scope,
    UsdGeom.Camera,
    UsdGeom.Subset,
    UsdShade.Material,
    UsdShade.NodeGraph,
    UsdShade.Shader,
    UsdRender.SettingsBase,
    UsdRender.Var,
    UsdLux.LightFilter,
)


def edits_left_out(before: Usd.Stage, after: Usd.Stage, matches: Matches) -> list[str]:
    """List the changes of an edited stage that are not imported.

    Changes that Blender makes at every export are no edits: in its files, only unambiguous ones are listed.

    Args:
        before: The scene without earlier edits.
        after: The same stage as exported by another program.
        matches: Prims that the two have in common.

    Returns:
        One line for each kind of thing, sorted, with the names of the prims.
    """
    found: dict[str, dict[str, None]] = {}
    for name, reason in _all(before, after, matches):
        found.setdefault(reason, {})[name] = None
    return sorted(f"{_few(list(names))}: {reason}" for reason, names in found.items())


def _all(before: Usd.Stage, after: Usd.Stage, matches: Matches) -> Iterator[tuple[str, str]]:
    yield from _strangers(before, after, matches)
    for path, prim in sorted(matches.pairs.items()):
        yield from _of_pair(before.GetPrimAtPath(path), prim)
    for prim in matches.added.values():
        yield from _of_addition(prim)
    yield from _of_materials(before, after)
    if not is_blender(after):
        yield from _of_properties(before, after, matches)
        yield from _gone(before, after, matches)


def _few(names: list[str]) -> str:
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return ", ".join(names[:_NAMED]) + more


def _strangers(before: Usd.Stage, after: Usd.Stage, matches: Matches) -> Iterator[tuple[str, str]]:
    """List new prims that are not a body, camera or lamp."""
    known = {prim.GetName() for prim in before.Traverse()}
    taken = {prim.GetPath() for prim in (*matches.pairs.values(), *matches.added.values())}
    prims = iter(after.Traverse())
    for prim in prims:
        if prim.IsA(UsdGeom.PointInstancer):
            prims.PruneChildren()
        kind = prim.GetTypeName()
        new = prim.GetPath() not in taken and not {prim.GetName(), object_name(prim)} & known
        if not new or not kind or any(prim.IsA(schema) for schema in _PLAIN):
            continue
        if prim.IsA(UsdLux.DomeLight) or prim.IsA(UsdLux.DomeLight_1):
            if not is_blender(after):
                yield object_name(prim), "another sky is not imported; import it with: scene set light=FILE.hdr"
        elif is_body(prim):
            if prim.IsA(UsdGeom.Mesh) and not has_faces(prim):
                yield object_name(prim), "a mesh without faces is not imported"
        elif prim.IsA(UsdGeom.PointInstancer):
            if is_blender(after) and any(one.IsA(UsdGeom.PointInstancer) for one in before.Traverse()):
                continue  # Blender renames those of the scene
            yield object_name(prim), "a PointInstancer is not imported; make its instances real"
        elif not prim.HasAPI(UsdLux.LightAPI):
            yield object_name(prim), f"{kind} is not imported; export it as a mesh"


def _of_pair(ours: Usd.Prim, theirs: Usd.Prim) -> Iterator[tuple[str, str]]:
    name, called = ours.GetName(), object_name(theirs)
    if called != name and theirs.GetName() != name and not is_blender(theirs.GetStage()):
        yield name, f"keeps its name; the file calls it {called}"
    above, now = _holder(ours), _holder(theirs)
    if above != now and now and not is_blender(theirs.GetStage()):
        yield name, f"stays below {above or 'the root'}; the file has it below {now}"
    for label in _LABELS:
        old, new = ours.GetAttribute(label).Get(), theirs.GetAttribute(label).Get()
        if new is not None and old is not None and new != old:
            yield name, f"keeps {label.rpartition(':')[2]} {old}; the file says {new}"
    if ours.IsInstance() and _shapes(ours) != _shapes(theirs):
        yield name, "is an instance, and keeps the shape and material that it shares with other instances"
    if is_body(ours) and not is_body(theirs):
        yield name, f"is a {theirs.GetTypeName()} in the file, and keeps its shape"
    if is_body(ours) and is_body(theirs):
        if len({material.GetPath() for part, material in bound_materials(theirs).items() if part}) > 1:
            yield name, "has more than one material in the file: the first one is used for all of it"
        if _moves(theirs):
            yield name, "moves in the file: its state at the first frame is imported"


def _shapes(prim: Usd.Prim) -> list[tuple[object, ...]]:
    """Summarize the meshes below an instance: numbers of points and corners, extent [stage units], material."""
    found = []
    for part in Usd.PrimRange(prim, Usd.TraverseInstanceProxies()):
        if not is_body(part) or UsdGeom.Imageable(part).ComputePurpose() == UsdGeom.Tokens.proxy:
            continue
        points = np.asarray(part.GetAttribute("points").Get(_TIME) or np.zeros((0, 3)), np.float64)
        corners = len(part.GetAttribute("faceVertexIndices").Get(_TIME) or ())
        size = np.ptp(points, axis=0).round(3).tolist() if len(points) else []
        found.append((len(points), corners, tuple(size), bound_name(part)))
    return sorted(found, key=str)


def _of_addition(prim: Usd.Prim) -> Iterator[tuple[str, str]]:
    name = object_name(prim)
    if _moves(prim):
        yield name, "moves in the file: its state at the first frame is imported"
    if prim.HasAPI(UsdLux.LightAPI):
        yield name, "emits light in the file: its shape is imported, its light is not"
    scheme = UsdGeom.Mesh(prim).GetSubdivisionSchemeAttr() if prim.IsA(UsdGeom.Mesh) else None
    if scheme and scheme.HasAuthoredValue() and scheme.Get() != UsdGeom.Tokens.none:
        yield name, f"is subdivided ({scheme.Get()}) in the file: its control mesh is imported; apply subdivision first"
    sources = (
        one
        for shader in _networks(prim)
        for attribute in shader.GetAuthoredAttributes()
        for one in attribute.GetConnections()
    )
    homes = [material.GetPath() for material in bound_materials(prim).values()]
    if any(not any(source.HasPrefix(home) for home in homes) for source in sources):
        yield name, "its material has a connection to a prim outside the material, which is not imported"


def _networks(prim: Usd.Prim) -> Iterator[Usd.Prim]:
    for material in bound_materials(prim).values():
        yield from Usd.PrimRange(material.GetPrim())


def _of_materials(before: Usd.Stage, after: Usd.Stage) -> Iterator[tuple[str, str]]:
    ours, theirs = materials_by_name(before), materials_by_name(after)
    for name in sorted(ours.keys() & theirs.keys()):
        if ours[name].ComputeSurfaceSource()[0] and not _is_preview(theirs[name]) and _is_preview(ours[name]):
            yield name, "its surface is not a UsdPreviewSurface in the file, and is not changed"
        elif not is_blender(after):
            yield from _of_network(name, ours[name], theirs[name])
    if not is_blender(after):
        worn = {
            material.GetPath()
            for prim in after.Traverse()
            if is_body(prim)
            for material in bound_materials(prim).values()
        }
        for name in sorted(theirs.keys() - ours.keys()):
            if theirs[name].GetPath() not in worn:
                yield name, "a material that no mesh uses is not imported"


def _of_network(name: str, ours: UsdShade.Material, theirs: UsdShade.Material) -> Iterator[tuple[str, str]]:
    """List inputs of a material that are not imported: the placement of a texture, a coat, a scale."""
    for prim in Usd.PrimRange(theirs.GetPrim()):
        old = ours.GetPrim().GetStage().GetPrimAtPath(prim.GetPath().ReplacePrefix(theirs.GetPath(), ours.GetPath()))
        if not old:
            continue
        surface = UsdShade.Shader(prim).GetShaderId() == "UsdPreviewSurface" if prim.IsA(UsdShade.Shader) else False
        for attribute in prim.GetAuthoredAttributes():
            word = attribute.GetName()
            if attribute.GetTypeName() == Sdf.ValueTypeNames.Asset or (surface and word in taken_inputs()):
                continue
            if not attribute.GetConnections() and _differs(old.GetAttribute(word), attribute):
                yield name, f"{prim.GetName()}.{word} is not imported"


def _of_properties(before: Usd.Stage, after: Usd.Stage, matches: Matches) -> Iterator[tuple[str, str]]:
    """List properties that differ on prims of both stages, and that are not imported."""
    pairs = {prim.GetPath(): prim for prim in before.Traverse()}
    there = {path: matches.pairs.get(path) or after.GetPrimAtPath(path) for path in pairs}
    for path, theirs in sorted(there.items()):
        ours = pairs[path]
        if not theirs or any(ours.IsA(schema) for schema in (UsdShade.Material, UsdShade.Shader, UsdShade.NodeGraph)):
            continue
        taken = _TAKEN + (_LENS if ours.IsA(UsdGeom.Camera) else ()) + (_SUN if ours.IsA(UsdLux.DistantLight) else ())
        for attribute in theirs.GetAuthoredAttributes():
            word = attribute.GetName()
            if word in _TAKEN_WHOLE or word in _LABELS or word.startswith(taken):
                continue
            if _differs(ours.GetAttribute(word), attribute):
                yield path.name, f"{word} is not imported"


def _gone(before: Usd.Stage, after: Usd.Stage, matches: Matches) -> Iterator[tuple[str, str]]:
    """List missing prims that are not bodies: plants, lights, cameras; other programs import only visible ones."""
    names = {prim.GetName() for prim in after.Traverse()}
    for prim in before.Traverse():
        counted = prim.IsA(UsdGeom.PointInstancer) or prim.IsA(UsdGeom.Camera) or prim.HasAPI(UsdLux.LightAPI)
        if not counted or UsdGeom.Imageable(prim).ComputeVisibility() == UsdGeom.Tokens.invisible:
            continue
        if prim.GetPath() not in matches.pairs and prim.GetName() not in names:
            yield prim.GetName(), f"the file has no such {prim.GetTypeName()}: it is kept"


def _differs(old: Usd.Attribute, new: Usd.Attribute) -> bool:
    a, b = (attribute.Get(_TIME) if attribute else None for attribute in (old, new))
    if b is None or a is None:
        return b is not None
    return not _same(a, b)


def _same(a: Any, b: Any) -> bool:
    if isinstance(a, Sdf.AssetPath) and isinstance(b, Sdf.AssetPath):
        return a.path.rpartition("/")[2] == b.path.rpartition("/")[2]
    try:
        one, two = np.asarray(a, np.float64), np.asarray(b, np.float64)
    except (TypeError, ValueError):
        return bool(a == b)
    return one.shape == two.shape and bool(np.allclose(one, two, rtol=_SAME, atol=_SAME))


def _is_preview(material: UsdShade.Material) -> bool:
    surface = material.ComputeSurfaceSource()[0]
    return bool(surface) and surface.GetShaderId() == "UsdPreviewSurface"


def _holder(prim: Usd.Prim) -> str:
    """Find the nearest prim above that has a stable id."""
    above = prim.GetParent()
    while above and not above.IsPseudoRoot() and not stable_id(above):
        above = above.GetParent()
    return stable_id(above) if above else ""


def _moves(prim: Usd.Prim) -> bool:
    points = prim.GetAttribute("points")
    if points and points.ValueMightBeTimeVarying():
        return True
    while prim and not prim.IsPseudoRoot():
        if prim.IsA(UsdGeom.Xformable) and UsdGeom.Xformable(prim).TransformMightBeTimeVarying():
            return True
        prim = prim.GetParent()
    return False
