"""The benchmark of structure from motion computes what was promised, and goes on where it was interrupted."""

import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks import page as page_of_code
from benchmarks.page import state_of_page
from benchmarks.recon import sfm as benchmark
from benchmarks.recon.colmap_defaults import Found, found_in
from benchmarks.recon.sfm_page import MARK, Row, crossing, equally_accurate, exponent, render_page
from benchmarks.recon.sfm_ways import Meter, Run, paid, with_settings
from groundwork.canonical import digest
from groundwork.errors import ChildError, RejectedSceneError
from groundwork.files import read_json, write_json
from recon.photos.photos import open_photographs
from render.capture import Capture, read_capture, read_truth
from tests.recon.test_duplicates import told_twice


def row_of(way: str, count: int, seconds: float, median: float | None = 0.01, right: float = 1.0) -> Row:
    """Make a row of which a tenth is mapping."""
    steps = {"features": 0.5 * seconds, "matching": 0.4 * seconds, "mapping": 0.1 * seconds}
    return Row(way, way, count, steps, "1", 5, 1.0, right, median, median)


def verdicts(rows: list[Row]) -> dict[tuple[str, str], tuple[str, str, str]]:
    """Read the second table of the page: what and images to wanted, found, verdict."""
    cells = [[cell.strip() for cell in line.split("|")[1:-1]] for line in render_page(rows, "", "").splitlines()]
    return {(line[0], line[1]): (line[2], line[3], line[4]) for line in cells if len(line) == 5}


def test_the_page_holds_what_was_found_against_what_was_promised() -> None:
    """Three times as fast at 200 and five times at 400, the exponent, and equal accuracy: each can be missed."""
    rows = [
        row_of("spatial", 100, 100.0),
        row_of("spatial", 200, 2.0**1.2 * 100.0 - 0.01),
        row_of("spatial", 400, 4.0**1.2 * 100.0 - 0.01),
        row_of("exhaustive", 200, 700.0),
        row_of("exhaustive", 400, 2600.0, median=0.005),
        row_of("global", 400, 300.0),
    ]
    found = verdicts(rows)
    assert found["times faster than every pair", "200"] == ("at least 3", "3.05", "held")
    assert found["times faster than every pair", "400"] == ("at least 5", "4.93", "**missed**")
    assert found["accuracy beside every pair", "200"][1:] == ("equal", "held")
    assert found["accuracy beside every pair", "400"][1:] == ("not equal", "**missed**")
    assert found["exponent: spatial", "100 to 400"] == ("at most 1.2", "1.20", "held")
    assert found["mapping time, incremental over global mapper", "400"][1] == f"{4.0**1.2 / 3:.2f}"
    slower = [*rows[:2], row_of("spatial", 400, 4.0**1.2 * 103.0)]
    assert verdicts(slower)["exponent: spatial", "100 to 400"][2] == "**missed**"
    assert verdicts(rows[:1])["times faster than every pair", "400"][1:] == ("not measured", "")
    assert verdicts(rows[:1])["exponent: spatial", ""][1] == "not measured"
    assert exponent([row_of("a", n, 3.0 * n**1.7) for n in (10, 30, 50)]) == pytest.approx(1.7)


def test_what_was_left_out_is_estimated_and_said_to_be() -> None:
    """Every pair of 400 images costs what its pairs cost at 200, and as much as ours for the rest."""
    rows = [row_of("spatial", 200, 100.0), row_of("exhaustive", 200, 700.0), row_of("spatial", 400, 200.0)]
    pairs = 400 * 399 / (200 * 199)
    title = "times faster than every pair, estimated by the cost of a pair of 200 images"
    assert verdicts(rows)[title, "400"][1:] == (f"{(0.6 * 200 + 0.4 * 700 * pairs) / 200:.2f}", "expected")
    assert verdicts(rows)["times faster than every pair", "200"][1:] == ("7.00", "held")


def test_from_where_on_the_global_mapper_pays() -> None:
    """It must be faster, and as accurate, at a count and at every larger one."""
    ours = [row_of("spatial", count, 100.0) for count in (60, 200, 400)]
    title = ("global mapper faster at equal accuracy", "")
    for seconds, error, found in (
        ((90.0, 110.0, 90.0), 0.01, "from 400 images on"),
        ((90.0,) * 3, 0.02, "not yet"),
        ((110.0, 90.0, 90.0), 0.01, "from 200 images on"),
    ):
        others = [row_of("global", count, time, error) for count, time in zip((60, 200, 400), seconds, strict=True)]
        assert verdicts([*ours, *others])[title][1] == found


def test_where_the_mappers_meet() -> None:
    """Two power laws meet where algebra says so, and two of one exponent nowhere."""
    title = ("global mapper as fast, by the lines through the mapping times of both", "")
    ours = [row_of("spatial", count, count**1.5) for count in (60, 200, 400)]
    others = [row_of("global", count, 30.0 * count) for count in (60, 200, 400)]
    assert crossing(list(zip(ours, others, strict=True))) == pytest.approx(900.0)
    assert verdicts([*ours, *others])[title][1] == "about 900 images"
    parallel = [row_of("global", count, 2.0 * count**1.5 + 1e-9 * count**2) for count in (60, 200, 400)]
    assert verdicts([*ours, *parallel])[title][1] == "never, or far away"


