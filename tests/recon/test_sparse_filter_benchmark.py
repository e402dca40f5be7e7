"""The benchmark of the sparse filter counts what its page says, and puts to points the rule of the clouds."""

from pathlib import Path

import numpy as np

from benchmarks.recon.sparse_filter import Judged, judge, rules, scene_part
from recon.cloud import Cloud, read_cloud
from recon.sfm.colmap_model import read_model
from render.capture import read_capture, read_truth


def test_the_page_counts_points() -> None:
    """Ten points whose worth is known, in one table."""
    judged = Judged(
        views=np.array([4, 4, 2, 2, 2, 9, 2, 2, 2, 2]),
        errors=np.zeros(10),
        deviation=np.array([9.0, 0.05, 0.05, 0.3, 0.3, 9.0, 0.3, 0.05, 0.05, 0.05]),
        noise=np.full(10, 0.25),
        segment=np.array([1, 1, 1, 1, 1, 1, 1, 0, 0, 0], np.uint8),
        right=np.array([0, 1, 1, 1, 0, 1, 1, 1, 1, 1], bool),
        distance=np.array([0.5, 0, 0, 0, 0, 0.5, 0, 0, 0, 0]),
        uncertainty=np.array([1, 0, 0, 1, 0, 1, 0, 0, 0, np.inf]),
    )
    assert {name: int(mask.sum()) for name, mask in rules(judged).items()} == {
        "all": 10,
        "by views": 7,
        "by precision": 8,
    }
    line = next(line for line in scene_part("x", judged, {0: "background", 1: "deck"}).splitlines() if "| deck" in line)
    assert [cell.strip() for cell in line.split("|")[1:-1]] == [
        "deck",
        "5",
        "28.6%",
        "20.0%",
        "42.9%",
        "40%",
        "50.0%",
        "0.0%",
        "50.0%",
        "100%",
        "0.0%",
        "20.0%",
        "20.0%",
    ]


def test_the_rule_is_that_of_the_clouds(plane_capture: Path, plane_cloud: Path) -> None:
    """What stays by precision is what the cloud of the same model holds."""
    capture = read_capture(plane_capture)
    truth = read_truth(capture)
    assert truth is not None
    judged = judge(read_model(plane_cloud / "model/sparse"), capture, truth)
    cloud: Cloud = read_cloud(plane_cloud)
    assert int(rules(judged)["by precision"].sum()) == len(cloud)
    assert cloud.statistics["classes"]["abutment"]["kept"] == (cloud.columns["segment"] == 1).sum()
