"""Runs inside Blender: opens a scene with the script that we ship, edits it as an artist would, exports with defaults.

Usage: python edit_scene.py REQUEST_JSON, with `script` (folder of open_scene.py), `scene`, `out`, and `edits`: a list
of operations by name, each with its arguments. The facts of the scene go to `facts`, where that is named.
"""

import json
import math
import sys
from pathlib import Path
from typing import Any

import bpy  # pyright: ignore[reportMissingImports]


def main(request: dict[str, Any]) -> None:
    """Open, edit, export.

    Args:
        request: See above.
    """
    bpy.ops.wm.read_factory_settings(use_empty=True)
    sys.path.insert(0, request["script"])
    from open_scene import open_scene  # pyright: ignore[reportMissingImports]

    open_scene(request["scene"])
    if "facts" in request:
        Path(request["facts"]).write_text(json.dumps(facts()), encoding="utf-8")
    for name, *arguments in request["edits"]:
        EDITS[name](*arguments)
    bpy.ops.wm.usd_export(filepath=request["out"], check_existing=False, **request.get("options", {}))


def facts() -> dict[str, Any]:
    """Tell what the script set, and the custom properties and materials that arrived."""
    scene = bpy.context.scene
    render = scene.render
    meshes = [thing for thing in scene.objects if thing.type == "MESH"]
    return {
        "camera": scene.camera.name,
        "size": [render.resolution_x, render.resolution_y, render.resolution_percentage],
        "fps": [render.fps, render.fps_base],
        "frames": [scene.frame_start, scene.frame_end],
        "properties": {thing.name: dict(thing.data.items()) for thing in meshes if "class" in thing.data},
        "index": {thing.name: thing.pass_index for thing in meshes},
        "sky": sky(scene.world.node_tree.nodes),
        "materials": {thing.name: [slot.material.name for slot in thing.material_slots] for thing in meshes},
    }


def sky(nodes: Any) -> dict[str, Any]:
    """Tell which picture surrounds the scene, and how it is turned [rad]."""
    (picture,) = [node for node in nodes if node.type == "TEX_ENVIRONMENT"]
    turns = [[node.vector_type, *node.inputs["Rotation"].default_value] for node in nodes if node.type == "MAPPING"]
    return {"image": Path(picture.image.filepath).name, "turns": turns}


def move(prefix: str, by: list[float]) -> None:
    """Move every object whose name begins so [m]."""
    for thing in bpy.data.objects:
        if thing.name.startswith(prefix):
            thing.location = [at + step for at, step in zip(thing.location, by, strict=True)]


def turn(name: str, angles: list[float]) -> None:
    """Turn an object [rad]."""
    bpy.data.objects[name].rotation_euler = angles


def push_vertex(name: str, vertex: int, by: list[float]) -> None:
    """Move one vertex [m]."""
    point = bpy.data.objects[name].data.vertices[vertex]
    point.co = [at + step for at, step in zip(point.co, by, strict=True)]


def subdivide(name: str) -> None:
    """Give a mesh other faces."""
    import bmesh  # pyright: ignore[reportMissingImports]

    data = bpy.data.objects[name].data
    cut = bmesh.new()
    cut.from_mesh(data)
    bmesh.ops.subdivide_edges(cut, edges=list(cut.edges), cuts=1, use_grid_fill=True)
    cut.to_mesh(data)
    cut.free()


def bevel(name: str) -> None:
    """Give an object a modifier, which the export applies; the mesh loses its custom properties by that."""
    bpy.data.objects[name].modifiers.new("Bevel", "BEVEL").width = 0.02


def slide_uv(name: str, layer: str, by: float) -> None:
    """Slide the texture coordinates of a mesh [1]."""
    for corner in bpy.data.objects[name].data.uv_layers[layer].uv:
        corner.vector = [value + by for value in corner.vector]


def paint(name: str, color: list[float]) -> None:
    """Give a material one color in place of its texture."""
    tree = bpy.data.materials[name].node_tree
    (surface,) = [node for node in tree.nodes if node.type == "BSDF_PRINCIPLED"]
    entry = surface.inputs["Base Color"]
    for link in list(entry.links):
        tree.links.remove(link)
    entry.default_value = (*color, 1.0)


def repaint(name: str, image: str) -> None:
    """Give a material another base texture."""
    tree = bpy.data.materials[name].node_tree
    (surface,) = [node for node in tree.nodes if node.type == "BSDF_PRINCIPLED"]
    (link,) = surface.inputs["Base Color"].links
    link.from_node.image = bpy.data.images.load(image)


def assign_material(name: str, material: str, color: list[float]) -> None:
    """Give an object another material, made when there is none of that name."""
    made = bpy.data.materials.get(material)
    if made is None:
        made = bpy.data.materials.new(material)
        made.use_nodes = True
        made.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (*color, 1.0)
    data = bpy.data.objects[name].data
    data.materials.clear()
    data.materials.append(made)


def add_cube(name: str, at: list[float], size: float) -> None:
    """Add a cube [m]."""
    bpy.ops.mesh.primitive_cube_add(size=size, location=at)
    bpy.context.object.name = name


def fly(name: str, lens: float, start: list[float], frames: int) -> None:
    """Add a camera that looks north, with a lens [mm], and flies east from a point by a meter a frame [m]."""
    thing = bpy.data.objects.new(name, bpy.data.cameras.new(name))
    thing.data.lens, thing.data.sensor_width, thing.data.clip_start = lens, 36.0, 0.5
    thing.rotation_euler = (math.pi / 2, 0.0, 0.0)
    bpy.context.scene.collection.objects.link(thing)
    for frame in range(frames):
        thing.location = (start[0] + frame, *start[1:])
        thing.keyframe_insert("location", frame=frame)


def add_lamp(name: str, kind: str, at: list[float]) -> None:
    """Add a lamp [m]."""
    thing = bpy.data.objects.new(name, bpy.data.lights.new(name, kind))
    thing.location = at
    bpy.context.scene.collection.objects.link(thing)


def say(name: str, key: str, value: str) -> None:
    """Write a custom property on an object."""
    bpy.data.objects[name][key] = value


def duplicate(name: str, by: list[float]) -> None:
    """Copy an object with its mesh, as Shift-D does [m]; a copied instance shows the same collection."""
    thing = bpy.data.objects[name].copy()
    if thing.data is not None:
        thing.data = thing.data.copy()
    thing.location = [at + step for at, step in zip(thing.location, by, strict=True)]
    bpy.context.scene.collection.objects.link(thing)


def delete(name: str) -> None:
    """Delete an object."""
    bpy.data.objects.remove(bpy.data.objects[name])


EDITS = {
    edit.__name__: edit
    for edit in (
        move,
        turn,
        push_vertex,
        subdivide,
        bevel,
        slide_uv,
        paint,
        repaint,
        assign_material,
        add_cube,
        fly,
        add_lamp,
        say,
        duplicate,
        delete,
    )
}


if __name__ == "__main__":
    main(json.loads(sys.argv[1]))
