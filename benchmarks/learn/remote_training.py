"""Train and test the networks of a comparison on another machine, one with a GPU, and put the results into its store.

Usage: python -m benchmarks.learn.remote_training pack SOURCE… -o OUT --preset EXPERIMENT --set … --pack FILE
       python -m benchmarks.learn.remote_training train FILE… --results FOLDER [--processes NUMBER] [--minutes NUMBER]
       python -m benchmarks.learn.remote_training fill SOURCE… -o OUT --preset EXPERIMENT --set … --results FOLDER

`pack` cuts the bridges as `falsework compare` does, and writes the windows of the networks' trainings and tests into
one file of few bytes, byte for byte what is read here; give it `--set accelerator=gpu`. `train` runs on the other
machine, and needs PyTorch, Lightning, SciPy, Numba, Pydantic, isal and safetensors only; each training is a process,
and a second call trains what is missing. After `fill`, the same `falsework compare` finds these results, and makes the
others and the tables.
"""

import argparse
import json
import lzma
import multiprocessing
import os
import shutil
import sys
import time
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from groundwork.canonical import canonical_json
from groundwork.files import read_json, write_bytes
from groundwork.progress import Silent
from groundwork.slug import slug
from learn.compare.preset import DEFAULT_SET

if TYPE_CHECKING:
    from falsework.commands.comparison import Experiment, TrialJobs
    from learn.compare.sources import HeldWindows, SampleSettings, TrainingWindows, WindowPlace

I64 = NDArray[np.int64]

PLAIN = ("labels", "rows", "origins", "start")  # written as they are; floats are written byte plane by byte plane
SHUFFLED = ("coord", "uncertainty")


def experiment_here(
    sources: Sequence[Path], output: Path, preset: str, changed: Sequence[str]
) -> tuple["Experiment", list["TrialJobs"]]:
    """Cut the bridges of an experiment, and describe its trainings.

    Args:
        sources: Runs, or folders of clouds.
        output: Folder of the comparison.
        preset: Name of a preset, or a TOML file.
        changed: Its changed settings, key=value.

    Returns:
        The experiment, and its trainings with their tests.
    """
    from falsework.commands.comparison import open_experiment
    from falsework.commands.dataset_verbs import nested
    from falsework.commands.given_settings import given_settings
    from groundwork.output.folder import claim_run
    from learn.compare.experiment import experiment_settings

    settings = experiment_settings(preset, nested(given_settings(tuple(changed))))
    experiment = open_experiment(settings, [(DEFAULT_SET, source) for source in sources], (), output, Silent())
    claim_run(output, sources)
    return experiment, experiment.prepare()[1]


def described(trial: "TrialJobs", names: Mapping[Path, str]) -> dict[str, Any]:
    """Describe a training and its tests for another machine.

    Args:
        trial: Of `experiment_here`.
        names: Folder of each cut bridge to its name in the pack.

    Returns:
        A record of JSON.
    """
    source, checked, settings = trial.training.make.args  # type: ignore[attr-defined]
    held = {name: (job.task.key, job.make.args[1]) for name, job in trial.tests.items()}  # type: ignore[attr-defined]
    return {
        "key": trial.training.task.key,
        "about": f"{trial.model}, {trial.training.about}",
        "settings": settings.model_dump(mode="json"),
        "data": trial.training.make.keywords["data"],  # type: ignore[attr-defined]
        "sampling": source.settings.record(),
        "count": source.count,
        "windows": placed(source.windows, names),
        "validation": {"sampling": checked.settings.record(), "windows": placed(checked.windows, names)},
        "tests": [
            {"key": key, "draws": one.draws, "sampling": one.settings.record(), "windows": placed(one.windows, names)}
            for key, one in held.values()
        ],
    }


def placed(windows: Iterable["WindowPlace"], names: Mapping[Path, str]) -> list[list[Any]]:
    """Write places of windows.

    Args:
        windows: The places.
        names: Folder of each cut bridge to its name in the pack.
    """
    return [[names[one.folder], one.cloud, one.number, one.bridge, one.points] for one in windows]


def thinned(folder: Path, cloud: str, numbers: Iterable[int]) -> dict[str, NDArray[Any]]:
    """Keep the points of some windows of a cut cloud; the windows keep their numbers, and the points their order.

    Args:
        folder: A cut bridge.
        cloud: Name of the cloud.
        numbers: Windows to keep.

    Returns:
        The arrays of the cloud's folder.
    """
    own = {name: np.load(folder / slug(cloud) / f"{name}.npy") for name in (*PLAIN, *SHUFFLED)}
    start, keep = own["start"], set(numbers)
    parts = [
        own["rows"][start[number] : start[number + 1]] if number in keep else own["rows"][:0]
        for number in range(len(start) - 1)
    ]
    kept, rows = np.unique(np.concatenate([own["rows"][:0], *parts]), return_inverse=True)
    return {
        **{name: own[name][kept] for name in ("coord", "labels", "uncertainty")},
        "rows": rows.astype(np.int32),
        "origins": own["origins"],
        "start": np.cumsum([0, *map(len, parts)]),
    }


