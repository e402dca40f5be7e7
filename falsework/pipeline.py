"""The chain as the paper draws it: for every scene its stage, a capture and a cloud for each survey, and the report."""

import json
import os
import time
from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import Any

from falsework.children.products import surveys_of
from falsework.platform import recon_platform, render_platform
from falsework.scenario import Scenario, given_files, scene_seed, scene_title
from falsework.stages import STAGES
from falsework.store import Store, Task, link_result
from groundwork.canonical import file_digest, folder_digest
from groundwork.errors import ChildError, InputError, OutOfSpaceError, RejectedSceneError
from groundwork.files import MARK, claim_output, space_errors, write_text
from groundwork.progress import Progress

KIND = "run"


@dataclass
class Outcome:
    """What came of one run.

    Attributes:
        made: Results made now.
        reused: Results that were there already.
        rejected: Scene name to the reason why it became no cloud.
        failed: Scene name to what went wrong.
        reports: The report page of each finished scene.
        clouds: The cloud folder of each finished survey.
    """

    made: int = 0
    reused: int = 0
    rejected: dict[str, str] = field(default_factory=dict)
    failed: dict[str, str] = field(default_factory=dict)
    reports: list[Path] = field(default_factory=list)
    clouds: list[Path] = field(default_factory=list)


def run_scenario(scenario: Scenario, out: Path, progress: Progress, scenes: Iterable[int] | None = None) -> Outcome:
    """Run the whole chain, or what is left of it, in this process.

    Args:
        scenario: What to make.
        out: Output folder: absent, empty, or of a former run.
        progress: Listener.
        scenes: Which scenes; all of the scenario when None.

    Returns:
        Counts and paths.

    Raises:
        InputError: The folder is not ours or not writable.
        OutOfSpaceError: The disk is full; finished results stay.
    """
    claim_output(out, KIND)
    with space_errors(out):
        Path(os.path.realpath(out), "run").mkdir(parents=True, exist_ok=True)  # `out` may be a link to what is not yet
        write_text(out / MARK, KIND + "\n")
        write_text(out / "scenario.toml", scenario.as_toml())
    outcome = Outcome()
    for index in range(scenario.scenes) if scenes is None else scenes:
        name = f"{index:04d}"
        try:
            _run_scene(scenario, index, out, progress, outcome)
        except RejectedSceneError as rejection:
            outcome.rejected[name] = f"{rejection.reason}: {rejection}"
        except OutOfSpaceError:
            raise
        except InputError as error:
            if scenario.scenes == 1:
                raise
            outcome.failed[name] = str(error)  # what one scene draws may not go together; the others go on
        except ChildError as error:
            outcome.failed[name] = str(error)
    return outcome


def run_task(root: Path, task: Task, inputs: dict[str, Path], progress: Progress) -> bool:
    """Make one result unless it is there: the unit of work that any worker can take.

    Args:
        root: Output folder of the run.
        task: What to make.
        inputs: Folder of each of the task's inputs.
        progress: Listener.

    Returns:
        True when it was made now.
    """
    begin = time.time()
    stage = STAGES[task.stage]
    made = Store(root).produce(
        task, lambda folder: stage.run({**task.settings, **task.manner}, inputs, folder, progress), resume=stage.resumes
    )
    event = {"stage": task.stage, "key": task.key, "made": made, "begin": begin, "seconds": time.time() - begin}
    with (root / "run" / "events.jsonl").open("a", encoding="utf-8") as file:  # not atomic: a log grows line by line
        file.write(json.dumps(event) + "\n")
    return made


def new_task(
    stage: str, settings: dict[str, Any], inputs: dict[str, str], manner: dict[str, Any] | None = None
) -> Task:
    """Describe a task of the current version of its stage.

    Args:
        stage: Row of `STAGES`.
        settings: JSON settings.
        inputs: Name to key of each input.
        manner: JSON settings that change no byte of the result.
    """
    return Task(stage, STAGES[stage].version, settings, inputs, manner or {})


