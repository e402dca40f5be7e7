"""Runs inside Blender: makes a textured world round a bridge and exports it, as an artist who knows no bridge would.

Usage: python world_scene.py REQUEST_JSON, with `out` (the USD file), `options` of `wm.usd_export`, and `image` (a
texture of 4 x 4 texels that it writes first).
"""

import json
import sys
from pathlib import Path
from typing import Any

import bpy  # pyright: ignore[reportMissingImports]

TOWER = (60.0, 80.0, 0.0)  # foot of the tower [m]
HEIGHT = 30.0  # of the tower [m]


def main(request: dict[str, Any]) -> None:
    """Build and export.

    Args:
        request: See above.
    """
    bpy.ops.wm.read_factory_settings(use_empty=True)
    brick = material("Brick", request["image"])
    tower = add("Tower", brick)
    tower.location = (TOWER[0], TOWER[1], TOWER[2] + HEIGHT / 2)
    tower.dimensions = (10.0, 12.0, HEIGHT)
    tower.data["class"] = "pier_cap"  # a world has no bridge in it, whatever it says
    field = add("Field", material("Field_Green", ""))
    field.location, field.dimensions = (0.0, 0.0, -12.0), (600.0, 600.0, 2.0)
    scene = bpy.context.scene
    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "SUN"))
    eye = bpy.data.objects.new("Eye", bpy.data.cameras.new("Eye"))
    for thing in (lamp, eye):
        scene.collection.objects.link(thing)
    bpy.ops.wm.usd_export(filepath=request["out"], check_existing=False, **request["options"])


def add(name: str, worn: Any) -> Any:
    """Add a unit cube with a material."""
    bpy.ops.mesh.primitive_cube_add(size=1.0)
    thing = bpy.context.object
    thing.name = thing.data.name = name
    thing.data.materials.append(worn)
    return thing


def material(name: str, image: str) -> Any:
    """Make a material, with a new texture where a file is named."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    tree = made.node_tree
    surface = tree.nodes["Principled BSDF"]
    surface.inputs["Base Color"].default_value = (0.1, 0.5, 0.1, 1.0)
    if image:
        picture = bpy.data.images.new(Path(image).stem, 4, 4)
        picture.pixels = [value for texel in range(16) for value in (0.8, 0.1 + 0.05 * texel, 0.1, 1.0)]
        picture.filepath_raw, picture.file_format = image, "PNG"
        picture.save()
        node = tree.nodes.new("ShaderNodeTexImage")
        node.image = picture
        tree.links.new(node.outputs["Color"], surface.inputs["Base Color"])
    return made


if __name__ == "__main__":
    main(json.loads(sys.argv[1]))
