"""Lights that another program added: they are under `/World/Environment`, for every selected light."""

from pathlib import Path

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux

from authoring.edits.matching import free_name, object_name
from groundwork.errors import InputError
from usd_schemas import tokens
from usd_schemas.reading.materials import asset_file
from usd_schemas.reading.stage_reader import stage_to_world

_DECIMALS = 6


def is_lamp(prim: Usd.Prim) -> bool:
    """Check whether a prim is a separate light, neither a sky nor an emissive mesh.

    Args:
        prim: Any prim.
    """
    return prim.HasAPI(UsdLux.LightAPI) and not prim.IsA(UsdLux.DomeLight) and not prim.IsA(UsdGeom.Gprim)


def harvest_lamps(
    layer: Sdf.Layer, scene: Usd.Stage, edited: Usd.Stage, sun: Usd.Prim | None, taken: set[str]
) -> tuple[dict[str, str], dict[str, str]]:
    """Write the lights that the scene does not have, with all connected prims, in the scene's units.

    Args:
        layer: Edits layer, without the lights of earlier edits.
        scene: The scene without earlier edits.
        edited: The same stage as exported by another program, in any unit and up axis.
        sun: The light of the edited stage that is the scene's sun.
        taken: Names of prims; those of the new lights are added to it.

    Returns:
        Name to type of the new lights, and destination below the layer's folder to source of each texture to copy.

    Raises:
        InputError: A texture of a light is missing.
    """
    known = {prim.GetName() for prim in scene.Traverse() if is_lamp(prim)}
    names: dict[str, str] = {}
    copies: dict[str, str] = {}
    for prim in sorted(filter(is_lamp, edited.Traverse()), key=lambda one: (object_name(one), str(one.GetPath()))):
        if prim == sun or object_name(prim) in known:
            continue
        name = free_name(object_name(prim), taken)
        taken.add(name)
        copies |= _write_lamp(layer, scene, name, prim)
        names[name] = str(prim.GetTypeName())
    return names, copies


def _write_lamp(layer: Sdf.Layer, scene: Usd.Stage, name: str, prim: Usd.Prim) -> dict[str, str]:
    environment = Sdf.CreatePrimInLayer(layer, tokens.ENVIRONMENT)
    if not scene.GetPrimAtPath(tokens.ENVIRONMENT):
        environment.specifier, environment.typeName = Sdf.SpecifierDef, "Scope"
    spec = Sdf.CreatePrimInLayer(layer, f"{tokens.ENVIRONMENT}/{name}")
    spec.specifier, spec.typeName = Sdf.SpecifierDef, prim.GetTypeName()
    schemas = [schema for schema in prim.GetPrimTypeInfo().GetAppliedAPISchemas() if schema.endswith("API")]
    if schemas:
        spec.SetInfo("apiSchemas", Sdf.TokenListOp.Create(prependedItems=schemas))
    copies = {}
    for attribute in prim.GetAuthoredAttributes():
        value = attribute.Get(Usd.TimeCode.EarliestTime())
        if not attribute.GetName().startswith("inputs:") or value is None:
            continue
        if isinstance(value, Sdf.AssetPath):
            file = asset_file(value)
            if not file:
                raise InputError("a texture is missing", where=str(prim.GetPath()), value=value.path)
            target = f"textures/{name}{Path(file).suffix.lower()}"
            copies[target], value = file, Sdf.AssetPath(f"./{target}")
        Sdf.AttributeSpec(spec, attribute.GetName(), attribute.GetTypeName()).default = value
    to_scene = np.linalg.inv(stage_to_world(scene)) @ stage_to_world(prim.GetStage())
    world = UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(Usd.TimeCode.EarliestTime())
    rows = np.round((to_scene @ np.array(world).T).T, _DECIMALS) + 0.0  # its scale also scales the light's surface
    matrix = Sdf.AttributeSpec(spec, "xformOp:transform", Sdf.ValueTypeNames.Matrix4d)
    matrix.default = Gf.Matrix4d(*rows.ravel().tolist())
    order = Sdf.AttributeSpec(spec, "xformOpOrder", Sdf.ValueTypeNames.TokenArray, Sdf.VariabilityUniform)
    order.default = ["xformOp:transform"]
    identity = Sdf.AttributeSpec(spec, tokens.USER_FALSEWORK_ID, Sdf.ValueTypeNames.String, declaresCustom=True)
    identity.default = name
    return copies
