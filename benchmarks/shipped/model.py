"""Train the model that comes with the package, score it, and write its card.

Usage: python -m benchmarks.shipped.model CLOUDS… [--work FOLDER] [--validation NAME…] [--test NAME…] [--init MODEL]

CLOUDS are folders of clouds, or folders that hold some at any depth; every sampler's count alike. Bridges are named by
their hash, or, where the clouds are too old for one, by that of the geometry in the `manifest.json` beside them; the
first digits are enough. What was begun in `--work` is gone on with. The model goes to `learn/shipped`, unless
`--candidate` keeps it in `--work`, for `benchmarks.shipped.selection`; `--set 'model="forest"'` trains a forest.
"""

import argparse
import json
import os
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch

from benchmarks.shipped.card import card_text
from benchmarks.shipped.training import SAMPLES, USUAL, train_shipped, varied_data
from falsework.commands.console import ConsoleProgress
from groundwork.canonical import file_digest
from groundwork.errors import InputError
from groundwork.files import read_json, write_text
from groundwork.output.folder import fresh_output
from learn.datasets.build import Source, build_dataset
from learn.datasets.settings import DatasetSettings, dataset_settings
from learn.trained import FACTS, FOREST, WEIGHTS, read_facts, read_weights, write_model
from learn.training.settings import TrainSettings
from learn.training.start import seen_by

STRIDE = 10.0  # [m] of the tiles in a prediction: every point is in four
SHIPPED = Path(__file__).resolve().parents[2] / "learn" / "shipped"
TILE = {"size": 20.0, "stride": 20.0, "scale": 10.0, "voxel": 0.15, "ground_reach": 40.0}


def clouds_below(places: Sequence[Path]) -> list[Path]:
    """Find clouds; those of a run in its scenes, so that its store does not give them twice.

    Args:
        places: Folders of clouds, or folders that hold some.
    """
    found: set[Path] = set()
    for place in places:
        for folder, inner, files in os.walk(place, followlinks=True):  # the scenes of a run are links
            if {"scenes", "store"} <= set(inner):
                inner[:] = ["scenes"]
            if "cloud.json" in files:
                found.add(Path(folder))
    return sorted(found)


def bridge_of(cloud: Path) -> str:
    """Find which bridge a cloud shows.

    Args:
        cloud: Folder of a cloud.

    Raises:
        InputError: Neither the cloud nor a manifest beside it knows.
    """
    said = read_json(cloud / "cloud.json").get("bridge")
    if said:
        return str(said)
    manifest = cloud.parent / "manifest.json"
    if not manifest.is_file():
        raise InputError("does not say which bridge it shows", where=cloud, hint="Make the cloud again")
    return str(read_json(manifest)["files"]["bridge/geometry.usdc"])


def dataset_of(clouds: Sequence[Path], held: Sequence[str], seed: int, folder: Path) -> None:
    """Cut the clouds into tiles, those of held bridges into the split for the test.

    Args:
        clouds: Folders of clouds.
        held: First digits of the bridges that are not trained on.
        seed: Seed of the draws.
        folder: Data set to write; left alone where it is whole.
    """
    sources = [Source(path, None, bridge_of(path)) for path in clouds]
    named = [name for name in held if any(source.bridge.startswith(name) for source in sources)]
    settings = dataset_settings(
        "local",
        {"table": "components", "tile": TILE, "shares": (1.0, 0.0, 0.0), "test": named, "seed": seed},
        "shipped",
    )
    asked = [settings.model_dump(mode="json"), [str(path) for path in clouds]]
    if (folder / "dataset.json").is_file():
        return
    with ConsoleProgress() as progress:
        fresh_output(
            folder,
            "dataset",
            lambda inner: _built(sources, inner, settings, progress),
            inputs=list(clouds),
            asked=asked,
        )


def _built(sources: Sequence[Source], folder: Path, settings: DatasetSettings, progress: ConsoleProgress) -> None:
    build_dataset(sources, folder, settings, progress)


def check_unseen(init: Path, names: Sequence[str]) -> None:
    """Refuse to test on what the model to begin with has seen.

    Args:
        init: Its folder.
        names: First digits of the bridges for the test.

    Raises:
        InputError: It has seen one of them.
    """
    for name in names:
        if any(bridge.startswith(name) for bridge in seen_by(init)):
            raise InputError("the model to begin with has learnt from it", where=init, field="--test", value=name)


def train_on(
    dataset: Path,
    validation: Sequence[str],
    folder: Path,
    settings: Mapping[str, Any],
    samples: int,
    init: Path | None = None,
) -> None:
    """Train a network on varied tiles, its epoch picked on bridges of their own; or a forest, which picks nothing.

    Args:
        dataset: Data set of `dataset_of`.
        validation: First digits of the bridges that the epoch is picked on.
        folder: Model to write; what was begun there is gone on with, a whole one is left alone.
        settings: Settings of the training that differ from the usual ones.
        samples: Samples of an epoch.
        init: A model to begin with.
    """
    if (folder / FACTS).is_file():
        return
    chosen = TrainSettings.model_validate({**USUAL, **settings})
    data = varied_data(dataset, validation, samples)
    begun = [] if init is None else [file_digest(init / WEIGHTS)]
    with ConsoleProgress() as progress:
        fresh_output(
            folder,
            "model",
            lambda inner: train_shipped(data, chosen, inner, progress, init),
            inputs=[dataset],
            asked=[data.facts, chosen.model_dump(mode="json"), *begun],
            resume=chosen.model != FOREST,
        )


def ship(model: Path, folder: Path) -> None:
    """Copy a model into the package; a prediction lets its tiles overlap, a training had no need of that.

    Args:
        model: What `train_on` has written.
        folder: `learn/shipped`.
    """
    facts = read_facts(model)
    settings = dict(facts.data["settings"])
    settings["tile"] = {**settings["tile"], "stride": STRIDE}
    write_model(folder, replace(facts, data={**facts.data, "settings": settings}), read_weights(model))


def main() -> None:
    """Go through the steps."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("clouds", type=Path, nargs="+")
    parser.add_argument("--work", type=Path, default=Path("shipped_work"))
    parser.add_argument("--validation", nargs="+", default=[])
    parser.add_argument("--test", nargs="+", default=[])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--samples", type=int, default=SAMPLES, help="samples of an epoch")
    parser.add_argument("--init", type=Path, help="a model to begin with")
    parser.add_argument("--candidate", default="", help="name of the model in --work; then nothing is shipped")
    parser.add_argument("--note", default="", help="a line for the card")
    parser.add_argument("--set", nargs="*", default=[], help="settings of the training, key=value")
    given = parser.parse_args()
    torch.set_num_threads(1)
    if given.init is not None:
        check_unseen(given.init, given.test)
    clouds = clouds_below(given.clouds)
    dataset, model = given.work / "dataset", given.work / (given.candidate or "model")
    dataset_of(clouds, [*given.validation, *given.test], given.seed, dataset)
    settings = {key: json.loads(value) for key, _, value in (word.partition("=") for word in given.set)}
    train_on(dataset, given.validation, model, {"seed": given.seed, **settings}, given.samples, given.init)
    if given.candidate:
        return
    ship(model, SHIPPED)
    named = [(bridge_of(path), path) for path in clouds]
    held = tuple(given.test)
    tests = {f"{bridge[:8]} {path.name}": path for bridge, path in named if held and bridge.startswith(held)}
    write_text(SHIPPED / "README.md", card_text(SHIPPED, dataset, tests, given.validation, given.note))
    sys.stdout.write(f"model   {SHIPPED}\n")


if __name__ == "__main__":
    main()
