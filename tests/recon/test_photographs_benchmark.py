"""The page about real photographs: a row for each cloud, and a peer beside ours."""

import json
from pathlib import Path
from typing import Any

import pytest

from benchmarks.recon.photographs import figures_of_openmvg, photographs_page
from groundwork.errors import ChildError
from tests.recon.test_photos import jpeg


def test_a_cloud_has_a_row() -> None:
    """Cameras and points of a sparse cloud, and the points that were merged into others."""
    figures: dict[str, Any] = {"images": 3, "registered": 2, "points": 50, "model_points": 100, "observations": 150}
    figures |= {"thrice": 0.5, "mean_reprojection_error": 0.7, "target": "none", "method": "up", "expected_error": None}
    page = photographs_page([("shore", {**figures, "mode": "sparse", "duplicates": 1200})])
    assert "\n| shore | sparse | 2 of 3 | 50 | 50% | 1,200 | 50% | 3.0 | 0.70 | nothing |  |  |\n" in page


def test_a_peer_has_a_row_beside_ours(tmp_path: Path) -> None:
    """What openmvg-rs answers becomes a row: cameras, points, their views and errors; its failure is one line."""
    for row in range(3):
        (tmp_path / f"{row}.jpg").write_bytes(jpeg())
    views = [{"name": f"{row}.jpg", "rotation": [], "center": []} for row in range(2)]
    answer = {
        "seconds": 1.0,
        "points": 4,
        "views": views,
        "errors": [0.2, 0.4, 0.6, 0.8],
        "track_lengths": [2, 2, 3, 5],
    }
    python = tmp_path / "python"
    python.write_text(f"#!/bin/sh\ntest $2 = {tmp_path} && cat > $3 <<END\n{json.dumps(answer)}\nEND\n")
    python.chmod(0o755)
    page = photographs_page([("shore", figures_of_openmvg(python, tmp_path))])
    assert "\n| shore | openmvg-rs, SIFT | 2 of 3 | 4 | 100% |  | 50% | 3.0 | 0.50 | nothing |  |  |\n" in page
    python.write_text("#!/bin/sh\necho no images >&2\nexit 1\n")
    with pytest.raises(ChildError, match="openmvg-rs: no images"):
        figures_of_openmvg(python, tmp_path)
