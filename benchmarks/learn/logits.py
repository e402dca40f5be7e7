"""Compares the logits of our networks with those of other implementations that have the same weights.

Usage: python -m benchmarks.learn.logits --yanx27 CHECKOUT [--commit COMMIT]

CHECKOUT is a clone of yanx27/Pointnet_Pointnet2_pytorch; Open3D-ML is the one that open3d-cpu holds. Our random weights
are copied into their classes, which also get our choice of points and our neighbors. Writes
`docs/benchmarks/logits.md`.
"""

import argparse
import importlib
import sys
import types
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from benchmarks.learn.step import ROOT, _commit
from benchmarks.page import write_page
from learn.models.backbone import COORD, batched, geometry_of
from learn.models.gather import Shared
from learn.models.randlanet import SLOPE
from learn.models.registry import build_network

PAGE = ROOT / "docs" / "benchmarks" / "logits.md"
POINTS, CLOUDS = 4096, 2
CLASSES = 13
YANX27 = {"pointnet2-ssg": "models.pointnet2_sem_seg", "pointnet2-msg": "models.pointnet2_sem_seg_msg"}
RANDLANET: dict[str, dict[str, Any]] = {
    "four layers": {"widths": (16, 64, 128, 256), "ratios": (4, 4, 4, 4)},
    "five layers": {"widths": (16, 64, 128, 256, 512), "ratios": (4, 4, 4, 4, 2)},
}


@dataclass(frozen=True)
class Difference:
    """By how much the logits of two implementations differ.

    Attributes:
        single: Greatest difference in float32 [1].
        double: Greatest difference in float64 [1].
        spread: Standard deviation of the logits [1].
    """

    single: float
    double: float
    spread: float


Forward = Callable[[Tensor, dict[str, Tensor]], Tensor]
"""Logits, shape (B, N, K), of features, shape (B, N, C), and a geometry of `learn.models.backbone`."""


def main() -> None:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--yanx27", type=Path, required=True)
    parser.add_argument("--commit", default="", help="of CHECKOUT, where it is no clone")
    chosen = parser.parse_args()
    torch.set_num_threads(1)
    found = {
        **{f"{name}, yanx27": yanx27_difference(name, chosen.yanx27) for name in YANX27},
        **{f"RandLA-Net of {name}, Open3D-ML": open3d_difference(**RANDLANET[name]) for name in RANDLANET},
    }
    own = open3d_difference(**RANDLANET["five layers"], slope=None)
    write_page(PAGE, page(found, own, chosen.commit or _commit(chosen.yanx27)), __file__)


def page(found: dict[str, Difference], own: Difference, commit: str) -> str:
    """Write the table.

    Args:
        found: Differences by network and peer.
        own: Of RandLA-Net, where Open3D-ML keeps the slope that it has of its own.
        commit: Of the checkout of yanx27.
    """
    rows = [f"| {name} | {row.single:.1e} | {row.double:.1e} | {row.spread:.2f} |" for name, row in found.items()]
    return "\n".join(
        [
            "# Logits under copied weights",
            "",
            "Written by `python -m benchmarks.learn.logits`.",
            "Our networks and other implementations of the same networks, with the same random weights and random",
            f"statistics of the batch normalizations, on {CLOUDS} clouds of {POINTS:,} random points. The others get",
            "our choice of points and our neighbors, because each implementation fills balls in its own way.",
            f"Yanx27's PointNet++ at commit {commit[:10]}, Open3D-ML of open3d-cpu {version('open3d-cpu')}.",
            "",
            "| network, compared with | greatest difference, float32 | float64 | standard deviation of the logits |",
            "|---|---|---|---|",
            *rows,
            "",
            "- Open3D-ML's RandLA-Net has a slope of 0.01 in the activation after each residual sum, the authors'",
            "  program and ours have 0.2. The table was made with 0.2 in both; with its own slope Open3D-ML differs by",
            f"  {own.single:.1e}. Its attention has a bias, which the softmax over the neighbors cancels.",
            "- The references of PointNeXt need CUDA operators of their own and were not run.",
            "",
        ]
    )


def yanx27_difference(name: str, folder: Path, points: int = POINTS) -> Difference:
    """Compare PointNet++ with yanx27's.

    Args:
        name: Row of `YANX27`.
        folder: Checkout.
        points: Points of a cloud.
    """
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))
    search: Any = importlib.import_module("models.pointnet2_utils")
    torch.manual_seed(1)
    theirs = importlib.import_module(YANX27[name]).get_model(CLASSES).eval()
    ours = randomized(build_network(name, {}, 9, CLASSES))
    into_yanx27(ours, theirs)

    def forward(features: Tensor, geometry: dict[str, Tensor]) -> Tensor:
        levels = range(len(ours.settings.counts))
        kept = iter([geometry[f"kept{level}"] for level in levels])
        balls = iter([geometry[f"ball{level}_{ring}"] for level in levels for ring in range(len(ours.balls[level]))])
        search.farthest_point_sample = lambda *_: next(kept)
        search.query_ball_point = lambda *_: next(balls)
        return theirs(features.transpose(1, 2))[0]

    return _difference(ours, theirs, forward, 9, points, logarithms=True)