def test_equal_accuracy() -> None:
    """A millimeter or a tenth may be lost, and one camera of a hundred; a way without a model is never equal."""
    every = row_of("exhaustive", 100, 1.0, 0.02)
    assert equally_accurate(row_of("spatial", 100, 1.0, 0.0219), every)
    assert not equally_accurate(row_of("spatial", 100, 1.0, 0.0221), every)
    assert not equally_accurate(row_of("spatial", 100, 1.0, 0.01, right=0.98), every)
    assert not equally_accurate(row_of("spatial", 100, 1.0, None), every)


def test_points_of_three_views_stand_beside_others() -> None:
    """Their share is that of the model; rows of a time that did not count them have no such column."""
    model = told_twice(np.random.default_rng(0))
    rows = model.obs_point.tolist()
    share = sum(rows.count(point) >= 3 for point in range(40)) / 40
    assert found_in(model, 6, {}).thrice == share
    assert 0.0 < share < 1.0
    old, new = row_of("spatial", 60, 1.0), replace(row_of("spatial", 200, 1.0), thrice=share)
    assert "three views" not in render_page([old], "", "")
    page = render_page([old, new], "", "")
    assert " | points | of three views and more |\n" in page
    assert " | 5 |  |\n" in page
    assert f" | 5 | {share:.0%} |\n" in page


def test_an_interrupted_benchmark_goes_on(plane_capture: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Finished rows are not measured again, failed ones and asked ones of earlier code are; others get a mark."""
    truth = read_truth(read_capture(plane_capture))
    assert truth is not None
    calls: list[tuple[str, int]] = []
    trouble: dict[tuple[str, int], BaseException] = {
        ("global", 6): ChildError("it died"),
        ("spatial", 8): KeyboardInterrupt(),
    }

    def way(name: str) -> Run:
        def run(capture: Capture, work: Path) -> Found:
            count = len(capture.images)
            calls.append((name, count))
            assert read_truth(capture) is None
            if (name, count) in trouble:
                raise trouble.pop((name, count))
            names, seconds = tuple(image.file for image in capture.images), {"mapping": float(count)}
            return Found(names, truth.poses[:count], 7, "3", seconds, 0.25)

        return run

    monkeypatch.setattr(benchmark, "WAYS", {name: way(name) for name in ("spatial", "global", "exhaustive")})
    for module in (benchmark, page_of_code):  # the real one reads half the repository; its own tests are elsewhere
        monkeypatch.setattr(module, "digest_of", lambda file, root=None: digest(str(file))[:16])
    monkeypatch.setattr(page_of_code, "_commit", lambda root: "none")
    page = tmp_path / "page.md"
    words = ["recon", str(plane_capture), "--work", str(tmp_path / "work"), "--page", str(page), "--images"]
    monkeypatch.setattr(sys, "argv", [*words, "6", "--ways", "exhaustive"])
    benchmark.main()
    assert calls == [("exhaustive", 6)]
    calls.clear()
    monkeypatch.setattr(sys, "argv", [*words, "8", "6", "--ways", "spatial", "global"])
    with pytest.raises(KeyboardInterrupt):
        benchmark.main()
    assert calls == [("spatial", 6), ("global", 6), ("spatial", 8)]
    assert "it died" in page.read_text()
    calls.clear()
    benchmark.main()
    assert calls == [("global", 6), ("spatial", 8), ("global", 8)]
    text = page.read_text()
    assert "it died" not in text
    assert len(re.findall(r"^\| [^|]+ \| [68] \| 3 \|  \|  \| [68] \| [68] \| 100% \| 100% \| 0\.0 ", text, re.M)) == 5
    assert text.count(" | 7 | 25% |\n") == 5
    calls.clear()
    benchmark.main()
    assert calls == []
    assert MARK not in page.read_text()
    assert state_of_page(page) == "fresh"
    for row in tmp_path.glob("page/*/*.json"):
        write_json(row, {**read_json(row), "code": "0123456789abcdef"})
    monkeypatch.setattr(sys, "argv", [*words, "6", "--ways", "spatial"])
    benchmark.main()
    assert calls == [("spatial", 6)]
    assert page.read_text().count(f"{MARK} |") == 4
    assert state_of_page(page) == "unknown"


def test_what_a_step_cost_stays_with_it(plane_capture: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A step that is taken over costs what it cost; what was interrupted, and every model, is made anew."""
    meter = Meter(tmp_path)
    meter.stage("features", 3)
    (tmp_path / "features-a").mkdir()
    meter.close()
    assert set(paid(tmp_path)) == {"features"}
    write_json(tmp_path / "features-a" / "processor_seconds.json", 12.5)
    for name in ("matches-b", "matches-c.partial", "model-d"):
        (tmp_path / name).mkdir()
    write_json(tmp_path / "model-d" / "processor_seconds.json", 99.0)
    seen: list[str] = []

    def run_nothing(_capture: Capture, work: Path, *_rest: object) -> None:
        seen.extend(sorted(path.name for path in work.iterdir()))
        raise RejectedSceneError("no_overlap", "none")

    monkeypatch.setattr("benchmarks.recon.sfm_ways.run_sparse", run_nothing)
    found = with_settings(mapper="global")(open_photographs(plane_capture), tmp_path)
    assert seen == ["features-a"]
    assert (found.names, found.pairs, found.seconds) == ((), "no_overlap", {"features": 12.5})
    assert read_json(tmp_path / "features-a" / "processor_seconds.json") == 12.5
