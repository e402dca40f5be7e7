"""Conductor of an experiment: every cut bridge, fit, training and test is a result in a store under its key."""

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np

from falsework.commands.compared_bridges import Bridge, find_bridges
from falsework.execution.costs import bytes_added
from falsework.execution.events import write_event
from falsework.platform import learn_platform
from falsework.store.store import Store, Task
from groundwork.canonical import digest
from groundwork.files import read_json, write_json
from groundwork.locks import BusyError
from groundwork.progress import Progress
from learn.compare.experiment import ExperimentSettings, Part, data_facts
from learn.compare.findings import Trial
from learn.compare.noise import fit_noise
from learn.compare.pieces import CloudSource, counts_of, cut_pieces
from learn.compare.selection import (
    CutScene,
    check_bridges,
    cloud_name,
    parts_in,
    share_out,
    windows_of,
    windows_to_test,
)
from learn.compare.sources import HeldWindows, TrainingWindows, WindowPlace
from learn.compare.trial import SCORES, check_models, score_trial, train_trial
from learn.datasets.class_tables import class_table
from learn.datasets.split import TRAIN, VAL
from learn.device import Device
from learn.trained import FOREST

VERSIONS = {"noise": 1, "pieces": 2, "training": 2, "scores": 1}  # increased by hand, as in falsework.stages
_NOISE = "noise.json"

Make = Callable[[Path], None]


@dataclass(frozen=True)
class Job:
    """A result to be made.

    Attributes:
        task: The task, which determines its key.
        make: Function that fills its folder.
        kind: Kind of work, by which its time is estimated.
        work: Amount of work: samples processed by a network, or clouds cut [1].
        about: Description for people.
    """

    task: Task
    make: Make
    kind: str
    work: float
    about: str


@dataclass(frozen=True)
class TrialJobs:
    """The training of one arm with one seed, and its tests.

    Attributes:
        group: Arms that share their windows.
        model: Network, or forest.
        arm: Name of the arm.
        seed: Seed.
        training: The training.
        tests: Name of each test to its job.
    """

    group: tuple[str, ...]
    model: str
    arm: str
    seed: int
    training: Job
    tests: dict[str, Job]


