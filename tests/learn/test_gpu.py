"""On a GPU: the same numbers as on the processor, and a training; left out where torch has no GPU."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from groundwork.progress import Silent
from learn.losses import cross_entropy, lovasz_softmax
from learn.models.backbone import COORD, batched, completed, geometry_of
from learn.models.registry import NETWORKS, build_network
from learn.neighborhoods.batches import farthest_in_turn
from learn.trained import read_network
from learn.training.settings import TrainSettings
from learn.training.train import TrainingData, train_network
from tests.learn.toy import ToyBridges

GPU = "cuda"
pytestmark = pytest.mark.skipif(not torch.cuda.is_available(), reason="torch has no GPU here")


@pytest.mark.parametrize("name", NETWORKS)
def test_a_step_is_that_of_the_processor(name: str) -> None:
    """Logits, losses, every gradient and the running means of a training step, in float64: no maximum changes place."""
    rng = np.random.default_rng(0)
    clouds = rng.random((2, 4096, 3), np.float32)
    labels = torch.from_numpy(rng.integers(0, 5, 2 * 4096))
    found = {}
    for device in ("cpu", GPU):
        torch.manual_seed(0)
        network: Any = build_network(name, {"dropout": 0.0}, 3, 5).train()
        geometry = batched([geometry_of(network, cloud) for cloud in clouds])
        geometry = {
            key: rows.to(device, torch.float64 if rows.is_floating_point() else None) for key, rows in geometry.items()
        }
        network = network.to(device, torch.float64)
        logits = network(torch.from_numpy(clouds).to(device, torch.float64), geometry)
        flat, truth = logits.flatten(0, 1), labels.to(device)
        loss = cross_entropy(flat, truth, torch.ones(5, device=device, dtype=torch.float64)) + lovasz_softmax(
            flat, truth
        )
        loss.backward()
        found[device] = [
            logits.detach(),
            loss.detach(),
            *(weight.grad for weight in network.parameters()),
            *(kept for kept in network.buffers() if kept.is_floating_point()),
        ]
    for ours, theirs in zip(found["cpu"], found[GPU], strict=True):
        assert ours is not None
        assert theirs is not None
        assert torch.allclose(ours, theirs.cpu(), rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("name", NETWORKS)
def test_neighborhoods_are_those_of_the_processor(name: str) -> None:
    """Farthest points by the kernel and without it, balls and nearest points: the same rows."""
    from learn.neighborhoods.farthest_kernel import farthest_on_gpu  # needs Triton

    rng = np.random.default_rng(1)
    clouds = rng.random((3, 4096, 3), np.float32)
    network: Any = build_network(name, {}, 3, 5)
    alone = batched([geometry_of(network, cloud) for cloud in clouds])
    together = completed(network, {COORD: torch.from_numpy(clouds).to(GPU)})
    for key, rows in alone.items():
        assert torch.equal(rows, together[key].cpu()), key
    grid = torch.from_numpy(np.stack(np.meshgrid(*[np.arange(12)] * 3), axis=-1).reshape(1, -1, 3).astype(np.float32))
    coord = torch.cat([grid, grid], dim=1).to(GPU)  # ties everywhere
    assert torch.equal(farthest_on_gpu(coord, 1728), farthest_in_turn(coord, 1728))
    assert torch.equal(farthest_on_gpu(coord, 1728).cpu(), farthest_in_turn(coord.cpu(), 1728))


@pytest.mark.parametrize("precision", ["32-true", "bf16-mixed"])
def test_a_training_on_a_gpu_learns_and_its_model_predicts_here(tmp_path: Path, precision: str) -> None:
    """Loader processes, mixed precision, the model's file: what `falsework train` does with `accelerator=gpu`."""
    chosen = TrainSettings.model_validate(
        {
            "model": "pointnet2-ssg",
            "network": {"counts": (64, 16), "unit": 2.0},
            "epochs": 10,
            "batch": 2,
            "seed": 3,
            "accelerator": "gpu",
            "precision": precision,
            "workers": 2,
        }
    )
    train_network(TrainingData(ToyBridges(8)), chosen, tmp_path, Silent())
    model, source = read_network(tmp_path), ToyBridges(2, first=50)
    right = []
    for row in range(len(source)):
        sample = source.sample(row, 1)
        right.append(model.probabilities([sample])[0].argmax(axis=1) == sample.labels)
    assert np.concatenate(right).mean() > 0.6
    sample = source.sample(0, 1)
    here, there = model.probabilities([sample])[0], read_network(tmp_path, "gpu").probabilities([sample] * 3)
    assert all(np.abs(here - one).max() < 1e-3 for one in there)
