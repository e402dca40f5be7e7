"""What an error costs is what was imported by then: heavy packages are counted, and no clock is asked."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

HEAVY = {
    *("cv2", "dask", "distributed", "h5py", "jinja2", "laspy", "lightning", "moderngl", "numba", "open3d", "plotly"),
    *("pyarrow", "pycolmap", "scipy", "sklearn", "torch", "trimesh", "viser"),
}
ROOMS = {"authoring.settings", "falsework.scenario", "learn.training.settings", "recon.reconstruct", "render.frames"}
SCRIPT = """
import json, sys
import falsework.cli
try:
    falsework.cli.main(json.loads(sys.argv[1]))
finally:
    print("\\n" + json.dumps(sorted({*sys.modules, *(name.partition(".")[0] for name in sys.modules)})))
"""
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


def loaded_after(words: list[str], folder: Path) -> tuple[int, str, set[str]]:
    """Run a command in a fresh interpreter; give its exit code, its errors, and every module that it loaded."""
    command = [sys.executable, "-c", SCRIPT, json.dumps(words)]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    return done.returncode, done.stderr, set(json.loads(done.stdout.splitlines()[-1]))


@pytest.mark.parametrize("words", HELP)
def test_help_loads_nothing_heavy(words: str, tmp_path: Path) -> None:
    """Neither a heavy package, nor the settings of all rooms."""
    code, _, loaded = loaded_after([*words.split(), "--help"], tmp_path)
    assert code == 0
    assert loaded & (HEAVY | ROOMS) == set()


@pytest.mark.parametrize("words", WRONG)
def test_an_error_loads_nothing_heavy(words: str, tmp_path: Path) -> None:
    """One line and exit code 2 before anything heavy is there; nothing is written."""
    (tmp_path / "folder").mkdir()
    (tmp_path / "notes.txt").write_text("a file")
    (tmp_path / "ok.toml").write_text("seed = 1\n")
    (tmp_path / "broken.toml").write_text("seed = = 1\n")
    before = sorted(tmp_path.rglob("*"))
    code, error, loaded = loaded_after(words.split(), tmp_path)
    assert code == 2, error
    assert error.startswith("falsework: ")
    assert error.count("\n") == 1
    assert loaded & (HEAVY | ROOMS) == set()
    assert sorted(tmp_path.rglob("*")) == before


def test_a_heavy_import_would_be_seen(tmp_path: Path) -> None:
    """What needs the settings of all rooms loads them, and is found to."""
    (tmp_path / "wrong.toml").write_text("sceens = 1\n")
    code, _, loaded = loaded_after(["plan", "wrong.toml"], tmp_path)
    assert code == 2
    assert "falsework.scenario" in loaded
    assert "scipy" in loaded


def test_reconstruction_loads_no_statistics_before_it_needs_them() -> None:
    """`scipy.stats` takes half of the time to import the room; a few limits of placing need it."""
    script = "import sys, recon.reconstruct; print('scipy' in sys.modules, 'scipy.stats' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout == "True False\n"
