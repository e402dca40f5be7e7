"""A plan agrees with what the run then does, in whatever state its folder is; and the disk is looked at before work."""

import json
import shutil
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from authoring.surveys.settings import GlobalSettings
from falsework.cli import main
from falsework.execution import chain, costs
from falsework.execution.amounts import amounts, sizes
from falsework.execution.costs import DEFAULT_BYTES, DEFAULT_SECONDS, Costs
from falsework.execution.events import read_events
from falsework.execution.plan import Plan, plan_run
from falsework.pipeline import Outcome, run_scenario
from falsework.scenario import demo_scenario, load_scenario
from falsework.stages import STAGES
from groundwork.errors import InputError, OutOfSpaceError
from groundwork.progress import SILENT
from recon.settings import ReconSettings
from render.settings import RenderSettings
from tests.falsework.tiny_chain import SEED, contents, tiny_scenario, tiny_stages

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
Agree = Callable[..., Plan]
LET_GO = {  # what a run makes, and lets go when it keeps only this
    ("stage", "cloud"): {"capture", "model"},
    ("cloud",): {"stage", "capture", "model"},
    ("model", "cloud"): {"stage", "capture"},
    ("report",): {"stage", "capture", "model", "cloud"},
    ("capture",): {"stage"},
}


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Outcome]:
    """Give `run(scenes=1, faults=None, part=None, retry_failed=False, **settings)` on tiny stages."""
    for name, stage in tiny_stages().items():
        monkeypatch.setitem(STAGES, name, stage)
    monkeypatch.setattr(chain, "render_platform", lambda device="auto": {"gl_renderer": "none"})
    monkeypatch.setattr(chain, "recon_platform", lambda: {"cpu": "none"})

    def run(
        scenes: int = 1,
        faults: dict[str, str] | None = None,
        part: range | None = None,
        retry_failed: bool = False,
        **more: Any,
    ) -> Outcome:
        monkeypatch.setenv("TINY_FAULTS", json.dumps(faults or {}))
        return run_scenario(tiny_scenario(scenes, **more), tmp_path / "out", SILENT, part, retry_failed=retry_failed)

    return run


@pytest.fixture
def agree(run: Callable[..., Outcome], tmp_path: Path) -> Agree:
    """Give a function that plans, runs, and compares; it gives the plan."""

    def agree(scenes: int = 1, part: range | None = None, retry_failed: bool = False, **more: Any) -> Plan:
        out = tmp_path / "out"
        before = _everything(out)
        plan = plan_run(tiny_scenario(scenes, **more), out, SILENT, part, retry_failed=retry_failed)
        assert _everything(out) == before  # a plan writes nothing
        former = _events(out)
        done = run(scenes, None, part, retry_failed, **more)
        assert plan.outcome == done
        assert sum(stage.make for stage in plan.stages.values()) == done.made
        assert {name: stage.make for name, stage in plan.stages.items() if stage.make} == _events(out) - former
        return plan

    return agree


def _events(out: Path) -> Counter[str]:
    """Count the results of each stage that have ever been made."""
    return Counter(event["stage"] for event in read_events(out) if event["made"])


def _everything(out: Path) -> dict[str, Any]:
    return {**contents(out), **{str(path): path.read_bytes() for path in out.glob("run/*")}}


def _stored(out: Path, stage: str) -> set[str]:
    return {path.name for path in (out / "store" / stage).glob("*")}


def _makes(plan: Plan) -> list[int]:
    return [stage.make for stage in plan.stages.values()]


def _theres(plan: Plan) -> list[int]:
    return [stage.there for stage in plan.stages.values()]


def test_empty_partial_and_complete_output(agree: Agree, tmp_path: Path) -> None:
    """Nothing there, two scenes of four there, and all there."""
    assert _makes(agree(4, range(2))) == [2, 2, 2, 2, 2]
    plan = agree(4)
    assert (_makes(plan), _theres(plan), plan.scenes_to_do) == ([2] * 5, [2] * 5, 2)
    plan = agree(4)
    assert (_makes(plan), _theres(plan), plan.seconds, plan.peak_bytes) == ([0] * 5, [4] * 5, 0, 0)
    shutil.rmtree(tmp_path / "out/store/cloud")
    assert _makes(agree(4)) == [0, 0, 0, 4, 0]


