"""Compare the light of the renderer with that of Cycles: the same stage, linear radiance before the sensor.

Usage: FALSEWORK_BPY_PYTHON=PYTHON python -m benchmarks.render.light WORK, where PYTHON has `bpy`. WORK keeps the stage
and what Cycles drew, so that a second call only measures ours anew. Writes `docs/benchmarks/light.md`.
"""

import argparse
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

import authoring.exchange.blender
from authoring.axis.alignment import Layout
from authoring.families.bridge_settings import draw_layout
from authoring.scene import author_scene
from authoring.settings import AuthoringSettings
from authoring.streams import stream
from benchmarks.page import write_page
from benchmarks.render.ask_peer import ask_peer
from benchmarks.speed_unit import this_machine
from falsework.gallery.camera import seen_from
from groundwork.files import write_bytes
from groundwork.progress import SILENT
from groundwork.settings import parse_settings
from render.gpu.context import open_context
from render.light.illumination import BRIGHTEST
from render.settings import RenderSettings
from render.views.prepare import Prepared, prepare
from usd_schemas.components import BACKGROUND, class_rows
from usd_schemas.flat_scene import Detail, FlatScene, world_triangles
from usd_schemas.pinhole import Pinhole, look_at
from usd_schemas.raycast import RayScene
from usd_schemas.reading.scene_cache import load_scene

B = NDArray[np.bool_]
F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGE, PICTURE = DOCS / "benchmarks" / "light.md", DOCS / "images" / "bench_light.jpg"
SEED, SAMPLES, BOUNCES = 7, 64, 4
CAMERA = Pinhole(320, 240, 320 * 24 / 36, 320 * 24 / 36, 160.0, 120.0)
NEAR = 0.1  # [m]
RECIPE: dict[str, object] = {
    "bridge": {
        "family": "girder",
        "service": "road",
        "alignment": {"kind": "straight", "skew": 0},
        "girder": {"spans": [30.0] * 3},
    },
    "site": {"crossing": "river"},
    "background": {"name": "countryside"},
    "look": {"name": "clean"},
    "survey": [{"kind": "global", "images": 8, "spacing": 50.0}],
}
VIEWS = ("beside", "other side", "far", "under deck", "along the soffit", "at the abutment")
REGIONS = ("shaded soffit", "shaded face", "sunlit face", "sunlit grass", "shaded ground", "sky")
FEWEST = 150  # pixels of a region that count
WITHIN = 0.15  # of Cycles
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
_RIM = 2  # [px] beside another surface: there a pixel shows both
_LIFT = 0.02  # [m]


@dataclass(frozen=True)
class Seen:
    """One view of ours.

    Attributes:
        light: Linear radiance [1], shape (H, W, 3), float32.
        regions: Where each of `REGIONS` is, shape (H, W), bool.
    """

    light: F32
    regions: Mapping[str, B]


