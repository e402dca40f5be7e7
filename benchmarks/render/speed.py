"""Time the renderer beside others on one scene, judge its images for structure from motion, write the page.

Usage: python -m benchmarks.render.speed. Others take part where their Python is named: FALSEWORK_BPY_PYTHON (bpy) and
FALSEWORK_PYRENDER_PYTHON (an environment with `pyrender` and `numpy<2`).
"""

import os
import resource
import shutil
import tempfile
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

import authoring.exchange.blender
from benchmarks.page import write_page
from benchmarks.render.ask_peer import ask_peer
from benchmarks.render.frame_meter import WARM, FrameMeter, processor_time
from benchmarks.render.sfm_value import SfmValue, sfm_value
from benchmarks.render.speed_scene import CAMERA, IMAGES, SEED, SURVEY, VIEWS, author_bench, view_pairs
from benchmarks.speed_unit import slower, this_machine
from falsework.gallery.camera import EACH_FOR_ITSELF, seen_from
from falsework.platform import render_platform
from falsework.stages import STAGES
from groundwork.files import write_bytes
from groundwork.progress import SILENT
from render.capture import load_image, read_capture, read_truth
from render.detail.surveyed_scene import survey_scene
from render.frames import render_scene
from render.gpu.camera import visible_boxes
from render.gpu.gpu_scene import draw_boxes
from render.settings import RenderSettings
from usd_schemas.flat_scene import FlatScene, world_triangles
from usd_schemas.reading.scene_cache import load_scene

U8 = NDArray[np.uint8]

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGE = DOCS / "benchmarks" / "render.md"
PICTURE = DOCS / "images" / "bench_scene.jpg"
MEMORY = 1.0  # [GB] a worker
LIMITS = {"fast": (0.33, 5.0), "standard": (0.45, 3.5), "fine": (1.1, 0.0)}  # CPU-s an image, images a second
ENGINES = (
    ("Workbench", "BLENDER_WORKBENCH", 0),
    ("Cycles, 16 samples, denoised", "CYCLES", 16),
)
ROUNDS = 3  # surveys of each quality: a shared machine is a quarter slower in some minutes than in others
FRAMES = (5, 5, 20)  # peers render the first to warm up (Blender a small one); the slower of the others counts
BAR = {"close": (5000, 0.80), "global": (5000, 0.80), "under deck": (3000, 0.79)}  # keypoints, right share


@dataclass(frozen=True)
class Cost:
    """What an image costs.

    Attributes:
        name: Who rendered it.
        cpu: Processor time of all threads [s].
        wall: Waiting time [s].
        memory: Peak memory of one of its processes [GB]; 0 where not measured.
        once: Processor time of a survey that is independent of its number of images [s]; 0 where not measured.
    """

    name: str
    cpu: float
    wall: float
    memory: float = 0.0
    once: float = 0.0


def main() -> None:
    """Author the scene, measure everybody, and write the page."""
    with tempfile.TemporaryDirectory() as scratch:
        work = Path(scratch)
        (work / "stage").mkdir()
        layout = author_bench(work / "stage")
        scene = load_scene(work / "stage" / "scene.usda")
        ours: dict[str, list[Cost]] = {quality: [] for quality in LIMITS}
        peers = [*measure_blender(work), *measure_pyrender(work, scene)]
        for quality in ROUNDS * tuple(LIMITS):
            ours[quality].append(in_own_process(measure_ours, work, quality))
        pairs = view_pairs(layout)
        values, pictures = judge_views(work, scene, pairs)
        write_bytes(
            PICTURE, cv2.imencode(".jpg", np.hstack(pictures)[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 88])[1].tobytes()
        )
        write_page(PAGE, _page(scene, ours, peers, values), __file__)


def in_own_process(measure: Callable[[Path, str], Cost], work: Path, quality: str) -> Cost:
    """Measure one quality in a process that has no other children, whose memory would count too.

    Args:
        measure: What to call there.
        work: Its folder.
        quality: One of `LIMITS`.
    """
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        return pool.submit(measure, work, quality).result()