def test_changed_section_is_made_again_from_there_on(agree: Agree) -> None:
    """Another setting of the points needs clouds and reports; of the cameras, models too; of the images, captures."""
    agree(2)
    assert _makes(agree(2, recon={"max_reprojection_error": 2.5})) == [0, 0, 0, 2, 2]
    assert _makes(agree(2, recon={"sparse": {"neighbours": 9}})) == [0, 0, 2, 2, 2]
    assert _makes(agree(2, render={"quality": "fast"})) == [0, 2, 2, 2, 2]
    flights = [{"kind": "global"}, {"kind": "local"}]
    assert _makes(agree(3, survey=flights)) == [3, 6, 6, 6, 3]  # a stage holds its flights


def test_one_model_serves_every_cloud(agree: Agree, tmp_path: Path) -> None:
    """The other mode, both, and another quality: the model is never made again, nor a cloud that does not use it."""
    links = tmp_path / "out/scenes/0000/cloud"
    agree(2)
    assert _makes(agree(2, recon={"mode": "dense"})) == [0, 0, 0, 2, 2]
    assert _makes(agree(2, recon={"mode": "both"})) == [0, 0, 0, 0, 2]
    assert sorted(path.name for path in links.iterdir()) == ["global+dense", "global+sparse"]
    assert _makes(agree(2, recon={"mode": "both", "quality": "low"})) == [0, 0, 0, 2, 2]
    assert _makes(agree(2, recon={"mode": "both", "quality": "low", "min_views": 3})) == [0, 0, 0, 2, 2]
    assert _makes(agree(2, recon={"mode": "both", "sparse": {"memory_limit": 4}, "dense": {"threads": 1}})) == [0] * 5
    agree(2)
    assert [path.name for path in links.iterdir()] == ["global"]  # links of clouds that are no more wanted are gone


@pytest.mark.parametrize("stage", ["stage", "capture", "model", "cloud"])
@pytest.mark.parametrize(("fault", "kind"), [("reject", "rejected"), ("input", "failed")])
def test_rejected_and_failed(stage: str, fault: str, kind: str, agree: Agree, run: Callable[..., Outcome]) -> None:
    """What was rejected or failed counts as that, what would follow it is left out; failures may be tried again."""
    run(3, {f"{stage}:1": fault})
    plan = agree(3)
    row = plan.stages[stage]
    assert (getattr(row, kind), row.there, sum(_makes(plan))) == (1, 2, 0)
    names = list(plan.stages)
    after = names[names.index(stage) + 1 :]
    assert {name: plan.stages[name].skipped for name in after} == dict.fromkeys(after, 1)
    assert list(getattr(plan.outcome, kind)) == ["0001"]
    again = agree(3, retry_failed=True)
    assert sum(_makes(again)) == (0 if kind == "rejected" else len(after) + 1)


@pytest.mark.parametrize("keep", LET_GO)
def test_evicted(keep: tuple[str, ...], agree: Agree, tmp_path: Path) -> None:
    """Results that were let go are not made again, except where a lost result needs them."""
    agree(2, keep=keep)
    plan = agree(2, keep=keep)
    assert sum(_makes(plan)) == 0
    assert {name for name, stage in plan.stages.items() if stage.let_go} == LET_GO[keep]
    for name in keep:
        shutil.rmtree(tmp_path / "out/store" / name)
        agree(2, keep=keep)
    agree(2)  # and where more is kept than before


def test_damaged_input_is_planned_to_be_made_again(agree: Agree, tmp_path: Path) -> None:
    """A capture with a file too few is made again before a new cloud is made from it."""
    agree(1)
    (frame,) = tmp_path.glob("out/store/capture/*/000002.jpg")
    frame.unlink()
    assert _makes(agree(1, recon={"max_reprojection_error": 2.5})) == [0, 1, 0, 1, 1]


