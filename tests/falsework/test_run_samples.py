"""`[[sample]]`: a run also makes clouds from the surface of each stage, results of its store like the others."""

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from authoring.streams import stream
from falsework.commands.clean import clean
from falsework.commands.repair import repair
from falsework.commands.verbs import report_scene
from falsework.execution import chain
from falsework.execution.chain import Chain, read_sources, scene_chain
from falsework.execution.scene import steps_of
from falsework.pipeline import run_scenario
from falsework.scenario import Scenario, load_scenario, scene_seed
from falsework.store.store import Store
from groundwork.progress import SILENT
from groundwork.settings import parse_settings
from recon.cloud import read_cloud
from tests.falsework.served_here import served_here
from tests.falsework.test_plan import Agree, agree, run  # noqa: F401 (fixtures)
from tests.falsework.test_run import Run, _flip, contents
from tests.falsework.test_sample_verbs import BODY
from tests.falsework.test_sample_verbs import run as call
from tests.falsework.tiny_chain import tiny_scenario
from tests.usd_schemas.stages import write_stage

MESH, TRIPOD = {"kind": "mesh", "density": 3.0}, {"kind": "terrestrial", "id": "tls", "reach": 40.0}


@pytest.fixture
def chained(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Give `chained(index, **settings)`: the steps of a scene, whatever the machine."""
    for name in ("recon_platform", "sample_platform"):
        monkeypatch.setattr(chain, name, lambda: {})
    monkeypatch.setattr(chain, "render_platform", lambda device="auto": {})

    def chained(index: int = 0, **settings: Any) -> Chain:
        scenario = tiny_scenario(3, **settings)
        return scene_chain(scenario, index, read_sources(scenario, SILENT))

    return chained


def _keys(found: Chain) -> dict[str, str]:
    return {step.link: step.task.key for step in found.steps}


def test_a_sample_changes_no_other_result(chained: Any) -> None:
    """Stage, capture and cloud keep their keys, and so does a sample beside another one; scenes draw differently."""
    without, one, two = chained(), chained(sample=[MESH]), chained(sample=[TRIPOD, MESH])
    assert _keys(without).items() < _keys(one).items() < _keys(two).items()
    assert set(_keys(two)) - set(_keys(without)) == {"cloud/mesh", "cloud/tls"}
    assert without.report().task.key != one.report().task.key
    settings = [
        chained(index, sample=[{**MESH, "seed": seed}]).samples[0].task.settings["sample"]
        for index in (0, 1)
        for seed in (0, 1)
    ]
    assert len({row["seed"] for row in settings}) == 4
    assert all({**row, "seed": 0} == {**settings[0], "seed": 0} for row in settings)


def test_every_result_of_a_scene_is_counted(chained: Any) -> None:
    """The table of a run and its time left expect models, samples and both clouds of a flight, too."""
    both = chained(sample=[MESH, TRIPOD], recon={"mode": "both"})
    flights = len(both.flights)
    counted = {"stage": 1, "capture": flights, "model": flights, "cloud": 2 * flights, "sample": 2}
    assert steps_of(both, ("stage", "cloud")) == counted
    assert steps_of(both, ("stage", "report")) == {**counted, "report": 1}


def test_without_samples_the_scenario_is_written_as_ever() -> None:
    """The file in a run's folder has no such key then, and with samples it reads back as itself, flights or none."""
    assert "sample" not in tiny_scenario().as_toml().replace("Samples count as clouds", "")
    for more in ({"sample": [MESH, TRIPOD]}, {"sample": [MESH], "survey": [{"kind": "grid"}]}):
        scenario = parse_settings(Scenario, dict(more), "tiny")
        assert len(scenario.survey) == len(more.get("survey", []))
        path = Path("again.toml")
        text = scenario.as_toml()
        assert parse_settings(Scenario, _parsed(text), path) == scenario


def _parsed(text: str) -> dict[str, Any]:
    import tomllib

    return tomllib.loads(text)


def test_plan_run_and_keep(agree: Agree, tmp_path: Path) -> None:  # noqa: F811
    """A plan tells what the run does; links lead to the clouds; what is let go is not made again."""
    out = tmp_path / "out"
    plan = agree(2, sample=[MESH, TRIPOD])
    assert {name: row.make for name, row in plan.stages.items()} == {
        "stage": 2,
        "capture": 2,
        "model": 2,
        "cloud": 2,
        "sample": 4,
        "report": 2,
    }
    assert {path.name for path in (out / "scenes/0001/cloud").iterdir()} == {"global", "mesh", "tls"}
    assert len(plan.outcome.clouds) == 6
    assert Store(out).verify() == []
    assert sum(row.make for row in agree(2, sample=[MESH]).stages.values()) == 2  # reports of fewer clouds
    for keep in (("report",), ("cloud",), ("capture", "report")):
        agree(2, sample=[MESH, TRIPOD], keep=keep)
        assert agree(2, sample=[MESH, TRIPOD], keep=keep).outcome.made == 0
        assert bool(list(out.glob("store/sample/*"))) == ("cloud" in keep)
        assert bool(list(out.glob("scenes/*/cloud/tls"))) == ("cloud" in keep)
        assert Store(out).verify() == []


def test_no_flight_needs_no_renderer(agree: Agree, tmp_path: Path) -> None:  # noqa: F811
    """Samples without a survey: no capture, no reconstruction, a report."""
    plan = agree(2, survey=[], sample=[MESH])
    assert {name: row.make for name, row in plan.stages.items() if row.make} == {"stage": 2, "sample": 2, "report": 2}


def test_variants_are_sampled_each(chained: Any) -> None:
    """As they are flown each."""
    found = chained(sample=[MESH], variants={"look": ["clean", "weathered"]}, survey=[])
    assert [step.link for step in found.samples] == ["cloud/mesh@clean", "cloud/mesh@weathered"]
    assert len({step.task.key for step in found.samples}) == 2


def test_a_rejected_flight_leaves_the_samples(run: Run, agree: Agree, tmp_path: Path) -> None:  # noqa: F811
    """They are made although no reconstruction comes of the scene; samples that are asked for later, too."""
    outcome = run(2, faults={"cloud:1": "reject"}, sample=[MESH])
    assert list(outcome.rejected) == ["0001"]
    assert (tmp_path / "out/scenes/0001/cloud/mesh/coord.npy").is_file()
    plan = agree(2, sample=[MESH, TRIPOD])
    assert (plan.stages["sample"].make, plan.stages["report"].make) == (2, 1)
    assert (tmp_path / "out/scenes/0001/cloud/tls/coord.npy").is_file()


def test_repair_and_clean(run: Run, tmp_path: Path) -> None:  # noqa: F811
    """A damaged sample comes back with its bytes; one that the scenario no longer leads to goes."""
    out = tmp_path / "out"
    run(2, sample=[MESH, TRIPOD])
    whole = contents(out)
    for path in out.glob("store/sample/*/coord.npy"):
        _flip(path, 17)
    assert len(Store(out).verify()) == 4
    assert repair(out, SILENT) == []
    assert contents(out) == whole
    run(2, sample=[MESH])
    assert {one.about for one in clean(out, SILENT, unused=True).removed} == {
        "sample that no scene uses",
        "report that no scene uses",
    }
    assert Store(out).verify() == []
    assert run(2, sample=[MESH]).made == 0
    shutil.rmtree(out / "store/sample")
    assert run(2, sample=[MESH]).made == 2


def test_the_clouds_are_those_of_the_verb(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """On a stage from elsewhere without a camera: the verb with the stream's seed gives the same columns."""
    stage = write_stage(tmp_path, BODY)
    section = "seed = 4\nsurvey = []\n[stage]\npath = 'scene.usda'\n"
    mesh, scan = "scope = 'bridge'\npoints = 700\nvoxel = 0.3\n", "positions = [[0, -9, 1.5]]\nangular_step = 2.0\n"
    (tmp_path / "s.toml").write_text(
        section.replace("scene.usda", stage.name)
        + "[[sample]]\nkind = 'mesh'\n"
        + mesh
        + "[[sample]]\nkind = 'terrestrial'\nid = 'tls'\n"
        + scan
    )
    scenario = load_scenario(tmp_path / "s.toml")
    outcome = run_scenario(scenario, tmp_path / "out", SILENT)
    assert (outcome.made, len(outcome.clouds)) == (3, 2)
    assert load_scenario(tmp_path / "out" / "scenario.toml").survey == ()
    for name, kind, words in (("mesh", ("mesh",), mesh), ("tls", ("lidar",), scan)):
        seed = int(stream(scene_seed(4, 0), f"sample/{name}").integers(2**31))
        given = [word for line in words.replace("'", "").splitlines() for word in ("--set", line.replace(" = ", "="))]
        with served_here():  # the run had its children
            assert call(capsys, "sample", *kind, stage, "-o", tmp_path / name, "--seed", str(seed), *given)[0] == 0
        ours, theirs = read_cloud(tmp_path / "out/scenes/0000/cloud" / name), read_cloud(tmp_path / name)
        assert ours.columns.keys() == theirs.columns.keys()
        for column, values in theirs.columns.items():
            np.testing.assert_array_equal(ours.columns[column], values)
    page = (tmp_path / "out/scenes/0000/report.html").read_text(encoding="utf-8")
    assert "Sample mesh: mesh" in page
    assert "Sample tls: lidar-terrestrial" in page
    report_scene(tmp_path / "out/scenes/0000", tmp_path / "page.html")
    assert "Sample tls" in (tmp_path / "page.html").read_text(encoding="utf-8")
