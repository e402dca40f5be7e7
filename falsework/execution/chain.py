"""Descriptions of a scene's steps: its stage, captures, models and clouds of each flight, samples, report."""

import os
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import Any, get_args

from authoring.streams import stream
from falsework.children.products import surveys_of
from falsework.platform import author_platform, recon_platform, render_platform, report_platform, sample_platform
from falsework.scenario import Scenario, given_files, scene_seed, scene_title
from falsework.stages import SEVERAL, STAGES
from falsework.store.store import Task
from groundwork.canonical import digest, file_digest, folder_digest
from groundwork.errors import InputError
from groundwork.marks import content_files, outputs_below
from groundwork.output.place import RUN
from groundwork.output.reading import reading
from groundwork.progress import Progress
from groundwork.slug import slug
from recon.sampling.sampler_settings import AnySample
from recon.settings import Mode

FOREIGN_STAGE = "foreign stage"
LARGE = 1_000_000_000  # bytes of an input whose reading is announced


@dataclass(frozen=True)
class Step:
    """One task of a scene, with the sources of its inputs.

    Attributes:
        task: The task.
        link: Readable name below the folder of the scene, e.g. `capture/local`.
        parents: Names of the inputs that other steps make, with these steps.
        given: Names of the inputs that exist already, with their paths.
        file: File of the result that the link points to; empty for the folder.
    """

    task: Task
    link: str
    parents: "dict[str, Step]" = field(default_factory=dict)
    given: dict[str, Path] = field(default_factory=dict)
    file: str = ""

    @property
    def kind(self) -> str:
        """Kind of the step as in the scenario's `keep`: stage, capture, model, cloud or report."""
        return self.link.partition("/")[0].removesuffix(".html")

    @property
    def input_name(self) -> str:
        """Name of the result as an input of other tasks; its first part is the stage that made it."""
        return self.task.stage + self.link.removeprefix(self.kind)


@dataclass(frozen=True)
class Flight:
    """One survey of one variant of a scene.

    Attributes:
        name: Name of its capture, and of its clouds.
        variant: Name of the variant, or empty.
        capture: The step that renders it.
        model: The step of structure from motion.
        clouds: The steps that make clouds from the model.
    """

    name: str
    variant: str
    capture: Step
    model: Step
    clouds: tuple[Step, ...]

    @property
    def steps(self) -> tuple[Step, ...]:
        """All steps, each after its inputs."""
        return (self.capture, self.model, *self.clouds)

    @property
    def possible_links(self) -> frozenset[str]:
        """Links of its clouds, also of those that a run with another mode has made."""
        return frozenset(f"cloud/{self.name}{mode}" for mode in ("", *(f"{SEVERAL}{one}" for one in get_args(Mode))))


@dataclass(frozen=True)
class Sources:
    """External inputs of a scenario, read once for all scenes.

    Attributes:
        surveys: Name of each survey.
        given: Name of each external input to its path.
        digests: Name of each external input to the hash of its contents.
    """

    surveys: tuple[str, ...]
    given: dict[str, Path]
    digests: dict[str, str]


@dataclass(frozen=True)
class Chain:
    """The steps of one scene.

    Attributes:
        name: Number of the scene, four digits.
        title: Title for people.
        stage: The step that authors it; None if it starts from an existing stage.
        flights: Its flights.
        samples: The steps that sample its surface.
        sources: External inputs of the scenario.
    """

    name: str
    title: str
    stage: Step | None
    flights: tuple[Flight, ...]
    samples: tuple[Step, ...]
    sources: Sources

    @property
    def steps(self) -> tuple[Step, ...]:
        """All steps except the report, each after its inputs."""
        stage = () if self.stage is None else (self.stage,)
        return (*stage, *(step for flight in self.flights for step in flight.steps), *self.samples)

    def report(self, without: frozenset[str] = frozenset()) -> Step:
        """Return the last step, the report.

        Args:
            without: Links of the steps that have no result.
        """
        parents = {step.input_name: step for step in self.steps if step.kind != "model" and step.link not in without}
        given, keys = _stage_input(self.stage, self.sources)
        inputs = {**keys, **{name: step.task.key for name, step in parents.items()}}
        task = new_task("report", {"title": self.title, "platform": report_platform()}, inputs)
        return Step(task, "report.html", parents, given, "report.html")


def read_sources(scenario: Scenario, progress: Progress) -> Sources:
    """List the surveys, and hash the external inputs of a scenario.

    Args:
        scenario: What to make.
        progress: Listener.

    Raises:
        InputError: The stage that it starts from cannot be rendered, or a sample has the name of one of its surveys.
    """
    if scenario.stage is None:
        given = given_files(scenario)  # imported worlds and skies are identified by their content
        for path in given.values():
            _tell_of_large(path, progress)
        digests = {name: file_digest(path) if path.is_file() else folder_digest(path) for name, path in given.items()}
        return Sources(tuple(survey.id for survey in scenario.survey), given, digests)
    path = Path(scenario.stage.path)
    roots = tuple(Path(root) for root in scenario.stage.allow_root)
    surveys = surveys_of(path, roots, progress) if scenario.survey else []
    both = {slug(survey) for survey in surveys} & {sample.id for sample in scenario.sample}
    if both:
        raise InputError(
            "a sample has the same name as a survey of the stage",
            field="sample.id",
            value=min(both),
            hint="Give it another id",
        )
    # Identified by its name and the content of all files beside it and in the roots, except runs. Where the path is a
    # link, what it loads lies beside the file that it leads to.
    real = Path(os.path.realpath(path))
    with reading(real, *roots):
        apart = [root for root in roots if not Path(os.path.realpath(root)).is_relative_to(real.parent)]
        for place in (real.parent, *apart):
            _tell_of_large(place, progress)
        found = digest([real.name, *(_digest(place, (real.parent, *roots)) for place in (real.parent, *apart))])
    return Sources(tuple(surveys), {FOREIGN_STAGE: path}, {FOREIGN_STAGE: found})


