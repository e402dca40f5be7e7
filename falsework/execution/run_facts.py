"""Facts of a run, read from its folder: scenes, results, rejections, points of each class, times."""

from pathlib import Path
from typing import Any

from falsework.execution.events import read_events
from falsework.execution.run_folder import is_run
from falsework.report.page import file_link
from falsework.report.run_page import Event, FailureRow, RunFacts, SceneRow, write_run_page
from falsework.scenario import scene_seed
from falsework.store.failures import read_failure
from groundwork.errors import InputError, MissingError
from groundwork.files import read_json
from groundwork.foreign_file import is_regular
from groundwork.settings import read_toml

STAGES = ("stage", "capture", "model", "cloud", "report")
REPORT = "report.html"
RUN = "run"


def run_facts(root: Path, place: str, *, times: bool = True) -> RunFacts:
    """Read the facts of a run.

    Args:
        root: Its output folder.
        place: Relative path from the page to that folder.
        times: Whether to read the log of times.

    Raises:
        MissingError: Not the folder of a run.
    """
    if not is_run(root):
        raise MissingError(
            "not a run: no scenario.toml with scenes", where=root, hint="Name an output folder of falsework run"
        )
    scenario = read_toml(root / "scenario.toml")
    seed, count = int(scenario.get("seed", 0)), int(scenario.get("scenes", 1))
    scenes = sorted(path for path in root.glob("scenes/*") if path.is_dir())
    events = [event for told in read_events(root) if (event := _event(told)) is not None] if times else []
    return RunFacts(
        name=root.absolute().name,
        stages=STAGES,
        wanted=count,
        scenes=[_scene(path, place) for path in scenes if _is_wanted(path.name, count)],
        failures=[row for row in _failures(root, scenes, seed, count) if _is_wanted(row.scene, count)],
        events=events,
        settings=scenario,
    )


def write_run_report(root: Path) -> None:
    """Write `run/report.html`, the only page that holds times.

    Args:
        root: Output folder of a run.
    """
    write_run_page(root / RUN / REPORT, [run_facts(root, "..")])


def _scene(folder: Path, place: str) -> SceneRow:
    results, clouds, cameras = {}, {}, {}
    for stage in STAGES:
        found = folder / stage
        if stage == "stage":
            results[stage] = int(found.exists())
        elif stage == "report":
            results[stage] = int((folder / REPORT).exists())
        else:
            results[stage] = sum(path.exists() for path in found.glob("*"))
    for path in sorted(folder.glob("cloud/*")):
        try:
            told = read_json(path / "cloud.json")
            counts = told["statistics"].get("points_per_class") or {}
            clouds[path.name] = {str(name): int(count) for name, count in counts.items()}
            good = sum(row["status"] == "ok" for row in told["cameras"])
            cameras[path.name] = (good, len(told["cameras"]))
        except (OSError, InputError, KeyError, TypeError, ValueError, AttributeError):
            continue  # `falsework verify` finds the faults
    page = file_link(*place.split("/"), "scenes", folder.name, REPORT) if (folder / REPORT).exists() else ""
    return SceneRow(folder.name, results, clouds, cameras, page)


def _is_wanted(name: str, count: int) -> bool:
    """Tell whether a scene is one of the scenario, whose number of scenes may have been lowered; unknown ones are."""
    return not name.isdecimal() or int(name) < count


def _failures(root: Path, scenes: list[Path], seed: int, count: int) -> list[FailureRow]:
    """Read the records of failures; a record holds inputs or a seed, which identify the scene."""
    seeds = {scene_seed(seed, index): f"{index:04d}" for index in range(count)}
    owners = {key: scene.name for scene in scenes for key in _keys(scene)}
    rows = []
    for path in sorted(root.glob("failed/*.json")):
        failure = read_failure(path)
        if failure is None:
            continue
        try:
            record = read_json(path)
            scene = _scene_of(root, record.get("inputs", {}), owners, seeds)
            drawn = record.get("settings", {}).get("seed", -1)
            if not scene and drawn != -1 and drawn not in seeds:  # of a former scene
                continue
            scene = scene or seeds.get(drawn, "")
            stage = str(record.get("stage", ""))
        except (OSError, InputError, AttributeError, TypeError, KeyError):
            scene, stage = "", ""
        rows.append(FailureRow(scene, stage, failure.kind, failure.reason, failure.message, failure.last_lines))
    return sorted(rows, key=lambda row: (row.scene or "~", row.stage))


def _scene_of(root: Path, inputs: dict[str, str], owners: dict[str, str], seeds: dict[int, str]) -> str:
    """Name the scene of a result by its inputs; the record of an input that was removed names its own, or its seed."""
    for key in inputs.values():
        if key in owners:
            return owners[key]
    for name, key in sorted(inputs.items()):
        stage = name.partition("/")[0]
        record = root / "evicted" / stage / f"{key}.json"
        if stage in STAGES and key.isalnum() and is_regular(record):
            former = read_json(record)
            if former.get("stage") != stage:
                continue
            drawn = seeds.get(former.get("settings", {}).get("seed", -1), "")
            if scene := _scene_of(root, _inputs_before(former), owners, seeds) or drawn:
                return scene
    return ""


def _inputs_before(record: dict[str, Any]) -> dict[str, str]:
    """List the inputs of earlier stages, so that the search ends for any file."""
    stage = STAGES.index(record["stage"])
    return {name: key for name, key in record["inputs"].items() if name.partition("/")[0] in STAGES[:stage]}


def _keys(scene: Path) -> list[str]:
    """List the keys of the results that a scene links to."""
    links = [scene / "stage", *scene.glob("capture/*"), *scene.glob("model/*"), *scene.glob("cloud/*")]
    return [link.readlink().name for link in links if link.is_symlink()]


def _event(told: dict[str, Any]) -> Event | None:
    """Convert the event of a made result; other and invalid events are skipped."""
    if not told.get("made"):
        return None
    try:
        return Event(
            str(told.get("scene", "")),
            str(told["stage"]),
            float(told["end"]),
            max(float(told["seconds"]), 0.0),
            int(told.get("bytes", 0)),
        )
    except (KeyError, TypeError, ValueError, OverflowError):
        return None
