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
    """Settings of the network."""
    recipe: Literal["paper", "modern"] = "modern"
    """paper: what is known of the paper's training. modern: AdamW, one cycle of the learning rate, class weights by the
    root of the frequency, Lovasz-softmax, half of the samples chosen by class, points that count less the less sure
    they are, samples as of other sensors, a head of its own for noisy points."""
    epochs: int = Field(default=50, ge=1, le=10_000)
    """Passes over the training samples."""
    batch: int = Field(default=8, ge=1, le=1024)
    """Samples of a step."""
    learning_rate: float | None = Field(default=None, gt=0.0, le=1.0)
    """Largest learning rate [1]; that of the recipe when left out."""
    seed: int = Field(default=0, ge=0)
    """Seed of weights, order, draws and dropout."""
    validation: float = Field(default=0.2, ge=0.0, lt=1.0)
    """Share of the bridges that are held out where the data set has no split for validation [1]; 0: none is, and the
    last epoch is taken."""
    class_aware: float | None = Field(default=None, ge=0.0, le=1.0)
    """Share of an epoch's samples that are chosen by class, each class alike [1]; that of the recipe when left out."""
    doubt: float | None = Field(default=None, ge=0.0, le=1000.0)
    """Uncertainty at which a point counts for 1/e in the cross-entropy [m], 0 for all alike; that of the recipe when
    left out."""
    sensors: SensorSettings | None = None
    """Changes towards other sensors; those of the recipe when left out."""
    workers: int = Field(default=0, ge=0, le=64)
    """Processes that load samples; 0 loads them in between."""
    precision: Literal["32-true", "bf16-mixed"] = "32-true"
    """Numbers of the training."""
    accelerator: Literal["auto", "cpu", "gpu"] = "auto"
    """What to train on; only the processor's results are the same bytes again."""
    devices: int = Field(default=1, ge=1, le=64)
    """Processes that train together (DDP), each with batches and, where there are any, a GPU of its own."""
    freeze_encoder: bool = False
    """Train the way back up and the head alone."""


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
