"""`[variants]` of a scenario, through the whole chain: one capture for each, from one bridge and one survey."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from falsework.pipeline import Outcome, run_scenario
from falsework.scenario import Scenario
from falsework.stages import STAGES
from groundwork.errors import RejectedSceneError
from groundwork.progress import SILENT, Progress
from groundwork.settings import parse_settings
from tests.authoring.small_scene import SEED, SMALL, file_bytes
from tests.conftest import Count, RecordProof
from tests.render.prepared_here import rendered_here

AXES = {"look": ["weathered", "clean"], "background": ["none", "countryside"]}
NAMES = [f"global@{look}_{background}" for look in AXES["look"] for background in AXES["background"]]
VARYING = {"render.json"}  # its exposure is that of the photographs


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory, proof_count: Count) -> tuple[Path, Outcome]:
    """Run a scenario with two looks and two backgrounds, as small as it goes; give its scene and what came of it."""
    flight = {"kind": "global", "images": proof_count(8, 40), "spacing": 30.0, "width": 160, "height": 120}
    said = {**SMALL, "seed": SEED, "survey": [flight], "variants": AXES, "render": {"quality": "fast"}}
    out = tmp_path_factory.mktemp("variants") / "out"
    with pytest.MonkeyPatch.context() as patch:
        if proof_count(0, 1) == 0:  # eight small photographs make no model: that is not found out four times
            patch.setitem(STAGES, "model", replace(STAGES["model"], run=_no_model))
        with rendered_here():
            outcome = run_scenario(parse_settings(Scenario, said, "variants"), out, SILENT)
    return out / "scenes/0000", outcome


def _no_model(settings: dict[str, Any], inputs: dict[str, Path], folder: Path, progress: Progress) -> None:
    assert (inputs["capture"] / "cameras.json").is_file()
    raise RejectedSceneError("no_model", "too little to see")


def test_each_variant_has_a_capture(run: tuple[Path, Outcome]) -> None:
    """Four captures from one authored stage; each is accounted for: as a cloud, or by why there is none."""
    scene, outcome = run
    assert sorted(path.name for path in (scene / "capture").iterdir()) == sorted(NAMES)
    assert len(list((scene / "stage").resolve().parent.iterdir())) == 1
    clouds = {path.name for path in outcome.clouds}
    assert clouds | {name.partition("/")[2] for name in outcome.rejected} == set(NAMES)
    assert not outcome.failed
    assert (scene / "report.html").is_file()


def test_variants_share_what_they_should(run: tuple[Path, Outcome], record_proof: RecordProof) -> None:
    """Cameras are equal in all; truth is byte-equal between looks, not between backgrounds; no two look alike."""
    captures = {name: file_bytes(run[0] / "capture" / name) for name in NAMES}
    for file in ("cameras.json", "truth/poses.json"):
        assert len({captures[name][file] for name in NAMES}) == 1
    truths = {name: _truth(files) for name, files in captures.items()}
    unequal = 0
    for background in AXES["background"]:
        one, two = (truths[f"global@{look}_{background}"] for look in AXES["look"])
        unequal += len(set(one.items()) ^ set(two.items()))
    assert unequal == 0
    assert truths[NAMES[0]] != truths[NAMES[1]]
    photographs = {
        name: {f: data for f, data in files.items() if f.startswith("images/")} for name, files in captures.items()
    }
    images = len(photographs[NAMES[0]])
    assert images > 0
    for image in photographs[NAMES[0]]:
        assert len({photographs[name][image] for name in NAMES}) == len(NAMES), image
    record_proof(
        "stage/variants: truth equal between looks, cameras in all",
        len(NAMES) * images,
        SEED,
        {"unequal_files": unequal},
    )


def _truth(files: dict[str, bytes]) -> dict[str, bytes]:
    return {name: data for name, data in files.items() if name.startswith("truth/") and Path(name).name not in VARYING}