def write_pack(path: Path, jobs: Sequence[Mapping[str, Any]], folders: Mapping[str, Path]) -> None:
    """Write trainings and the windows that they need.

    Args:
        path: File.
        jobs: Of `described`.
        folders: Name of each cut bridge in the pack to its folder.
    """
    needed: dict[tuple[str, str], set[int]] = {}
    for job in jobs:
        for rows in (job["windows"], job["validation"]["windows"], *(test["windows"] for test in job["tests"])):
            for name, cloud, number, _, _ in rows:
                needed.setdefault((name, cloud), set()).add(number)
    arrays: dict[str, NDArray[Any]] = {"jobs": np.frombuffer(canonical_json(list(jobs)).encode(), np.uint8)}
    for (name, cloud), numbers in sorted(needed.items()):
        for key, values in thinned(folders[name], cloud, numbers).items():
            if key in SHUFFLED:
                planes = np.ascontiguousarray(values).view(np.uint8).reshape(*values.shape, values.itemsize)
                values = np.ascontiguousarray(np.moveaxis(planes, -1, 0))
            arrays[f"{name}/{slug(cloud)}/{key}"] = values
    buffer = BytesIO()
    np.savez(buffer, allow_pickle=False, **arrays)
    write_bytes(path, lzma.compress(buffer.getvalue(), preset=6))


def read_pack(path: Path, folder: Path) -> list[dict[str, Any]]:
    """Write the cut bridges of a pack into a folder.

    Args:
        path: File.
        folder: Where to.

    Returns:
        Its trainings.
    """
    jobs: list[dict[str, Any]] = []
    with np.load(BytesIO(lzma.decompress(path.read_bytes())), allow_pickle=False) as stored:
        for name in stored.files:
            values = stored[name]
            if name == "jobs":
                jobs = json.loads(values.tobytes())
                continue
            target = folder / f"{name}.npy"
            if target.stem in SHUFFLED:
                planes = np.ascontiguousarray(np.moveaxis(values, 0, -1))
                values = planes.view(np.float32)[..., 0]
            target.parent.mkdir(parents=True, exist_ok=True)
            np.save(target, values)
    return jobs


def train(job: Mapping[str, Any], pieces: Path, results: Path) -> str:
    """Train and test one model, where that is missing.

    Args:
        job: Of `read_pack`.
        pieces: Folder of the cut bridges.
        results: Where results go, each into a folder named by its key.

    Returns:
        What was done.
    """
    import torch

    from learn.compare.trial import score_trial, train_trial
    from learn.training.settings import TrainSettings

    torch.set_num_threads(1)
    settings = TrainSettings.model_validate(job["settings"])
    model = results / job["key"]
    if not (model / "model.json").is_file():
        model.mkdir(parents=True, exist_ok=True)
        checked = held_windows({"draws": 1, **job["validation"]}, pieces)
        train_trial(training_windows(job, pieces), checked, settings, model, Silent(), job["data"])
    for test in job["tests"]:
        folder = results / test["key"]
        if not (folder / "scores.json").is_file():
            folder.mkdir(exist_ok=True)
            score_trial(model, held_windows(test, pieces), folder, Silent(), "auto")
    return f"{job['about']}: {read_json(model / 'model.json')['training']['validation']}"


def training_windows(job: Mapping[str, Any], pieces: Path) -> "TrainingWindows":
    """Read the samples of a training.

    Args:
        job: Of `read_pack`.
        pieces: Folder of the cut bridges.
    """
    from learn.compare.sources import TrainingWindows

    return TrainingWindows(read_places(job["windows"], pieces), read_sampling(job["sampling"]), job["count"])


def held_windows(test: Mapping[str, Any], pieces: Path) -> "HeldWindows":
    """Read the samples of a validation or a test.

    Args:
        test: Its record.
        pieces: Folder of the cut bridges.
    """
    from learn.compare.sources import HeldWindows

    return HeldWindows(read_places(test["windows"], pieces), read_sampling(test["sampling"]), test["draws"])


def read_places(rows: Iterable[Sequence[Any]], pieces: Path) -> list["WindowPlace"]:
    """Read places of windows.

    Args:
        rows: Of `placed`.
        pieces: Folder of the cut bridges.
    """
    from learn.compare.sources import WindowPlace

    return [WindowPlace(pieces / name, cloud, number, bridge, points) for name, cloud, number, bridge, points in rows]


