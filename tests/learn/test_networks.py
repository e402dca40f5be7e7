"""The networks are the published ones: their sizes, their logits, and what must not change these."""

from __future__ import annotations

import copy
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from groundwork.errors import InputError
from learn.models.backbone import COORD, batched, geometry_of
from learn.models.gather import Shared
from learn.models.pooled import pooled
from learn.models.registry import NETWORKS, build_network
from learn.neighborhoods.trees import Trees
from tests.learn import literal_networks as literal

CLASSES = 5
FOUR_LAYERS = {"widths": (16, 64, 128, 256), "ratios": (4, 4, 4, 4)}


@pytest.fixture(autouse=True)
def one_thread() -> None:
    """Small tensors gain nothing from threads, and sums come out in one order."""
    torch.set_num_threads(1)


def drawn(name: str, inputs: int = 4, seed: int = 1, **settings: Any) -> Any:
    """Build a network with random weights and random statistics, ready to predict."""
    torch.manual_seed(seed)
    network = build_network(name, settings, inputs, CLASSES)
    for module in network.modules():
        if isinstance(module, nn.BatchNorm1d):
            assert module.running_mean is not None
            assert module.running_var is not None
            module.running_mean.normal_(0.0, 0.3)
            module.running_var.uniform_(0.5, 1.5)
            nn.init.uniform_(module.weight, 0.5, 1.5)
            nn.init.normal_(module.bias, 0.0, 0.3)
    return network.eval()