def _tell_of_large(place: Path, progress: Progress) -> None:
    """Say that reading a large input takes a while."""
    sizes = {path: path.stat().st_size for path in ([place] if place.is_file() else content_files(place))}
    if sum(sizes.values()) <= LARGE:  # the runs in it, which are not read, need not be sought
        return
    runs = outputs_below(place, RUN) if place.is_dir() else set[Path]()
    size = sum(size for path, size in sizes.items() if not runs or runs.isdisjoint(path.parents))
    if size > LARGE:
        progress.note(f"{place}: {size / 1e9:.1f} GB are read, since results depend on their content")


def _digest(root: Path, roots: tuple[Path, ...]) -> str:
    """Hash what a stage may read in one of its roots; files elsewhere, also those behind links, are refused to it."""
    return file_digest(root) if root.is_file() else folder_digest(root, without=RUN, within=roots)


def scene_chain(scenario: Scenario, index: int, sources: Sources) -> Chain:
    """Describe every step of a scene.

    Args:
        scenario: What to make.
        index: Number of the scene.
        sources: Its external inputs.
    """
    seed = scene_seed(scenario.seed, index)
    stage = None
    if scenario.stage is None:
        settings = {"seed": seed, "authoring": scenario.authoring(), "platform": author_platform()}
        task = new_task("stage", settings, sources.digests)
        stage = Step(task, "stage", given=sources.given)
    variants = scenario.variants.combinations() or [""]
    pairs = product(sources.surveys, variants)
    flights = tuple(_flight(scenario, seed, survey, variant, stage, sources) for survey, variant in pairs)
    pairs = product(scenario.sample, variants)
    samples = tuple(_sample(scenario, seed, sample, variant, stage, sources) for sample, variant in pairs)
    return Chain(f"{index:04d}", scene_title(index, scenario.seed), stage, flights, samples, sources)


def new_task(
    stage: str, settings: dict[str, Any], inputs: dict[str, str], manner: dict[str, Any] | None = None
) -> Task:
    """Make a task with the current version of its stage.

    Args:
        stage: Row of `STAGES`.
        settings: JSON settings.
        inputs: Name to key of each input.
        manner: JSON settings that change no byte of the result.
    """
    return Task(stage, STAGES[stage].version, settings, inputs, manner or {})


def _flight(scenario: Scenario, seed: int, survey: str, variant: str, stage: Step | None, sources: Sources) -> Flight:
    name = f"{slug(survey)}@{slug(variant)}" if variant else slug(survey)  # the surveys of an existing stage
    rendering = scenario.rendering()
    drawing = {part: rendering.pop(part) for part in ("workers", "encoders")}
    settings = {"seed": seed, "survey": survey, "render": rendering}
    settings |= {"variant": variant} if variant else {}
    settings["platform"] = render_platform(scenario.render.device)
    given, keys = _stage_input(stage, sources)
    parents = {} if stage is None else {"stage": stage}
    keys = keys if stage is None else {"stage": stage.task.key}
    capture = Step(new_task("capture", settings, keys, {"drawing": drawing}), f"capture/{name}", parents, given)
    recon, platform = scenario.recon, recon_platform()
    limits = {"limits": recon.limits()}
    settings = {"recon": recon.of_model(), "platform": platform}
    model = Step(
        new_task("model", settings, {"capture": capture.task.key}, limits), f"model/{name}", {"capture": capture}
    )
    both = {"capture": capture, "model": model}
    keys = {name: step.task.key for name, step in both.items()}
    clouds = tuple(
        Step(
            new_task("cloud", {"recon": recon.of_cloud(mode), "platform": platform}, keys, limits),
            f"cloud/{name}" + (f"{SEVERAL}{mode}" if len(recon.modes) > 1 else ""),
            both,
        )
        for mode in recon.modes
    )
    return Flight(name, variant, capture, model, clouds)


def _sample(
    scenario: Scenario, seed: int, sample: AnySample, variant: str, stage: Step | None, sources: Sources
) -> Step:
    """Describe one sampled cloud; it has its own random stream, which depends on the `seed` of the section."""
    layer = f"sample/{sample.id}" + (f"/{sample.seed}" if sample.seed else "")
    drawn = int(stream(seed, layer).integers(2**31))
    values = {**sample.model_dump(mode="json", exclude={"id"}), "seed": drawn}
    kind = values.pop("kind") if sample.kind == "mesh" else sample.kind  # scanners have a setting with this name
    settings = {"kind": kind, "sample": values, "platform": sample_platform()}
    settings |= {"variant": variant} if variant else {}
    given, keys = _stage_input(stage, sources)
    parents = {} if stage is None else {"stage": stage}
    keys = keys if stage is None else {"stage": stage.task.key}
    manner = {} if scenario.stage is None else {"allow_roots": [os.path.realpath(r) for r in scenario.stage.allow_root]}
    link = f"cloud/{sample.id}@{slug(variant)}" if variant else f"cloud/{sample.id}"
    return Step(new_task("sample", settings, keys, manner), link, parents, given)


def _stage_input(stage: Step | None, sources: Sources) -> tuple[dict[str, Path], dict[str, str]]:
    """Return path and hash of an existing stage."""
    if stage is not None:
        return {}, {}
    return {"stage": sources.given[FOREIGN_STAGE]}, {"stage": sources.digests[FOREIGN_STAGE]}
