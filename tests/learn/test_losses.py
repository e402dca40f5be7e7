"""Losses equal their definitions, written out slowly, and unlabelled points pull nowhere."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from sklearn.metrics import jaccard_score

from learn.losses import (
    WeightRule,
    class_weights,
    components_only,
    cross_entropy,
    lovasz_softmax,
    merge_noise,
    noise_loss,
    uncertainty_weights,
)

SEEDS = st.integers(0, 10_000)


def drawn(seed: int, count: int = 50, classes: int = 4) -> tuple[torch.Tensor, torch.Tensor]:
    """Draw logits, and labels of which some are unknown."""
    rng = np.random.default_rng(seed)
    labels = rng.integers(0, classes, count)
    labels[rng.random(count) < 0.2] = 255
    return torch.from_numpy(rng.normal(size=(count, classes))), torch.from_numpy(labels)


def test_class_weights_are_the_published_formulas() -> None:
    """Frequencies 0.9, 0.1 and 0."""
    counts = torch.tensor([900, 100, 0])
    assert class_weights(counts, "none").tolist() == [1.0, 1.0, 1.0]
    assert class_weights(counts, "randla").tolist() == pytest.approx([1 / 0.92, 1 / 0.12, 1 / 0.12])
    assert class_weights(counts, "cube-root").tolist() == pytest.approx([1.0, 9 ** (1 / 3), 9 ** (1 / 3)])
    raw = np.array([0.9001, 0.1001]) ** -0.5
    wanted = raw / (raw @ [0.9, 0.1])
    assert class_weights(counts, "sqrt").tolist() == pytest.approx([*wanted, wanted[1]], rel=1e-6)


@pytest.mark.parametrize("rule", ["none", "cube-root", "randla", "sqrt"])
def test_class_weights_are_finite_whatever_is_counted(rule: WeightRule) -> None:
    """No point at all, and one class alone."""
    for counts in ([0, 0], [5, 0]):
        assert torch.isfinite(class_weights(torch.tensor(counts), rule)).all()


@given(SEEDS)
def test_cross_entropy_is_a_plain_mean_of_weighted_terms(seed: int) -> None:
    """Term by term in Python; without weights it is torch's own."""
    logits, labels = drawn(seed)
    weights, points = torch.tensor([1.0, 2.0, 0.5, 3.0]).double(), torch.rand(50).double()
    terms = [
        -float(weights[label] * points[row] * logits[row].log_softmax(-1)[label])
        for row, label in enumerate(labels.tolist())
        if label != 255
    ]
    assert math.isclose(float(cross_entropy(logits, labels, weights, points)), sum(terms) / len(terms), rel_tol=1e-9)
    plain = torch.nn.functional.cross_entropy(logits, labels, ignore_index=255)
    assert torch.allclose(cross_entropy(logits, labels), plain)


@given(SEEDS)
def test_lovasz_softmax_of_a_sure_forecast_is_one_minus_the_iou(seed: int) -> None:
    """At the corners the extension is the set function itself, averaged over the classes that are present."""
    _, labels = drawn(seed)
    found = torch.from_numpy(np.random.default_rng(seed + 1).integers(0, 4, 50))
    logits = torch.nn.functional.one_hot(found, 4).double() * 60.0
    known = labels != 255
    present = sorted(set(labels[known].tolist()))
    iou = [jaccard_score(labels[known] == number, found[known] == number) for number in present]
    assert math.isclose(float(lovasz_softmax(logits, labels)), float(1 - np.mean(iou)), abs_tol=1e-9)


def slow_lovasz(probabilities: np.ndarray, labels: np.ndarray) -> float:
    """Sum the errors, worst first, each times the growth of 1 - IoU of the set of wrong points."""
    losses = []
    for number in sorted(set(labels.tolist())):
        inside = labels == number
        errors = np.abs(inside - probabilities[:, number])
        wrong, before, total = np.zeros(len(labels), bool), 0.0, 0.0
        for row in np.argsort(-errors, kind="stable"):
            wrong[row] = True
            loss = 1 - (inside & ~wrong).sum() / (inside | wrong).sum()
            total += errors[row] * (loss - before)
            before = loss
        losses.append(total)
    return float(np.mean(losses))


@given(SEEDS)
def test_lovasz_softmax_equals_its_definition(seed: int) -> None:
    """The extension as a sum over a growing set of wrong points."""
    logits, labels = drawn(seed)
    known = labels != 255
    slow = slow_lovasz(logits[known].softmax(-1).numpy(), labels[known].numpy())
    assert math.isclose(float(lovasz_softmax(logits, labels)), slow, rel_tol=1e-9)


def test_unlabeled_points_pull_nowhere() -> None:
    """The gradient of every loss is zero in the rows without a label, and where all are unlabelled it is zero."""
    logits, labels = drawn(5)
    for loss in (cross_entropy, lovasz_softmax, lambda a, b: noise_loss(a, b, 3)):
        leaf = logits.clone().requires_grad_()
        loss(leaf, labels).backward()
        assert leaf.grad is not None
        assert leaf.grad[labels == 255].abs().max() == 0.0
        assert leaf.grad[labels != 255].abs().min() >= 0.0
        assert leaf.grad.abs().max() > 0.0
        leaf = logits.clone().requires_grad_()
        loss(leaf, torch.full_like(labels, 255)).backward()
        assert leaf.grad is not None
        assert leaf.grad.abs().max() == 0.0


def test_uncertain_points_count_less() -> None:
    """1 where sure, 1/e or 1/2 at the scale, 0 where nothing was seen."""
    values = torch.tensor([0.0, 0.1, torch.inf])
    assert uncertainty_weights(values, 0.1).tolist() == pytest.approx([1.0, math.exp(-1), 0.0])
    assert uncertainty_weights(values, 0.1, "inverse").tolist() == pytest.approx([1.0, 0.5, 0.0])


@given(SEEDS)
def test_the_two_heads_together_are_one_forecast(seed: int) -> None:
    """p(noisy) is the sigmoid of its logit; the others share the rest as their own softmax says."""
    logits, _ = drawn(seed)
    merged = merge_noise(logits, 3).exp()
    noise = logits[:, 3].sigmoid()
    assert torch.allclose(merged.sum(-1), torch.ones(50, dtype=torch.float64))
    assert torch.allclose(merged[:, 3], noise)
    assert torch.allclose(merged[:, :3], logits[:, :3].softmax(-1) * (1 - noise[:, None]))


@given(SEEDS)
def test_components_are_learnt_apart_from_noise(seed: int) -> None:
    """A noisy point moves no component, and the head for noise does not enter the components' softmax."""
    logits, labels = drawn(seed)
    rest, target = components_only(logits, labels, 3)
    assert (target[labels == 3] == 255).all()
    few = labels < 3
    wanted = torch.nn.functional.cross_entropy(logits[few][:, :3], labels[few])
    assert torch.allclose(cross_entropy(rest, target), wanted)
