"""Time the stage: author, export, open, switch and diff at three sizes, and write `docs/benchmarks/stage.md`."""

import os
import shutil
import tempfile
import time
from collections.abc import Callable
from itertools import cycle
from pathlib import Path
from typing import TypeVar

import numpy as np
from pxr import Sdf, Usd, Vt

from authoring.layers.bridge import bridge_layer, payload_layer
from authoring.layers.geometry import BRIDGE, geometry_layer, roles_of
from authoring.layers.layer import export, new_layer
from authoring.layers.looks import look_layer
from authoring.layers.root import bounds_of, edits_layer, root_layer
from authoring.layers.semantics import semantics_layer
from authoring.layers.worlds import WorldFiles
from authoring.looks.material import MaterialRecipe
from authoring.scenes.diff import diff_scenes
from authoring.shapes.component import Component, Mesh
from benchmarks.page import write_page
from benchmarks.speed_unit import slower, this_machine

PAGE = Path(__file__).resolve().parents[2] / "docs" / "benchmarks" / "stage.md"
SIZES = (100, 1_000, 2_000, 10_000)
TARGETS = {1_000: 0.7, 2_000: 1.5}  # [s] geometry, semantics and export on one core
TRIANGLES = 1_000_000
REPEATS = 3
SWITCHES = 20  # a millisecond is easily disturbed
T = TypeVar("T")
_FACES = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))
_NORMALS = ((0, 0, -1), (0, 0, 1), (0, -1, 0), (0, 1, 0), (-1, 0, 0), (1, 0, 0))


def main() -> None:
    """Measure, and write the page."""
    rows = [measure(size) for size in SIZES]
    PAGE.parent.mkdir(parents=True, exist_ok=True)
    write_page(PAGE, _page(rows, _large_mesh()), __file__)


def measure(count: int) -> dict[str, float]:
    """Author, write, open, switch and compare a bridge of boxes.

    Args:
        count: Number of components.

    Returns:
        Processor time of `author`, `export`, `open`, `switch_cpu` and `diff` [s], the wall time of
        `switch` [s], and the number of `components`.

    Raises:
        ValueError: The scene differs from its copy.
    """
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "a"
        pieces = tuple(_girder(number) for number in range(count))
        row = {"components": float(count)}
        row["author"], layers = _best(lambda: (geometry_layer(BRIDGE, pieces), semantics_layer(BRIDGE, pieces)))
        row["export"], _ = _best(lambda: _export(layers, folder))
        scene = _assemble(folder, pieces)
        row["open"], stage = _best(lambda: _open(scene))
        stage.SetEditTarget(stage.GetSessionLayer())
        looks = stage.GetPrimAtPath("/World/Bridge").GetVariantSet("look")
        names = cycle(("clean", "weathered"))
        row["switch_cpu"], _ = _best(lambda: looks.SetVariantSelection(next(names)), SWITCHES)
        row["switch"], _ = _best(lambda: looks.SetVariantSelection(next(names)), SWITCHES, time.perf_counter)
        other = Path(scratch) / "b"
        shutil.copytree(folder, other)
        row["diff"], found = _best(lambda: diff_scenes(scene, other / "scene.usda"))
        if not found.same:
            raise ValueError("a scene differs from its copy")
        return row


def _export(layers: tuple[Sdf.Layer, Sdf.Layer], folder: Path) -> None:
    for name, layer in zip(("geometry.usdc", "semantics.usda"), layers, strict=True):
        export(layer, folder / "bridge" / name)


def _best(
    work: Callable[[], T], repeats: int = REPEATS, clock: Callable[[], float] = time.process_time
) -> tuple[float, T]:
    """Time a piece of work: the least of a few times [s] on a clock, and the last result."""
    seconds, results = [], []
    for _ in range(repeats):
        begin = clock()
        results = [work()]
        seconds.append(clock() - begin)
    return min(seconds), results[0]


def _open(scene: Path) -> Usd.Stage:
    for layer in Sdf.Layer.GetLoadedLayers():
        if layer.realPath.startswith(str(scene.parent)):
            layer.Reload(force=True)  # from the disk, not from what the last opening left in memory
    return Usd.Stage.Open(str(scene))


