"""What a training step costs, ours beside the usual implementations of the same networks, in processor seconds.

Usage: python -m benchmarks.learn.step [--yanx27 CHECKOUT] [--open3d-python PYTHON] [--steps N]

CHECKOUT is a clone of yanx27/Pointnet_Pointnet2_pytorch, PYTHON one that has open3d-cpu and what Open3D-ML imports; who
is not named has dashes. The ways take turns, one step each a round, in one thread, so that whatever else the
machine does falls on all of them alike. Writes `docs/benchmarks/learn.md`.
"""

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.page import write_page

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "benchmarks" / "learn.md"
SIZES = {
    "pointnet2-ssg": (8, 4096, 9, 13),
    "pointnet2-msg": (8, 4096, 9, 13),
    "pointnext-s": (8, 4096, 9, 13),
    "pointnext-b": (8, 4096, 9, 13),
    "randlanet": (1, 65_536, 6, 17),
}
"""Of each network: clouds of a step, points of a cloud, inputs, classes."""


@dataclass(frozen=True)
class Cost:
    """What steps cost.

    Attributes:
        name: Which way.
        geometry: Processor seconds for the neighborhoods of a step, by step [s].
        step: Processor seconds for forward pass, backward pass and the optimizer, by step [s].
    """

    name: str
    geometry: tuple[float, ...]
    step: tuple[float, ...]

    @property
    def whole(self) -> float:
        """Median of both together [s]."""
        return float(np.median(np.add(self.geometry, self.step)))


def main() -> None:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--yanx27", type=Path)
    parser.add_argument("--commit", default="", help="of CHECKOUT, where it is no clone")
    parser.add_argument("--open3d-python", type=Path)
    parser.add_argument("--steps", type=int, default=5)
    chosen = parser.parse_args()
    load = os.getloadavg()[1]
    ways: dict[str, Callable[[], dict[str, list[float]]]] = {
        name: (lambda name=name: _child([sys.executable, "-m", "benchmarks.learn.step_child", name]))
        for name in [*SIZES, "pointnet2-ssg bf16"]
    }
    script = str(ROOT / "benchmarks" / "peers" / "in_learning.py")
    if chosen.yanx27:
        ways["yanx27"] = lambda: _child([sys.executable, script, "yanx27", str(chosen.yanx27), "1"])
    if chosen.open3d_python:
        ways["open3d"] = lambda: _child([str(chosen.open3d_python), script, "open3d", "-", "1"])
    costs = take_turns(ways, chosen.steps)
    commit = chosen.commit or (_commit(chosen.yanx27) if chosen.yanx27 else "")
    write_page(PAGE, page(costs, chosen.steps, load, commit), __file__)


def take_turns(ways: dict[str, Callable[[], dict[str, list[float]]]], rounds: int) -> dict[str, Cost]:
    """Let every way make its steps in turn, round after round.

    Args:
        ways: What makes some steps, and gives the processor seconds of each.
        rounds: How often.
    """
    found: dict[str, list[tuple[float, float]]] = {name: [] for name in ways}
    for _ in range(rounds):
        for name, way in ways.items():
            cost = way()
            found[name] += zip(cost["geometry"], cost["step"], strict=True)
    return {name: Cost(name, *(tuple(column) for column in zip(*rows, strict=True))) for name, rows in found.items()}


