"""What is wrong with a call from Python is said as on the command line, before anything is written."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args, get_type_hints

import numpy as np
import pytest
from pydantic import BaseModel

import falsework
import falsework.api
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

CALLS: dict[str, tuple[Callable[[Path], object], str]] = {
    "a file as scenario": (lambda out: falsework.author("x.toml", out), "load_scenario reads a file"),  # type: ignore[arg-type]
    "workers": (lambda out: falsework.run(SCENARIO, out, workers=-1), "number of workers out of range"),
    "scenes": (lambda out: falsework.run(SCENARIO, out, scenes=[9]), "no such scene"),
    "settings to sample": (lambda out: falsework.sample("x.usda", out, WRONG), "settings of a wrong class"),
    "settings to render": (lambda out: falsework.render("x.usda", out, settings=WRONG), "settings of a wrong class"),
    "settings to reconstruct": (lambda out: falsework.reconstruct("x", out, settings=WRONG), "allowed: ReconSettings"),
    "a column": (
        lambda out: falsework.save_cloud(
            replace(toy_cloud(1, 50), columns={**toy_cloud(1, 50).columns, "mine": np.zeros(50)}), out
        ),
        "a column that the format does not have",
    ),
}


@pytest.mark.parametrize("name", CALLS)
def test_a_wrong_call_is_one_line(name: str, tmp_path: Path) -> None:
    """An `InputError` that says what is allowed; the output folder holds no result."""
    call, said = CALLS[name]
    with pytest.raises(falsework.InputError, match=said):
        call(tmp_path / "out")
    assert not list((tmp_path / "out").glob("*"))


def test_one_folder_as_root_is_that_folder_alone(tmp_path: Path) -> None:
    """The letters of its name are no roots: a slash among them would open the whole disk."""
    for folder in ("stage", "other"):
        (tmp_path / folder).mkdir()
    (tmp_path / "other/o.usda").write_text('#usda 1.0\ndef Xform "O"\n{\n    def Cube "Box"\n    {\n    }\n}\n')
    stage = tmp_path / "stage/s.usda"
    stage.write_text(STAGE)
    for roots in ((), "/nonexistent", ["/nonexistent"]):
        with pytest.raises(falsework.InputError, match=r"o\.usda"):
            falsework.render(stage, tmp_path / "out", allow_roots=roots)
    for roots in (str(tmp_path / "other"), [str(tmp_path / "other")]):
        scan = falsework.sample(stage, tmp_path / "out", falsework.MeshSettings(density=5.0), allow_roots=roots)
        assert len(scan)


def own_classes(hint: object) -> set[type]:
    """Take the project's own classes out of an annotation."""
    inner = {found for part in get_args(hint) for found in own_classes(part)}
    rooms = ("groundwork", "usd_schemas", "authoring", "render", "recon", "learn", "falsework")
    is_own = isinstance(hint, type) and hint.__module__.partition(".")[0] in rooms
    return inner | ({hint} if isinstance(hint, type) and is_own else set())


def test_every_type_that_an_argument_needs_is_public() -> None:
    """Classes of arguments and results, and of the sections of settings; a scenario is given as a table of its own."""
    public = {name: getattr(falsework, name) for name in falsework.__all__}
    needed: set[type] = set()
    for name in ("author", "render", "reconstruct", "sample", "run", "save_cloud"):
        for hint in get_type_hints(public[name], {**vars(falsework.api), **public}).values():
            needed |= own_classes(hint)
    for kind in needed - {falsework.Scenario}:
        if issubclass(kind, BaseModel):
            needed = needed.union(*(own_classes(field.annotation) for field in kind.model_fields.values()))
    assert {kind.__name__ for kind in needed} <= set(public)
    assert {"SensorSettings", "DenseSettings", "Capture", "TerrestrialSettings"} <= {kind.__name__ for kind in needed}
