"""The mapper: an image that few matches tie to the others."""

import sqlite3
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from groundwork.progress import SILENT
from recon.settings import ReconSettings, SparseSettings
from recon.sfm import mapping
from recon.sfm.database import DATABASE
from recon.sfm.sparse import run_sparse
from render.capture import read_capture

SETTINGS = ReconSettings(sparse=SparseSettings(max_features=1200))
TIES = 28  # matches of the last image; COLMAP registers none with fewer than 30
_PAIRS = 2147483647  # COLMAP's key of a pair is the first image's number times this, plus the second one's


def test_an_image_with_few_matches_is_in_the_model(
    make_capture: Callable[..., Path],
    arc: Callable[[int], NDArray[np.float64]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Where 28 matches are all that ties an image to the others, it is registered; with COLMAP's limit it is not."""
    capture = read_capture(make_capture(tmp_path / "capture", arc(6)))
    (tmp_path / "work").mkdir()
    run_sparse(capture, tmp_path / "work", SETTINGS, SILENT)
    (matches,) = (tmp_path / "work").glob("matches-*")
    _thin(matches / DATABASE)
    found = {}
    for limit in (30, mapping.FEW_INLIERS):
        monkeypatch.setattr(mapping, "FEW_INLIERS", limit)
        folder = tmp_path / f"model{limit}"
        folder.mkdir()
        found[limit] = mapping.map_images(capture, matches, folder, SETTINGS.sparse, 0, SILENT)["models"][0]["images"]
    assert found == {30: 5, 15: 6}


def _thin(database: Path) -> None:
    """Leave the last image `TIES` matches with the one before it, and none with others."""
    with sqlite3.connect(database) as opened:
        images = dict(opened.execute("SELECT name, image_id FROM images"))
        before, last = (images[name] for name in sorted(images)[-2:])
        for pair, rows, data in opened.execute("SELECT pair_id, rows, data FROM two_view_geometries").fetchall():
            if last not in (pair // _PAIRS, pair % _PAIRS):
                continue
            kept = TIES if before in (pair // _PAIRS, pair % _PAIRS) else 0
            assert rows >= kept
            opened.execute(
                "UPDATE two_view_geometries SET rows = ?, data = ? WHERE pair_id = ?",
                (kept, np.frombuffer(data or b"", np.uint32)[: 2 * kept].tobytes(), pair),
            )
