"""Which packages a result's name in the store depends on: every one that its code imports."""

import re
import sys
from collections.abc import Callable, Iterator
from importlib.metadata import PackageNotFoundError
from pathlib import Path

import pytest

from falsework import platform
from falsework.execution.chain import read_sources, scene_chain
from groundwork.progress import SILENT
from tests.falsework.tiny_chain import tiny_scenario
from tests.house.house import ROOMS, ROOT
from tests.house.test_imports import imported_names

CHILD = re.compile(rf'"((?:{"|".join(ROOMS)})(?:\.\w+)+)"')  # a module that runs in a process of its own
PACKAGES = {  # distribution of each module where the names differ
    "cv2": "opencv-python-headless",
    "OpenEXR": "openexr",
    "pxr": "usd-core",
    "MaterialX": "materialx",
    "sklearn": "scikit-learn",
}
CHANGE_NO_BYTE = {
    "pydantic",
    "pydantic_core",
    "glcontext",
    "libusb_package",
    "markupsafe",
    "triton",
}  # torch pins triton
UNUSED = {  # imported for another stage
    "stage": {"materialx"},  # reads the stages of others
    "model": {"deflate", "h5py"},  # read without loss; writes data sets
    "report": {"deflate"},
    "learn": {"laspy"},  # reads without loss
}
STARTS = {
    "stage": ["authoring.scene"],
    "capture": ["render.workers"],
    "model": ["recon.reconstruct"],
    "sample": ["falsework.children.sample_work"],
    "report": ["falsework.report.report"],
    "learn": ["learn.compare.noise", "learn.compare.pieces", "learn.compare.trial"],
}
LISTED = {
    "stage": platform.AUTHOR_PACKAGES,
    "capture": platform.RENDER_PACKAGES,
    "model": platform.RECON_PACKAGES,
    "sample": platform.SAMPLE_PACKAGES,
    "report": platform.REPORT_PACKAGES,
    "learn": platform.LEARN_PACKAGES,
}


def module_file(name: str) -> Path | None:
    """Find the file of a module, or of the module that a name is imported from."""
    parts = name.split(".")
    files = (ROOT.joinpath(*parts[:count]).with_suffix(".py") for count in range(len(parts), 1, -1))
    return next((file for file in files if file.is_file()), None)


def packages_of(starts: list[str]) -> set[str]:
    """Name every package that these modules and all that they import or run import, inside functions too."""
    found: set[str] = set()
    todo = [module_file(start) for start in starts]
    seen = set(todo)
    while todo:
        file = todo.pop()
        assert file is not None
        source = file.read_text(encoding="utf-8")
        for name in (*(name for _, name in imported_names(source)), *CHILD.findall(source)):
            top = name.partition(".")[0]
            if top not in ROOMS:
                found |= {top} - sys.stdlib_module_names
            elif (other := module_file(name)) not in {None, *seen}:
                seen.add(other)
                todo.append(other)
    return {PACKAGES.get(name, name) for name in found}


@pytest.mark.parametrize("stage", STARTS)
def test_every_package_that_a_stage_imports_is_in_its_key(stage: str) -> None:
    """A new version of it may change the result, which then gets a new name; `lazrs` compresses for `laspy`."""
    wanted = packages_of(STARTS[stage]) - CHANGE_NO_BYTE - UNUSED.get(stage, set())
    assert wanted | ({"lazrs"} if "laspy" in wanted else set()) == set(LISTED[stage])


@pytest.fixture
def keys_with(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str], dict[str, str]]]:
    """Give `keys_with(package)`: the key of every step of a scene with another version of it; no driver is asked."""
    facts = [one for name, one in vars(platform).items() if name.endswith("_platform")]
    monkeypatch.setattr(platform, "run_child", lambda *_, **__: {"renderer": "none", "version": "0"})
    scenario = tiny_scenario(sample=[{"kind": "mesh"}])

    def keys_with(package: str) -> dict[str, str]:
        names = {name: "2" for name in platform._NAMES.get(package, (package,))}
        monkeypatch.setattr(platform, "version", lambda name: names.get(name, "1"))
        for one in facts:
            one.cache_clear()
        found = scene_chain(scenario, 0, read_sources(scenario, SILENT))
        return {step.task.stage: step.task.key for step in (*found.steps, found.report())}

    yield keys_with
    for one in facts:
        one.cache_clear()


@pytest.mark.parametrize("package", sorted(set().union(*(LISTED[stage] for stage in STARTS if stage != "learn"))))
def test_another_version_of_a_package_renames_what_depends_on_it(
    package: str, keys_with: Callable[[str], dict[str, str]]
) -> None:
    """The results of the stages that use it, and all that is made from them, get other names, and no other ones."""
    before, after = keys_with("none of them"), keys_with(package)
    wanted = {stage for stage in STARTS if stage != "learn" and package in LISTED[stage]} | {"report"}
    wanted |= {"cloud"} if "model" in wanted else set()
    wanted |= {"model", "cloud"} if "capture" in wanted else set()
    wanted |= set(before) if "stage" in wanted else set()
    assert {stage for stage in before if before[stage] != after[stage]} == wanted


def test_a_build_of_open3d_for_processors_alone_counts_like_the_other(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its version is read under either name."""
    for installed in ("open3d-cpu", "open3d"):
        monkeypatch.setattr(platform, "version", lambda name, there=installed: _only(name, there))
        assert platform._versions(("numpy", "open3d")) == {"numpy": "1", "open3d": "1"}


def _only(name: str, installed: str) -> str:
    if name not in ("numpy", installed):
        raise PackageNotFoundError(name)
    return "1"