def test_costs_are_the_demos_and_then_ones_own(agree: Agree, tmp_path: Path) -> None:
    """Before any run the stated defaults; then means of the events; without those the sizes of what is stored."""
    out = tmp_path / "out"
    plan = agree(2)
    more = amounts(tiny_scenario(2))
    assert plan.seconds == pytest.approx(2 * sum(more.get(name, 1) * DEFAULT_SECONDS[name] for name in plan.stages))
    assert plan.peak_bytes == pytest.approx(2 * sum(more.get(name, 1) * DEFAULT_BYTES[name] for name in plan.stages))
    for path in (out / "run").glob("*.jsonl"):
        path.unlink()
    rows = [(True, 10, 1000), (True, 30, 5000), (False, 900, 9), (True, "x", None)]
    lines = [{"stage": "cloud", "made": made, "seconds": seconds, "bytes": size} for made, seconds, size in rows]
    (out / "run/a.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines) + '{"stage": "cloud"')
    found = Costs(out)
    assert (found.seconds("cloud"), found.bytes_each("cloud"), found.most_bytes("cloud")) == (20, 3000, 5000)
    assert (found.seconds("stage"), found.is_learned("stage")) == (DEFAULT_SECONDS["stage"], False)
    sizes = [sum(file.stat().st_size for file in folder.rglob("*.jpg")) for folder in out.glob("store/capture/*")]
    assert found.most_bytes("capture") == pytest.approx(max(sizes), abs=20)
    (out / "run/b.jsonl").write_text(json.dumps({"stage": "cloud", "made": True, "seconds": 80}) + "\n")
    assert found.seconds("cloud") == 40  # another process has gone on
    plan = plan_run(tiny_scenario(4), out, SILENT)
    others = sum(more.get(name, 1) * DEFAULT_SECONDS[name] for name in ("stage", "capture", "model", "report"))
    assert plan.stages["cloud"].make * 40 == 80 == round(plan.seconds - 2 * others)


def test_work_is_estimated_from_the_demo() -> None:
    """The demo is the unit. Images, their size, shading and density count; of a stage of one's own nothing is known.

    The recipes of the paper took some 20 and 30 minutes a scene on two cores (docs/benchmarks/scale.md).
    """
    demo = demo_scenario()
    (flight,) = demo.survey
    assert isinstance(flight, GlobalSettings)
    assert amounts(demo) == {"capture": 1, "model": 1, "cloud": 1}

    def changed(images: int, **sections: Any) -> dict[str, float]:
        survey = (flight.model_copy(update={"images": images}),)
        return amounts(demo.model_copy(update={"survey": survey, **sections}))

    assert changed(104) == {"capture": 2, "model": 2, "cloud": 2}
    assert changed(52, render=RenderSettings(quality="fine"))["capture"] == 2
    assert changed(52, recon=ReconSettings(quality="high"))["cloud"] == 5
    assert changed(52, recon=ReconSettings(mode="both"))["cloud"] == pytest.approx((1 + 0.15) / 2)
    assert changed(52, stage="town.usda") == {}
    fine = demo.model_copy(update={"render": RenderSettings(quality="fine")})
    assert sizes(fine) == sizes(demo) == amounts(demo)  # its photographs take longer, and are not larger
    for name, minutes in (("paper-local", 20), ("paper-global", 30)):
        more = amounts(load_scenario(SCENARIOS / f"{name}.toml"))
        seconds = sum(more.get(stage, 1) * DEFAULT_SECONDS[stage] for stage in ("stage", "capture", "model", "cloud"))
        assert 0.5 < seconds / 60 / minutes < 2


def test_peak_is_lower_where_less_is_kept(agree: Agree) -> None:
    """What is let go makes room for the next scene: all of one scene, and the clouds of those before it."""
    plan = agree(3, keep=("cloud",))
    expected = {name: sizes(tiny_scenario(3)).get(name, 1) * size for name, size in DEFAULT_BYTES.items()}
    kept, others = expected["cloud"], sum(expected[name] for name in ("stage", "capture", "model"))
    assert plan.peak_bytes == pytest.approx(3 * kept + others)


def test_textures_that_others_have_count_once(run: Callable[..., Outcome], tmp_path: Path) -> None:
    """The first scene adds the texture, the second one only what is its own."""
    run(2)
    found = Costs(tmp_path / "out")
    assert found.most_bytes("stage") > 100_000
    assert found.bytes_each("stage") < 0.7 * found.most_bytes("stage")


def test_full_disk_stops_before_the_work(
    run: Callable[..., Outcome], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Less free than a result of the stage has needed at most: it says both figures, and the stage has not run."""
    free = DEFAULT_BYTES["stage"] - 1
    monkeypatch.setattr(costs, "free_space", lambda path: free)
    with pytest.raises(OutOfSpaceError, match=r"\(stage\) may need 103\.0 MB of disk space, 103\.0 MB are free"):
        run(2)
    assert not list(tmp_path.glob("out/work/*")) and not list(tmp_path.glob("out/store/*"))  # noqa: PT018
    free += 1
    costs.check_space(tmp_path / "out", "stage", "key", {})
    free = max(DEFAULT_BYTES.values())
    assert run(2, part=range(1)).made == 5
    most = Costs(tmp_path / "out").most_bytes("stage")
    assert most < 200_000  # learned now
    free = most - 1
    with pytest.raises(OutOfSpaceError):
        run(2)
    assert len(_stored(tmp_path / "out", "stage")) == 1
    free = most
    assert run(2).made == 5


def test_the_scenario_says_what_its_first_result_needs(
    run: Callable[..., Outcome], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Before any was measured: more than the demo's where more is asked for, and less where less is."""
    out = tmp_path / "out"
    monkeypatch.setattr(costs, "free_space", lambda path: DEFAULT_BYTES["cloud"])
    costs.check_space(out, "cloud", "key", {"cloud": 0.1})
    with pytest.raises(OutOfSpaceError, match=r"may need 1440\.0 MB"):
        costs.check_space(out, "cloud", "key", {"cloud": 10.0})
    monkeypatch.setattr(costs, "free_space", lambda path: DEFAULT_BYTES["stage"])
    assert run(1).made == 5  # the demo's cloud would not fit, this one does


def test_what_an_interrupted_run_left_counts_as_there(
    run: Callable[..., Outcome], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Half a capture in the work folder needs only room for the other half."""
    out = tmp_path / "out"
    left = DEFAULT_BYTES["capture"]
    monkeypatch.setattr(costs, "free_space", lambda path: left - 30_000)
    (out / "work" / "key").mkdir(parents=True)
    with pytest.raises(OutOfSpaceError):
        costs.check_space(out, "capture", "key", {})
    (out / "work" / "key" / "000000.jpg").write_bytes(bytes(30_000))
    costs.check_space(out, "capture", "key", {})


def test_verb(
    run: Callable[..., Outcome], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """With and without a folder, as lines and as JSON; a full disk is exit code 4, a stranger's folder 2."""

    def ask(*words: str | Path) -> tuple[int, str]:
        with pytest.raises(SystemExit) as end:
            main([str(word) for word in words])
        said = capsys.readouterr()
        return int(end.value.code or 0), said.out + said.err

    scenario, out = tmp_path / "s.toml", tmp_path / "out"
    scenario.write_text(f'seed = {SEED}\nscenes = 3\n[[survey]]\nkind = "global"\n[recon]\nmode = "sparse"\n')
    code, said = ask("plan", scenario)
    assert code == 0
    assert "15 results to make in 3 of 3 scenes: about 10 min in one process, 657 MB more" in said
    assert ask("plan", scenario, "-o", out) == (code, said)
    assert not out.exists()
    run(3, {"cloud:2": "reject"}, range(1, 3))
    said = json.loads(ask("plan", scenario, "-o", out, "--json")[1])
    assert (said["made"], said["reused"], said["scenes_to_do"]) == (5, 8, 1)
    assert (said["version"], said["stages"]["cloud"]["rejected"]) == (1, 1)
    assert json.loads(ask("plan", scenario, "-o", out, "--json", "--scenes", "1:2")[1])["made"] == 0
    assert "nothing to do: all 5 results exist already" in ask("plan", scenario, "-o", out, "--scenes", "1:2")[1]
    assert "nothing to make: 3 results exist already" in ask("plan", scenario, "-o", out, "--scenes", "2:3")[1]
    assert "0 results made, 3 existed already" in ask("run", scenario, "-o", out, "--scenes", "2:3")[1]
    monkeypatch.setattr(costs, "free_space", lambda path: 0)
    code, said = ask("run", scenario, "-o", out)
    assert (code, "0.0 MB are free" in said) == (4, True)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine/thesis.txt").write_text("mine")
    assert ask("plan", scenario, "-o", tmp_path / "mine")[0] == 2


def test_stranger_folder_is_refused_as_by_the_run(run: Callable[..., Outcome], tmp_path: Path) -> None:
    """A plan for a folder that `run` would refuse is refused with the same words."""
    (tmp_path / "out").mkdir()
    (tmp_path / "out/thesis.txt").write_text("mine")
    with pytest.raises(InputError) as of_run:
        run()
    with pytest.raises(InputError) as of_plan:
        plan_run(tiny_scenario(), tmp_path / "out", SILENT)
    assert str(of_plan.value) == str(of_run.value)