def open3d_difference(
    widths: Sequence[int], ratios: Sequence[int], *, slope: float | None = SLOPE, points: int = POINTS
) -> Difference:
    """Compare RandLA-Net with Open3D-ML's.

    Args:
        widths: Half the features of each layer.
        ratios: By how much each layer thins the cloud.
        slope: Slope of the activation after each residual sum [1]; None leaves Open3D-ML's own.
        points: Points of a cloud.
    """
    torch.manual_seed(1)
    theirs: Any = open3d_randlanet()(
        num_neighbors=16,
        num_layers=len(widths),
        num_classes=CLASSES,
        sub_sampling_ratio=list(ratios),
        in_channels=6,
        dim_output=list(widths),
    )
    theirs.device = torch.device("cpu")
    theirs.eval()
    ours = randomized(build_network("randlanet", {"widths": tuple(widths), "ratios": tuple(ratios)}, 6, CLASSES))
    into_open3d(ours, theirs)
    if slope is not None:
        for block in theirs.encoder:
            block.lrelu = nn.LeakyReLU(slope)

    def forward(features: Tensor, geometry: dict[str, Tensor]) -> Tensor:
        inputs: dict[str, Any] = {"coords": [], "neighbor_indices": [], "sub_idx": [], "interp_idx": []}
        coord = geometry[COORD]
        for level in range(len(widths)):
            near, kept = geometry[f"near{level}"], geometry[f"kept{level}"]
            rows = torch.arange(len(coord))[:, None]
            below = (coord, near, near[rows, kept], geometry[f"up{level}"])
            for key, values in zip(inputs, below, strict=True):
                inputs[key].append(values)
            coord = coord[rows, kept]
        return theirs({**inputs, "features": features})

    return _difference(ours, theirs, forward, 6, points)


def open3d_randlanet() -> Any:
    """Import Open3D-ML's class from its file alone; the rest of Open3D-ML needs packages that nothing here uses.

    Raises:
        ImportError: Open3D is missing, or without Open3D-ML.
    """
    found = find_spec("open3d")
    file = Path(found.origin).parent / "_ml3d/torch/models/randlanet.py" if found and found.origin else None
    if file is None or not file.is_file():
        raise ImportError("Open3D without Open3D-ML")
    stubs = {f"{_ROOM}.{name}": _module(f"{_ROOM}.{name}", values) for name, values in _UNUSED.items()}
    made = spec_from_file_location(f"{_ROOM}.torch.models.randlanet", file)
    assert made is not None
    assert made.loader is not None
    module = module_from_spec(made)
    sys.modules.update(stubs)
    try:
        made.loader.exec_module(module)
    finally:
        for name in stubs:
            del sys.modules[name]
    return module.RandLANet


class _Model(nn.Module):
    """What Open3D-ML's base class of models is for a forward pass: it keeps the settings."""

    def __init__(self, **settings: Any) -> None:
        super().__init__()
        self.cfg, self.rng = SimpleNamespace(**settings), np.random.default_rng(0)


_ROOM = "open3d_ml_alone"
_UNUSED: dict[str, dict[str, Any]] = {
    "utils": {"MODEL": SimpleNamespace(_register_module=lambda *_: None)},
    "datasets": {},
    "datasets.augment": {"SemsegAugmentation": lambda *_, **__: None},
    "datasets.utils": {"DataProcessing": None},
    "torch": {},
    "torch.dataloaders": {"DefaultBatcher": None},
    "torch.modules": {},
    "torch.modules.losses": {"filter_valid_label": None},
    "torch.models": {},
    "torch.models.base_model": {"BaseModel": _Model},
}
"""Names that the file of the network imports from the rest of Open3D-ML, for data and losses."""


def _module(name: str, values: dict[str, Any]) -> types.ModuleType:
    module = types.ModuleType(name)
    vars(module).update(values)
    return module


def randomized(network: Any, seed: int = 1) -> Any:
    """Draw the statistics and the parameters of all batch normalizations, so that none of them can be left out.

    Args:
        network: One of ours, which is set to evaluation.
        seed: Seed of the draws.
    """
    drawn = torch.Generator().manual_seed(seed)
    for module in network.modules():
        if isinstance(module, nn.BatchNorm1d):
            assert module.running_mean is not None
            assert module.running_var is not None
            module.running_mean.normal_(0.0, 0.3, generator=drawn)
            module.running_var.uniform_(0.5, 1.5, generator=drawn)
            nn.init.uniform_(module.weight, 0.5, 1.5, generator=drawn)
            nn.init.normal_(module.bias, 0.0, 0.3, generator=drawn)
    return network.eval()