def measure_ours(work: Path, quality: str) -> Cost:
    """Render the survey, encoding included, and measure what its images cost once the first of them are drawn.

    Args:
        work: Folder with `stage`.
        quality: One of `LIMITS`.
    """
    folder = work / quality
    folder.mkdir()
    request = {
        "seed": SEED,
        "survey": SURVEY,
        "render": {"quality": quality},
        "drawing": {"workers": len(os.sched_getaffinity(0)), "encoders": 1},
    }
    meter = FrameMeter()
    STAGES["capture"].run(request, {"stage": work / "stage"}, folder, meter)
    count = len(read_capture(folder).images)
    if count != IMAGES:
        raise RuntimeError(f"{count} images were rendered, {IMAGES} were asked for")
    shutil.rmtree(folder)
    cpu, wall = meter.per_frame()
    memory = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * 1024 / 1e9
    return Cost(quality, cpu, wall, memory, processor_time() - count * cpu)


def measure_blender(work: Path) -> list[Cost]:
    """Let Blender's engines render the same stage, opened with the script that we ship.

    Args:
        work: Folder with `stage`.
    """
    python = os.environ.get("FALSEWORK_BPY_PYTHON", "")
    if not python:
        return []
    found = []
    for name, engine, samples in ENGINES:
        rows = ask_peer(
            python,
            "in_blender.py",
            work,
            {
                "script": str(Path(authoring.exchange.blender.__file__).parent),
                "scene": str(work / "stage" / "scene.usda"),
                "survey": SURVEY,
                "engine": engine,
                "samples": samples,
                "frames": FRAMES,
                "folder": str(work),
            },
        )
        slower_one = max(rows[1:], key=lambda row: row["cpu"])
        found.append(Cost(f"Blender {name}", slower_one["cpu"], slower_one["wall"], slower_one["memory"]))
    return found


def measure_pyrender(work: Path, scene: FlatScene) -> list[Cost]:
    """Let pyrender draw the same triangles, flat colors with shadows, no files written.

    Args:
        work: Folder for the exchange.
        scene: The scene.
    """
    python = os.environ.get("FALSEWORK_PYRENDER_PYTHON", "")
    if not python:
        return []
    corners, _, rows = world_triangles(scene)
    material = scene.draws.material[rows]
    order = np.argsort(material, kind="stable")  # one mesh a material: a mesh for each of all stones takes 20 GB
    used, start = np.unique(material[order], return_index=True)
    start = np.append(start, len(order))
    track = next(camera for camera in scene.cameras if camera.name.startswith(SURVEY))
    assert scene.sun is not None
    down = -np.array(scene.sun.direction)
    side = np.cross(down, [0.0, 1.0, 0.0])
    side /= np.linalg.norm(side)
    np.savez(
        work / "triangles.npz",
        corners=corners[order].astype(np.float32),
        start=start,
        color=np.array([scene.materials[row].base_color for row in used]),
        poses=track.poses,
        sun=np.column_stack([side, np.cross(-down, side), -down]),
        camera=[CAMERA.width, CAMERA.height, CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy],
    )
    found = ask_peer(python, "in_pyrender.py", work, {"scene": str(work / "triangles.npz"), "frames": FRAMES})
    slower_one = max(found[1:], key=lambda row: row["cpu"])
    return [Cost("pyrender, flat colors", slower_one["cpu"], slower_one["wall"])]


def triangles_in_view(scene: FlatScene) -> NDArray[np.int64]:
    """Count the triangles of each view of the survey, after culling and levels of detail, shape (N,), int64.

    Args:
        scene: The scene.
    """
    (product,) = (product for product in scene.products if product.name == SURVEY)
    surveyed = survey_scene(replace(scene, products=(product,)), RenderSettings().triangle_budget)
    lower, upper = draw_boxes(surveyed.scene)
    count = surveyed.scene.geometry.part_count[surveyed.scene.draws.part].astype(np.int64)
    seen = (visible_boxes(lower, upper, surveyed.camera, pose) for pose in surveyed.track.poses)
    return np.array([count[rows].sum() for rows in seen])


def judge_views(work: Path, scene: FlatScene, pairs: NDArray[np.float64]) -> tuple[dict[str, SfmValue], list[U8]]:
    """Photograph the views in `standard`, noise on, and judge the pairs.

    Args:
        work: Folder for the capture.
        scene: The scene.
        pairs: camera_to_world, shape (3, 2, 4, 4), float64.

    Returns:
        Figures by view, and the first picture of each, a third of its size.
    """
    folder = work / "views"
    folder.mkdir()
    settings = RenderSettings.model_validate({"quality": "standard", "sensor": EACH_FOR_ITSELF})
    render_scene(seen_from(scene, pairs.reshape(-1, 4, 4), CAMERA), folder, settings, SEED, SILENT)
    capture = read_capture(folder)
    truth = read_truth(capture)
    assert truth is not None
    values, pictures = {}, []
    for row, name in enumerate(VIEWS):
        images = (load_image(capture, 2 * row), load_image(capture, 2 * row + 1))
        values[name] = sfm_value(images, truth.depth(2 * row), (pairs[row, 0], pairs[row, 1]), CAMERA)
        pictures.append(cv2.resize(images[0], (640, 480), interpolation=cv2.INTER_AREA).astype(np.uint8))
    return values, pictures


