"""The container is set up by the steps that are tested elsewhere, and by no others."""

import re

from bootstrap.system_libraries import CORE, DRIVER_PACKAGE
from tests.house.house import ROOT

README = (ROOT / "README.md").read_text(encoding="utf-8")
LINES = (ROOT / "Dockerfile").read_text(encoding="utf-8").splitlines()
RUNS = [line.removeprefix("RUN ") for line in LINES if line.startswith("RUN ")]


def test_the_packages_are_those_of_the_set_up() -> None:
    """What README asks for before the clone, and what the set-up would install where it is missing."""
    update, install, *_ = RUNS
    assert update == "apt-get update"
    (before,) = re.findall(r"sudo apt-get install (.*?) {2,}#", README)
    wanted = [*before.split(), *sorted({*CORE.values(), DRIVER_PACKAGE})]
    assert install.split() == ["apt-get", "install", "-y", *wanted]


def test_the_other_steps_are_targets_and_verbs_that_are_there() -> None:
    """`make setup` is a target of the Makefile; the check at the end is the one that README names."""
    _, _, setup, check = RUNS
    assert setup == "make setup"
    assert re.search(r"^setup: \.venv/\.stamp-core", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M)
    assert f"`{check}`" in README


def test_the_python_is_one_that_the_pins_are_for() -> None:
    """constraints.txt says which Python it was made with; the image is of Debian, whose packages the set-up names."""
    (version,) = re.findall(r"on Python (\d+\.\d+)\.$", (ROOT / "constraints.txt").read_text(encoding="utf-8"), re.M)
    assert f"FROM python:{version}-slim-bookworm" in LINES
