"""`[variants]` of a scenario, through the whole chain: one capture for each, from one bridge and one survey."""

from pathlib import Path

import pytest

from falsework.pipeline import Outcome, run_scenario
from groundwork.progress import SILENT
from tests.authoring.small_scene import SEED, file_bytes
from tests.conftest import RecordProof
from tests.end_to_end.conftest import VARIANTS, Varied

NAMES = [f"global@{look}_{background}" for look in VARIANTS["look"] for background in VARIANTS["background"]]
VARYING = {"render.json"}  # its exposure is that of the photographs


@pytest.fixture(scope="module")
def run(varied: Varied) -> tuple[Path, Outcome]:
    """Give the scene of a run of two looks and two backgrounds, and what its records say came of it."""
    outcome = run_scenario(varied.scenario, varied.out, SILENT)
    assert outcome.made == 0
    return varied.out / "scenes/0000", outcome


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
    for background in VARIANTS["background"]:
        one, two = (truths[f"global@{look}_{background}"] for look in VARIANTS["look"])
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
