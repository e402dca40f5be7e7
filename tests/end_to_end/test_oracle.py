"""Every exact image of authored bridges against the ray caster, from the files of the capture alone."""

from pathlib import Path

import numpy as np
import pytest

from falsework.scenario import Scenario
from falsework.stages import STAGES
from groundwork.progress import SILENT
from groundwork.settings import parse_settings
from render.capture import read_capture, read_truth
from tests.conftest import RecordProof
from tests.end_to_end.conftest import Chain
from tests.render.oracle import Oracle, Verdict, judge

FAMILIES = ("slab", "beam", "girder", "arch", "suspension", "cable_stayed")
CAMERAS = ("default_24mm", "mini_like")  # without distortion; with it, and with a rolling shutter
# Components with leaves that are cut out of cards. Only their picture knows the holes, which no ray caster reads.
LEAFY = ("tree", "shrub", "vegetation")


def judged(folder: Path, count: int) -> list[Verdict]:
    """Judge some images of a capture, spread over its flight."""
    truth = read_truth(read_capture(folder))
    assert truth is not None
    corners, ids, _ = truth.surface()
    leafy = np.array([row.id for row in truth.instances if row.component in LEAFY], np.uint32)
    bare = ~np.isin(ids, leafy)
    whole, solid = Oracle(corners, ids), Oracle(corners[bare], ids[bare])
    verdicts, leaves, cards = [], 0, 0
    for index in np.unique(np.linspace(0, len(truth.names) - 1, count).round().astype(int)):
        shown, away = truth.instance(int(index)), truth.depth(int(index))
        depth, expected, _ = whole.look(truth, int(index))
        behind, expected_behind, _ = solid.look(truth, int(index))
        # Where a ray meets a card, either a hole shows exactly what is solid behind it, or some leaf lies in between,
        # whose depth counts as right: it may be that of any card.
        card, leaf = np.isin(expected, leafy), np.isin(shown, leafy)
        hole, between = card & ~leaf, card & leaf & (away > depth * (1 - 1e-4)) & (away < behind)
        expected, depth = np.where(hole, expected_behind, expected), np.where(hole, behind, depth)
        expected, depth = np.where(between, shown, expected), np.where(between, away.astype(np.float64), depth)
        verdicts.append(judge(shown, away, expected, depth))
        leaves, cards = leaves + int(between.sum()), cards + int(card.sum())
    assert 0.1 * cards < leaves < 0.98 * cards, "cards are drawn whole, or not at all"
    return verdicts


def hold(verdicts: list[Verdict]) -> dict[str, float]:
    """Hold verdicts against what is promised; return the worst figures."""
    pixels = sum(verdict.pixels for verdict in verdicts)
    equal = sum(verdict.equal * verdict.pixels for verdict in verdicts) / pixels
    worst = {
        "ids_equal": equal,
        "ids_equal_worst_image": min(verdict.equal for verdict in verdicts),
        "strays": max(verdict.stray for verdict in verdicts),
        "depth_median": max(verdict.median for verdict in verdicts),
        "depth_p999": max(verdict.tail for verdict in verdicts),
    }
    assert worst["ids_equal"] >= 0.9995, worst
    assert worst["strays"] <= 1e-5, worst  # a few pixels where faces of different parts meet at a grazing angle
    assert worst["depth_median"] < 5e-7, worst
    assert worst["depth_p999"] < 5e-6, worst
    return worst


def test_an_authored_bridge_equals_the_ray_caster(chain: Chain) -> None:
    """Ids and depth of the tiny chain's capture."""
    (folder,) = (chain.out / "scenes/0000/capture").iterdir()
    hold(judged(folder, 4))


@pytest.mark.proof_only
@pytest.mark.parametrize("family", FAMILIES)
def test_every_family_equals_the_ray_caster(family: str, tmp_path: Path, record_proof: RecordProof) -> None:
    """Both kinds of camera, on a bridge of every family in the countryside."""
    flights = [
        {"kind": "global", "id": camera, "images": 12, "spacing": 50.0, "width": 960, "height": 720, "camera": camera}
        for camera in CAMERAS
    ]
    scenario = parse_settings(
        Scenario,
        {
            "seed": 5,
            "bridge": {"family": family},
            "background": {"name": "countryside"},
            "survey": flights,
            "render": {"quality": "fast"},
        },
        "proof",
    )
    stage = tmp_path / "stage"
    stage.mkdir()
    STAGES["stage"].run({"seed": 5, "authoring": scenario.authoring()}, {}, stage, SILENT)
    figures, count = {}, 0
    for camera in CAMERAS:
        folder = tmp_path / camera
        folder.mkdir()
        settings = {"seed": 5, "survey": camera, "render": scenario.rendering()}
        STAGES["capture"].run(settings, {"stage": stage}, folder, SILENT)
        verdicts = judged(folder, 6)
        count += len(verdicts)
        figures |= {f"{camera}_{name}": value for name, value in hold(verdicts).items()}
    record_proof(f"render: a bridge of family {family} equals the ray caster", count, 5, figures)