def page(costs: dict[str, Cost], rounds: int, load: float, commit: str) -> str:
    """Write the tables.

    Args:
        costs: Of `take_turns`.
        rounds: Steps of each way.
        load: Load of the machine when it began.
        commit: Of the checkout of yanx27, or empty.
    """
    ours, bf16, randla = costs["pointnet2-ssg"], costs["pointnet2-ssg bf16"], costs["randlanet"]
    lines = [
        "# What a training step costs",
        "",
        f"Processor seconds of one thread, medians of {rounds} steps. The ways took turns, so that ratios hold though",
        f"the seconds themselves depend on what else the machine did (load {load:.0f} on {os.cpu_count()} cores when",
        "this began). `python -m benchmarks.learn.step` writes this page. *Geometry* is what the loader searches",
        "(farthest points, balls, nearest neighbors), *step* is forward pass, backward pass and optimizer.",
        "Goals: yanx27's step takes at least 5 times as much as ours, and that of Open3D-ML at least 1.25 times.",
        "",
        "| PointNet++ SSG, 8 clouds of 4,096 points | geometry | step | together | ratio |",
        "|---|---|---|---|---|",
        _row("ours", ours, ours),
        _row("ours, bf16", bf16, ours),
        _row(f"yanx27 at {commit[:10]}, searches inside the step", costs.get("yanx27"), ours),
        "",
        "| RandLA-Net, five layers, 65,536 points | geometry | step | together | ratio |",
        "|---|---|---|---|---|",
        _row("ours", randla, randla),
        _row("Open3D-ML of open3d-cpu", costs.get("open3d"), randla),
        "",
        "What a loader process has to do for each second of training on one thread: below 1, one process keeps up.",
        "",
        "| network | clouds x points | geometry | step | loader's share |",
        "|---|---|---|---|---|",
        *(_share(costs[name], *SIZES[name][:2]) for name in SIZES),
        "",
    ]
    return "\n".join(lines)


def _row(name: str, cost: Cost | None, ours: Cost) -> str:
    if cost is None:
        return f"| {name} | – | – | – | – |"
    cells = [float(np.median(cost.geometry)), float(np.median(cost.step)), cost.whole]
    return f"| {name} | " + " | ".join(f"{cell:.2f} s" for cell in cells) + f" | {cost.whole / ours.whole:.2f} |"


def _share(cost: Cost, clouds: int, points: int) -> str:
    search, step = float(np.median(cost.geometry)), float(np.median(cost.step))
    return f"| {cost.name} | {clouds} x {points:,} | {search:.3f} s | {step:.2f} s | {search / step:.2f} |"


def _child(command: Sequence[str]) -> dict[str, list[float]]:
    """Run one way in a process of its own, with one thread."""
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"{' '.join(command)} failed:\n{done.stderr[-2000:]}")
    found: dict[str, list[float]] = json.loads(done.stdout.strip().splitlines()[-1])
    return found


def _commit(checkout: Path) -> str:
    done = subprocess.run(["git", "rev-parse", "HEAD"], cwd=checkout, capture_output=True, text=True, check=False)
    return done.stdout.strip() if not done.returncode else "an unknown commit"


def our_steps(name: str, steps: int, *, bf16: bool = False) -> dict[str, list[float]]:
    """Time training steps of one of our networks.

    Args:
        name: Row of `SIZES`.
        steps: How many, after one that is not counted.
        bf16: Whether the step is computed in bfloat16 where torch deems that safe.
    """
    import torch

    from learn.models.backbone import batched, geometry_of
    from learn.models.registry import build_network

    torch.set_num_threads(1)
    torch.manual_seed(0)
    clouds, points, inputs, classes = SIZES[name]
    network: Any = build_network(name, {}, inputs, classes)
    optimizer = torch.optim.Adam(network.parameters(), lr=1e-3)
    rng = np.random.default_rng(0)
    searched, taken = [], []
    for _ in range(steps + 1):
        features = rng.random((clouds, points, inputs)).astype(np.float32)
        labels = torch.from_numpy(rng.integers(0, classes, clouds * points))
        begun = time.process_time()
        geometry = batched([geometry_of(network, cloud[:, :3].copy()) for cloud in features])
        searched.append(time.process_time() - begun)
        begun = time.process_time()
        optimizer.zero_grad()
        with torch.autocast("cpu", torch.bfloat16, enabled=bf16):
            found = network(torch.from_numpy(features), geometry)
        torch.nn.functional.cross_entropy(found.float().flatten(0, 1), labels).backward()
        optimizer.step()
        taken.append(time.process_time() - begun)
    return {"geometry": searched[1:], "step": taken[1:]}


if __name__ == "__main__":
    main()