@dataclass
class Experiment:
    """An experiment on given bridges, in an output folder.

    Attributes:
        settings: Settings of the experiment.
        bridges: The bridges of all sets.
        store: Store of the results.
        progress: Listener.
        made: Number of results made in this call.
        reused: Number of results that existed.
    """

    settings: ExperimentSettings
    bridges: Sequence[Bridge]
    store: Store
    progress: Progress
    made: int = 0
    reused: int = 0
    _scenes: list[CutScene] = field(default_factory=list)

    @cached_property
    def splits(self) -> dict[tuple[str, str], str]:
        """Return the split of each set and bridge: train, val or test."""
        sets: dict[str, list[str]] = {}
        for bridge in self.bridges:
            sets.setdefault(bridge.set, []).append(bridge.bridge)
        return share_out(self.settings, sets)

    @property
    def _parts(self) -> list[Part]:
        """List all clouds, those of arms first: windows along a bridge are laid out over the first that it has."""
        tests = (self.settings.test(name) for name in self.settings.tests)
        return list(dict.fromkeys([*parts_in(self.settings, self.settings.arms), *tests]))

    def noise_jobs(self) -> dict[Part, Job]:
        """Describe the fits of noise models that parts use, each on the training bridges only."""
        jobs = {}
        for part in self._parts:
            if not part.like:
                continue
            needed = {part.cloud, part.like}
            mine = [
                one
                for one in self.bridges
                if one.set == part.set and needed <= one.clouds.keys() and self.splits[one.set, one.bridge] == TRAIN
            ]
            inputs = {f"given/{one.name}/{name}": one.digests[name] for one in mine for name in (part.cloud, part.like)}
            pairs = [(one.clouds[part.cloud], one.clouds[part.like]) for one in mine]
            task = Task("noise", VERSIONS["noise"], {"platform": learn_platform()}, inputs)
            jobs[part] = Job(task, partial(_fit, pairs), "noise", len(pairs), str(part))
        return jobs

    def piece_jobs(self, noise: Mapping[Part, Job]) -> dict[tuple[str, str], Job]:
        """Describe the cutting of each bridge: set and name to its job; a bridge without any of the clouds has none."""
        jobs = {}
        for bridge in self.bridges:
            parts = [
                part
                for part in self._parts
                if part.set == bridge.set and {part.cloud, part.like} - {""} <= bridge.clouds.keys()
            ]
            if not parts:
                continue
            used = sorted({name for part in parts for name in (part.cloud, part.like) if name})
            inputs = {f"given/{name}": bridge.digests[name] for name in used}
            inputs |= {f"noise/{cloud_name(part)}": noise[part].task.key for part in parts if part.like}
            names = [cloud_name(part) for part in parts]
            settings = {"cut": self.settings.cut.model_dump(mode="json"), "clouds": names, "platform": learn_platform()}
            sources = [
                CloudSource(
                    cloud_name(part),
                    bridge.clouds[part.cloud],
                    bridge.clouds[part.like] if part.like else None,
                    self.store.folder(noise[part].task) / _NOISE if part.like else None,
                )
                for part in parts
            ]
            make = partial(cut_pieces, sources, settings=self.settings.cut, progress=self.progress)
            task = Task("pieces", VERSIONS["pieces"], settings, inputs)
            jobs[bridge.set, bridge.name] = Job(task, make, "pieces", len(parts), bridge.name)
        return jobs

    def cut_scenes(self, pieces: Mapping[tuple[str, str], Job]) -> list[CutScene]:
        """Read the counts of the cut bridges.

        Args:
            pieces: From `piece_jobs`; all must be finished.
        """
        scenes = []
        for bridge in self.bridges:
            if (bridge.set, bridge.name) in pieces:
                folder = self.store.folder(pieces[bridge.set, bridge.name].task)
                scenes.append(CutScene(bridge.set, bridge.name, bridge.bridge, folder, counts_of(folder)))
        return scenes

    def trials(self, pieces: Mapping[tuple[str, str], Job], scenes: Sequence[CutScene]) -> list[TrialJobs]:
        """Describe every training and its tests; an arm in several groups with the same windows is trained once.

        Args:
            pieces: Of `piece_jobs`.
            scenes: Of `cut_scenes`.
        """
        keys = {scene.folder: pieces[scene.set, scene.name].task.key for scene in scenes}
        names = {scene.folder: f"pieces/{scene.set}/{scene.name}" for scene in scenes}
        held = {name: windows_to_test(scenes, self.splits, self.settings, name) for name in self.settings.tests}
        found = []
        for group in self.settings.groups:
            for arm in group:
                chosen = {
                    split: windows_of(scenes, self.splits, self.settings, arm=arm, group=group, split=split)
                    for split in (TRAIN, VAL)
                }
                for model in self.settings.models:
                    for number in range(self.settings.seeds):
                        seed = self.settings.first_seed + number
                        training = self._training(arm, model, seed, chosen, keys, names)
                        tests = {name: self._test(name, training, places, keys, names) for name, places in held.items()}
                        found.append(TrialJobs(group, model, arm, seed, training, tests))
        return found

    def _training(
        self,
        arm: str,
        model: str,
        seed: int,
        chosen: Mapping[str, list[WindowPlace]],
        keys: Mapping[Path, str],
        names: Mapping[Path, str],
    ) -> Job:
        train = self.settings.training(model, seed)
        is_forest = model == FOREST
        validation = [] if is_forest else chosen[VAL]
        count = self.settings.forest_draws if is_forest else self.settings.samples_each
        sampling = self.settings.sampling_of(arm)
        source = TrainingWindows(chosen[TRAIN], sampling, count)
        checked = HeldWindows(validation, self.settings.sampling, 1)
        data = data_facts(self.settings, self.settings.kept(arm))
        settings = {
            "train": train.model_dump(mode="json"),
            "sampling": sampling.record(),
            "count": count,
            "data": data,
            "windows": _named(chosen[TRAIN], keys),
            "validation": _named(validation, keys),
            "platform": learn_platform(),
        }
        inputs = {names[place.folder]: keys[place.folder] for place in (*chosen[TRAIN], *validation)}
        make = partial(train_trial, source, checked, train, progress=self.progress, data=data)
        work = count if is_forest else count * self.settings.looks
        return Job(
            Task("training", VERSIONS["training"], settings, inputs),
            make,
            f"training {model}",
            work,
            f"{arm}, seed {seed}",
        )

    def _test(
        self, name: str, training: Job, places: list[WindowPlace], keys: Mapping[Path, str], names: Mapping[Path, str]
    ) -> Job:
        source = HeldWindows(places, self.settings.sampling, self.settings.test_draws)
        settings = {
            "sampling": source.settings.record(),
            "windows": _named(places, keys),
            "platform": learn_platform(),
            "draws": self.settings.test_draws,
        }
        inputs = {"training": training.task.key, **{names[one.folder]: keys[one.folder] for one in places}}
        make = partial(
            _score,
            self.store.folder(training.task),
            source,
            progress=self.progress,
            accelerator=self.settings.accelerator,
        )
        model = training.kind.removeprefix("training ")
        task = Task("scores", VERSIONS["scores"], settings, inputs)
        return Job(task, make, f"scores {model}", len(places), f"{training.about}, on {name}")

    def prepare(self) -> tuple[list[CutScene], list[TrialJobs]]:
        """Fit the noise models and cut the bridges, where that is missing.

        Returns:
            The cut bridges, and every training with its tests.
        """
        noise = self.noise_jobs()
        self.make_all(noise.values())
        pieces = self.piece_jobs(noise)
        self.make_all(pieces.values())
        scenes = self.cut_scenes(pieces)
        return scenes, self.trials(pieces, scenes)

    def make_all(self, jobs: Iterable[Job]) -> None:
        """Make the missing results; those that another process is making come last.

        Args:
            jobs: Results to make; none depends on a later one.
        """
        jobs = list(jobs)
        missing = [job.task.key for job in jobs if not self.store.has(job.task)]
        later = []
        for job in jobs:
            if job.task.key in missing:
                which = f"{missing.index(job.task.key) + 1} of {len(missing)}"
                self.progress.note(f"{job.kind} {which}: {job.about}")
            try:
                self._make(job, wait=False)
            except BusyError:
                later.append(job)
        for job in later:
            self._make(job, wait=True)

    def _make(self, job: Job, *, wait: bool) -> None:
        begin = time.monotonic()
        resumes = job.task.stage == "training" and job.kind != f"training {FOREST}"
        made = self.store.produce(job.task, job.make, resume=resumes, wait=wait)
        self.made, self.reused = self.made + made, self.reused + (not made)
        if made:
            write_event(
                self.store.root,
                {
                    "stage": job.kind,
                    "key": job.task.key,
                    "made": True,
                    "seconds": time.monotonic() - begin,
                    "work": job.work,
                    "bytes": bytes_added(self.store.folder(job.task)),
                },
            )

    def read_trials(self, trials: Sequence[TrialJobs]) -> list[Trial]:
        """Read the results of the tests.

        Args:
            trials: From `trials`; all tests must be finished.
        """
        found = []
        for one in trials:
            for name, job in one.tests.items():
                record = read_json(self.store.folder(job.task) / SCORES)
                matrices = [
                    {bridge: np.array(rows, np.int64) for bridge, rows in record[key].items()}
                    for key in ("bridges", "sure")
                ]
                found.append(Trial(one.group, one.model, one.arm, one.seed, name, *matrices))
        return found


