"""One tiny chain that every end-to-end test shares, whichever process runs it."""

import shutil
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest

import falsework
from falsework.pipeline import run_scenario
from falsework.scenario import Scenario
from falsework.stages import STAGES
from groundwork.errors import RejectedSceneError
from groundwork.progress import SILENT, Progress
from groundwork.settings import parse_settings
from tests.authoring.small_scene import SEED, SMALL
from tests.conftest import Count
from tests.made_once import made_once
from tests.recon.conftest import in_this_process
from tests.render.prepared_here import rendered_here

TINY = {
    "seed": 3,
    "bridge": {
        "family": "beam",
        "service": "road",
        "alignment": {"kind": "straight", "skew": 0, "profile": "grade"},
        "beam": {"spans": [12.0]},
    },
    "background": {"name": "none"},
    "look": {"texels": 256},
    "light": {"sky_height": 64},
    "site": {"half_width": 40, "run_out": 40, "scatter": {"tufts": 60, "stones": 40, "shrubs": 5, "reeds": 5}},
    # as few photographs, pairs and keypoints as leave every camera registered: close by, and near one another
    "survey": [
        {
            "kind": "local",
            "id": "global",
            "images": [16, 18],
            "spacing": 0.8,
            "near": 4.0,
            "station": 0.0,
            "length": 12.0,
            "width": 400,
            "height": 300,
        }
    ],
    "render": {"quality": "fast"},
    "recon": {"mode": "sparse", "sparse": {"neighbours": 5, "max_features": 600}},
}
# What --proof measures: a loop round the whole bridge, with finer textures.
LOOP = {
    **TINY,
    "look": {"texels": 512},
    "site": {"half_width": 40, "run_out": 40, "scatter": {"tufts": 200, "stones": 100, "shrubs": 10, "reeds": 5}},
    "survey": [{"kind": "global", "images": 24, "spacing": 4.0, "width": 480, "height": 360}],
    "recon": {"mode": "sparse", "sparse": {"neighbours": 6, "max_features": 1000}},
}
VARIANTS = {"look": ["weathered", "clean"], "background": ["none", "countryside"]}
DENSE = falsework.ReconSettings(mode="dense", quality="medium")


@dataclass(frozen=True)
class Chain:
    """A finished tiny run.

    Attributes:
        scenario: What was asked for.
        out: Its output folder.
        made: How many results the first run made.
    """

    scenario: Scenario
    out: Path
    made: int


@dataclass(frozen=True)
class Varied:
    """A finished run of a scenario with variants.

    Attributes:
        scenario: What was asked for.
        out: Its output folder.
    """

    scenario: Scenario
    out: Path


@pytest.fixture(scope="session")
def chain(tmp_path_factory: pytest.TempPathFactory, worker_id: str, proof_count: Count) -> Chain:
    """Run the whole chain once, on real parts, as small as it goes; the first process that needs it runs it."""
    scenario = parse_settings(Scenario, (TINY, LOOP)[proof_count(0, 1)], "tiny")
    out = made_once(tmp_path_factory, worker_id, "chain", lambda out: str(run_scenario(scenario, out, SILENT).made))
    return Chain(scenario, out, int(out.with_name("made").read_text()))


@pytest.fixture(scope="session")
def varied(tmp_path_factory: pytest.TempPathFactory, worker_id: str, proof_count: Count) -> Varied:
    """Run a scenario with two looks and two backgrounds once, as small as it goes: four captures of one bridge."""
    flight = {"kind": "global", "images": proof_count(8, 40), "spacing": 30.0, "width": 160, "height": 120}
    said = {**SMALL, "seed": SEED, "survey": [flight], "variants": VARIANTS, "render": {"quality": "fast"}}
    scenario = parse_settings(Scenario, said, "variants")
    with pytest.MonkeyPatch.context() as patch, rendered_here():
        if proof_count(0, 1) == 0:  # eight small photographs make no model: that is not found out four times
            patch.setitem(STAGES, "model", replace(STAGES["model"], run=_no_model))
        out = made_once(
            tmp_path_factory, worker_id, "varied", lambda out: str(run_scenario(scenario, out, SILENT).made)
        )
    return Varied(scenario, out)


def _no_model(settings: dict[str, Any], inputs: dict[str, Path], folder: Path, progress: Progress) -> None:
    assert (inputs["capture"] / "cameras.json").is_file()
    raise RejectedSceneError("no_model", "too little to see")


@pytest.fixture(scope="session")
def dense(chain: Chain, tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> Path:
    """Make a dense cloud of the chain's photographs from Python once, with the settings that the pages show."""

    def make(out: Path) -> None:
        flown = chain.out / "scenes/0000"
        with in_this_process():
            falsework.reconstruct(
                falsework.read_capture(flown / "capture/global"), out, settings=DENSE, model=flown / "model/global"
            )

    return made_once(tmp_path_factory, worker_id, "dense", make)


@pytest.fixture
def densely(dense: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let `falsework.reconstruct` give a copy of that cloud to whoever asks for one like it."""

    def reconstruct(
        capture: falsework.Capture, out: Path | str, *, settings: falsework.ReconSettings
    ) -> falsework.Cloud:
        assert settings == DENSE
        assert len(capture.images) > 0
        shutil.copytree(dense, out)
        return falsework.read_cloud(out)

    monkeypatch.setattr("falsework.api.reconstruct", reconstruct)