def _run_scene(scenario: Scenario, index: int, out: Path, progress: Progress, outcome: Outcome) -> None:
    scene = out / "scenes" / f"{index:04d}"
    seed = scene_seed(scenario.seed, index)
    maker = _Maker(out, scene, progress, outcome)
    paths, keys = {}, {}
    paths["stage"], keys["stage"] = _stage(scenario, seed, maker)
    surveys = _surveys(scenario, paths["stage"], progress)
    for survey, variant in product(surveys, scenario.variants.combinations() or [""]):
        name = f"{survey}@{variant}" if variant else survey
        flight = _Flight(scenario, seed, survey, variant, name)
        try:
            _run_flight(flight, maker, paths, keys)
        except RejectedSceneError as rejection:
            if not variant:
                raise
            outcome.rejected[f"{index:04d}/{name}"] = f"{rejection.reason}: {rejection}"  # the other variants go on
    title = scene_title(index, scenario.seed)
    maker.make(new_task("report", {"title": title}, keys), paths, "report.html", "report.html")
    outcome.reports.append(scene / "report.html")


@dataclass(frozen=True)
class _Flight:
    """One survey of one variant of a scene.

    Attributes:
        scenario: What to make.
        seed: Seed of the scene.
        survey: Survey id.
        variant: Name of the variant, or empty.
        name: Name of its capture and cloud.
    """

    scenario: Scenario
    seed: int
    survey: str
    variant: str
    name: str


def _run_flight(flight: _Flight, maker: "_Maker", paths: dict[str, Path], keys: dict[str, str]) -> None:
    """Make the capture and the cloud of one flight, and add them to `paths` and `keys`."""
    scenario, shot, cloud = flight.scenario, f"capture/{flight.name}", f"cloud/{flight.name}"
    rendering = scenario.rendering()
    drawing = {name: rendering.pop(name) for name in ("workers", "encoders")}
    settings = {"seed": flight.seed, "survey": flight.survey, "render": rendering}
    settings |= {"variant": flight.variant} if flight.variant else {}
    settings["platform"] = render_platform(scenario.render.device)
    keys[shot] = maker.make(new_task("capture", settings, {"stage": keys["stage"]}, {"drawing": drawing}), paths, shot)
    paths[shot] = maker.scene / shot
    settings = {"recon": scenario.recon.model_dump(mode="json"), "platform": recon_platform()}
    keys[cloud] = maker.make(new_task("cloud", settings, {"capture": keys[shot]}), {"capture": paths[shot]}, cloud)
    paths[cloud] = maker.scene / cloud
    maker.outcome.clouds.append(paths[cloud])


def _surveys(scenario: Scenario, stage: Path, progress: Progress) -> list[str]:
    if scenario.stage is None:
        return [survey.id for survey in scenario.survey]
    return surveys_of(stage, tuple(Path(root) for root in scenario.stage.allow_root), progress)


@dataclass(frozen=True)
class _Maker:
    out: Path
    scene: Path
    progress: Progress
    outcome: Outcome

    def make(self, task: Task, inputs: dict[str, Path], link: str, file: str = "") -> str:
        made = run_task(self.out, task, inputs, self.progress)
        self.outcome.made += made
        self.outcome.reused += not made
        link_result(self.scene / link, Store(self.out).folder(task) / file)
        return task.key


def _stage(scenario: Scenario, seed: int, maker: _Maker) -> tuple[Path, str]:
    if scenario.stage is None:
        settings = {"seed": seed, "authoring": scenario.authoring()}
        given = given_files(scenario)  # a world or a sky counts by content
        inputs = {name: file_digest(path) if path.is_file() else folder_digest(path) for name, path in given.items()}
        return maker.scene / "stage", maker.make(new_task("stage", settings, inputs), given, "stage")
    path = Path(scenario.stage.path)
    return path, folder_digest(path.parent)  # a foreign stage counts by content, with every file that stands beside it
