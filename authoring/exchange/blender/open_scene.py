"""Runs inside Blender, with Blender's own packages only: opens a scene with the settings of its renders.

Blender reads neither render settings nor the frame rate of a stage. This script imports with the options that keep ids
and labels, and then sets frames per second, resolution, frame range and camera from the RenderProduct.

In Blender's text editor: open this file, set SCENE, run. Else: `blender --python open_scene.py -- SCENE [SURVEY]`.
"""

import contextlib
import sys
from pathlib import Path
from typing import Any

import bpy  # pyright: ignore[reportMissingImports]

SCENE = ""  # for the text editor: path of scene.usda

FRAMES_PER_SECOND = 24  # one time code is one image
SUN_STOPS = -2.0  # Blender makes a distant light of USD four times as strong as its sky; an exposure corrects this


def open_scene(scene: str, survey: str = "") -> None:
    """Import a scene and apply the settings of a survey.

    Args:
        scene: Path of `scene.usda`.
        survey: Name of the RenderProduct; the first when empty.
    """
    if bpy.context.scene.world is None:  # the sky needs one
        bpy.context.scene.world = bpy.data.worlds.new("World")
    bpy.ops.wm.usd_import(
        filepath=str(Path(scene).resolve()),
        property_import_mode="ALL",  # ids and labels arrive as custom properties
        support_scene_instancing=True,
        import_visible_only=True,
        import_textures_mode="IMPORT_PACK",
        mtl_name_collision_mode="MAKE_UNIQUE",
        set_frame_range=True,
        create_world_material=True,  # the sky
    )
    for lamp in bpy.data.lights:
        if lamp.type == "SUN" and hasattr(lamp, "exposure"):  # Blender 4.5 and later
            lamp.exposure += SUN_STOPS
    with contextlib.suppress(ImportError):  # without Blender's own USD library, only the import is done
        apply_product(bpy.context.scene, *read_product(scene, survey))
    for thing in bpy.context.scene.objects:
        number = thing.data.get("instanceId") if thing.data is not None else None
        if isinstance(number, int):
            thing.pass_index = number & 0x7FFF  # Blender's index passes have 15 bits


def apply_product(target: Any, camera: str, size: tuple[int, int], frames: tuple[int, int]) -> None:
    """Set up a Blender scene for a RenderProduct.

    Args:
        target: Blender scene.
        camera: Name of the camera.
        size: Width and height of the images [px].
        frames: First and last frame.
    """
    target.render.fps, target.render.fps_base = FRAMES_PER_SECOND, 1.0
    target.render.resolution_x, target.render.resolution_y = size
    target.render.resolution_percentage = 100
    target.render.pixel_aspect_x = target.render.pixel_aspect_y = 1.0
    target.frame_start, target.frame_end = frames
    target.frame_set(frames[0])
    if camera in target.objects:
        target.camera = target.objects[camera]


def read_product(scene: str, survey: str) -> tuple[str, tuple[int, int], tuple[int, int]]:
    """Read a RenderProduct with the USD library of Blender.

    Args:
        scene: Path of `scene.usda`.
        survey: Name of the RenderProduct; the first when empty.

    Returns:
        Name of the camera, width and height [px], first and last frame.

    Raises:
        ImportError: This Blender has no USD library for Python.
        ValueError: There is no such product.
    """
    inner = Path(bpy.utils.resource_path("LOCAL")) / f"python/lib/python{sys.version_info[0]}.{sys.version_info[1]}"
    if (inner / "site-packages/pxr").is_dir() and str(inner / "site-packages") not in sys.path:
        sys.path.append(str(inner / "site-packages"))
    from pxr import Usd, UsdRender

    stage = Usd.Stage.Open(str(scene), Usd.Stage.LoadNone)
    products = [UsdRender.Product(prim) for prim in stage.Traverse() if prim.IsA(UsdRender.Product)]
    chosen = [product for product in products if survey in ("", product.GetPrim().GetName())]
    if not chosen:
        raise ValueError(f"no RenderProduct {survey!r} in {scene}")
    width, height = chosen[0].GetResolutionAttr().Get()
    (camera,) = chosen[0].GetCameraRel().GetTargets()
    times = [time for op in Usd.Prim.GetAttributes(stage.GetPrimAtPath(camera)) for time in op.GetTimeSamples()]
    frames = (int(min(times)), int(max(times))) if times else (0, 0)
    return camera.name, (int(width), int(height)), frames


if __name__ == "__main__":
    words = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else [SCENE]
    open_scene(*words)
