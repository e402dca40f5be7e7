"""The verb that writes report pages: of a scene, a cloud, a run, a data set, models with scores, or a comparison."""

from pathlib import Path
from typing import Annotated

import tyro

from falsework.commands.answers import AsJson, tell
from falsework.commands.console import ConsoleProgress
from falsework.commands.given_files import need_page
from falsework.execution.run_folder import is_run
from groundwork.errors import InputError, MissingError
from groundwork.output.file import fresh_file
from groundwork.output.reading import reading

Sources = tyro.conf.Positional[Annotated[tuple[Path, ...], tyro.conf.arg(metavar="FOLDER ...")]]
Output = Annotated[Path, tyro.conf.arg(aliases=["-o"])]

ALLOWED = "a scene of a run, clouds, the folder of a run, a data set, a model, scores (.json), or a comparison"
SEVERAL = ("run", "model", "scores")


def report(sources: Sources, output: Output, *, as_json: AsJson = False) -> int:
    """Write a self-contained report page: of a scene, a cloud, a run, a data set, a training or a comparison.

    The kind of page depends on the content of the folder. Several runs are shown side by side in one page, and so are
    several models with their scores. The page loads nothing from the network.

    Args:
        sources: Folder of a scene (`OUT/scenes/0000`), of one or more clouds, of a run, a data set, a model or a
            comparison; JSON files of falsework evaluate.
        output: HTML file to write.
        as_json: Print one JSON object instead of a line.
    """
    for source in sources:
        if not source.exists():
            raise MissingError("no such file or folder", where=source, hint="Check the path")
    if not sources:
        raise InputError("no source for the report", allowed=ALLOWED)
    need_page(output, "--output")
    kinds = [kind_of(source) for source in sources]
    if len(sources) > 1 and not (set(kinds) <= {"run"} or set(kinds) <= {"model", "scores"}):
        raise InputError(
            "these cannot be shown on one page",
            value=", ".join(dict.fromkeys(kinds)),
            allowed="one source of any kind, several runs, or models and their scores",
        )
    _write(kinds, sources, output)
    return tell({"report": str(output)}, [f"report  {output}"], as_json)


def kind_of(source: Path) -> str:
    """Find the kind of a folder or file.

    Args:
        source: A folder, or a file.

    Returns:
        scene, cloud, run, dataset, model, scores or comparison.

    Raises:
        InputError: None of them.
    """
    if source.is_file():
        if source.suffix == ".json":
            return "scores"
        raise InputError("no report on this kind of file", where=source, allowed=ALLOWED)
    marks = {"comparison": "comparison.json", "dataset": "dataset.json", "model": "model.json", "cloud": "cloud.json"}
    for kind, mark in marks.items():
        if (source / mark).is_file():
            return kind
    if is_run(source):
        return "run"
    if (source / "capture").is_dir() or (source / "stage").exists():
        return "scene"
    if _clouds_in(source):  # result of `reconstruct --mode both`, or of `dataset demo`
        return "cloud"
    raise InputError("not a folder that a report can show", where=source, allowed=ALLOWED)


def _clouds_in(source: Path) -> dict[str, Path]:
    """List the clouds of a folder: itself, or those in it."""
    if (source / "cloud.json").is_file():
        return {source.absolute().name: source}
    found = [*source.glob("cloud/*/cloud.json"), *source.glob("*/cloud.json")]
    return {path.parent.name: path.parent for path in sorted(found)}


def _write(kinds: list[str], sources: tuple[Path, ...], page: Path) -> None:
    first, inputs = sources[0], list(sources)
    if kinds[0] == "scene":
        from falsework.commands.verbs import report_scene

        report_scene(first, page)
        return
    from falsework.report.page import way_to

    with ConsoleProgress() as progress, reading(*inputs), fresh_file(page, inputs) as temporary:
        if kinds[0] == "run":
            from falsework.execution.run_facts import run_facts
            from falsework.report.run_page import write_run_page

            write_run_page(temporary, [run_facts(run, way_to(run, page)) for run in sources])
        elif kinds[0] == "cloud":
            from falsework.report.cloud_page import write_cloud_page

            clouds = _clouds_in(first)
            title = f"{'Clouds' if len(clouds) > 1 else 'Cloud'} {first.absolute().name}"
            write_cloud_page(temporary, title, clouds, page)
        elif kinds[0] == "dataset":
            from falsework.report.dataset_page import write_dataset_page

            write_dataset_page(temporary, first, way_to(first, page), progress)
        elif kinds[0] == "comparison":
            from falsework.report.comparison_page import write_comparison_page

            write_comparison_page(temporary, first)
        else:
            from falsework.report.training_page import write_training_page

            named = list(zip(kinds, sources, strict=True))
            models = {_name(source, sources): source for kind, source in named if kind == "model"}
            scores = {_name(source, sources): source for kind, source in named if kind == "scores"}
            write_training_page(temporary, models, scores)


def _name(source: Path, sources: tuple[Path, ...]) -> str:
    """Name a source by its last part, or by its whole path if another one has the same name."""
    alike = [other for other in sources if other.stem == source.stem and other.suffix == source.suffix]
    return source.absolute().stem if len(alike) < 2 else str(source)