def cloud(count: int, inputs: int = 4, seed: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """Draw positions in a unit cube and features."""
    rng = np.random.default_rng(seed)
    return rng.random((count, 3)).astype(np.float32), rng.normal(size=(count, inputs)).astype(np.float32)


def logits(network: Any, features: np.ndarray, coord: np.ndarray) -> Tensor:
    """Score one cloud."""
    with torch.no_grad():
        return network(torch.from_numpy(features)[None], batched([geometry_of(network, coord)]))[0]


@pytest.mark.parametrize(
    ("name", "settings", "inputs", "classes", "count"),
    [
        ("pointnet2-ssg", {}, 9, 13, 968_269),
        ("pointnet2-msg", {}, 9, 13, 1_883_269),
        ("pointnet2-ssg", {}, 3, 4, 966_916),
        ("pointnet2-ssg", {}, 6, 4, 967_012),
        ("randlanet", FOUR_LAYERS, 3, 19, 1_241_379),
        ("randlanet", {}, 6, 17, 4_993_273),
        ("randlanet", {}, 6, 13, 4_993_141),
        ("pointnext-s", {}, 4, 13, 792_237),
        ("pointnext-b", {}, 4, 13, 3_827_853),
    ],
)
def test_the_networks_have_the_published_sizes(
    name: str, settings: dict[str, Any], inputs: int, classes: int, count: int
) -> None:
    """Weights to be trained, to the last one; PointNeXt's authors round theirs to 0.792 and 3.828 million."""
    network = build_network(name, settings, inputs, classes)
    assert sum(weight.numel() for weight in network.parameters() if weight.requires_grad) == count


def published_pointnext(blocks: list[int]) -> int:
    """Count PointNeXt's weights from its configuration: width 32, four inputs, 13 classes."""

    def layer(inputs: int, outputs: int) -> int:
        return inputs * outputs + 2 * outputs  # a convolution without bias, and its batch normalisation

    widths = [32, 64, 128, 256, 512]
    total = 4 * 32 + 32
    for stage, (a, b) in enumerate(pairwise(widths)):
        small = not any(blocks)
        total += layer(a + 3, b // 2) + layer(b // 2, b) + a * b + b if small else layer(a + 3, b)
        total += blocks[stage] * (layer(b + 3, b) + layer(b, 4 * b) + layer(4 * b, b))
        total += layer(a + b, a) + layer(a, a)
    return total + layer(32, 32) + 32 * 13 + 13


def test_the_sizes_of_pointnext_follow_from_its_configuration() -> None:
    """Counted layer by layer from the published table, apart from the code of the network."""
    assert published_pointnext([0, 0, 0, 0]) == 792_237
    assert published_pointnext([1, 2, 1, 1]) == 3_827_853


LITERAL: dict[str, tuple[dict[str, Any], int, Callable[[Any, np.ndarray, np.ndarray], Tensor]]] = {
    "pointnet2-ssg": ({}, 1100, lambda n, f, c: literal.pointnet2(n, literal.SSG, f, c, CLASSES)),
    "pointnet2-msg": ({}, 1100, lambda n, f, c: literal.pointnet2(n, literal.MSG, f, c, CLASSES)),
    "pointnext-s": ({}, 1024, lambda n, f, c: literal.pointnext(n, [0, 0, 0, 0], f, c, CLASSES)),
    "pointnext-b": ({}, 1024, lambda n, f, c: literal.pointnext(n, [1, 2, 1, 1], f, c, CLASSES)),
}


@pytest.mark.parametrize("name", LITERAL)
def test_logits_equal_those_of_the_literal_network(name: str) -> None:
    """Copied weights, the literal network's own brute-force geometry: the same logits."""
    settings, count, reference = LITERAL[name]
    network = drawn(name, **settings)
    coord, features = cloud(count)
    with torch.no_grad():
        wanted = reference(network, features, coord)
    found = logits(network, features, coord)
    assert wanted.std() > 0.05
    assert (found - wanted).abs().max() < 1e-5


@pytest.mark.parametrize(
    ("widths", "ratios", "count"),
    [((16, 64, 128, 256), (4, 4, 4, 4), 1100), ((16, 64, 128, 256, 512), (2, 2, 2, 2, 2), 600)],
)
def test_logits_equal_those_of_the_literal_randlanet(
    widths: tuple[int, ...], ratios: tuple[int, ...], count: int
) -> None:
    """Copied weights and the same random choice of points: the same logits, with four and with five layers."""
    network = drawn("randlanet", widths=widths, ratios=ratios)
    coord, features = cloud(count)
    pyramid = network.pyramid(coord, Trees())
    kept = [np.asarray(pyramid[f"kept{level}"], np.int64) for level in range(len(widths))]
    with torch.no_grad():
        wanted = literal.randlanet(network, list(widths), kept, features, coord, CLASSES)
    found = logits(network, features, coord)
    assert wanted.std() > 0.05
    assert (found - wanted).abs().max() < 1e-5


def test_a_layer_in_training_is_the_usual_one() -> None:
    """Output, gradients and running statistics are those of linear, normalisation and activation in turn."""
    torch.manual_seed(0)
    ours = Shared(7, 5, nn.ReLU(), momentum=0.3).double()
    nn.init.normal_(ours.linear.bias)
    nn.init.normal_(ours.norm.bias)
    usual = copy.deepcopy(ours)
    values = torch.randn(4, 30, 7, dtype=torch.float64)
    for _ in range(3):
        inputs = [values.clone().requires_grad_() for _ in range(2)]
        found = ours(inputs[0])
        wanted = usual.norm(usual.linear(inputs[1].reshape(-1, 7))).relu().view(4, 30, 5)
        assert torch.allclose(found, wanted, atol=1e-12)
        for layer, outputs in ((ours, found), (usual, wanted)):
            layer.zero_grad()
            outputs.square().sum().backward()
        assert torch.allclose(inputs[0].grad, inputs[1].grad, atol=1e-10)  # type: ignore[arg-type]
        for (name, a), b in zip(ours.named_parameters(), usual.parameters(), strict=True):
            assert torch.allclose(a.grad, b.grad, atol=1e-10), name  # type: ignore[arg-type]
        for name, buffer in ours.norm.named_buffers():
            assert torch.allclose(buffer, usual.norm.get_buffer(name), atol=1e-12), name
    ours.norm.eval()
    usual.norm.eval()
    wanted = usual.norm(usual.linear(values.reshape(-1, 7))).relu().view(4, 30, 5)
    assert torch.allclose(ours(values), wanted, atol=1e-12)


SMALL: dict[str, dict[str, Any]] = {
    "pointnet2-ssg": {"counts": (256, 64)},
    "pointnet2-msg": {"counts": (256, 64)},
    "pointnext-s": {"width": 8},
    "pointnext-b": {"width": 8},
    "randlanet": {"widths": (8, 16), "ratios": (4, 4)},
}


@pytest.mark.parametrize("name", NETWORKS)
def test_the_order_of_points_does_not_matter(name: str) -> None:
    """With points and features reordered, the logits are reordered and nothing else; the first point stays the first.

    Where points are chosen at random the choice goes along, since it is one of rows.
    """
    network = drawn(name, **SMALL[name])
    coord, features = cloud(1024)
    order = np.concatenate([[0], 1 + np.random.default_rng(0).permutation(1023)])
    before, after = logits(network, features, coord), geometry_of(network, coord[order])
    if name == "randlanet":
        after = geometry_of(network, coord)
        back = torch.from_numpy(np.argsort(order))
        after[COORD] = torch.from_numpy(coord[order])
        after["near0"] = back[after["near0"]][torch.from_numpy(order)]
        after["kept0"] = back[after["kept0"]]
        after["up0"] = after["up0"][torch.from_numpy(order)]
    with torch.no_grad():
        found = network(torch.from_numpy(features[order])[None], batched([after]))[0]
    assert (found - before[torch.from_numpy(order)]).abs().max() < 1e-5


@pytest.mark.parametrize("name", [name for name in NETWORKS if name != "randlanet"])
def test_a_translated_cloud_has_the_same_logits(name: str) -> None:
    """Positions enter as offsets alone where they are no features; RandLA-Net's encoding takes them as they are."""
    network = drawn(name, **SMALL[name])
    coord, features = cloud(1024)
    coord = np.round(coord * 1024) / 1024  # so that adding 4 is exact in float32
    moved = coord + np.float32(4.0)
    assert (logits(network, features, moved) - logits(network, features, coord)).abs().max() < 1e-4


@pytest.mark.parametrize("name", NETWORKS)
def test_clouds_of_a_batch_do_not_mix(name: str) -> None:
    """A cloud's logits are the same alone and beside another one."""
    network = drawn(name, **SMALL[name])
    clouds = [cloud(1024, seed=seed) for seed in (3, 4)]
    geometry = batched([geometry_of(network, coord) for coord, _ in clouds])
    with torch.no_grad():
        both = network(torch.stack([torch.from_numpy(features) for _, features in clouds]), geometry)
    for row, (coord, features) in enumerate(clouds):
        assert (both[row] - logits(network, features, coord)).abs().max() < 1e-5


@pytest.mark.parametrize("name", NETWORKS)
def test_one_cloud_can_be_learnt_by_heart(name: str) -> None:
    """Four classes in the quarters of a cube: more than 99 % of the points are right after a few steps."""
    torch.manual_seed(2)
    network: Any = build_network(name, {**SMALL[name], "dropout": 0.0}, 3, 4)
    coord, _ = cloud(1024 if name.startswith("pointnext") else 512)  # which leaves a quarter at each of four levels
    labels = torch.from_numpy((coord[:, 0] > 0.5) * 2 + (coord[:, 1] > 0.5) * 1).long()
    features, geometry = torch.from_numpy(coord - 0.5)[None], batched([geometry_of(network, coord)])
    optimizer = torch.optim.AdamW(network.parameters(), lr=0.01)
    slower = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, 80)
    share = 0.0
    for _ in range(80):
        optimizer.zero_grad()
        scores = network(features, geometry)[0]
        nn.functional.cross_entropy(scores, labels).backward()
        optimizer.step()
        slower.step()
        share = float((scores.argmax(-1) == labels).float().mean())
        if share > 0.99:
            break
    assert share > 0.99


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[pytest.mark.proof_only] * (name == "pointnet2-ssg")) for name in NETWORKS],
)
def test_an_exported_network_gives_the_same_logits(name: str) -> None:
    """torch.export sees the whole forward pass, since no search stands in it; one ball is the case of several."""
    network = drawn(name, **SMALL[name])
    coord, features = cloud(1024)
    inputs = (torch.from_numpy(features)[None], batched([geometry_of(network, coord)]))
    with torch.no_grad():
        assert torch.equal(torch.export.export(network, inputs).module()(*inputs), network(*inputs))


