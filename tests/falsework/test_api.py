"""What is wrong with a call from Python is said as on the command line, before anything is written."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import is_dataclass, replace
from inspect import isfunction
from itertools import count
from pathlib import Path
from typing import Any, get_args, get_type_hints

import cv2
import numpy as np
import pytest
from pydantic import BaseModel

import falsework
import falsework.api
import falsework.api_reading
from falsework.arguments import of_python
from tests.falsework.served_here import served_here
from tests.learn.toy_bridge import toy_cloud

STAGE = """#usda 1.0
(
    metersPerUnit = 1
    upAxis = "Z"
)
def Xform "W" (
    references = @../other/o.usda@</O>
)
{
}
"""
SCENARIO = {"sample": [{"kind": "mesh"}]}
WRONG: Any = {"density": 1.0}
EMPTY: Any = {}
NUMBER: Any = 5
WORD: Any = "2"
YES: Any = True
HALF: Any = 1.5
BYTES: Any = b"x.usda"
LONE: Any = np.array(0)


def photographs(out: Path) -> str:
    """Name a folder of one photograph beside the output."""
    (out.parent / "photographs").mkdir()
    cv2.imwrite(str(out.parent / "photographs/a.jpg"), np.zeros((64, 64, 3), np.uint8))
    return str(out.parent / "photographs")


def one_box(out: Path) -> str:
    """Write a stage of one box beside the output."""
    path = out.parent / "s.usda"
    path.write_text('#usda 1.0\n(\n    metersPerUnit = 1\n    upAxis = "Z"\n)\ndef Cube "Box"\n{\n}\n')
    return str(path)


def read_with(**choices: Any) -> object:
    """Read a stage with one choice."""
    return falsework.read_stage("x.usda", choices=falsework.StageChoices(**choices))


CALLS: dict[str, tuple[Callable[[Path], object], str]] = {
    "a file as scenario": (lambda out: falsework.author("x.toml", out), "use load_scenario"),  # type: ignore[arg-type]
    "workers": (lambda out: falsework.run(SCENARIO, out, workers=-1), "number of workers out of range"),
    "scenes": (lambda out: falsework.run(SCENARIO, out, scenes=[9]), "no such scene"),
    "settings to sample": (lambda out: falsework.sample("x.usda", out, WRONG), "^settings: of a wrong class"),
    "settings to render": (lambda out: falsework.render("x.usda", out, settings=WRONG), "^settings: of a wrong class"),
    "settings to reconstruct": (lambda out: falsework.reconstruct("x", out, settings=WRONG), "allowed: ReconSettings"),
    "a number as out": (
        lambda out: falsework.author(SCENARIO, NUMBER),
        r"out: not a path \(found 'int'\); allowed: a str or",
    ),
    "a negative seed": (lambda out: falsework.render("x", out, seed=-1), r"seed: seed out of range \(found -1\)"),
    "bytes as stage": (lambda out: falsework.render(BYTES, out), r"stage: not a path \(found 'bytes'\)"),
    "a number as capture": (lambda out: falsework.reconstruct(NUMBER, out), "capture: not a path"),
    "a number as control": (lambda out: falsework.reconstruct(out, out, control=NUMBER), "control: not a path"),
    "a number as model": (lambda out: falsework.reconstruct(out, out, model=NUMBER), "model: not a path"),
    "a number as root": (
        lambda out: falsework.sample("x.usda", out, falsework.MeshSettings(), allow_roots=[NUMBER]),
        "allow_roots: not a path",
    ),
    "a number as a scene": (lambda out: falsework.swap(NUMBER, out, look="clean"), "scene: not a path"),
    "a scene that is missing": (lambda out: falsework.swap("x", out, look="clean"), "x: holds no scene.usda"),
    "a number as a look": (lambda out: falsework.swap("x", out, look=NUMBER), "look: not a path"),
    "a number as roots": (lambda out: falsework.render("x", out, allow_roots=NUMBER), "allow_roots: not a path"),
    "a number as a folder of a run": (lambda out: falsework.run(SCENARIO, NUMBER), "out: not a path"),
    "a number as a cloud's folder": (lambda out: falsework.save_cloud(toy_cloud(1, 50), NUMBER), "out: not a path"),
    "a number as a cloud": (lambda out: falsework.read_cloud(NUMBER), "folder: not a path"),
    "a number as the folder of a capture": (lambda out: falsework.read_capture(NUMBER), "folder: not a path"),
    "a number as the folder of a truth": (lambda out: falsework.read_truth(NUMBER), "capture: not a path"),
    "a number as a stage": (lambda out: falsework.read_stage(NUMBER), "path: not a path"),
    "a number as a scenario": (lambda out: falsework.load_scenario(NUMBER), "path: not a path"),
    "a number as a scenario's path": (lambda out: falsework.scenario_of({}, NUMBER), "path: not a path"),
    "a missing model as str": (lambda out: falsework.reconstruct(".", out, model="x"), "x: model: no such folder"),
    "a missing control as str": (lambda out: falsework.reconstruct(photographs(out), out, control="x"), "x: no such"),
    "an empty dict as settings": (
        lambda out: falsework.render("x", out, settings=EMPTY),
        "^settings: of a wrong class",
    ),
    "a number as scenes": (
        lambda out: falsework.run(SCENARIO, out, scenes=NUMBER),
        r"^scenes: of a wrong type \(found 'int'\); allowed: whole numbers, such as \[0, 2\] or range\(3\)$",
    ),
    "an array without an axis as scenes": (
        lambda out: falsework.run(SCENARIO, out, scenes=LONE),
        r"^scenes: of a wrong type \(found 'ndarray'\); allowed: whole numbers",
    ),
    "a word as scenes": (lambda out: falsework.run(SCENARIO, out, scenes=WORD), "scenes: of a wrong type"),
    "words as scenes": (lambda out: falsework.run(SCENARIO, out, scenes=[WORD]), "scenes: .* allowed: a whole number$"),
    "a word as workers": (lambda out: falsework.run(SCENARIO, out, workers=WORD), "workers: of a wrong type .*'str'"),
    "True as workers": (lambda out: falsework.run(SCENARIO, out, workers=YES), "workers: of a wrong type .*'bool'"),
    "a word as memory": (
        lambda out: falsework.run(SCENARIO, out, memory=WORD),
        "memory: .* allowed: a number of GB, or None$",
    ),
    "a word to retry": (lambda out: falsework.run(SCENARIO, out, retry_failed=WORD), "retry_failed: .*True or False$"),
    "a number as cluster": (
        lambda out: falsework.run(SCENARIO, out, cluster=NUMBER),
        "cluster: .* allowed: a str, or None$",
    ),
    "a place as cluster": (lambda out: falsework.run(SCENARIO, out, cluster="x"), "^cluster: not an address"),
    "half a scene": (lambda out: falsework.author(SCENARIO, out, scene=HALF), "scene: of a wrong type .*'float'"),
    "a missing scene": (lambda out: falsework.author(SCENARIO, out, scene=9), "^scene: no such scene"),
    "a word as seed": (lambda out: falsework.render("x", out, seed=WORD), "seed: of a wrong type"),
    "a number as survey": (lambda out: falsework.render("x", out, survey=NUMBER), "survey: of a wrong type"),
    "True as progress": (lambda out: falsework.run(SCENARIO, out, progress=YES), "progress: cannot listen .*'bool'"),
    "a class as progress": (
        lambda out: falsework.author(SCENARIO, out, progress=falsework.ConsoleProgress),  # type: ignore[arg-type]
        "progress: cannot listen .*stage, advance, note",
    ),
    "a dict as choices": (lambda out: falsework.read_stage("x", choices=EMPTY), "choices: .* allowed: StageChoices$"),
    "a number as survey to read": (lambda out: falsework.read_stage("x", survey=NUMBER), "survey: of a wrong type"),
    "a missing camera": (
        lambda out: falsework.read_stage(one_box(out), choices=falsework.StageChoices(camera="x")),
        r"s\.usda: choices\.camera: no such camera|^choices\.camera: no such camera",
    ),
    "a path as a cloud": (lambda out: falsework.save_cloud(WORD, out), "cloud: .*; a folder of one is read by"),
    "a number as a section": (lambda out: falsework.scenario_of({NUMBER: {}}), "scenario: .*5"),
    "a column": (
        lambda out: falsework.save_cloud(
            replace(toy_cloud(1, 50), columns={**toy_cloud(1, 50).columns, "mine": np.zeros(50)}), out
        ),
        "not a column of the format",
    ),
    **{
        f"{field} of {value}": (
            lambda out, field=field, value=value: read_with(**{field: value}),
            rf"^choices\.{field}: {said}; allowed: ",
        )
        for field, value, said in (
            ("camera", 7, r"not a camera \(found 7\)"),
            ("purposes", ("render", "foo"), r"not a USD purpose \(found 'foo'\)"),
            ("frames", (1.0, float("nan")), r"not time codes \(found nan\)"),
            ("frames", "7", r"not time codes \(found '7'\)"),
            ("frames", 5.0, r"not time codes \(found 5.0\)"),
            ("frames", np.array(5.0), r"not time codes \(found array\(5\.\)\)"),
            ("frames", (True,), r"not time codes \(found True\)"),
            ("frames", count(), "too many time codes"),
            ("purposes", "render", r"not a USD purpose \(found 'render'\)"),
            ("purposes", 5, r"not a USD purpose \(found 5\)"),
            ("variants", 5, r"not a variant \(found 5\)"),
            ("variants", ("/World", "roof", "flat"), r"not a variant \(found '/World'\)"),
            ("variants", (("/World", "roof", 5),), r"not a variant \(found 5\)"),
            ("variants", (("/World", "roof"),), r"not a variant \(found \('/World', 'roof'\)\)"),
            ("width", -5, r"image size out of range \(found -5\)"),
            ("width", True, r"image size out of range \(found True\)"),
            ("width", 640.0, r"image size out of range \(found 640.0\)"),
            ("height", "640", r"image size out of range \(found '640'\)"),
            ("subdivision", 5, r"number of refinements out of range \(found 5\)"),
        )
    },
    "choices of another class": (
        lambda out: falsework.read_stage("x.usda", choices=WRONG),
        r"choices: of a wrong type \(found 'dict'\); allowed: StageChoices",
    ),
    "a list as a column": (
        lambda out: falsework.save_cloud(
            replace(toy_cloud(1, 50), columns={**toy_cloud(1, 50).columns, "segment": [0] * 50}), out
        ),
        r"^/.*/out/segment\.npy: segment: a column is not an array",
    ),
}


@pytest.mark.parametrize("name", CALLS)
def test_a_wrong_call_is_one_line(name: str, tmp_path: Path) -> None:
    """An `InputError` that says what is allowed; the output folder holds no result."""
    call, said = CALLS[name]
    with pytest.raises(falsework.InputError, match=said):
        call(tmp_path / "out")
    assert not list((tmp_path / "out").glob("*"))


def test_numbers_of_numpy_are_numbers(tmp_path: Path) -> None:
    """A scene, a seed and workers may come from an array."""
    with pytest.raises(falsework.InputError, match=r"scene: no such scene \(found 9\)"):
        falsework.author(SCENARIO, tmp_path / "out", scene=np.int64(9))  # type: ignore[arg-type]
    yes: Any = np.True_
    with pytest.raises(falsework.InputError, match="scenes: no such scene"):
        falsework.run(SCENARIO, tmp_path / "out", scenes=[9], retry_failed=yes)
    numbers: Any = np.array([7, 9])
    with pytest.raises(falsework.InputError, match=r"scenes: no such scene \(found \[7, 9\]\)"):
        falsework.run(SCENARIO, tmp_path / "out", scenes=numbers)


def test_an_error_names_arguments_instead_of_options() -> None:
    """In its hints too, and from a child, of which only the text is known; a command to type stays as it is."""

    @of_python
    def call(out: str, allow_roots: str = "", workers: int = 0) -> None:
        raise falsework.InputError(out)

    for said, wanted in {
        "x: -o: is a folder. Give --allow-root DIR or --output": "x: out: is a folder. Give allow_roots DIR or out",
        "--workers: only 0 with --cluster": "workers: only 0 with --cluster",
        "no world. Import it with falsework background import FILE -o DIR": None,
        "a-workers and x--workers, -1 and - o": None,
        "(--workers) or --workers, -o; --workers: 5.": "(workers) or workers, out; workers: 5.",
        "/tmp/rv/-out: --out is no folder": "/tmp/rv/-out: out is no folder",
        "/tmp/--out/-o/a -o.txt": None,
        "not a world (found '--out') nor \"-o it's\"; its user's --out": (
            "not a world (found '--out') nor \"-o it's\"; its user's out"
        ),
        "Try falsework export /a/b.usd --to laz -o DIR. Give --out": (
            "Try falsework export /a/b.usd --to laz -o DIR. Give out"
        ),
    }.items():
        with pytest.raises(falsework.InputError) as caught:
            call(said)
        assert str(caught.value) == (wanted or said)


def test_a_file_whose_name_holds_an_option_keeps_it() -> None:
    """The place of an error is no text of ours."""

    @of_python
    def call(out: str) -> None:
        raise falsework.InputError("is a folder", where=out, field="--out")

    with pytest.raises(falsework.InputError) as caught:
        call("/tmp/my --out file")
    assert str(caught.value) == "/tmp/my --out file: out: is a folder"


def test_one_folder_as_root_is_that_folder_alone(tmp_path: Path) -> None:
    """The letters of its name are no roots: a slash among them would open the whole disk."""
    for folder in ("stage", "other"):
        (tmp_path / folder).mkdir()
    (tmp_path / "other/o.usda").write_text('#usda 1.0\ndef Xform "O"\n{\n    def Cube "Box"\n    {\n    }\n}\n')
    stage = tmp_path / "stage/s.usda"
    stage.write_text(STAGE)
    for roots in ("/nonexistent", ["/nonexistent"], ()):
        apart = roots == "/nonexistent"  # once each with its child
        with nullcontext() if apart else served_here(), pytest.raises(falsework.InputError, match=r"o\.usda"):
            falsework.render(stage, tmp_path / "out", allow_roots=roots)
    for roots in (str(tmp_path / "other"), [str(tmp_path / "other")]):
        with nullcontext() if isinstance(roots, str) else served_here():
            scan = falsework.sample(stage, tmp_path / "out", falsework.MeshSettings(density=5.0), allow_roots=roots)
        assert len(scan)


PATHS = {
    "author": {"out"},
    "swap": {"scene", "out", "look", "background", "allow_roots"},
    "render": {"stage", "out", "allow_roots"},
    "reconstruct": {"capture", "out", "control", "model"},
    "sample": {"stage", "out", "allow_roots"},
    "run": {"out"},
    "save_cloud": {"out"},
    "read_stage": {"path"},
    "read_capture": {"folder"},
    "read_truth": {"capture"},
    "read_cloud": {"folder"},
    "load_image": set(),
    "load_scenario": {"path"},
    "scenario_of": {"path"},
    "segment_with_noise": set(),
}


def test_every_path_may_be_a_str_or_a_path() -> None:
    """No argument of a function takes a Path alone."""
    public = {name: getattr(falsework, name) for name in falsework.__all__}
    functions = {name for name, what in public.items() if isfunction(what)}
    assert functions == set(PATHS)
    for name in functions:
        hints = get_type_hints(public[name], {**vars(falsework.api), **vars(falsework.api_reading), **public})
        hints.pop("return")
        spelled = {argument: str(hint) for argument, hint in hints.items()}
        assert {argument for argument, hint in spelled.items() if "Path" in hint or "PathLike" in hint} == PATHS[name]
        for argument in PATHS[name]:
            assert "str | os.PathLike[str]" in spelled[argument], (name, argument)


def own_classes(hint: object) -> set[type]:
    """Take the project's own classes out of an annotation."""
    inner = {found for part in get_args(hint) for found in own_classes(part)}
    rooms = ("groundwork", "usd_schemas", "authoring", "render", "recon", "learn", "falsework")
    is_own = isinstance(hint, type) and hint.__module__.partition(".")[0] in rooms
    return inner | ({hint} if isinstance(hint, type) and is_own else set())


def test_every_type_that_an_argument_needs_is_public() -> None:
    """Classes of arguments and results, and of their fields; a scenario is given as a table of its own."""
    public = {name: getattr(falsework, name) for name in falsework.__all__}
    needed: set[type] = set()
    for name in PATHS:
        for hint in get_type_hints(
            public[name], {**vars(falsework.api), **vars(falsework.api_reading), **public}
        ).values():
            needed |= own_classes(hint)
    waiting = needed - {falsework.Scenario}
    while waiting:
        kind = waiting.pop()
        fields: list[object] = []
        if issubclass(kind, BaseModel):
            fields = [field.annotation for field in kind.model_fields.values()]
        elif is_dataclass(kind):
            fields = list(get_type_hints(kind).values())
        more = set[type]().union(*(own_classes(field) for field in fields)) - needed
        needed, waiting = needed | more, waiting | more
    assert {kind.__name__ for kind in needed} <= set(public)
    assert {kind for kind in needed if public[kind.__name__] is not kind} == set()
    reached = {"SensorSettings", "DenseSettings", "Capture", "TerrestrialSettings", "CameraTrack", "Pinhole", "Readout"}
    assert reached <= {kind.__name__ for kind in needed}
