"""How much a model leans towards what is no part of a bridge, chosen on scans that it did not learn from.

Usage: python -m benchmarks.shipped.lean MODEL OUT --clouds CLOUD… [--reach METERS]

A training draws pieces with a bridge far more often than a scan of others holds one, and weighs rare classes. What a
network then says is right for such samples: elsewhere too much of the surroundings becomes a part of a bridge. Known
frequencies would mend that by a summand of each logit (Saerens, Latinne and Decaestecker 2002; Menon et al. 2021). Here
one summand for all kinds of surroundings is the smallest that is enough on scans of held bridges, and OUT is the model
with that in the bias of its last layer.
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from benchmarks.shipped.robustness import near_bridge
from benchmarks.shipped.scan_scores import TABLES, Scan, read_labeled_scan
from benchmarks.shipped.selection import APART, within
from learn.datasets.class_tables import class_table, is_background
from learn.datasets.voxels import VoxelCloud, add_points, empty_cloud, lay_grid
from learn.metrics import confusion, scores
from learn.predict.class_sum import sum_classes
from learn.predict.predict import vote
from learn.predict.trained_model import TrainedModel, read_trained_model
from learn.scoring.table import table
from learn.trained import read_facts, read_weights, write_model

F32 = NDArray[np.float32]
I64 = NDArray[np.int64]

LEANS = tuple(0.5 * number for number in range(11))  # of the logits [1]
ENOUGH = 0.02  # share of the points far from a bridge that may be called a part of one [1]


def leaning(probabilities: F32, rest: NDArray[np.bool_], lean: float) -> F32:
    """Multiply the odds of the surroundings.

    Args:
        probabilities: Probabilities of the classes [1], shape (N, C), float32.
        rest: Which classes are surroundings, shape (C,), bool.
        lean: Logarithm of the factor [1].

    Returns:
        Probabilities again [1], shape (N, C), float32.
    """
    raised = probabilities * np.where(rest, np.float32(np.exp(lean)), np.float32(1.0))
    return raised / raised.sum(axis=1, keepdims=True)


def measure(model: TrainedModel, scans: Sequence[Scan]) -> list[tuple[float, float, dict[str, float]]]:
    """Label scans with every lean.

    Args:
        model: The model.
        scans: Scans with their truth.

    Returns:
        For each of `LEANS`: itself, the share of the points far from a bridge that is called a part of one, and the
        mean IoU in each table [1].
    """
    rest = is_background(model.classes)
    sizes = {name: len(class_table(name).names) for name in TABLES}
    matrices = {(lean, name): np.zeros((size, size), np.int64) for lean in LEANS for name, size in sizes.items()}
    false, count = dict.fromkeys(LEANS, 0), 0
    for scan in scans:
        columns = {"place": scan.place, **scan.labels}
        grid = lay_grid(scan.coord.min(axis=0), scan.coord.max(axis=0), model.tile.voxel)
        cloud: VoxelCloud = add_points(empty_cloud(grid), scan.coord, columns)
        probabilities = vote(VoxelCloud(cloud.grid, cloud.keys, cloud.coord, {}), model, scan.settings.batch)
        far = ~near_bridge(scan, APART)(cloud.columns["place"]) & (cloud.columns["falsework"] == 0)
        count += int(far.sum())
        for lean in LEANS:
            said = leaning(probabilities, rest, lean)
            for name in TABLES:
                names = class_table(name).names
                summing = sum_classes(model.classes, model.table, name, ())
                found = (said @ summing.matrix[:, [summing.names.index(one) for one in names]]).argmax(axis=1)
                matrices[lean, name] += confusion(cloud.columns[name], found, len(names))
                false[lean] += int((found[far] != 0).sum()) if name == "falsework" else 0
    return [
        (lean, false[lean] / max(1, count), {name: scores(matrices[lean, name]).mean_iou for name in TABLES})
        for lean in LEANS
    ]


def choose(rows: Sequence[tuple[float, float, dict[str, float]]]) -> float:
    """Choose the lean with the best mean IoU, over both tables, among those that are enough; else the least false one.

    Args:
        rows: Of `measure`.
    """
    fit = [row for row in rows if row[1] <= ENOUGH]
    if not fit:
        return min(rows, key=lambda row: row[1])[0]
    return max(fit, key=lambda row: sum(row[2].values()))[0]


def lean_model(folder: Path, lean: float, out: Path) -> None:
    """Write a model that leans.

    Args:
        folder: A network of `falsework train`.
        lean: Logarithm of the factor by which the odds of the surroundings grow [1].
        out: Where to.
    """
    facts, weights = read_facts(folder), read_weights(folder)
    name = max((key for key in weights if key.startswith("head.")), key=lambda key: int(key.split(".")[1]))
    bias = name.rsplit(".", 1)[0] + ".bias"
    shift = torch.from_numpy(is_background(facts.classes).astype(np.float32)) * (lean * facts.temperature)
    leant = {**weights, bias: weights[bias] + shift}
    write_model(out, replace(facts, training={**(facts.training or {}), "lean": lean}), leant)


def main() -> None:
    """Measure, choose and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("model", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--clouds", nargs="+", type=Path, required=True)
    parser.add_argument("--reach", type=float, default=np.inf, help="how far round a bridge scans are labeled [m]")
    given = parser.parse_args()
    torch.set_num_threads(1)
    scans = [within(read_labeled_scan(path), given.reach) for path in given.clouds]
    rows = measure(read_trained_model(given.model), scans)  # tiles side by side: a quarter of the time
    cells = [[f"{lean:g}", f"{false:.2%}", *(f"{found[name]:.3f}" for name in TABLES)] for lean, false, found in rows]
    sys.stdout.write("\n".join(table(["lean", "false", *TABLES], cells)) + "\n")
    lean = choose(rows)
    lean_model(given.model, lean, given.out)
    sys.stdout.write(f"chosen  {lean:g}\n")


if __name__ == "__main__":
    main()
