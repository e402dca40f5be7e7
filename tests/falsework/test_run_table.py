"""The table of a run: what is done, at which rate, and how long the rest takes; drawn where somebody watches."""

import io
from pathlib import Path

import pytest
from rich.console import Console

from falsework.commands.run_console import RunConsole
from falsework.commands.run_table import MOST_ROWS, RunTable
from falsework.execution import chain
from falsework.execution.board import StepEvent, detailed
from falsework.execution.costs import Costs
from falsework.pipeline import run_scenario
from falsework.stages import STAGES
from tests.falsework.tiny_chain import tiny_scenario, tiny_stages

STEPS = {"stage": 1, "capture": 2, "cloud": 2, "report": 1}
COSTS = {"stage": 10.0, "capture": 20.0, "cloud": 100.0, "report": 1.0}
EACH = 10.0 + 2 * 20.0 + 2 * 100.0 + 1.0  # [s] a scene


class Clock:
    """A clock that is set."""

    now = 1000.0

    def __call__(self) -> float:
        """Tell the time."""
        return self.now


def _table(scenes: int, workers: int) -> tuple[RunTable, Clock]:
    clock = Clock()
    table = RunTable(COSTS.__getitem__, clock)
    table.expect([f"{index:04d}" for index in range(scenes)], STEPS, workers)
    return table, clock


def _whole(table: RunTable, scene: str, *, begun: bool = True) -> None:
    for stage, count in STEPS.items():
        for number in range(count):
            if begun:
                table.tell(StepEvent(scene, stage, f"{stage}/{number}"))
            table.tell(StepEvent(scene, stage, f"{stage}/{number}", "done"))
    table.tell(StepEvent(scene, state="done"))


def test_rate_and_time_left_follow_the_work() -> None:
    """Time left is what misses, by the mean of each stage, over the workers; the rate counts scenes with work alone."""
    table, clock = _table(10, 2)
    assert table.seconds_left == pytest.approx(10 * EACH / 2)
    _whole(table, "0000", begun=False)  # it was there
    assert (table.ended, table.rate) == (1, 0.0)
    _whole(table, "0001")
    clock.now += 1800.0
    assert table.rate == pytest.approx(2.0)
    table.tell(StepEvent("0002", "stage", "stage", "done"))
    table.tell(StepEvent("0002", "capture", "capture/0", "done"))
    assert table.seconds_left == pytest.approx((8 * EACH - 30.0) / 2)
    for index in range(2, 9):
        table.tell(StepEvent(f"{index:04d}", state="failed" if index == 5 else "rejected"))
    assert table.seconds_left == pytest.approx(EACH)  # one scene is left, for one worker
    assert table.line().startswith("9 of 10 scenes, 6 rejected, 1 failed, 2.0 per hour, about 4 min left (stage ")
    assert table.line().endswith("(stage 3/10, capture 5/20, cloud 4/20, report 2/10)")


def test_what_a_step_does_is_seen_until_it_ends() -> None:
    """A scene in work shows its phase and share; a scene of another run, and what is told twice, change nothing."""
    table, _ = _table(2, 1)
    begun = StepEvent("0000", "capture", "capture/1")
    table.tell(StepEvent("0000", "capture", "capture/0", "done"))
    table.tell(StepEvent("0000", "capture", "capture/0", "done"))
    table.tell(begun)
    table.tell(detailed(begun, "render", 26, 65))
    table.tell(StepEvent("0777", "capture", "capture/0", "done"))
    assert "1/2 render 40 %" in _draw(table)
    assert "1/4" in _draw(table)
    table.tell(StepEvent("0000", "capture", "capture/1", "done"))
    assert "render" not in _draw(table)
    assert "2/4" in _draw(table)


def test_many_scenes_fit_on_a_screen() -> None:
    """Those in work come first, then those that ended last; one that nobody has looked at takes no row."""
    table, _ = _table(400, 3)
    for index in range(40):
        _whole(table, f"{index:04d}")
    table.tell(StepEvent("0100", "stage", "stage"))
    rows = [line.split()[0] for line in _draw(table).splitlines()[1:-2]]
    assert rows == [*(f"{index:04d}" for index in range(40 - MOST_ROWS + 1, 40)), "0100"]


def _draw(table: RunTable) -> str:
    console = Console(file=io.StringIO(), width=110)
    console.print(table.drawn())
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


@pytest.fixture
def tiny(monkeypatch: pytest.MonkeyPatch) -> None:
    """Put the tiny stages into the table of stages."""
    for name, stage in tiny_stages().items():
        monkeypatch.setitem(STAGES, name, stage)
    monkeypatch.setattr(chain, "render_platform", lambda device="auto": {"gl_renderer": "none"})
    monkeypatch.setattr(chain, "recon_platform", lambda: {"cpu": "none"})


@pytest.mark.parametrize("terminal", [True, False])
def test_a_run_is_drawn_on_a_terminal_alone(
    terminal: bool, tiny: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """There the last table says what became of each scene; elsewhere a plain line comes now and then."""
    monkeypatch.setenv("TINY_FAULTS", '{"cloud:1": "reject", "capture:2": "input"}')
    monkeypatch.setattr("falsework.commands.run_console.PLAIN_INTERVAL", 0.0)
    console = Console(file=io.StringIO(), force_terminal=terminal, color_system=None, width=100)
    assert isinstance(console.file, io.StringIO)
    with RunConsole(Costs(tmp_path / "out"), console) as listener:
        outcome = run_scenario(tiny_scenario(4), tmp_path / "out", listener, board=listener)
    assert (list(outcome.rejected), list(outcome.failed)) == (["0001"], ["0002"])
    drawn, lines = console.file.getvalue(), capsys.readouterr().err.splitlines()
    if terminal:
        rows = {line.split()[0]: line.split()[1:] for line in drawn.splitlines()[-7:] if line.split()}
        assert rows["0000"] == rows["0003"] == ["done"] * 5
        assert rows["0001"] == ["done", "done", "done", "-", "-", "rejected"]
        assert rows["0002"] == ["done", "-", "-", "-", "-", "failed"]
        assert rows["all"] == ["4/4", "3/4", "3/4", "2/4", "2/4"]
        assert "4 of 4 scenes, 1 rejected, 1 failed, " in drawn
        assert lines == []
    else:
        assert drawn == ""
        assert [line.partition(",")[0] for line in lines] == [f"{count} of 4 scenes" for count in (1, 2, 3, 4)]
