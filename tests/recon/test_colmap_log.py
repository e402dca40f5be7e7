"""COLMAP says nothing, and leaves no file in the folder for temporary files."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.patience import left

ROOT = Path(__file__).resolve().parents[2]
ADJUST = """
import sys
import pycolmap
from recon.sfm.colmap_log import silence
if sys.argv[1:]:
    silence()
made = pycolmap.SyntheticDatasetOptions()
made.num_rigs, made.num_cameras_per_rig, made.num_frames_per_rig, made.num_points3D = 1, 1, 6, 50
pycolmap.bundle_adjustment(pycolmap.synthesize_dataset(made))
"""


@pytest.mark.parametrize("silent", [False, True])
def test_no_log_is_left(silent: bool, tmp_path: Path) -> None:
    """With the names of user and computer in its name; it is there without our word."""
    command = [sys.executable, "-c", ADJUST, *(["silent"] if silent else [])]
    environment = {**os.environ, "TMPDIR": str(tmp_path)}
    subprocess.run(command, cwd=ROOT, env=environment, check=True, capture_output=True, timeout=left())
    found = [path.name for path in tmp_path.iterdir()]
    assert found == [] if silent else any(".log.INFO." in name for name in found)