def open_experiment(
    settings: ExperimentSettings,
    sources: Sequence[tuple[str, Path]],
    names: Sequence[str],
    output: Path,
    progress: Progress,
) -> Experiment:
    """Find the bridges of an experiment, and check that it can be carried out on them.

    Args:
        settings: The experiment.
        sources: Name of a set and a folder: of a run, or of one bridge with a folder for each of its clouds.
        names: A name for each source that is one bridge with clouds of an older format.
        output: Folder of the results.
        progress: Listener.

    Raises:
        InputError: An unknown model or table, or bridges that lack something.
    """
    check_models(settings.models, settings.network)
    class_table(settings.table, settings.noisy_class)
    wanted: dict[str, set[str]] = {}
    for part in (*parts_in(settings, settings.arms), *(settings.test(name) for name in settings.tests)):
        wanted.setdefault(part.set, set()).update({part.cloud, part.like} - {""})
    experiment = Experiment(settings, find_bridges(sources, wanted, names), Store(output), progress)
    check_bridges(settings, experiment.splits, [(one.set, one.bridge, {*one.clouds}) for one in experiment.bridges])
    return experiment


def _fit(pairs: Sequence[tuple[Path, Path]], folder: Path) -> None:
    write_json(folder / _NOISE, fit_noise(pairs).as_json())


def _score(model: Path, source: HeldWindows, folder: Path, progress: Progress, accelerator: Device) -> None:
    score_trial(model, source, folder, progress, accelerator)


def _named(places: Sequence[WindowPlace], keys: Mapping[Path, str]) -> dict[str, Any]:
    """Describe windows for a key: their number and their hash."""
    return {"count": len(places), "digest": digest([[keys[one.folder], one.cloud, one.number] for one in places])}
