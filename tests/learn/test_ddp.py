"""Two processes train one network together on a CPU."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch

from learn.training import loader
from learn.training.loader import EpochOrder
from tests.learn.toy_bridge import write_toy


def test_processes_share_an_epoch(monkeypatch: pytest.MonkeyPatch) -> None:
    """Their shares are of one length and together the whole epoch, with the first sample again where it is odd."""
    whole = list(EpochOrder(range(7), 1))
    shares = []
    for rank in range(2):
        monkeypatch.setattr(loader, "_processes", lambda rank=rank: (rank, 2))
        order = EpochOrder(range(7), 1)
        shares.append(list(order))
        assert len(shares[-1]) == len(order) == 4
    assert [place for pair in zip(*shares, strict=True) for place in pair] == [*whole, (*whole[0][:2], 1)]


@pytest.mark.proof_only
def test_two_processes_train_as_one_with_twice_the_batch(tmp_path: Path) -> None:
    """Gloo on two processes: the bytes of a second run, every epoch in the log, and a model that has learnt."""
    clouds = [write_toy(tmp_path / f"{i}", i, 3000, f"b{i}") for i in range(4)]
    cut = ["--set", "points=256", "--set", "fewest=64", "--set", "tile.voxel=0.3"]
    command = [sys.executable, "-m", "falsework"]
    subprocess.run([*command, "dataset", "local", *map(str, clouds), "-o", str(tmp_path / "set"), *cut], check=True)
    net = [
        "--epochs",
        "4",
        "--batch",
        "4",
        "--set",
        "network.counts=[64, 16]",
        "--set",
        "network.unit=2.0",
        "--set",
        "accelerator=cpu",
        "--set",
        "devices=2",
    ]
    for name in ("a", "b"):
        subprocess.run([*command, "train", str(tmp_path / "set"), "-o", str(tmp_path / name), *net], check=True)
    assert (tmp_path / "a/model.safetensors").read_bytes() == (tmp_path / "b/model.safetensors").read_bytes()
    rows = (tmp_path / "a/log.csv").read_text().splitlines()
    assert [row.split(",")[0] for row in rows] == ["epoch", "0", "1", "2", "3"]
    facts = json.loads((tmp_path / "a/model.json").read_text())
    assert facts["training"]["settings"]["devices"] == 2
    values = [float(row.split(",")[2]) for row in rows[1:]]
    assert facts["training"]["picked_epoch"] == int(np.argmax(values))
    assert max(values) > 0.5
    assert torch.distributed.is_available()
