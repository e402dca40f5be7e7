"""Progress in plain lines, by a clock that the test moves."""

import pytest

from falsework.commands import console
from falsework.commands.console import ConsoleProgress
from groundwork.progress import duration


def test_the_first_unit_does_not_foretell_the_rest(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """It holds what was loaded and compiled: 95 s for it, 1 s for each of the others, and no word of 6,000 s."""
    now = [0.0]
    monkeypatch.setattr(console.time, "monotonic", lambda: now[0])
    with ConsoleProgress() as progress:
        for name in ("fuse", "depth"):  # a second stage begins anew
            progress.stage(name, 65)
            now[0] += 95.0
            for done in range(1, 66):
                progress.advance(done)
                now[0] += 1.0
    lines = capsys.readouterr().err.splitlines()
    own = [line for line in lines if line.startswith("fuse")]
    assert own[0] == "fuse: 1/65"
    assert own[1] == "fuse: 11/65, about 54 s left"
    assert own[-1] == "fuse: done in 160.0 s"
    assert [line.replace("depth", "fuse") for line in lines if line.startswith("depth")] == own


def test_the_time_left_is_said_in_minutes_and_hours(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """As in every other place: no line says 35,960 s."""
    now = [0.0]
    monkeypatch.setattr(console.time, "monotonic", lambda: now[0])
    with ConsoleProgress() as progress:
        progress.stage("fuse", 3600)
        for done in (1, 2, 3):
            now[0] += 10.0
            progress.advance(done)
    assert "fuse: 3/3600, about 10.0 h left" in capsys.readouterr().err.splitlines()


@pytest.mark.parametrize(
    ("seconds", "said"),
    [
        (0.44, "0.4 s"),
        (9.94, "9.9 s"),
        (9.96, "10 s"),
        (54.4, "54 s"),
        (119.4, "119 s"),
        (119.6, "2 min"),
        (150.0, "2 min"),
        (7140.0, "119 min"),
        (7199.0, "2.0 h"),
        (8999.0, "2.5 h"),
    ],
)
def test_durations_are_short(seconds: float, said: str) -> None:
    """Tenths of a second of the shortest, then seconds, minutes and tenths of an hour."""
    assert duration(seconds) == said