def main() -> None:
    """Author the scene, let both draw it, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("work", type=Path)
    work: Path = parser.parse_args().work
    settings = parse_settings(AuthoringSettings, RECIPE, "benchmark")
    if not (work / "stage" / "scene.usda").is_file():
        (work / "stage").mkdir(parents=True)
        author_scene(settings, SEED, work / "stage", SILENT)
    poses = view_poses(draw_layout(settings.bridge, stream(SEED, "bridge"))[0])
    ours = draw_ours(load_scene(work / "stage" / "scene.usda"), poses)
    theirs = draw_cycles(work, poses)
    pictures = [np.hstack([_shown(seen.light), _shown(other)]) for seen, other in zip(ours, theirs, strict=True)]
    rows = [np.hstack(pictures[first : first + 2]) for first in range(0, len(pictures), 2)]
    write_bytes(PICTURE, cv2.imencode(".jpg", np.vstack(rows)[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 88])[1].tobytes())
    write_page(PAGE, page(ours, theirs), __file__)


def view_poses(layout: Layout) -> F64:
    """Place a camera for each of `VIEWS`.

    Args:
        layout: The bridge.

    Returns:
        camera_to_world, shape (6, 4, 4), float64.
    """
    pier, end, width, depth = layout.supports[1], layout.supports[0], layout.width, layout.depth

    def at(along: float, left: float, above: float) -> F64:
        return layout.alignment.point(np.array([along]), np.array([left]), np.array([above]))[0]

    places = (
        (at(pier - 12.0, -0.5 * width - 14.0, -depth), at(pier + 2.0, 0.0, -depth - 2.0)),
        (at(pier + 14.0, 0.5 * width + 16.0, -depth), at(pier - 2.0, 0.0, -depth - 2.0)),
        (at(pier - 40.0, -0.5 * width - 40.0, 8.0), at(pier + 10.0, 0.0, -depth)),
        (at(pier - 10.0, -0.3 * width, -depth - 3.0), at(pier, 0.1 * width, -depth - 1.5)),
        (at(pier + 3.0, 0.4 * width, -depth - 2.5), at(pier + 20.0, -0.2 * width, -depth)),
        (at(end + 14.0, 0.5 * width + 6.0, -depth - 2.0), at(end, 0.0, -depth - 1.0)),
    )
    return np.array([look_at(eye, target) for eye, target in places])


def draw_ours(scene: FlatScene, poses: F64) -> list[Seen]:
    """Draw the views in `standard`, without haze, and find the regions.

    Args:
        scene: The scene.
        poses: camera_to_world, shape (V, 4, 4), float64.
    """
    settings = RenderSettings.model_validate({"quality": "standard", "normals": True, "haze_distance": 1e7})
    plain = tuple(replace(material, detail=Detail()) for material in scene.materials)  # Blender has none of it
    scene = replace(seen_from(scene, poses, CAMERA), materials=plain)
    corners = world_triangles(scene)[0]
    rays = RayScene(corners, np.zeros(len(corners), np.uint32))
    gl = open_context(settings.device)
    try:
        prepared = prepare(gl, scene, settings, SILENT)
        painter = prepared.painter(CAMERA, sharp=True)
        found = []
        for pose in poses:
            view = painter.draw(pose, NEAR)
            assert view.normal is not None
            light = ((view.code / 65535.0) ** 2 * BRIGHTEST).astype(np.float32)
            found.append(Seen(light, _regions(scene, rays, prepared, pose, (view.draw, view.depth, view.normal))))
        return found
    finally:
        gl.close()


def draw_cycles(work: Path, poses: F64) -> list[F32]:
    """Let Cycles draw the views, unless it has.

    Args:
        work: Folder with `stage`.
        poses: camera_to_world, shape (V, 4, 4), float64.

    Returns:
        Linear radiance [1], shape (H, W, 3), float32 each.

    Raises:
        SystemExit: Cycles has not drawn them yet, and no Python with it is named.
    """
    answer = work / "answer.json"
    if answer.is_file():
        return [np.load(file) for file in json.loads(answer.read_text(encoding="utf-8"))]
    python = os.environ.get("FALSEWORK_BPY_PYTHON", "")
    if not python:
        raise SystemExit("benchmarks.render.light: name a Python that has bpy in FALSEWORK_BPY_PYTHON")
    request = {
        "script": str(Path(authoring.exchange.blender.__file__).parent),
        "scene": str(work / "stage" / "scene.usda"),
        "poses": poses.tolist(),
        "width": CAMERA.width,
        "height": CAMERA.height,
        "focal": CAMERA.fx,
        "samples": SAMPLES,
        "bounces": BOUNCES,
        "folder": str(work),
    }
    return [np.load(file) for file in ask_peer(python, "light_in_blender.py", work, request)]


def _regions(
    scene: FlatScene, rays: RayScene, prepared: Prepared, pose: F64, seen: tuple[NDArray[np.uint32], F32, F32]
) -> dict[str, B]:
    """Find each of `REGIONS`: by class and normal, and by rays to the sun."""
    draw, depth, coded = seen
    row = np.maximum(draw.astype(np.int64) - 1, 0)
    normal = coded[..., :3].astype(np.float64)
    bridge = (scene.draws.label[row] != class_rows()[BACKGROUND].id) & (draw > 0)
    kinds = {instance.id: instance.component for instance in scene.instances}
    kind = np.array([kinds.get(int(number), "") for number in scene.draws.instance])[row]
    ground = np.isin(kind, ("ground", "embankment")) & (draw > 0)
    lit = _sunlit(rays, prepared, pose, depth.astype(np.float64), normal) & (draw > 0)
    upright = np.abs(normal[..., 2]) < 0.3
    regions = {
        "shaded soffit": bridge & (normal[..., 2] < -0.8),
        "shaded face": bridge & upright & ~lit,
        "sunlit face": bridge & upright & lit,
        "sunlit grass": ground & lit,
        "shaded ground": ground & ~lit,
        "sky": draw == 0,
    }
    square = np.ones((2 * _RIM + 1, 2 * _RIM + 1), np.uint8)
    low, high = (method(draw.astype(np.float32), square) for method in (cv2.erode, cv2.dilate))
    one = low == high  # a single draw all around
    return {name: mask & one for name, mask in regions.items()}


def _sunlit(rays: RayScene, prepared: Prepared, pose: F64, depth: F64, normal: F64) -> B:
    """Find what the sun's rays reach, shape (H, W), bool."""
    sun = np.asarray(prepared.light.daylight.sun_direction, np.float64)
    v, u = np.mgrid[0 : CAMERA.height, 0 : CAMERA.width] + 0.5
    way = np.stack([(u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy, np.ones_like(u)], axis=-1)
    point = pose[:3, 3] + (way * np.where(np.isfinite(depth), depth, 0.0)[..., None]) @ pose[:3, :3].T
    start = (point + _LIFT * normal).reshape(-1, 3)
    distance = rays.cast(start, np.broadcast_to(sun, start.shape))[0].reshape(depth.shape)
    return ~np.isfinite(distance) & (normal @ sun > 0.05)


def _shown(light: F32) -> NDArray[np.uint8]:
    coded = np.clip(light, 0, 1) ** (1 / 2.2)
    return np.rint(coded * 255).astype(np.uint8)


def page(ours: list[Seen], theirs: list[F32]) -> str:
    """Write the page.

    Args:
        ours: Views of ours.
        theirs: The same views of Cycles, linear radiance [1], shape (H, W, 3), float32 each.
    """
    lines = [
        "# Light beside Cycles",
        "",
        f"Written by `python -m benchmarks.render.light WORK`, on {len(os.sched_getaffinity(0))} cores of",
        f"{this_machine()}. A girder bridge of three spans in the `countryside`, seen from six places, "
        f"{CAMERA.width} x {CAMERA.height} px.",
        "The same stage is opened in Blender with the script that we ship. Both give linear radiance, before any",
        "sensor or film; ours in `standard` without haze and without fine detail, Cycles with "
        f"{SAMPLES} samples a pixel and",
        f"{BOUNCES} bounces. The bridge is new: what weather does to it as a whole is detail too, which Blender does "
        "not",
        "know. No region holds water, whose mirror is our own.",
        "",
        "Each figure is our mean luminance of a region over that of Cycles. Where it does not lie between "
        f"{1 - WITHIN:.2f} and",
        f"{1 + WITHIN:.2f} it is **bold**. Regions of fewer than {FEWEST} pixels are left out.",
        "",
        "![Ours and Cycles side by side, two views a row](../images/bench_light.jpg)",
        "",
        f"| view | {' | '.join(REGIONS)} |",
        f"|---|{'---|' * len(REGIONS)}",
    ]
    every: dict[str, list[tuple[float, float, int]]] = {name: [] for name in REGIONS}
    for name, seen, other in zip(VIEWS, ours, theirs, strict=True):
        cells = []
        for region in REGIONS:
            mask = seen.regions[region]
            if mask.sum() < FEWEST:
                cells.append("")
                continue
            pair = (float((light[mask] @ LUMINANCE).mean()) for light in (seen.light, other))
            one, two = pair
            every[region].append((one, two, int(mask.sum())))
            cells.append(_ratio(one / two))
        lines.append(f"| {name} | {' | '.join(cells)} |")
    means = []
    for rows in every.values():
        sums = np.array([(one * count, two * count) for one, two, count in rows]).sum(axis=0) if rows else None
        means.append("" if sums is None else _ratio(float(sums[0] / sums[1])))
    lines += [f"| all | {' | '.join(means)} |", ""]
    return "\n".join(lines)


def _ratio(value: float) -> str:
    return f"{value:.2f}" if abs(value - 1.0) <= WITHIN else f"**{value:.2f}**"


if __name__ == "__main__":
    main()
