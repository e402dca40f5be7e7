"""The scenarios of the paper's data sets, and those that stand in for others, say what is known of them, and load."""

from pathlib import Path

import numpy as np

from authoring.families.bridge_settings import draw_layout
from authoring.families.registry import FAMILIES
from authoring.streams import stream
from benchmarks.falsework.recipes import MOST_REJECTED, PROOF
from falsework.scenario import Scenario, load_scenario, scene_seed
from learn.compare.experiment import experiment_settings
from learn.compare.preset import preset_names
from learn.compare.selection import parts_in
from tests.proof_rows import read_rows

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
    """399 close flights of 74 images on average, every half meter, dense clouds."""
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


def test_few_scenes_are_rejected() -> None:
    """Of the scenes that have been made of each set: at most 3 of the first 30, and 1 of the first 6."""
    for name, (most, first) in MOST_REJECTED.items():
        rows = {f"{name}: scene {number}" for number in range(first)}
        made = [row["figures"] for row in read_rows(PROOF) if row["name"] in rows]
        assert made
        assert sum("rejected" in figures for figures in made) <= most


def test_learning_set() -> None:
    """One bridge after the other as five kinds of cloud that `compare` knows; scans show 40 m of surroundings."""
    scenario = load_scenario(SCENARIOS / "learning.toml")
    assert isinstance(scenario.bridge.family, dict)
    assert set(scenario.bridge.family) == set(FAMILIES)
    assert [sample.id for sample in scenario.sample] == ["mesh", "visible", "tls"]
    assert [sample.reach for sample in scenario.sample if sample.kind != "mesh"] == [40.0]
    assert {sample.voxel for sample in scenario.sample} == {0.15}
    flight = scenario.survey[0]
    assert (scenario.scenes, scenario.recon.mode) == (36, "both")
    assert flight.kind == "local"
    assert (flight.images[1], flight.at_support) == (60, 1.0)


def test_pseudo_korea() -> None:
    """Seven concrete bridges within the lengths and spans that are known, of several lengths, by laser alone."""
    scenario = load_scenario(SCENARIOS / "pseudo-korea.toml")
    assert (scenario.scenes, scenario.bridge.family, scenario.survey) == (7, "beam", ())
    spans = [
        np.diff(draw_layout(scenario.bridge, stream(scene_seed(scenario.seed, number), "bridge"))[0].supports)
        for number in range(scenario.scenes)
    ]
    assert min(row.min() for row in spans) >= 17.0
    assert max(row.max() for row in spans) <= 38.0
    assert 54.0 <= min(row.sum() for row in spans) < 60.0 < 120.0 < max(row.sum() for row in spans) <= 272.0


def test_pseudo_illinois_shares_nothing_of_the_way_it_is_made() -> None:
    """Camera, world, light, pairs, mapper and depth are others than those of the clouds that arms are trained on."""
    ours, theirs = (load_scenario(SCENARIOS / f"{name}.toml") for name in ("learning", "pseudo-illinois"))
    assert (ours.recon.mode, theirs.recon.mode) == ("both", "dense")
    flight, other_flight = ours.survey[0], theirs.survey[0]
    assert flight.kind == "local"
    assert other_flight.kind == "local"
    for one, other in (
        (flight.camera, other_flight.camera),
        (ours.light, theirs.light),
        (ours.background.name, theirs.background.name),
        (ours.seed, theirs.seed),
        (ours.recon.sparse.pairing, theirs.recon.sparse.pairing),
        (ours.recon.sparse.mapper, theirs.recon.sparse.mapper),
        (ours.recon.dense.method, theirs.recon.dense.method),
    ):
        assert one != other


def test_presets_name_clouds_that_the_scenarios_make() -> None:
    """Every cloud of an arm or a test of every preset is a sample or a survey of its set's scenario."""
    made = {"korea": "pseudo-korea", "illinois": "pseudo-illinois", "synthetic": "learning", "bridges": "learning"}
    for preset in preset_names():
        settings = experiment_settings(preset, {})
        for part in (*parts_in(settings, settings.arms), *(settings.test(name) for name in settings.tests)):
            name = "paper-global" if preset == "global" else made[part.set]
            scenario = load_scenario(SCENARIOS / f"{name}.toml")
            modes = scenario.recon.modes
            ends = [f"+{mode}" for mode in modes] if len(modes) > 1 else [""]
            clouds = {sample.id for sample in scenario.sample}
            clouds |= {f"{survey.id}{end}" for survey in scenario.survey for end in ends}
            assert {part.cloud, part.like} - {""} <= clouds, (preset, part)