def test_an_unknown_network_or_setting_is_refused() -> None:
    """The error names what there is."""
    with pytest.raises(InputError, match="pointnet2-ssg"):
        build_network("pointnet", {}, 3, 4)
    with pytest.raises(InputError, match="counts"):
        build_network("pointnet2-ssg", {"cuonts": (1, 2)}, 3, 4)
    with pytest.raises(InputError, match="same length"):
        build_network("randlanet", {"widths": (8, 16)}, 3, 4)
    with pytest.raises(InputError, match="from 2 to 2048"):
        build_network("randlanet", {"widths": (33000000000000, 16), "ratios": (4, 4)}, 3, 4)


def test_a_cloud_too_small_for_its_network_is_refused() -> None:
    """Each search says how many points it needs."""
    for name, least in (("pointnet2-ssg", r"\d+"), ("randlanet", r"\d+"), ("pointnext-s", "768")):
        with pytest.raises(InputError, match=rf"(?s)too few points.*allowed: {least} or more"):
            geometry_of(drawn(name), cloud(60)[0])


@pytest.mark.parametrize("active", [True, False])
def test_the_maximum_before_the_norm_is_the_maximum_after_it(active: bool) -> None:
    """Output, gradients and running statistics are those of layer and maximum in turn, for weights of either sign."""
    torch.manual_seed(1)
    relu = nn.ReLU() if active else None
    ours = nn.Sequential(Shared(7, 6, nn.ReLU()), Shared(6, 5, relu, bias=active, momentum=0.3)).double()
    last = ours[-1]
    assert isinstance(last, Shared)
    nn.init.normal_(last.norm.weight)
    nn.init.normal_(last.norm.bias)
    assert 0 < int((last.norm.weight < 0).sum()) < 5
    usual = copy.deepcopy(ours)
    values = torch.randn(2, 9, 8, 7, dtype=torch.float64)
    for _ in range(3):
        inputs = [values.clone().requires_grad_() for _ in range(2)]
        begun = nn.functional.linear(inputs[0], ours[0].linear.weight)  # type: ignore[arg-type]
        found, wanted = pooled(ours, begun), usual(inputs[1]).max(dim=2).values
        assert torch.allclose(found, wanted, atol=1e-12)
        for layers, outputs in ((ours, found), (usual, wanted)):
            layers.zero_grad()
            (outputs.square() + outputs).sum().backward()
        assert torch.allclose(inputs[0].grad, inputs[1].grad, atol=1e-10)  # type: ignore[arg-type]
        for (name, a), b in zip(ours.named_parameters(), usual.parameters(), strict=True):
            assert torch.allclose(a.grad, b.grad, atol=1e-10), name  # type: ignore[arg-type]
        for name, buffer in ours.named_buffers():
            assert torch.allclose(buffer, usual.get_buffer(name), atol=1e-12), name
    ours.eval()
    usual.eval()
    begun = nn.functional.linear(values, ours[0].linear.weight)  # type: ignore[arg-type]
    assert torch.allclose(pooled(ours, begun), usual(values).max(dim=2).values, atol=1e-12)
