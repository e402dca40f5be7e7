"""What an error costs is what was imported by then: heavy packages are counted, and no clock is asked."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.falsework.fresh_interpreter import FreshInterpreter

HEAVY = {
    *("cv2", "dask", "distributed", "h5py", "jinja2", "laspy", "lightning", "moderngl", "numba", "open3d", "plotly"),
    *("pyarrow", "pycolmap", "scipy", "sklearn", "torch", "trimesh", "viser"),
}
ROOMS = {"authoring.settings", "falsework.scenario", "learn.training.settings", "recon.reconstruct", "render.frames"}
HELP = ("", "scene set", "dataset local", "predict")
WRONG = (
    "run ok.toml -o out --sceens 1:2",
    "run broken.toml -o out",
    "run ok.toml -o out --workers -1",
    "plan folder",
    "run ok.toml -o out --shard 5/2",
    "run ok.toml -o out --cluster here",
    "plan ok.toml --scenes a:b",
    "preview ok.toml -o picture.jpg",
    "gallery families -o out --family moon",
    "gallery worlds -o out --count 0",
    "gallery looks -o out --world city",
    "render notes.txt -o out",
    "reconstruct folder -o out --settings broken.toml",
    "export folder --to laz -o out",
    "report folder -o page.html",
    "report folder -o page.pdf",
    "view folder",
    "view folder --save page.pdf",
    "clean folder",
    "dataset local nowhere -o out",
    "dataset global folder -o out --table none",
    "dataset local folder -o out --class-map nowhere.toml",
    "train folder -o out",
    "train --demo -o out --model forest",
    "evaluate folder folder",
    "predict folder -o out.laz",
    "predict notes.txt -o out.png",
    "predict notes.txt -o out.laz --table none",
    "compare nowhere -o out",
    "compare folder -o out --preset none",
    "background import notes.txt -o out",
    "scene checkout folder -o out",
    "scene import-edits notes.txt folder",
    "survey plan folder",
    "sample lidar notes.txt -o out",
)


@pytest.mark.parametrize("words", HELP)
def test_help_loads_nothing_heavy(words: str, fresh: FreshInterpreter, tmp_path: Path) -> None:
    """Neither a heavy package, nor the settings of all rooms."""
    done = fresh.run([*words.split(), "--help"], tmp_path)
    assert done.code == 0
    assert done.loaded & (HEAVY | ROOMS) == set()


@pytest.mark.parametrize("words", WRONG)
def test_an_error_loads_nothing_heavy(words: str, fresh: FreshInterpreter, tmp_path: Path) -> None:
    """One line and exit code 2 before anything heavy is there; nothing is written."""
    (tmp_path / "folder").mkdir()
    (tmp_path / "notes.txt").write_text("a file")
    (tmp_path / "ok.toml").write_text("seed = 1\n")
    (tmp_path / "broken.toml").write_text("seed = = 1\n")
    before = sorted(tmp_path.rglob("*"))
    done = fresh.run(words.split(), tmp_path)
    assert done.code == 2, done.error
    assert done.error.startswith("falsework: ")
    assert done.error.count("\n") == 1
    assert done.loaded & (HEAVY | ROOMS) == set()
    assert sorted(tmp_path.rglob("*")) == before


def test_a_heavy_import_would_be_seen(fresh: FreshInterpreter, tmp_path: Path) -> None:
    """What needs the settings of all rooms loads them, and is found to."""
    (tmp_path / "wrong.toml").write_text("sceens = 1\n")
    done = fresh.run(["plan", "wrong.toml"], tmp_path)
    assert done.code == 2
    assert "falsework.scenario" in done.loaded
    assert "scipy" in done.loaded


def test_reconstruction_loads_no_statistics_before_it_needs_them() -> None:
    """`scipy.stats` takes half of the time to import the room; a few limits of placing need it."""
    script = "import sys, recon.reconstruct; print('scipy' in sys.modules, 'scipy.stats' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, timeout=100)
    assert done.stdout == "True False\n"
