"""Runs inside Blender: builds a small scene, exports it as USD, and writes down Blender's own numbers about it.

Usage: python export_scene.py OPTIONS_JSON, with `file` (the USD file), `facts` (the JSON file), `frames`, and any
further options of `wm.usd_export`.
"""

import json
import math
import sys
from pathlib import Path
from typing import Any

import bpy  # pyright: ignore[reportMissingImports]
from bpy_extras.object_utils import world_to_camera_view  # pyright: ignore[reportMissingImports]
from mathutils import Vector  # pyright: ignore[reportMissingImports]

WIDTH, HEIGHT = 1280, 720


def main(options: dict[str, Any]) -> None:
    """Build, measure and export.

    Args:
        options: See above.
    """
    file, facts, frames = Path(options.pop("file")), Path(options.pop("facts")), options.pop("frames")
    bpy.ops.wm.read_factory_settings(use_empty=True)
    build(frames)
    bpy.context.view_layer.update()
    numbers = measure(frames)
    bpy.ops.wm.usd_export(filepath=str(file), export_animation=frames > 1, check_existing=False, **options)
    facts.write_text(json.dumps(numbers), encoding="utf-8")


def add(name: str, points: list[tuple[float, ...]], faces: list[tuple[int, ...]], link: bool = True) -> Any:
    """Add a mesh object."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(points, [], faces)
    mesh.uv_layers.new(name="UVMap")
    thing = bpy.data.objects.new(name, mesh)
    if link:
        bpy.context.scene.collection.objects.link(thing)
    return thing


def box(name: str, link: bool = True) -> Any:
    """Add a unit cube about the origin, faces outwards."""
    points = [(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return add(name, points, faces, link)


def material(name: str, color: tuple[float, float, float]) -> Any:
    """Make a material of one color."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    made.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (*color, 1.0)
    return made


def build(frames: int) -> None:
    """Build the scene: concave face, two materials, mirror, linked and collection instances, camera, sun."""
    scene = bpy.context.scene
    red, blue = material("Red", (0.8, 0.05, 0.05)), material("Blue", (0.05, 0.1, 0.8))
    outline = [(0, 0), (6, 0), (6, 1), (2, 1), (3, 2), (1, 4), (0.5, 1.5), (0, 4)]
    count = len(outline)
    points = [(x, y, z) for z in (0.0, 0.5) for x, y in outline]
    sides = [(i, (i + 1) % count, (i + 1) % count + count, i + count) for i in range(count)]
    plate = add("Plate", points, [tuple(reversed(range(count))), tuple(range(count, 2 * count)), *sides])
    plate.location, plate.rotation_euler = (1.0, 2.0, 0.25), (0.1, -0.2, 0.7)
    plate.data.materials.append(red)
    mixed = box("Mixed")
    mixed.data.materials.append(red)
    mixed.data.materials.append(blue)
    for face in list(mixed.data.polygons)[:2]:
        face.material_index = 1
    mixed.location, mixed.scale, mixed.rotation_euler = (-4.0, 1.0, 1.0), (-2.0, 1.0, 3.0), (0.3, 0.0, 0.4)
    post = box("Post_0")
    post.data.materials.append(blue)
    for number in range(1, 4):
        other = bpy.data.objects.new(f"Post_{number}", post.data)
        other.location, other.scale = (2.5 * number, -3.0, 1.0), (0.2, 0.2, 2.0 * (-1) ** number)
        scene.collection.objects.link(other)
    group = bpy.data.collections.new("Kit")
    inside = box("KitBox", link=False)
    inside.location, inside.rotation_euler = (0.0, 1.5, 0.0), (0.0, 0.5, 0.0)
    inside.data.materials.append(red)
    group.objects.link(inside)
    for number in range(2):
        empty = bpy.data.objects.new(f"KitUse_{number}", None)
        empty.instance_type, empty.instance_collection = "COLLECTION", group
        empty.location, empty.rotation_euler = (-3.0, -4.0 - 3 * number, 0.5), (0.0, 0.0, 0.6 * number)
        scene.collection.objects.link(empty)
    build_camera(frames)
    sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
    sun.rotation_euler, sun.data.energy = (0.6, 0.2, 1.1), 4.0
    scene.collection.objects.link(sun)


def build_camera(frames: int) -> None:
    """Add a 24 mm camera with a shift on a turned, moving rig, and the frame range."""
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
    scene.frame_start, scene.frame_end, scene.render.fps = 1, frames, 24
    rig = bpy.data.objects.new("Rig", None)
    rig.rotation_euler = (0.0, 0.0, 0.35)
    camera = bpy.data.objects.new("Drone", bpy.data.cameras.new("Drone"))
    camera.data.lens, camera.data.sensor_width, camera.data.shift_x, camera.data.shift_y = 24.0, 36.0, 0.05, -0.03
    camera.location = (2.0, -16.0, 7.0)
    camera.rotation_euler = (math.radians(68.0), 0.0, math.radians(5.0))
    camera.parent = rig
    for thing in (rig, camera):
        scene.collection.objects.link(thing)
    scene.camera = camera
    if frames > 1:
        for frame, x in ((1, 0.0), (frames, 8.0)):
            rig.location.x = x
            rig.keyframe_insert("location", frame=frame)


def measure(frames: int) -> dict[str, Any]:
    """Ask Blender for areas, volume, bounds, poses, projections and the sun."""
    scene = bpy.context.scene
    graph = bpy.context.evaluated_depsgraph_get()
    areas: dict[str, float] = {}
    corners: list[list[float]] = []
    volume = 0.0
    for instance in graph.object_instances:
        thing = instance.object
        if thing.type != "MESH":
            continue
        matrix = instance.matrix_world.copy()
        mesh = thing.data
        mesh.calc_loop_triangles()
        sign = -1.0 if matrix.determinant() < 0 else 1.0
        for triangle in mesh.loop_triangles:
            a, b, c = (matrix @ mesh.vertices[row].co for row in triangle.vertices)
            used = mesh.materials[mesh.polygons[triangle.polygon_index].material_index].name
            areas[used] = areas.get(used, 0.0) + (b - a).cross(c - a).length / 2
            volume += sign * a.dot(b.cross(c)) / 6
            corners += [list(a), list(b), list(c)]
    poses, pixels = [], []
    for frame in range(1, frames + 1):
        scene.frame_set(frame)
        poses.append([list(row) for row in scene.camera.matrix_world])
        seen = (world_to_camera_view(scene, scene.camera, Vector(corner)) for corner in corners[::7])
        pixels.append([[view.x * WIDTH, (1.0 - view.y) * HEIGHT, view.z] for view in seen])
    towards = bpy.data.objects["Sun"].matrix_world.to_3x3() @ Vector((0.0, 0.0, 1.0))
    return {
        "areas": areas,
        "volume": volume,
        "corners": corners[::7],
        "poses": poses,
        "pixels": pixels,
        "low": [min(column) for column in zip(*corners, strict=True)],
        "high": [max(column) for column in zip(*corners, strict=True)],
        "sun": list(towards),
        "size": [WIDTH, HEIGHT],
    }


if __name__ == "__main__":
    main(json.loads(sys.argv[1]))
