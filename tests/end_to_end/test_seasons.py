"""A season, through the renderer: the photographs are others, and no bit of the truth is.

`make test` knows it from two sides: a season changes files of materials alone (tests/authoring/test_seasons.py), and
these change photographs alone (tests/end_to_end/test_swaps.py).
"""

from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from groundwork.progress import SILENT
from render.capture import TRUTH
from render.frames import render_stage
from render.settings import RenderSettings, SensorSettings
from tests.authoring.small_scene import SEED, file_bytes, write_small_scene
from tests.conftest import Count, RecordProof
from tests.render.prepared_here import prepared_here

COUNTRY: dict[str, object] = {
    "name": "countryside",
    "countryside": {"reach": 400, "buildings": 1, "trees": 8, "hedge_bushes": 5},
}
IDEAL = RenderSettings(quality="fast", shadow_size=512, sensor=SensorSettings(noise=False, image_format="png"))
VISIBLE = 10  # of 255
VARYING = "truth/render.json"  # its exposure is that of the photographs


@pytest.mark.proof_only
def test_season_changes_rgb_alone(tmp_path: Path, proof_count: Count, record_proof: RecordProof) -> None:
    """Depth, labels, ids, normals, poses and cameras are byte-equal; land turns from green to brown."""
    flight = {
        "kind": "global",
        "images": proof_count(8, 40),
        "spacing": proof_count(30, 6),
        "width": proof_count(160, 480),
        "height": proof_count(120, 360),
    }
    captures = []
    for one in ("summer", "autumn"):
        (tmp_path / one).mkdir()
        background = {**COUNTRY, "season": one}
        scene = write_small_scene(tmp_path / one, background=background, survey=[flight])
        (tmp_path / f"{one}_capture").mkdir()
        with prepared_here():
            render_stage(scene, tmp_path / f"{one}_capture", IDEAL, SEED, SILENT)
        captures.append(file_bytes(tmp_path / f"{one}_capture"))
    summer, other = captures
    assert summer.keys() == other.keys()
    differ = {name for name in summer if summer[name] != other[name]} - {VARYING}
    images = {name for name in summer if name.startswith("images/")}
    assert differ == images
    before, after = (np.stack([_picture(files[name]) for name in sorted(images)]) for files in captures)
    turned = np.abs(before - after).max(axis=-1) > VISIBLE
    assert turned.mean() > 0.1
    warm = [float(one[turned][:, 2].mean() / one[turned][:, 1].mean()) for one in (before, after)]
    assert warm[1] > warm[0] + 0.05
    truth = [name for name in summer if name.startswith(f"{TRUTH}/")]
    figures = {
        "files_of_truth": len(truth),
        "unequal_files_of_truth": len(differ - images),
        "turned_share": round(float(turned.mean()), 3),
        "red_over_green": [round(value, 3) for value in warm],
    }
    record_proof("stage/season: autumn changes rgb alone", len(images), SEED, figures)


def _picture(data: bytes) -> NDArray[np.float64]:
    """Read a picture: blue, green, red, of 255."""
    return np.asarray(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR), np.float64)
