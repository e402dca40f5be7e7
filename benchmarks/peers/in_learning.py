"""Times training steps of another project's network; runs in a Python that has it.

Usage: python in_learning.py WHICH FOLDER STEPS [MODULES…]: `yanx27`, PointNet++ of a checkout of
yanx27/Pointnet_Pointnet2_pytorch in FOLDER, or `open3d`, RandLA-Net of Open3D-ML as the wheel of open3d-cpu bundles it
(FOLDER is not looked at). Prints JSON: `step` and `geometry`, lists of processor seconds. One thread.
"""

import json
import sys
import time
import types
from typing import Any

import numpy as np
import torch


def main(which: str, folder: str, steps: int) -> None:
    """Time the steps.

    Args:
        which: yanx27 or open3d.
        folder: Checkout.
        steps: How many, after one that is not counted.
    """
    torch.set_num_threads(1)
    torch.manual_seed(0)
    print(json.dumps(yanx27(folder, steps) if which == "yanx27" else open3d(steps)))  # noqa: T201


def yanx27(folder: str, steps: int) -> dict[str, list[float]]:
    """PointNet++ SSG, 8 blocks of 4,096 points with 9 numbers each: FPS, balls and 3-NN are inside its forward pass.

    Args:
        folder: Checkout.
        steps: How many.
    """
    sys.path.insert(0, folder)
    from models.pointnet2_sem_seg import get_model  # pyright: ignore[reportMissingImports]

    network = get_model(13)
    optimizer = torch.optim.Adam(network.parameters(), lr=1e-3)
    rng = np.random.default_rng(0)
    taken = []
    for _ in range(steps + 1):
        points = torch.from_numpy(rng.random((8, 9, 4096)).astype(np.float32))
        labels = torch.from_numpy(rng.integers(0, 13, 8 * 4096))
        begun = time.process_time()
        optimizer.zero_grad()
        found, _ = network(points)
        torch.nn.functional.nll_loss(found.reshape(-1, 13), labels).backward()
        optimizer.step()
        taken.append(time.process_time() - begun)
    return {"step": taken[1:], "geometry": [0.0] * steps}


def open3d(steps: int) -> dict[str, list[float]]:
    """RandLA-Net, five layers, one cloud of 65,536 points with 6 numbers each; its neighbors are searched beforehand.

    Args:
        steps: How many.
    """
    if "torch.utils.tensorboard" not in sys.modules:
        silent: Any = types.ModuleType("torch.utils.tensorboard")
        silent.SummaryWriter = object  # only its pipelines, which are not used here, write there
        sys.modules["torch.utils.tensorboard"] = silent
    from open3d._ml3d.datasets.utils import DataProcessing  # pyright: ignore[reportMissingImports]
    from open3d._ml3d.torch.models.randlanet import RandLANet  # pyright: ignore[reportMissingImports]

    ratios = [4, 4, 4, 4, 2]
    network: Any = RandLANet(
        num_neighbors=16,
        num_layers=5,
        num_classes=17,
        sub_sampling_ratio=ratios,
        in_channels=6,
        dim_output=[16, 64, 128, 256, 512],
    )
    network.device = torch.device("cpu")
    network.train()
    optimizer = torch.optim.Adam(network.parameters(), lr=1e-3)
    rng = np.random.default_rng(0)
    taken, searched = [], []
    for _ in range(steps + 1):
        features = rng.random((65_536, 6)).astype(np.float32)
        labels = torch.from_numpy(rng.integers(0, 17, 65_536))
        begun = time.process_time()
        coord = features[:, :3].copy()
        inputs: dict[str, Any] = {"coords": [], "neighbor_indices": [], "sub_idx": [], "interp_idx": []}
        for ratio in ratios:
            near = DataProcessing.knn_search(coord, coord, 16)
            kept = coord[: len(coord) // ratio]
            up = DataProcessing.knn_search(kept, coord, 1)
            for name, values in zip(inputs, (coord, near, near[: len(kept)], up), strict=True):
                whole = values if name == "coords" else values.astype(np.int64)
                inputs[name].append(torch.from_numpy(np.ascontiguousarray(whole))[None])
            coord = kept
        inputs["features"] = torch.from_numpy(features)[None]
        searched.append(time.process_time() - begun)
        begun = time.process_time()
        optimizer.zero_grad()
        torch.nn.functional.cross_entropy(network(inputs)[0], labels).backward()
        optimizer.step()
        taken.append(time.process_time() - begun)
    return {"step": taken[1:], "geometry": searched[1:]}


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]))
