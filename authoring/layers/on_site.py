"""The class of a world's changes on the site: the site inherits from it while the world is selected."""

from dataclasses import replace

import numpy as np
from pxr import Sdf, Usd, UsdGeom, UsdShade, Vt

from authoring.backgrounds.site_changes import SiteChanges
from authoring.layers.assets import Pieces
from authoring.layers.geometry import SITE, roles_of
from authoring.layers.layer import new_stage
from authoring.looks.material import MaterialRecipe, author_material
from authoring.shapes.component import Component
from authoring.site.photo import MARK, surface_of
from usd_schemas import tokens

ROOT = "OnSite"
ON_SITE = f"{tokens.BACKGROUND}/{ROOT}"
FILE = "on_site.usda"
_TYPES = Sdf.ValueTypeNames
_INPUTS = (("roughness", "roughness_file", _TYPES.Float), ("normal", "normal_file", _TYPES.Normal3f))


def on_site_layer(world: str, pieces: Pieces, changes: SiteChanges, recipes: dict[str, MaterialRecipe]) -> Sdf.Layer:
    """Author the class: other materials for ground, of the site or new ones, and the visibility of repeats and fences.

    Args:
        world: Name of the world.
        pieces: The site's components and scatters.
        changes: What the world changes on them.
        recipes: One recipe for each new surface.

    Returns:
        A layer in memory, to be written beside the world's `textures`.
    """
    stage = new_stage(ROOT)
    stage.CreateClassPrim(f"/{ROOT}")
    own = roles_of(pieces)
    materials: dict[str, tuple[str, str]] = {}  # surface, and the site's material on the square
    for piece in pieces:
        if isinstance(piece, Component) and piece.name in changes.surfaces:
            surface, (_, square) = changes.surfaces[piece.name], surface_of(piece.role)
            name = surface if square is None else f"{surface}{MARK}{square}"
            if name not in own:
                name = f"{world}_{name}"
                materials.setdefault(name, (surface, "" if square is None else SITE.material(piece.role)))
            prim = stage.OverridePrim(_inside(SITE.prim(piece)))
            worn = prim.CreateRelationship(UsdShade.Tokens.materialBinding, custom=False)
            worn.SetTargets([_inside(SITE.material(name))])
        elif piece.name in changes.hidden:
            _hide(stage.OverridePrim(_inside(SITE.prim(piece))), changes.hidden[piece.name])
    for name, (surface, base) in sorted(materials.items()):
        _author(stage, _inside(SITE.material(name)), recipes[surface], base)
    return stage.GetRootLayer()


def _hide(prim: Usd.Prim, rows: tuple[int, ...]) -> None:
    """Hide rows of a PointInstancer, or all of a prim if none are named."""
    if rows:
        numbers = Vt.Int64Array.FromNumpy(np.array(rows, np.int64))
        prim.CreateAttribute(UsdGeom.Tokens.invisibleIds, _TYPES.Int64Array, custom=False).Set(numbers)
    else:
        prim.CreateAttribute(UsdGeom.Tokens.visibility, _TYPES.Token, custom=False).Set(UsdGeom.Tokens.invisible)


def _author(stage: Usd.Stage, path: str, recipe: MaterialRecipe, base: str) -> None:
    """Define a material; on a square it specializes the site's, whose image it keeps, and nothing else."""
    material = author_material(stage, path, replace(recipe, macro_file="") if base else recipe)
    if not base:
        return
    material.GetPrim().GetSpecializes().AddSpecialize(_inside(base))
    surface = UsdShade.Shader(stage.GetPrimAtPath(f"{path}/Surface"))
    surface.CreateInput("ior", _TYPES.Float).Set(recipe.ior)  # land is matt, paving is not
    for name, file, kind in _INPUTS:
        if not getattr(recipe, file):
            surface.CreateInput(name, kind).GetAttr().SetConnections([])


def _inside(path: str) -> str:
    """Find the path in the class of a path in the site."""
    return path.replace(f"/{SITE.root}/", f"/{ROOT}/", 1)
