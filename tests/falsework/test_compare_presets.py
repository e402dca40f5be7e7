"""The paper's experiments, from their shipped presets to their tables, on toy bridges and with a small forest."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from recon.cloud import write_cloud
from tests.falsework.test_sample_verbs import run as call
from tests.learn.toy_bridge import toy_cloud

SMALL = ("seeds=2", "forest_draws=12", "points=256", "fewest=1", "draws=100")
SMALL += ('models=["forest"]', "network.forest.trees=4", "network.forest.scales=[10]", "network.forest.points=1000")
CLOUDS = {
    "task-local-1": {"korea": ("tls",), "synthetic": ("local+dense",), "illinois": ("local",)},
    "global": {"": ("global",)},
}


@pytest.mark.parametrize("preset", sorted(CLOUDS))
def test_a_preset_becomes_tables(preset: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Arms are trained on their own sets and scored on the test's; windows and classes are the paper's."""
    sources = []
    for number, (name, clouds) in enumerate(CLOUDS[preset].items()):
        for bridge in range(5):
            place = tmp_path / (name or "run") / f"{bridge}"
            for cloud in clouds:
                made = toy_cloud(10 * number + bridge, 3000, f"{name}{bridge}")
                columns = {**made.columns, "uncertainty": np.full(len(made), 0.01, np.float32)}
                columns["uncertainty"][::10] = 0.3
                (place / cloud).mkdir(parents=True)
                write_cloud(place / cloud, replace(made, columns=columns))
        sources.append(f"{name}={tmp_path / name}" if name else tmp_path / "run")
    changed = [word for setting in SMALL for word in ("--set", setting)]
    code, _, error = call(capsys, "compare", *sources, "-o", tmp_path / "out", "--preset", preset, *changed)
    assert code == 0, error
    record = json.loads((tmp_path / "out" / "comparison.json").read_text())
    part = {row["part"] for row in record["losses"]}
    arms = {row["arm"]: row for row in record["scores"]}
    if preset == "global":
        assert part == {"bridges/global"}
        assert set(arms) == {"sparse"}
        assert record["classes"][-1] == "noisy_point"
        truly_noisy = np.array(arms["sparse"]["confusion"])[-1].sum()
        assert 0.03 < truly_noisy / np.sum(arms["sparse"]["confusion"]) < 0.2  # a tenth of the points
    else:
        assert part == {"korea/tls", "synthetic/local+dense"}
        assert set(arms) == {"korea", "korea+sfm"}
        assert any(fact.startswith("windows of 10 m, each scaled to the cube") for fact in record["facts"])
        (difference,) = record["differences"]
        assert (difference["first"], difference["second"]) == ("korea", "korea+sfm")
        assert difference["interval"][0] < difference["difference"] < difference["interval"][1]
    assert all(0.4 < row["mean_iou"] <= 1.0 for row in arms.values())
