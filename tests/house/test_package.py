"""What a wheel carries: every file of the rooms and nothing else, and data that is found without a checkout."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

from tests.house.house import ROOMS, ROOT, tracked_files


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the wheel without a network, and unpack it."""
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    (built,) = folder.glob("*.whl")
    with zipfile.ZipFile(built) as archive:
        archive.extractall(folder / "site")
    return folder / "site"


def test_the_wheel_holds_the_rooms_and_nothing_else(wheel: Path) -> None:
    """Shaders, tables, schemas and templates are in; tests, benchmarks and set-up scripts are out."""
    carried = {path.relative_to(wheel).as_posix() for path in wheel.rglob("*") if path.is_file()}
    carried = {name for name in carried if ".dist-info/" not in name}
    names = [path.relative_to(ROOT).as_posix() for path in tracked_files()]
    rooms = {name for name in names if name.split("/")[0] in ROOMS}
    scenarios = {f"falsework/{name}" for name in names if name.startswith("scenarios/")}
    assert carried == rooms | scenarios


def test_the_demo_scenario_is_package_data(wheel: Path, tmp_path: Path) -> None:
    """The scenario that users see in scenarios/ is the one that an installed package reads."""
    program = (
        "import falsework, importlib.resources as resources; print(list(falsework.__path__)); "
        "print(resources.files('falsework').joinpath('scenarios/demo.toml').read_text())"
    )
    environment = {**os.environ, "PYTHONPATH": str(wheel)}
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, cwd=tmp_path, env=environment, check=True, capture_output=True, text=True)
    where, _, text = done.stdout.partition("\n")
    assert str(wheel) in where
    assert text.rstrip("\n") == (ROOT / "scenarios" / "demo.toml").read_text(encoding="utf-8").rstrip("\n")


def test_the_notice_names_every_package() -> None:
    """Whatever pyproject.toml asks for, in the core or an extra, has a line with its license."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    wanted = [
        *project["dependencies"],
        *(line for lines in project["optional-dependencies"].values() for line in lines),
    ]
    names = {re.split(r"[^\w.-]", line)[0] for line in wanted}
    notice = (ROOT / "NOTICE").read_text(encoding="utf-8")
    named = {name.strip() for line in re.findall(r"^  (\S.*?)  +\S", notice, re.M) for name in line.split(",")}
    assert names - named == set()
    assert named - names == set()
