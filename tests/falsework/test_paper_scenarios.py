"""The two scenarios of the paper's data sets say what is known of them, and load."""

from pathlib import Path

from authoring.families.registry import FAMILIES
from falsework.scenario import Scenario, load_scenario

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"


def check_common(scenario: Scenario) -> None:
    """Check what both sets share: every family, random looks, noise, one lens, the rule of 40 %."""
    family = scenario.bridge.family
    assert isinstance(family, dict)
    assert set(family) == set(FAMILIES)
    assert scenario.bridge.profile == "paper"
    assert scenario.look.name == "random"
    assert scenario.sensor.noise
    assert scenario.recon.alignment.max_invalid_share == 0.40
    assert len(scenario.survey) == 1


def test_local_set() -> None:
    """399 close flights of 74 images on average, every half metre, dense clouds."""
    scenario = load_scenario(SCENARIOS / "paper-local.toml")
    check_common(scenario)
    flight = scenario.survey[0]
    assert (scenario.scenes, flight.kind, scenario.recon.mode) == (399, "local", "dense")
    assert flight.kind == "local"
    assert flight.spacing == 0.5
    assert flight.images[0] < 74 < flight.images[1]


def test_global_set() -> None:
    """220 flights round the whole bridge of 378 images, after the paper's box, sparse clouds."""
    scenario = load_scenario(SCENARIOS / "paper-global.toml")
    check_common(scenario)
    flight = scenario.survey[0]
    assert (scenario.scenes, scenario.recon.mode) == (220, "sparse")
    assert flight.kind == "global"
    assert (flight.images, flight.tour, flight.poi) == (378, "rings", "box50")


def test_learning_set() -> None:
    """One bridge after the other as five kinds of cloud that `compare` knows; scans show 40 m of surroundings."""
    scenario = load_scenario(SCENARIOS / "learning.toml")
    assert isinstance(scenario.bridge.family, dict)
    assert set(scenario.bridge.family) == set(FAMILIES)
    assert [sample.id for sample in scenario.sample] == ["mesh", "visible", "tls", "mls"]
    assert [sample.reach for sample in scenario.sample if sample.kind != "mesh"] == [40.0, 40.0]
    assert {sample.voxel for sample in scenario.sample} == {0.05}
    flight = scenario.survey[0]
    assert (scenario.scenes, flight.kind, scenario.recon.mode) == (36, "local", "dense")
    assert flight.kind == "local"
    assert flight.images[1] <= 60
