"""Time real bridges of every family: geometry, layers and their export; writes `docs/benchmarks/bridges.md`."""

import os
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from authoring.axis.alignment import Layout
from authoring.families.bridge_settings import BridgeSettings, draw_layout
from authoring.families.registry import build_bridge
from authoring.layers.geometry import BRIDGE, geometry_layer
from authoring.layers.layer import export
from authoring.layers.semantics import semantics_layer
from authoring.shapes.component import F64, Component, Scatter
from authoring.streams import stream
from benchmarks.page import write_page
from benchmarks.speed_unit import slower, this_machine
from groundwork.errors import InputError
from groundwork.settings import parse_settings

PAGE = Path(__file__).resolve().parents[2] / "docs" / "benchmarks" / "bridges.md"
FAMILIES = ("slab", "beam", "girder", "arch", "suspension", "cable_stayed")
AXES: dict[str, dict[str, Any]] = {
    "straight": {"kind": "straight", "profile": "grade", "skew": 0.0},
    "curved": {"kind": "clothoid", "profile": "crest"},
}
LEAST_PARTS = 1_000
TARGET = 0.7  # [s] for 1,000 components on one core
REPEATS = 9
T = TypeVar("T")


@dataclass(frozen=True)
class Row:
    """What the bridges of one family took together.

    Attributes:
        family: Family.
        axis: Key of AXES.
        bridges: How many were built.
        parts: Their components.
        triangles: Their triangles.
        geometry: Time for the meshes [s].
        layers: Time for the geometry and semantics layers [s].
        export: Time to write both [s].
    """

    family: str
    axis: str
    bridges: int
    parts: int
    triangles: int
    geometry: float
    layers: float
    export: float

    @property
    def per_thousand(self) -> float:
        """Time for 1,000 components [s]."""
        return 1000.0 * (self.geometry + self.layers + self.export) / self.parts


def main() -> None:
    """Measure, and write the page."""
    rows = [
        measure(family, axis)
        for family in FAMILIES
        for axis in (("straight",) if family in ("arch", "suspension", "cable_stayed") else tuple(AXES))
    ]
    PAGE.parent.mkdir(parents=True, exist_ok=True)
    write_page(PAGE, _page(rows), __file__)


def measure(family: str, axis: str, least_parts: int = LEAST_PARTS) -> Row:
    """Time the bridges of the first seeds until they have enough components.

    Args:
        family: Family.
        axis: Key of AXES.
        least_parts: Components that are enough.
    """
    bridges, parts, triangles, seconds, seed = 0, 0, 0, np.zeros(3), 0
    while parts < least_parts:
        seed += 1
        values = {"family": family, "alignment": AXES[axis] if family in ("slab", "beam", "girder") else {}}
        settings = parse_settings(BridgeSettings, values, "benchmark")
        try:
            layout, drawn = draw_layout(settings, stream(seed, "bridge"))
        except InputError:
            continue  # this curve does not fit what was drawn
        build, pieces = _best(lambda layout=layout, drawn=drawn: build_bridge(_forgetful(layout), drawn, _level))
        write = _write(pieces)
        bridges, parts = bridges + 1, parts + len(pieces)
        triangles += sum(int((piece.mesh.face_counts - 2).sum()) for piece in pieces if isinstance(piece, Component))
        seconds += (build, *write)
    geometry, layers, exported = seconds.tolist()
    return Row(family, axis, bridges, parts, triangles, geometry, layers, exported)


def _write(pieces: tuple[Component | Scatter, ...]) -> tuple[float, float]:
    author, layers = _best(lambda: (geometry_layer(BRIDGE, pieces), semantics_layer(BRIDGE, pieces)))
    with tempfile.TemporaryDirectory() as scratch:
        paths = [Path(scratch) / f"{name}.usdc" for name in ("geometry", "semantics")]
        write, _ = _best(lambda: [export(layer, path) for layer, path in zip(layers, paths, strict=True)])
    return author, write


def _forgetful(layout: Layout) -> Layout:
    """Copy a layout without what its axis remembers of the stations that it was asked for."""
    return replace(layout, alignment=replace(layout.alignment))


def _level(xy: F64) -> F64:
    return np.zeros(len(xy))


def _best(work: Callable[[], T]) -> tuple[float, T]:
    """Time a piece of work: the least of a few times [s], on the processor's clock, and the last result."""
    seconds, results = [], []
    for _ in range(REPEATS):
        begin = time.process_time()
        results = [work()]
        seconds.append(time.process_time() - begin)
    return min(seconds), results[0]


def _page(rows: list[Row]) -> str:
    lines = [
        "# Real bridges: how long they take",
        "",
        f"Written by `make bench`. Processor time on one of {len(os.sched_getaffinity(0))} cores of {this_machine()},",
        f"the least of {REPEATS} runs; the bridges of the first seeds that have {LEAST_PARTS:,} components",
        "or more. Geometry is every mesh with normals and both UV sets; layers are the geometry and semantics layers",
        "in memory; export writes them. No textures. Curved: clothoid, arc, clothoid with a crest, skew as drawn.",
        "",
        "| family | axis | bridges | components | triangles | geometry [s] | layers [s] | export [s] "
        f"| for 1,000 components, at most {TARGET * slower('numpy'):.2g} [s] |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    lines += [
        f"| {row.family} | {row.axis} | {row.bridges} | {row.parts:,} | {row.triangles:,} | {row.geometry:.2f} "
        f"| {row.layers:.2f} | {row.export:.2f} | {row.per_thousand:.2f} |"
        for row in rows
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    main()