def read_sampling(values: Mapping[str, Any]) -> "SampleSettings":
    """Read how samples are drawn.

    Args:
        values: Of `SampleSettings.record`.
    """
    from learn.compare.sources import SampleSettings
    from learn.datasets.patch import Scaling
    from learn.datasets.settings import AugmentSettings

    return SampleSettings(
        tuple(values["classes"]),
        tuple(values["channels"]),
        Scaling(**values["scaling"]),
        values["points"],
        float(values["noisy"]),
        AugmentSettings.model_validate(values["augment"]),
    )


def train_all(paths: Sequence[Path], results: Path, processes: int, minutes: float) -> None:
    """Train everything of some packs, several models at a time; those of the first packs and seeds begin first.

    Args:
        paths: The packs.
        results: Where results go.
        processes: How many at a time.
        minutes: After so long nothing goes on [min].
    """
    end = time.monotonic() + 60.0 * minutes
    jobs: list[tuple[int, int, dict[str, Any], Path]] = []
    for number, path in enumerate(paths):
        pieces = results.with_name(f"{results.name}-{number}")
        jobs += [(number, job["settings"]["seed"], job, pieces) for job in read_pack(path, pieces)]
    jobs.sort(key=lambda row: row[:2])
    results.mkdir(parents=True, exist_ok=True)
    os.environ["OMP_NUM_THREADS"] = "1"
    pool = ProcessPoolExecutor(processes, multiprocessing.get_context("spawn"))
    waiting = [pool.submit(train, job, pieces, results) for _, _, job, pieces in jobs]
    try:
        for done in as_completed(waiting, end - time.monotonic()):
            said = done.result() if done.exception() is None else f"failed: {done.exception()}"
            sys.stdout.write(f"{time.monotonic() - end:.0f} s: {said}\n")
            sys.stdout.flush()
    except TimeoutError:
        sys.stdout.write(f"{sum(one.done() for one in waiting)} of {len(waiting)} are done\n")
        sys.stdout.flush()
        for child in multiprocessing.active_children():
            child.kill()
    pool.shutdown(cancel_futures=True)


def fill(trials: Sequence["TrialJobs"], experiment: "Experiment", results: Path) -> int:
    """Put results of another machine into the store of a comparison.

    Args:
        trials: Of `experiment_here`.
        experiment: The experiment.
        results: Of `train_all`.

    Returns:
        How many results were put in.
    """
    count = 0
    for trial in trials:
        for job in (trial.training, *trial.tests.values()):
            made = results / job.task.key
            if any((made / name).is_file() for name in ("model.json", "scores.json")):
                count += experiment.store.produce(job.task, lambda folder, made=made: copied(made, folder))
    return count


def copied(made: Path, folder: Path) -> None:
    """Copy the files of a result.

    Args:
        made: Folder of another machine's result.
        folder: Empty folder to fill.
    """
    for path in sorted(made.iterdir()):
        shutil.copyfile(path, folder / path.name)


def main() -> None:
    """Pack, train or fill."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("verb", choices=("pack", "train", "fill"))
    parser.add_argument("sources", type=Path, nargs="+")
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--preset", default="")
    parser.add_argument("--set", action="append", default=[])
    parser.add_argument("--pack", type=Path)
    parser.add_argument("--results", type=Path)
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--minutes", type=float, default=1e6, help="end then, with what is done")
    given = parser.parse_args()
    if given.verb == "train":
        train_all(given.sources, given.results, given.processes, given.minutes)
        return
    experiment, trials = experiment_here(given.sources, given.output, given.preset, given.set)
    networks = list({one.training.task.key: one for one in trials if one.model != "forest"}.values())
    if given.verb == "fill":
        sys.stdout.write(f"{fill(networks, experiment, given.results)} results put into {given.output}\n")
        return
    folders = {f"{number:03d}": path for number, path in enumerate(sorted(pieces_of(networks)))}
    names = {path: name for name, path in folders.items()}
    write_pack(given.pack, [described(one, names) for one in networks], folders)
    sys.stdout.write(f"{len(networks)} trainings in {given.pack}, {given.pack.stat().st_size / 1e6:.1f} MB\n")


def pieces_of(trials: Iterable["TrialJobs"]) -> set[Path]:
    """List the cut bridges that trainings need.

    Args:
        trials: Of `experiment_here`.
    """
    found: set[Path] = set()
    for trial in trials:
        source, checked, _ = trial.training.make.args  # type: ignore[attr-defined]
        tests = [job.make.args[1] for job in trial.tests.values()]  # type: ignore[attr-defined]
        found |= {place.folder for one in (source, checked, *tests) for place in one.windows}
    return found


if __name__ == "__main__":
    main()
