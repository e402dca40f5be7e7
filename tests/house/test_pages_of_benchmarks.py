"""A benchmark's page says which code it speaks of, and whether that still is the code."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from benchmarks.page import state_of_page, words_of, write_page
from docs.proof_state import page_states
from tests.house.house import ROOT


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """Lay out a benchmark that reaches one module."""
    for name, text in {
        "benchmarks/speed.py": "from render.draw import draw\n\nPAGE = draw()\n",
        "render/__init__.py": "",
        "render/draw.py": '"""Draws."""\n\n\ndef draw():\n    return 1\n',
    }.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def test_a_page_is_stale_when_its_code_does_something_else(project: Path) -> None:
    """Another docstring stales nothing, another result does; a page without a benchmark, or a stamp, is told."""
    page, benchmark, code = project / "speed.md", project / "benchmarks" / "speed.py", project / "render" / "draw.py"
    write_page(page, "# Speed\n\n| 1 |\n", str(benchmark), project)
    assert page.read_text().startswith("# Speed\n\n| 1 |\n\nWritten by `benchmarks/speed.py`")
    assert words_of(page) == "# Speed\n\n| 1 |\n\n"
    assert state_of_page(page, project) == "fresh"
    code.write_text(code.read_text().replace("Draws.", "Draws one."))
    assert state_of_page(page, project) == "fresh"
    code.write_text(code.read_text().replace("return 1", "return 22"))
    assert state_of_page(page, project) == "stale"
    benchmark.unlink()
    assert state_of_page(page, project) == "gone"
    page.write_text("# Speed\n")
    assert state_of_page(page, project) == "unknown"


def test_pages_of_experiments_are_listed_beside_those_of_benchmarks(project: Path) -> None:
    """Both folders are looked at, and every page of them has a state."""
    benchmark = project / "benchmarks" / "speed.py"
    for name in ("benchmarks", "experiments"):
        (project / "docs" / name).mkdir(parents=True)
    write_page(project / "docs" / "experiments" / "sensors.md", "# Sensors\n", str(benchmark), project)
    (project / "docs" / "benchmarks" / "speed.md").write_text("# Speed\n")
    assert page_states(project) == {"benchmarks/speed.md": "unknown", "experiments/sensors.md": "fresh"}


def test_every_page_is_written_with_its_code() -> None:
    """No benchmark writes its page by any other way."""
    files = [path for path in ROOT.glob("benchmarks/**/*.py") if path.name != "page.py"]
    others = [path.name for path in files if re.search(r"write_text\((PAGE|page)\b", path.read_text(encoding="utf-8"))]
    assert not others


def test_readme_repeats_what_the_accuracy_page_says() -> None:
    """The sentence that sums up the page stands in README word by word."""
    page, readme = (ROOT / name for name in ("docs/benchmarks/accuracy.md", "README.md"))
    lines = page.read_text(encoding="utf-8").splitlines()
    (sentence,) = (line for line in lines if " bridges with a close flight of a part, " in line)
    assert sentence in " ".join(readme.read_text(encoding="utf-8").split())


def test_the_readme_gives_the_figures_of_the_demos_page() -> None:
    """Points, shares, bearings, images and the error of the cameras are those that `make bench` wrote last."""
    page = (ROOT / "docs/benchmarks/chain.md").read_text(encoding="utf-8")
    rows = dict(re.findall(r"^\| ([^|]+) \| ([\d,.]+)%? \|$", page, re.M))
    wanted = {
        "images": rows["images"],
        "camera": rows["median camera center error [mm]"],
        "points": rows["points"],
        "near": rows["points within 0.1 m of the true surface"],
        "right": f"{float(rows['of these, with the class of that surface']):.1f}",
        "bearings": rows["points of class bearing"],
    }
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    lead = re.search(
        r"^One bridge \(seed 7\), (?P<images>\d+) images .* positions of (?P<camera>[\d.]+) mm:$", readme, re.M
    )
    row = re.search(
        r"^\| dense, `medium` \| (?P<points>[\d,]+) \| (?P<near>[\d.]+) % \| (?P<right>[\d.]+) % "
        r"\| (?P<bearings>[\d,]+) \|$",
        readme,
        re.M,
    )
    assert lead is not None
    assert row is not None
    assert {**lead.groupdict(), **row.groupdict()} == wanted
    assert ("every camera registered" in readme) == (rows["cameras registered and within limits"] == "100.0")