def _assemble(folder: Path, pieces: tuple[Component, ...]) -> Path:
    for look, gray in (("weathered", 0.3), ("clean", 0.6)):
        recipes = {role: MaterialRecipe(role, color=(gray, gray, gray)) for role in roles_of(pieces)}
        export(look_layer(recipes), folder / f"bridge/looks/{look}/look.usda")
    export(payload_layer(), folder / "bridge/payload.usda")
    looks = {look: f"./looks/{look}/look.usda" for look in ("weathered", "clean")}
    export(bridge_layer("beam", (20.0,), 10.0, {}, looks), folder / "bridge/bridge.usda")
    site = new_layer("Site")
    Sdf.CreatePrimInLayer(site, "/Site").specifier = Sdf.SpecifierDef
    export(site, folder / "site/site.usda")
    for name in ("render.usda", "surveys/surveys.usda", "lighting.usda", "edits/user.usda"):
        export(edits_layer(), folder / name)
    export(root_layer("weathered", "none", {"none": WorldFiles("")}, 1, bounds_of(pieces)), folder / "scene.usda")
    return folder / "scene.usda"


def _girder(number: int) -> Component:
    unit = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], np.float64)
    points = unit * (18.0, 0.6, 1.2) + (20.0 * (number // 10), 1.5 * (number % 10), 5.0)
    corners = np.array(_FACES, np.int32).reshape(-1)
    normals = np.repeat(np.array(_NORMALS, np.float32), 4, axis=0)
    st = points[corners][:, :2].astype(np.float32)
    mesh = Mesh(points, np.full(6, 4, np.int32), corners, normals, st, (st - st.min()) / 1e4)
    name, role = f"Girder_{number:05d}", "Role_GirderConcrete"
    return Component(name, "concrete_girder", role, "Superstructure", mesh, number + 1, {"height": 1.2})


def _large_mesh() -> dict[str, float]:
    side = int(np.sqrt(TRIANGLES / 2))
    grid = np.stack(np.meshgrid(np.arange(side + 1.0), np.arange(side + 1.0)), axis=-1).reshape(-1, 2)
    points = np.column_stack([grid * 0.1, np.sin(grid[:, 0] / 9)])
    first = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).reshape(-1)
    quads = np.stack([first, first + 1, first + side + 2, first + side + 1], axis=1)
    corners = quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1).astype(np.int32)
    with tempfile.TemporaryDirectory() as scratch:
        layer = new_layer("Big")
        spec = Sdf.CreatePrimInLayer(layer, "/Big")
        spec.specifier, spec.typeName = Sdf.SpecifierDef, "Mesh"
        kinds = Sdf.ValueTypeNames
        for name, kind, value in (
            ("points", kinds.Point3fArray, Vt.Vec3fArray.FromNumpy(points.astype(np.float32))),
            ("faceVertexCounts", kinds.IntArray, Vt.IntArray.FromNumpy(np.full(len(corners) // 3, 3, np.int32))),
            ("faceVertexIndices", kinds.IntArray, Vt.IntArray.FromNumpy(corners)),
        ):
            Sdf.AttributeSpec(spec, name, kind).default = value
        save, _ = _best(lambda: export(layer, Path(scratch) / "big.usdc"))
        read, _ = _best(lambda: _open(Path(scratch) / "big.usdc"))
        return {"triangles": float(len(corners) // 3), "save": save, "open": read}


def _page(rows: list[dict[str, float]], large: dict[str, float]) -> str:
    lines = [
        "# The stage: how long it takes",
        "",
        f"Written by `make bench`. Processor time on one of {len(os.sched_getaffinity(0))} cores of {this_machine()},",
        f"the least of {REPEATS} runs. Components are boxes with two UV sets, labels and parameters; no textures.",
        "Switching a look shows the time that somebody waits, and beside it that of the processors.",
        "",
        "| components | author [s] | export [s] | both, at most [s] | open [s] | switch a look [ms] | processor [ms] "
        "| diff [s] |",
        "|---|---|---|---|---|---|---|---|",
    ]
    speed = slower("numpy")
    for row in rows:
        count = int(row["components"])
        target = TARGETS.get(count)
        held = "" if target is None else f"{target * speed:.2g}"
        lines.append(
            f"| {count:,} | {row['author']:.2f} | {row['export']:.2f} | {held} "
            f"| {row['open']:.3f} | {1000 * row['switch']:.1f} | {1000 * row['switch_cpu']:.1f} | {row['diff']:.2f} |"
        )
    lines += [
        "",
        f"One mesh of {large['triangles'] / 1e6:.1f} million triangles: saved in {large['save']:.2f} s, opened in "
        f"{large['open']:.3f} s (at most {0.5 * speed:.2g} s each).",
        "",
        "Another look composes every prim below the bridge anew, on all cores at once (aim: at most "
        f"{5 * speed:.2g} ms for 1,000 components). The variant set stands on the bridge, where a DCC looks for it.",
        "",
    ]
    return "\n".join(lines)
