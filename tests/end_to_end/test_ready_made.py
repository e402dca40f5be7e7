"""Scenes with photographs of `falsework dataset demo`: whole, without a trace of their run, and loadable."""

import os
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from falsework.cli import main
from falsework.commands import photographed_scenes
from falsework.commands.photographed_scenes import photographed_scenario
from falsework.execution.outcome import Outcome
from groundwork.files import MANIFEST
from learn.demo import clouds
from learn.demo.clouds import thin_cloud
from recon.cloud import OBSERVATION_COLUMNS, read_cloud
from render.capture import read_capture, read_truth
from tests.conftest import RecordProof
from tests.end_to_end.conftest import Chain
from tests.learn.toy_bridge import write_toy

MOST_BYTES = 60e6


def command(*words: str | Path) -> None:
    """Run a verb that must succeed."""
    with pytest.raises(SystemExit) as done:
        main([str(word) for word in words])
    assert done.value.code == 0


@pytest.fixture
def folder(chain: Chain, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Write the ready-made data with the scene of the shared chain, and one toy bridge."""

    def run(scenario: Any, out: Path, progress: Any) -> Outcome:
        assert scenario == chain.scenario.model_copy(update={"keep": ("capture", "cloud")})
        for kind in ("capture", "cloud"):
            shutil.copytree(chain.out / "scenes/0000" / kind, out / "scenes/0000" / kind)
        return Outcome()

    toy = thin_cloud(write_toy(tmp_path / "toy", 0, 2000, "b"), "beam26")
    monkeypatch.setattr(clouds, "demo_clouds", lambda: [toy])
    monkeypatch.setattr(photographed_scenes, "photographed_scenario", lambda: chain.scenario)
    monkeypatch.setattr("falsework.pipeline.run_scenario", run)
    command("dataset", "demo", "-o", tmp_path / "bridges", "--photographs")
    return tmp_path / "bridges"


def test_scenes_are_whole_and_say_nothing_of_their_run(folder: Path, chain: Chain) -> None:
    """Capture and cloud are read like those of the run; no link, no path, no store; every file can be changed."""
    scene, made = folder / "scenes/beam-3", chain.out / "scenes/0000"
    capture = read_capture(scene / "capture/global")
    truth = read_truth(capture)
    assert truth is not None
    assert len(capture.images) == len(read_capture(made / "capture/global").images)
    assert np.isfinite(truth.depth(0)).any()
    ours, theirs = read_cloud(scene / "cloud/global"), read_cloud(made / "cloud/global")
    np.testing.assert_array_equal(ours.columns["coord"], theirs.columns["coord"])
    assert {*ours.observations} == {*OBSERVATION_COLUMNS}
    files = [path for path in (folder / "scenes").rglob("*") if not path.is_dir()]
    assert not any(path.is_symlink() or path.name in (MANIFEST, "cloud.ply") for path in files)
    assert all(os.access(path, os.W_OK) for path in files)
    texts = [path.read_text() for path in files if path.suffix in (".json", ".toml")]
    assert len(texts) > 4
    assert not any(str(place) in text for text in texts for place in (chain.out, folder, Path.home()))
    assert sorted(path.name for path in folder.iterdir() if not path.name.startswith(".")) == [
        "README.md",
        "beam26",
        "scenes",
    ]


def test_the_card_tells_numbers_and_how_to_load(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its row has the figures of the cloud; its lines of Python and its commands find the scene."""
    card = (folder / "README.md").read_text()
    cloud = read_cloud(folder / "scenes/beam-3/cloud/global")
    median = float(np.median(cloud.columns["uncertainty"]))
    images, valid = len(cloud.cameras), sum(row["status"] == "ok" for row in cloud.cameras)
    assert f"| beam-3 | {images} | {valid} | global | {len(cloud):,} | {median:.4f} | " in card
    (lines,) = re.findall(r"```python\n(.*?)```", card, re.DOTALL)
    monkeypatch.chdir(folder.parent)
    found: dict[str, Any] = {}
    exec(lines, found)
    assert found["points"].shape == (len(cloud), 3)
    assert {found["names"][label] for label in set(found["labels"].tolist())} >= {"background", "deck"}
    assert 0 < len(found["sure"]) < len(cloud)
    (text,) = re.findall(r"```sh\n(falsework report.*?)```", card, re.DOTALL)
    for line in text.splitlines():
        command(*line.split()[1:])
    assert "Scene beam-3" in (tmp_path / "scene.html").read_text()
    assert len(list((tmp_path / "for_colmap").rglob("*.jpg"))) == images


@pytest.mark.slow
@pytest.mark.proof_only
def test_three_scenes_are_small_and_good(tmp_path: Path, record_proof: RecordProof) -> None:
    """Less than 60 MB; every photograph registered; three families; medians of uncertainty of centimeters."""
    names, out, images = [], tmp_path / "bridges", 0
    command("dataset", "demo", "-o", out, "--photographs")
    size = sum(path.stat().st_size for path in out.rglob("*") if path.is_file())
    assert size < MOST_BYTES
    for scene in sorted((out / "scenes").iterdir()):
        if not scene.is_dir():
            continue
        names.append(scene.name)
        for name in ("global+dense", "global+sparse"):
            cloud = read_cloud(scene / "cloud" / name)
            assert all(row["status"] == "ok" for row in cloud.cameras)
            images += len(cloud.cameras) if name == "global+dense" else 0
            assert np.median(cloud.columns["uncertainty"]) < 0.06  # a pixel is some 2 cm wide
    assert names == ["arch-54", "beam-54", "girder-54"]
    figures = {"bytes": size, "photographs_all_registered": images}
    record_proof("dataset demo: three scenes with photographs", len(names), 54, figures)


def test_a_filled_folder_is_refused_before_any_work(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One line, and nothing is written beside the user's file."""
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(SystemExit) as done:
        main(["dataset", "demo", "-o", str(tmp_path), "--photographs"])
    assert done.value.code == 2
    assert "files that Falsework did not write" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


def test_the_scenes_are_of_three_families() -> None:
    """One of each, so that family and seed name them."""
    assert photographed_scenes._names(photographed_scenario()) == ["beam-54", "girder-54", "arch-54"]
