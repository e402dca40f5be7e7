"""Settings of a training, and the values of the two recipes."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

from pydantic import Field

from groundwork.settings import Settings
from learn.datasets.settings import SensorSettings
from learn.losses import WeightRule


class TrainSettings(Settings):
    """A training."""

    model: str = "pointnet2-ssg"
    """Network to train."""
    network: dict[str, Any] = Field(default_factory=dict)
    """Settings of the network; see the tables of the networks."""
    recipe: Literal["paper", "modern"] = "modern"
    """paper: the paper's training, as far as it is known. modern: AdamW, one cycle of the learning rate, class weights
    by the square root of the frequency, Lovasz-softmax, half of the samples chosen by class, points weighted by their
    certainty, samples as from other sensors, a separate head for noisy points."""
    epochs: int = Field(default=50, ge=1, le=10_000)
    """Passes over the training samples."""
    batch: int = Field(default=8, ge=1, le=1024)
    """Samples per step."""
    learning_rate: float | None = Field(default=None, gt=0.0, le=1.0)
    """Largest learning rate [1]; left out: that of the recipe."""
    seed: int = Field(default=0, ge=0)
    """Seed of weights, order, draws and dropout."""
    validation: float = Field(default=0.2, ge=0.0, lt=1.0)
    """Share of the bridges that are held out if the data set has no validation split [1]; 0: none, and without a
    validation split the weights of the last epoch are used. Held-out bridges lack their noisy points, as all training
    pieces do; those of a validation split have them."""
    class_aware: float | None = Field(default=None, ge=0.0, le=1.0)
    """Share of an epoch's samples that are chosen by class, all classes equally often [1]; left out: that of the
    recipe."""
    doubt: float | None = Field(default=None, ge=0.0, le=1000.0)
    """Uncertainty at which a point has the weight 1/e in the cross-entropy; 0: all have the same weight [m]. Left out:
    that of the recipe."""
    sensors: SensorSettings | None = None
    """Augmentation that imitates other sensors; left out: that of the recipe."""
    workers: int = Field(default=0, ge=0, le=64)
    """Number of processes that load samples; 0: the training process loads them."""
    precision: Literal["32-true", "bf16-mixed"] = "32-true"
    """Floating-point precision of the training."""
    accelerator: Literal["auto", "cpu", "gpu"] = "auto"
    """Device of the training; only results of the CPU are the same bytes in every run."""
    devices: int = Field(default=1, ge=1, le=64)
    """Number of processes that train together (DDP), each with its own batches and, if there are any, its own GPU."""
    freeze_encoder: bool = False
    """Train only the decoder and the head."""


@dataclass(frozen=True)
class Recipe:
    """Values that a recipe determines.

    Attributes:
        adamw: AdamW instead of Adam.
        learning_rate: Largest learning rate [1].
        schedule: constant; decay: times 0.95 after each epoch; cycle: up over the first tenth and down to zero.
        weights: Rule of the class weights.
        lovasz: Weight of the Lovasz-softmax loss beside the cross-entropy [1].
        smoothing: Label smoothing [1].
        noise_head: Whether noisy points get a head of their own.
        class_aware: Share of an epoch's samples that are chosen by class [1].
        doubt: Uncertainty at which a point has the weight 1/e [m]; 0: all points have equal weights.
        sensors: Augmentation that imitates other sensors, or None.
        channels: Default inputs of a network.
    """

    adamw: bool
    learning_rate: float
    schedule: Literal["constant", "decay", "cycle"]
    weights: WeightRule
    lovasz: float
    smoothing: float
    noise_head: bool
    class_aware: float = 0.0
    doubt: float = 0.0
    sensors: SensorSettings | None = None
    channels: tuple[str, ...] = ("x", "y", "z")


_MODERN = Recipe(True, 5e-3, "cycle", "sqrt", 1.0, 0.1, True, 0.5, 0.1, SensorSettings(), ("x", "y", "z", "height"))
_PAPER = Recipe(False, 1e-4, "constant", "none", 0.0, 0.0, False)  # PointNet++ in the paper
_PAPER_RANDLA = Recipe(False, 1e-2, "decay", "randla", 0.0, 0.0, False)  # the paper's table is lost: RandLA-Net's own

RECIPES: Mapping[str, Recipe] = {"modern": _MODERN, "paper": _PAPER, "paper randlanet": _PAPER_RANDLA}


def recipe_of(settings: TrainSettings) -> Recipe:
    """Choose the recipe of a training.

    Args:
        settings: The training.

    Returns:
        The recipe of the network, if it has one, with the user's settings applied.
    """
    recipe = RECIPES.get(f"{settings.recipe} {settings.model}", RECIPES[settings.recipe])
    chosen = {"class_aware": settings.class_aware, "doubt": settings.doubt, "sensors": settings.sensors}
    return replace(recipe, **{name: value for name, value in chosen.items() if value is not None})
