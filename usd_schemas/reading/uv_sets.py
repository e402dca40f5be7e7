"""Shares the two UV sets of a mesh among the materials of its parts, each of which numbers its own."""

from collections.abc import Iterable
from dataclasses import replace

from pxr import Usd, UsdGeom

from usd_schemas.flat_scene import Material, Texture
from usd_schemas.reading.labels import Warn
from usd_schemas.reading.meshes import choose_uv

Names = tuple[str, str]


def share_sets(prim: Usd.Prim, read: Iterable[Names], atlas_is_read: bool, warn: Warn) -> Names:
    """Choose the two UV sets of a mesh.

    Args:
        prim: The mesh.
        read: Primvars of the first and second set of each of its materials; either may be empty.
        atlas_is_read: Whether one of them reads `st1` without naming it.
        warn: Called with one line for each primvar that is left out.

    Returns:
        Names of the primvars; empty where none is named.
    """
    told = list(read)
    first = next((name for name, _ in told if name), "")
    second = next((name for _, name in told if name and name != first), "")
    if len(set(told)) < 2 or not prim.IsA(UsdGeom.Mesh):
        return first, second
    named = dict.fromkeys(name for names in told for name in names if name)
    others = [name for name in named if name != first and choose_uv(prim, (name, ""))[0] == name]
    if not second and not atlas_is_read:
        second = next(iter(others), "")
    for name in others:
        if name != second:
            warn(f"{prim.GetPath()}: texture coordinates {name} are left out: a mesh has two sets of them")
    return first, second


def on_sets(material: Material, own: Names, sets: Names) -> Material:
    """Number the UV sets of a material as those of a mesh; the material itself if these are its own numbers.

    Args:
        material: A material.
        own: Primvars of its own first and second set; either may be empty.
        sets: Those of the mesh.
    """
    slots = [sets.index(name) if name and name in sets else number for number, name in enumerate(own)]
    if slots == [0, 1]:
        return material
    moved = {
        name: replace(texture, uv_set=slots[texture.uv_set])
        for name, texture in vars(material).items()
        if isinstance(texture, Texture)
    }
    return replace(material, **moved)