def _missed(above: bool) -> str:
    return " (missed)" if above else ""


def _page(scene: FlatScene, ours: dict[str, list[Cost]], peers: list[Cost], values: dict[str, SfmValue]) -> str:
    triangles = int(scene.geometry.part_count[scene.draws.part].sum())
    cores, shown = len(os.sched_getaffinity(0)), triangles_in_view(scene)
    standard = min(cost.cpu for cost in ours["standard"])
    lines = [
        "# Speed and memory of the renderer, compared with other renderers",
        "",
        f"Written by `python -m benchmarks.render.speed`. {len(os.sched_getaffinity(0))} cores of {this_machine()},",
        f"{render_platform()['gl_renderer']}; {CAMERA.width} x {CAMERA.height} px. Processor time counts all threads.",
        f"The scene: {len(scene.instances):,} prims, {triangles:,} triangles with instances, look `weathered`; after "
        "culling and",
        f"levels of detail {int(np.median(shown)):,} of them in the median view of the survey, {shown.max():,} in the "
        "fullest.",
        "",
        "![Close, global, under the deck](../images/bench_scene.jpg)",
        "",
        "Ours: photograph with sensor noise, depth, labels and instances, encoded and written; what each of "
        f"{IMAGES - WARM}",
        f"images of a survey costs after the first {WARM}, what the survey costs once (scene, textures, light,",
        f"shadows, in each of its {cores} worker processes), and the most memory that one of them takes; the least of",
        f"{ROUNDS} surveys, and the greatest in brackets (of images per second, the most and the least), as others",
        "work on the same machine. Below them the others, scene, textures and shaders loaded (Blender's",
        f"`use_persistent_data` is on): the slower of {len(FRAMES) - 1} images after the first. Blender's EEVEE is "
        "not among them. Limits of time are scaled by our speed unit; that of `fine` is older than its edge samples.",
        "",
        "| renderer | processor [s per image] | limit | images per second | limit | times `standard` | once [s] "
        "| memory [GB] | limit |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    speed = slower("llvmpipe")
    for name, costs in ours.items():
        cpu, rate = LIMITS[name]
        least, greatest = (pick(cost.cpu for cost in costs) for pick in (min, max))
        quick, slow = (1 / pick(cost.wall for cost in costs) for pick in (min, max))
        lines.append(
            f"| Falsework `{name}` | {least:.2f} ({greatest:.2f}) | {cpu * speed:.2f}{_missed(least > cpu * speed)} "
            f"| {quick:.1f} ({slow:.1f}) | {f'{rate / speed:.1f}{_missed(quick < rate / speed)}' if rate else ''} "
            f"| {least / standard:.1f} | {min(cost.once for cost in costs):.0f} "
            f"| {(most := max(cost.memory for cost in costs)):.2f} | {MEMORY:.1f}{_missed(most > MEMORY)} |"
        )
    lines += [
        f"| {cost.name} | {cost.cpu:.1f} | | {1 / cost.wall:.2f} | | {cost.cpu / standard:.0f} | | "
        f"{f'{cost.memory:.2f}' if cost.memory else ''} | |"
        for cost in peers
    ]
    lines += [
        "",
        "What an image is worth to structure from motion (`standard`, noise on): keypoints of OpenCV's SIFT, matches",
        "to an image taken 0.6 m beside it (ratio 0.8), and the share of them within 1.5 px of the truth.",
        "",
        "| view | keypoints | limit | matches | right | limit |",
        "|---|---|---|---|---|---|",
    ]
    lines += [
        f"| {name} | {value.keypoints:,} | {BAR[name][0]:,} | {value.matches:,} | {value.right:.2f} | {BAR[name][1]} |"
        for name, value in values.items()
    ]
    return "\n".join([*lines, ""])


if __name__ == "__main__":
    main()