def into_yanx27(ours: Any, theirs: Any) -> None:
    """Copy the weights of our PointNet++ into yanx27's.

    Args:
        ours: With one ball or two about each point.
        theirs: The same.
    """
    for level, mlps in enumerate(ours.down):
        target = getattr(theirs, f"sa{level + 1}")
        several = hasattr(target, "conv_blocks")
        convs = target.conv_blocks if several else [target.mlp_convs]
        norms = target.bn_blocks if several else [target.mlp_bns]
        for mlp, conv, norm in zip(mlps, convs, norms, strict=True):
            _copy_all(mlp, conv, norm, last_offset=several)
    for step, mlp in enumerate(ours.up):
        target = getattr(theirs, f"fp{len(ours.up) - step}")
        _copy_all(mlp, target.mlp_convs, target.mlp_bns)
    _copy(ours.head[0], theirs.conv1, theirs.bn1)
    _copy_linear(ours.head[2], theirs.conv2)


def into_open3d(ours: Any, theirs: Any) -> None:
    """Copy the weights of our RandLA-Net into Open3D-ML's; the bias of its attention, which we lack, stays as it is.

    Args:
        ours: RandLA-Net.
        theirs: With as many layers.
    """
    _copy(ours.stem, theirs.fc0, theirs.bn0)
    for block, target in zip(ours.down, theirs.encoder, strict=True):
        pairs = (
            (block.enter, target.mlp1),
            (block.place_first, target.lse1.mlp),
            (block.pool_first.mlp, target.pool1.mlp),
            (block.place_second, target.lse2.mlp),
            (block.pool_second.mlp, target.pool2.mlp),
            (block.leave, target.mlp2),
            (block.shortcut, target.shortcut),
        )
        for layer, shared in pairs:
            _copy(layer, shared.conv, shared.batch_norm)
        for pool, other in ((block.pool_first, target.pool1), (block.pool_second, target.pool2)):
            other.score_fn[0].weight.data.copy_(pool.score.weight.data)
    _copy(ours.bottom, theirs.mlp.conv, theirs.mlp.batch_norm)
    for layer, shared in zip(
        [*ours.up, ours.head[0], ours.head[1]], [*theirs.decoder, theirs.fc1[0], theirs.fc1[1]], strict=True
    ):
        _copy(layer, shared.conv, shared.batch_norm)
    _copy_linear(ours.head[3], theirs.fc1[3].conv)


def _copy_all(mlp: Any, convs: Any, norms: Any, *, last_offset: bool = False) -> None:
    """Copy a shared MLP; yanx27's network with several balls has the offset behind the features, not before them."""
    for number, (layer, conv, norm) in enumerate(zip(mlp, convs, norms, strict=True)):
        _copy(layer, conv, norm, turned=3 if last_offset and not number else 0)


def _copy(layer: Shared, conv: Any, norm: Any, *, turned: int = 0) -> None:
    """Copy a layer with its normalization; so many first inputs become the last ones."""
    _copy_linear(layer.linear, conv, turned=turned)
    norm.load_state_dict(layer.norm.state_dict())


def _copy_linear(linear: nn.Linear, conv: Any, *, turned: int = 0) -> None:
    weight = torch.roll(linear.weight.data, -turned, dims=1)
    weight = weight.T if isinstance(conv, nn.ConvTranspose2d) else weight
    conv.load_state_dict({"weight": weight.reshape(conv.weight.shape), "bias": linear.bias.data})


def _difference(
    ours: Any, theirs: Any, forward: Forward, inputs: int, points: int, *, logarithms: bool = False
) -> Difference:
    """Score the same clouds with both networks, in both precisions; yanx27's gives logarithms of probabilities."""
    rng = np.random.default_rng(3)
    clouds = rng.random((CLOUDS, points, inputs)).astype(np.float32)
    searched = batched([geometry_of(ours, cloud[:, :3].copy()) for cloud in clouds])
    found: list[tuple[float, float]] = []
    for kind in (torch.float32, torch.float64):
        features = torch.from_numpy(clouds).to(kind)
        geometry = {**searched, COORD: searched[COORD].to(kind)}
        ours.to(kind)
        theirs.to(kind)
        with torch.no_grad():
            mine, others = ours(features, geometry), forward(features, geometry)
        mine = mine.log_softmax(dim=-1) if logarithms else mine
        found.append((float((mine - others).abs().max()), float(others.std())))
    return Difference(found[0][0], found[1][0], found[1][1])


if __name__ == "__main__":
    main()
