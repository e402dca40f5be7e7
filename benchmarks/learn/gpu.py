"""Seconds of an epoch on a GPU, for the sizes of the paper's data sets.

Usage: python -m benchmarks.learn.gpu, on a machine with a GPU that torch can use.

Each network is trained as `falsework train` does, on made up clouds that as many loader processes draw as there are
cores. Neighborhoods of small clouds are searched by the GPU, a batch at once, those of large ones by the loader. The
first epoch warms up, the second is told; both have a quarter of the clouds, and the time is told for all. Beside it
stands what the steps alone take, with the batch on the GPU already. Writes `docs/benchmarks/gpu.md`.
"""

import os
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from benchmarks.page import write_page
from groundwork.progress import Silent
from learn.losses import cross_entropy
from learn.models.backbone import COORD, completed
from learn.models.registry import build_network
from learn.neighborhoods.batches import MANY
from learn.sample import Sample
from learn.training.loader import Loaded, collate
from learn.training.settings import TrainSettings
from learn.training.train import TrainingData, train_network

PAGE = Path(__file__).resolve().parents[2] / "docs" / "benchmarks" / "gpu.md"
CLASSES = tuple(f"class_{number}" for number in range(17))
LOCAL, GLOBAL = 2643, 122  # clouds of an epoch: the training shares of the paper's 4,405 and 203
ROWS = (  # network, recipe, clouds of an epoch, points of each, clouds of a step, numbers
    ("pointnet2-ssg", "paper", LOCAL, 4096, 8, "32-true"),
    ("pointnet2-ssg", "paper", LOCAL, 4096, 8, "bf16-mixed"),
    ("pointnext-s", "modern", LOCAL, 4096, 8, "bf16-mixed"),
    ("pointnext-b", "modern", LOCAL, 4096, 8, "bf16-mixed"),
    ("randlanet", "paper", GLOBAL, 65_536, 4, "32-true"),
)
PART = 4  # of the clouds of an epoch, one in so many is trained on
STEPS = 20


@dataclass(frozen=True)
class MadeUp:
    """Rough floors and walls; a `learn.sample.SampleSource`.

    Attributes:
        samples: How many.
        points: Points of each.
    """

    samples: int
    points: int
    classes: tuple[str, ...] = CLASSES

    def __len__(self) -> int:
        """Count the samples."""
        return self.samples

    def bridge(self, index: int) -> str:
        """Name the bridge of a sample: each is one of its own.

        Args:
            index: Number of the sample.
        """
        return str(index)

    def sample(self, index: int, seed: int) -> Sample:
        """Draw one sample.

        Args:
            index: Number of the sample.
            seed: Seed of the draw.
        """
        rng = np.random.default_rng([seed, index])
        coord = rng.random((self.points, 3), np.float32)
        flat = rng.integers(0, 3, self.points)
        coord[np.arange(self.points), flat] *= np.float32(0.02)
        labels = (coord @ np.array([5.0, 5.0, 5.0])).astype(np.int64) % len(CLASSES)
        return Sample(coord, coord.copy(), labels, ("x", "y", "z"))


class Clock(Silent):
    """A listener that notes when epochs end."""

    def __init__(self) -> None:
        self.ends: list[float] = []

    def advance(self, done: int) -> None:
        """Note the time.

        Args:
            done: Epochs that are over.
        """
        self.ends.append(time.monotonic())


def epoch_seconds(row: tuple[str, str, int, int, int, str]) -> float:
    """Train two short epochs, and give the seconds that one over all clouds would take as the second did [s].

    Args:
        row: One of `ROWS`.
    """
    network, recipe, clouds, points, batch, precision = row
    settings = TrainSettings.model_validate(
        {
            "model": network,
            "recipe": recipe,
            "epochs": 2,
            "batch": batch,
            "precision": precision,
            "accelerator": "gpu",
            "workers": len(os.sched_getaffinity(0)),
            "validation": 0.0,
            "class_aware": 0.0,
        }
    )
    clock = Clock()
    with tempfile.TemporaryDirectory() as folder:
        train_network(TrainingData(MadeUp(-(-clouds // PART), points)), settings, Path(folder), clock)
    return PART * (clock.ends[1] - clock.ends[0])


def step_seconds(row: tuple[str, str, int, int, int, str]) -> float:
    """Give the seconds of a step whose clouds are on the GPU already: the median of some [s].

    Args:
        row: One of `ROWS`.
    """
    name, _, _, points, batch, precision = row
    network: Any = build_network(name, {}, 3, len(CLASSES))
    loaded = Loaded(MadeUp(batch, points), network, ("x", "y", "z"), 0)
    items = collate([loaded[0, number, 0] for number in range(batch)])
    network = network.cuda()
    features, labels = items["features"].cuda(), items["labels"].cuda().flatten()
    geometry = {key: value.cuda() for key, value in items["geometry"].items() if points > MANY or key == COORD}
    optimizer = torch.optim.Adam(network.parameters(), lr=1e-3)
    weights, taken = torch.ones(len(CLASSES), device="cuda"), []
    for _ in range(STEPS):
        torch.cuda.synchronize()
        begun = time.monotonic()
        optimizer.zero_grad()
        with torch.autocast("cuda", torch.bfloat16, enabled=precision == "bf16-mixed"):
            logits = network(features, completed(network, geometry))
        cross_entropy(logits.float().flatten(0, 1), labels, weights).backward()
        optimizer.step()
        torch.cuda.synchronize()
        taken.append(time.monotonic() - begun)
    return float(np.median(taken[STEPS // 4 :]))


def main() -> None:
    """Measure, and write the page."""
    if not torch.cuda.is_available():
        sys.exit("no GPU that torch can use")
    lines = [
        "# Training on a GPU",
        "",
        "Written by `python -m benchmarks.learn.gpu`.",
        f"One {torch.cuda.get_device_name(0)} and {len(os.sched_getaffinity(0))} cores, PyTorch {torch.__version__}.",
        f"An epoch of the paper's local set has {LOCAL:,} clouds of 4,096 points, one of its global set {GLOBAL} of",
        "65,536. *Epoch* is one of `falsework train`, with one loader process a core (measured over a quarter of the",
        "clouds), from artificial clouds in memory; reading, validation and sensor augmentation take additional time.",
        "A step of the small clouds includes the search of their neighborhoods by the GPU; those of large clouds are",
        "searched by the loader processes. *Steps alone* is what the steps take with the batch on the GPU already:",
        "where that is much less, the loader limits the speed.",
        "",
        "| network | recipe | numbers | clouds of a step | a step | steps alone | epoch |",
        "|---|---|---|---|---|---|---|",
    ]
    for row in ROWS:
        network, recipe, clouds, _, batch, precision = row
        step, epoch = step_seconds(row), epoch_seconds(row)
        alone = step * -(-clouds // batch)
        lines.append(
            f"| {network} | {recipe} | {precision} | {batch} | {step * 1000:.1f} ms | {alone:.1f} s | {epoch:.1f} s |"
        )
        sys.stdout.write(lines[-1] + "\n")
        sys.stdout.flush()
    write_page(PAGE, "\n".join(lines) + "\n", __file__)


if __name__ == "__main__":
    main()
