"""The renderer compared with others where culling and levels of detail hide nothing: one surface in every image.

Usage: python -m benchmarks.render.in_view. Others take part where their Python is named: FALSEWORK_BPY_PYTHON and
FALSEWORK_PYRENDER_PYTHON, as for `benchmarks.render.speed`. Writes `docs/benchmarks/in_view.md`.
"""

import os
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdRender, UsdShade, Vt

from benchmarks.page import write_page
from benchmarks.render.speed import (
    Cost,
    in_own_process,
    measure_blender,
    measure_ours,
    measure_pyrender,
    triangles_in_view,
)
from benchmarks.render.speed_scene import CAMERA, IMAGES, SURVEY
from benchmarks.speed_unit import this_machine
from usd_schemas.pinhole import look_at
from usd_schemas.reading.scene_cache import load_scene

F64 = NDArray[np.float64]

PAGE = Path(__file__).resolve().parents[2] / "docs" / "benchmarks" / "in_view.md"
SIDES = (1000, 500)  # quads of the surface: a million triangles
EXTENT = (80.0, 60.0)  # [m]
WAVES, STEEPNESS = 24, 0.02  # of the surface; height of a wave over its length [1]
HEIGHT, SWAY = 70.0, 1.5  # [m] of the camera over the surface, and how far it moves: all of it stays in view
QUALITIES = ("fast", "standard", "fine")


def surface() -> tuple[F64, NDArray[np.int32]]:
    """Make a rough surface.

    Returns:
        Points [m], shape (N, 3), float64; the corners of its quads, shape (Q, 4), int32.
    """
    rng = np.random.default_rng(0)
    x, y = np.meshgrid(*(np.linspace(-0.5, 0.5, n + 1) * size for n, size in zip(SIDES, EXTENT, strict=True)))
    z = np.zeros_like(x)
    for _ in range(WAVES):
        length, heading, phase = np.exp(rng.uniform(np.log(0.6), np.log(20.0))), *rng.uniform(0.0, 2.0 * np.pi, 2)
        z += STEEPNESS * length * np.sin(2 * np.pi * (np.cos(heading) * x + np.sin(heading) * y) / length + phase)
    rows = np.arange(x.size).reshape(x.shape)
    quads = np.stack([rows[:-1, :-1], rows[:-1, 1:], rows[1:, 1:], rows[1:, :-1]], axis=-1)
    return np.stack([x, y, z], axis=-1).reshape(-1, 3), quads.reshape(-1, 4).astype(np.int32)


def write_stage(path: Path) -> None:
    """Write the surface, a sun, a sky and a camera that looks down on all of it.

    Args:
        path: The stage.
    """
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetTimeCodesPerSecond(24)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
    points, quads = surface()
    mesh = UsdGeom.Mesh.Define(stage, "/World/Surface")
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points.astype(np.float32)))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(quads), 4, np.int32)))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(quads.ravel()))
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateExtentAttr([Gf.Vec3f(*points.min(axis=0).tolist()), Gf.Vec3f(*points.max(axis=0).tolist())])
    material = UsdShade.Material.Define(stage, "/World/Gray")
    shader = UsdShade.Shader.Define(stage, "/World/Gray/Shader")
    shader.CreateIdAttr("UsdPreviewSurface")
    shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set(Gf.Vec3f(0.4, 0.38, 0.35))
    shader.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(0.8)
    material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)
    UsdLux.DomeLight.Define(stage, "/World/Sky").CreateIntensityAttr(1.0)
    sun = UsdLux.DistantLight.Define(stage, "/World/Sun")
    sun.CreateIntensityAttr(4.0)
    sun.CreateNormalizeAttr(True)
    UsdGeom.XformCommonAPI(sun).SetRotate(Gf.Vec3f(55.0, 20.0, 0.0))
    camera = UsdGeom.Camera.Define(stage, f"/World/{SURVEY}")
    camera.CreateFocalLengthAttr(0.24)
    camera.CreateHorizontalApertureAttr(0.36)
    camera.CreateVerticalApertureAttr(0.36 * CAMERA.height / CAMERA.width)
    placed = camera.AddTransformOp()
    for image in range(IMAGES):
        eye = np.array([SWAY * (2.0 * image / (IMAGES - 1) - 1.0), 0.0, HEIGHT])
        pose = look_at(eye, eye * [1.0, 1.0, 0.0], np.array([0.0, 1.0, 0.0])) @ np.diag([1.0, -1.0, -1.0, 1.0])
        placed.Set(Gf.Matrix4d(*pose.T.ravel().tolist()), image)
    product = UsdRender.Product.Define(stage, f"/Render/{SURVEY}")
    product.CreateResolutionAttr(Gf.Vec2i(CAMERA.width, CAMERA.height))
    product.CreateCameraRel().SetTargets([camera.GetPath()])
    stage.SetStartTimeCode(0)
    stage.SetEndTimeCode(IMAGES - 1)
    stage.Save()


def page(ours: list[Cost], peers: list[Cost], triangles: int) -> str:
    """Write the table.

    Args:
        ours: What an image costs in each quality.
        peers: What it costs others.
        triangles: How many are in view.
    """
    standard = next(cost.cpu for cost in ours if cost.name == "standard")
    return "\n".join(
        [
            "# All triangles in view",
            "",
            f"Written by `python -m benchmarks.render.in_view`. {len(os.sched_getaffinity(0))} cores of",
            f"{this_machine()}, {CAMERA.width} x {CAMERA.height} px.",
            f"One rough surface of {triangles:,} triangles without a texture, seen from {HEIGHT:.0f} m above: no image",
            "hides any of it, and nothing can be drawn with fewer. What is counted is as in",
            "[the renderer beside others](render.md): ours writes photograph, depth, labels and instances.",
            "",
            "| renderer | processor [s an image] | images a second | times `standard` | once [s] |",
            "|---|---|---|---|---|",
            *(
                f"| Falsework `{cost.name}` | {cost.cpu:.2f} | {1 / cost.wall:.1f} | {cost.cpu / standard:.1f} "
                f"| {cost.once:.0f} |"
                for cost in ours
            ),
            *(
                f"| {cost.name} | {cost.cpu:.1f} | {1 / cost.wall:.2f} | {cost.cpu / standard:.1f} | |"
                for cost in peers
            ),
            "",
        ]
    )


def main() -> None:
    """Write the stage, measure everybody, and write the page."""
    with tempfile.TemporaryDirectory() as scratch:
        work = Path(scratch)
        (work / "stage").mkdir()
        write_stage(work / "stage" / "scene.usda")
        scene = load_scene(work / "stage" / "scene.usda")
        seen = triangles_in_view(scene)
        if seen.min() < 2 * SIDES[0] * SIDES[1]:
            raise RuntimeError(f"{seen.min()} triangles in view, {2 * SIDES[0] * SIDES[1]} were authored")
        peers = [*measure_blender(work), *measure_pyrender(work, scene)]
        ours = [in_own_process(measure_ours, work, quality) for quality in QUALITIES]
        write_page(PAGE, page(ours, peers, int(seen.min())), __file__)


if __name__ == "__main__":
    main()
