"""The measurement of how long pages take to open: what is asked, what is spelt, and that a browser can be timed."""

from pathlib import Path

import pytest

from benchmarks.falsework.reports import PAGE, VERBS, Opened, asked, open_once, page_lines
from falsework.cli import all_verbs
from falsework.report.survey_page import write_survey_page
from groundwork.errors import InputError
from tests.falsework.browser import needs_browser
from tests.falsework.flight_rows import judged_flight


def test_what_is_asked() -> None:
    """Several paths of a kind, kinds in their order; anything else names the kinds; every verb is one."""
    words = ["training=model,scores.json", "run=out"]
    assert asked(words) == [("training", [Path("model"), Path("scores.json")]), ("run", [Path("out")])]
    for wrong in ("runs=out", "run", "run="):
        with pytest.raises(InputError, match="not KIND=PATH"):
            asked([wrong])
    assert {verb for verb, _ in VERBS.values()} <= set(all_verbs())


def test_the_table_says_what_is_not_as_promised() -> None:
    """Too large or too slow is `no`; the median counts; what is committed is such a page."""
    rows = [
        Opened("run", 4_000_000, (9.0, 0.5, 0.6)),
        Opened("scene", 12_000_000, (0.5,) * 3),
        Opened("view", 1_000_000, (3.5,) * 3),
    ]
    lines = page_lines(rows, "One core")
    assert lines[-3:] == [
        "| run | 4.0 | 0.60 | 0.50 | 9.00 | yes |",
        "| scene | 12.0 | 0.50 | 0.50 | 0.50 | no |",
        "| view | 1.0 | 3.50 | 3.50 | 3.50 | no |",
    ]
    assert PAGE.read_text(encoding="utf-8").splitlines()[:7] == lines[:7]
    assert page_lines([], "")[-1].startswith("Not measured yet")


@needs_browser
def test_an_opening_takes_time(tmp_path: Path) -> None:
    """The page with figures and a view in space is opened as it is, its policy in force, and says when it stood."""
    pytest.importorskip("websockets")
    write_survey_page(tmp_path / "page.html", [judged_flight("local")], "scene.usda")
    assert 0.0 < open_once(tmp_path / "page.html", tmp_path / "profile") < 120.0
