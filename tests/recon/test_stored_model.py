"""One model, several clouds: structure from motion is not run again, and nothing else is taken for its model."""

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from groundwork.canonical import file_digest
from groundwork.errors import InputError, MissingError
from groundwork.progress import SILENT
from recon.photos.photos import open_photographs
from recon.reconstruct import reconstruct, reconstruct_cloud
from recon.settings import ReconSettings
from recon.sfm.stored_model import MODEL, read_stored_model


def contents(folder: Path) -> dict[str, str]:
    """Hash every file of a cloud but its model."""
    files = sorted(path for path in folder.rglob("*") if path.is_file() and MODEL not in path.relative_to(folder).parts)
    return {path.relative_to(folder).as_posix(): file_digest(path) for path in files}


@pytest.fixture
def no_more_mapping(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let structure from motion fail."""

    def fail(*unused: object) -> None:
        raise AssertionError("structure from motion ran again")

    monkeypatch.setattr("recon.reconstruct.run_sparse", fail)


@pytest.mark.usefixtures("no_more_mapping", "no_children")
def test_one_model_makes_both_clouds(
    plane_capture: Path, plane_cloud: Path, plane_settings: ReconSettings, tmp_path: Path
) -> None:
    """Both clouds come of a former cloud's cameras, the sparse one with its very bytes, each as if made alone."""
    settings = plane_settings.model_copy(update={"mode": "both", "quality": "low", "filter": "mild"})
    both, alone = tmp_path / "both", tmp_path / "alone"
    for folder in (both, alone):
        folder.mkdir()
    reconstruct(plane_capture, both, settings, SILENT, model=plane_cloud)
    assert contents(both / "cloud/sparse") == contents(plane_cloud)
    dense = settings.model_copy(update={"mode": "dense"})
    reconstruct_cloud(plane_capture, both / MODEL, alone, dense, SILENT)
    assert contents(both / "cloud/dense") == contents(alone)
    assert json.loads((alone / "cloud.json").read_text())["source"] == "sfm-dense"
    for path in sorted((both / MODEL).rglob("*.*")):
        assert path.read_bytes() == (plane_cloud / path.relative_to(both)).read_bytes()
    assert sorted(path.name for path in both.iterdir()) == ["cloud", "model"]


def _change(path: Path, **values: Any) -> None:
    path.write_text(json.dumps({**json.loads(path.read_text()), **values}))


def test_what_is_no_model_of_these_photographs(plane_capture: Path, plane_cloud: Path, tmp_path: Path) -> None:
    """Nothing, another version or photograph, keys of another kind, a changed bit: one line each, in its place."""
    capture = open_photographs(plane_capture)
    with pytest.raises(MissingError, match=r"holds no model\.json"):
        read_stored_model(tmp_path, capture)
    folder = tmp_path / "model"
    shutil.copytree(plane_cloud / MODEL, folder)
    assert read_stored_model(folder, capture).facts == read_stored_model(plane_cloud, capture).facts
    file, whole = folder / "model.json", (folder / "model.json").read_text()
    stored = json.loads(whole)
    for values, said in (
        ({"format_version": 9}, "not a model of this version"),
        ({"recipe": 3}, "of a wrong kind"),
        ({"reasons": [1]}, "of a wrong kind"),
        ({"facts": None}, "of a wrong kind"),
        ({"photographs": {**stored["photographs"], capture.images[0].file: "0" * 64}}, "made from other photographs"),
    ):
        _change(file, **values)
        with pytest.raises(InputError, match=said):
            read_stored_model(folder, capture)
        file.write_text(whole)
    points = folder / "sparse/points3D.bin"
    data = bytearray(points.read_bytes())
    data[30] ^= 1  # the last bits of a coordinate
    points.write_bytes(data)
    with pytest.raises(InputError, match="was changed after it was written"):
        read_stored_model(folder, capture)
    points.write_bytes(data[:-5])
    with pytest.raises(InputError, match="not a complete COLMAP model"):
        read_stored_model(folder, capture)
