"""The card of the model that comes with the package: training data, scores, limits."""

import time
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.shipped.scan_scores import TABLES, label_scan, read_labeled_scan
from groundwork.canonical import file_digest
from learn.datasets.class_tables import class_table
from learn.datasets.layout import DatasetFacts, read_facts
from learn.metrics import scores
from learn.predict.model import PointModel
from learn.predict.trained_model import read_trained_model
from learn.scoring.table import table
from learn.trained import WEIGHTS, ModelFacts
from learn.trained import read_facts as read_model_facts
from recon.cloud import read_cloud

I64 = NDArray[np.int64]

LIMITS = (
    "Everything it saw was made by this project: no real scan had a part in its training, and none in these scores.",
    "It sees positions alone. It cannot know what only color or intensity distinguishes.",
    "It was trained on {bridges} bridges{start} among the plants, houses and vehicles of our own worlds. It knows "
    "few power lines and no crane, scaffold or person, and will call some of them parts of a bridge.",
    "Parts finer than its cubes of {voxel:g} m (bearings, sockets, clamps, rails) are mostly lost.",
    "Its tiles are {size:g} m wide. Where the function of a part is visible only from farther away, its class is a "
    "guess.",
    "Confidence is calibrated on {picked} of our bridges; how far it can be trusted on other scans is not known.",
    "The scan must say its unit, or be given `--unit`, and stand with z up, or be given `--up`.",
)


def card_text(folder: Path, dataset: Path, tests: Mapping[str, Path], validation: Sequence[str], note: str = "") -> str:
    """Write the card.

    Args:
        folder: The model.
        dataset: Data set that it was trained on.
        tests: Name and folder of clouds of bridges that neither training nor the choice of the epoch saw.
        validation: First digits of the bridges that the epoch was picked on.
        note: A line more.
    """
    model, facts = read_trained_model(folder), read_model_facts(folder)
    matrices: dict[str, Mapping[str, I64]] = {}
    seconds, points = 0.0, 0
    for name, path in tests.items():
        scan = read_labeled_scan(path)
        before = time.process_time()
        found = label_scan(scan, model)
        seconds, points = seconds + time.process_time() - before, points + len(scan.coord)
        matrices[f"{name} ({read_cloud(path).source})"] = {t: found.matrix(t) for t in TABLES}
    lines = [*_head(folder, facts, model), *([f"- {note}"] if note else [])]
    lines += ["", "## Training data", "", *_sources(read_facts(dataset), validation, facts)]
    lines += ["", "## Scores", "", *_score_lines(matrices), "", "## What it cannot do", ""]
    own = {row.bridge for row in read_facts(dataset).pieces if row.split == "train"}
    bridges = sum(not bridge.startswith(tuple(validation)) for bridge in own)
    others = len(set(facts.data.get("earlier", [])) - own)
    start = f", starting from a model of {others} others," if others else ""
    values = {"bridges": bridges, "start": start, "picked": len(validation)}
    sizes = {"voxel": model.tile.voxel, "size": model.tile.size}
    lines += [f"- {line.format(**values, **sizes)}" for line in LIMITS]
    if points:
        lines += [
            "",
            "## Speed",
            "",
            f"{points:,} points took {seconds:.0f} CPU-seconds on one thread, "
            f"{seconds * 2e6 / points:.0f} for two million; reading and writing not counted.",
        ]
    return "\n".join(lines) + "\n"


def _head(folder: Path, facts: ModelFacts, model: PointModel) -> list[str]:
    size = (folder / WEIGHTS).stat().st_size / 1e6
    chosen = facts.training or {}
    return [
        "# The model of the package",
        "",
        "`falsework predict scan.laz -o labeled.laz` uses it where no `--model` is named. It labels weakly: look at",
        "the scores and limits below before you rely on it.",
        "",
        f"- {facts.network}, {size:.1f} MB, {len(facts.classes)} component kinds, summed into any table (`--table`).",
        f"- Sees positions alone, in cubes of {model.tile.voxel:g} m and tiles of {model.tile.size:g} m; "
        f"{model.points} points a draw.",
        f"- SHA-256 of `{WEIGHTS}`: `{file_digest(folder / WEIGHTS)}`",
        f"- Epoch {chosen.get('picked_epoch', 0) + 1} of {chosen.get('settings', {}).get('epochs')}, temperature "
        f"{facts.temperature:g}.",
        *(
            [f"- Leans: the odds of surroundings are {np.exp(lean):.3g} times those that its training gave."]
            if (lean := chosen.get("lean"))
            else []
        ),
        "- License: Apache-2.0, as the package. Trained on clouds of this project alone.",
        "- Made by `python -m benchmarks.shipped.model CLOUDS… --validation HASH… --test HASH…`.",
    ]


def _sources(facts: DatasetFacts, validation: Sequence[str], model: ModelFacts) -> list[str]:
    """Return the use of each bridge; those that only the previous model has seen have no cloud any more."""
    own = {str(source["bridge"]) for source in facts.sources}
    earlier = sorted(set(model.data.get("earlier", [])) - own)
    rows = [[f"`{bridge[:16]}`", "the model before", "", ""] for bridge in earlier]
    for bridge in sorted({str(source["bridge"]) for source in facts.sources}):
        kinds = sorted(str(source["kind"]) for source in facts.sources if source["bridge"] == bridge)
        part = {row.split for row in facts.pieces if row.bridge == bridge}
        picks = any(bridge.startswith(name) for name in validation)
        role = "epoch" if picks else "training" if "train" in part else "test"
        count = sum(row.points for row in facts.pieces if row.bridge == bridge)
        rows.append([f"`{bridge[:16]}`", role, ", ".join(kinds), str(count)])
    return table(["bridge", "for", "clouds", "thinned points"], rows)


def _score_lines(matrices: Mapping[str, Mapping[str, I64]]) -> list[str]:
    if not matrices:
        return ["No bridge was kept for the test: nothing is known."]
    lines = ["Of the thinned points of whole scans of the test bridges, labeled as `falsework predict` does.", ""]
    rows = [
        [
            title,
            *(
                f"{value:.3f}"
                for name in TABLES
                for result in [scores(found[name])]
                for value in (result.overall_accuracy, result.mean_iou)
            ),
        ]
        for title, found in matrices.items()
    ]
    lines += table(["scan", *(f"{name} {word}" for name in TABLES for word in ("accuracy", "mean IoU"))], rows)
    for name in TABLES:
        total = np.sum([found[name] for found in matrices.values()], axis=0)
        result = scores(total)
        cells = [
            [
                word,
                str(result.support[i]),
                _figure(result.iou[i]),
                _figure(result.accuracy[i]),
                _figure(result.precision[i]),
            ]
            for i, word in enumerate(class_table(name).names)
        ]
        cells.append(
            [
                "mean",
                str(result.support.sum()),
                _figure(result.mean_iou),
                _figure(result.mean_accuracy),
                _figure(result.mean_precision),
            ]
        )
        lines += ["", f"Table `{name}`, all scans together:", ""]
        lines += table(["class", "points", "IoU", "accuracy", "precision"], cells)
    return lines


def _figure(value: float) -> str:
    return "-" if np.isnan(value) else f"{value:.3f}"
