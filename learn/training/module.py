"""The Lightning module: training step, validation step, history. Only `train` imports it."""

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import lightning
import numpy as np
import torch
from lightning.pytorch.callbacks import ModelCheckpoint
from safetensors.torch import save
from torch import Tensor, nn

from groundwork.files import write_bytes, write_text
from groundwork.progress import Progress
from learn.losses import components_only, cross_entropy, lovasz_softmax, noise_loss
from learn.metrics import confusion, scores
from learn.models.backbone import Backbone, Geometry, completed
from learn.sample import UNLABELED
from learn.trained import as_probabilities
from learn.training.event_file import EVENTS, event_file
from learn.training.settings import Recipe, TrainSettings

LAST, BEST = "last.ckpt", "best.safetensors"
ENCODER = ("stem", "down", "blocks", "bottom")
_SURE = math.exp(-1.0) - 1e-6  # weight of a point whose uncertainty equals the recipe's `doubt`
_WARM = 0.1  # share of the steps in which the learning rate of a cycle rises
_CYCLE_START = 0.04  # learning rate at the beginning of a cycle, as a share of the largest


@dataclass(frozen=True, eq=False)
class TrainingPlan:
    """How a network is trained.

    Attributes:
        settings: The user's settings.
        recipe: Losses, optimizer and schedule.
        weights: Of the classes [1], shape (C,), float32.
        noisy: Number of the class of noisy points; None where there is none.
        steps: Steps of all epochs.
    """

    settings: TrainSettings
    recipe: Recipe
    weights: Tensor
    noisy: int | None
    steps: int


class Segmentation(lightning.LightningModule):
    """A network in training.

    Attributes:
        history: One row per epoch: epoch, mean loss, mean IoU and accuracies of the validation, None if nothing is held
            out.
        best: Epoch with the highest mean IoU of the validation, the earliest of equals; the last one if nothing is held
            out; -1 before the first.
    """

    def __init__(self, network: nn.Module, plan: TrainingPlan, folder: Path, progress: Progress) -> None:
        super().__init__()
        self.network, self._settings, self._recipe, self._noisy = network, plan.settings, plan.recipe, plan.noisy
        self._steps, self._folder, self._listener = plan.steps, folder, progress
        self.register_buffer("class_weights", plan.weights, persistent=False)
        self.history: list[dict[str, float | None]] = []
        self.best = -1
        self._losses: list[Tensor] = []
        self._matrix = np.zeros((len(plan.weights), len(plan.weights)), np.int64)

    def configure_optimizers(self) -> Any:
        """Make the recipe's optimizer and schedule."""
        rate = self._settings.learning_rate or self._recipe.learning_rate
        moving = [weight for weight in self.network.parameters() if weight.requires_grad]
        if self._recipe.adamw:
            optimizer: torch.optim.Optimizer = torch.optim.AdamW(moving, lr=rate, weight_decay=1e-2)
        else:
            optimizer = torch.optim.Adam(moving, lr=rate)
        schedule = torch.optim.lr_scheduler.LambdaLR(optimizer, self._rate_at)
        return {"optimizer": optimizer, "lr_scheduler": {"scheduler": schedule, "interval": "step"}}

    def on_train_epoch_start(self) -> None:
        """Begin an epoch."""
        self._losses = []
        if self._settings.freeze_encoder:
            for name in ENCODER:
                if isinstance(part := getattr(self.network, name, None), nn.Module):
                    part.eval()  # its statistics stay, too

    def training_step(self, batch: dict[str, Any], number: int) -> Tensor:
        """Compute the loss of a batch.

        Args:
            batch: Features, labels and geometry.
            number: Number of the batch in the epoch.

        Returns:
            The loss [1], shape (), float32.
        """
        # Dropout depends only on the seed and the step, so that a resumed training continues identically.
        place = [self._settings.seed, self.global_step] + ([self.global_rank] if self.global_rank else [])
        torch.manual_seed(int(np.random.SeedSequence(place).generate_state(1)[0]))
        logits = self.network(batch["features"], self._geometry(batch)).float().flatten(0, 1)
        labels, loss = batch["labels"].flatten(), torch.zeros((), device=logits.device)
        if self._noisy is not None:
            loss = loss + noise_loss(logits, labels, self._noisy)
            logits, labels = components_only(logits, labels, self._noisy)
        assert isinstance(self.class_weights, Tensor)
        smoothing = 0.0 if self._noisy is not None else self._recipe.smoothing  # it would reach the masked column
        weights = batch["weights"].flatten() if "weights" in batch else None
        loss = loss + cross_entropy(logits, labels, self.class_weights, weights, smoothing)
        if self._recipe.lovasz:
            # Lovasz-softmax has no point weights: points more uncertain than the recipe's `doubt` are left out
            sure = labels if weights is None else labels.masked_fill(weights < _SURE, UNLABELED)
            loss = loss + self._recipe.lovasz * lovasz_softmax(logits, sure)
        self._losses.append(loss.detach())
        return loss

    def _geometry(self, batch: dict[str, Any]) -> Geometry:
        return completed(cast("Backbone", self.network), batch["geometry"])

    def on_validation_epoch_start(self) -> None:
        """Reset the confusion matrix."""
        self._matrix[:] = 0

    def validation_step(self, batch: dict[str, Any], number: int) -> None:
        """Add a batch of the validation to the confusion matrix.

        Args:
            batch: Features, labels and geometry.
            number: Number of the batch.
        """
        logits = self.network(batch["features"], self._geometry(batch)).flatten(0, 1)
        found = as_probabilities(logits, self._noisy, 1.0).argmax(dim=-1).cpu().numpy()
        self._matrix += confusion(batch["labels"].flatten().cpu().numpy(), found, len(self._matrix))

    def on_validation_epoch_end(self) -> None:
        """Log the epoch, and store the weights if they are the best so far."""
        result = scores(self._matrix)
        ahead = max((row["miou"] or 0.0 for row in self.history), default=-1.0)
        miou = 0.0 if np.isnan(result.mean_iou) else result.mean_iou
        self._close(miou > ahead, miou, result.overall_accuracy, result.mean_accuracy)

    def on_train_epoch_end(self) -> None:
        """Log an epoch without validation, and store its weights."""
        if len(self.history) == self.current_epoch:
            self._close(True, None, None, None)

    def _close(self, kept: bool, miou: float | None, accuracy: float | None, mean_accuracy: float | None) -> None:
        loss = float(torch.stack(self._losses).mean()) if self._losses else float("nan")
        diverged = self.trainer.strategy.reduce_boolean_decision(not np.isfinite(loss), all=False)
        self.trainer.should_stop = self.trainer.should_stop or diverged
        self.history.append(
            {
                "epoch": self.current_epoch,
                "loss": loss,
                "miou": miou,
                "accuracy": accuracy,
                "mean_accuracy": mean_accuracy,
            }
        )
        self.best = self.current_epoch if kept else self.best
        if not self.trainer.is_global_zero:
            return
        if kept:
            state = {name: value.cpu().contiguous() for name, value in self.network.state_dict().items()}
            write_bytes(self._folder / BEST, save(state))
        write_text(self._folder / "log.csv", log_table(self.history))
        write_bytes(self._folder / EVENTS, event_file(self.history))
        self._listener.advance(self.current_epoch + 1)

    def on_save_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Store the history.

        Args:
            checkpoint: What Lightning writes.
        """
        checkpoint["history"], checkpoint["best"] = json.dumps(self.history), self.best

    def on_load_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Restore the history.

        Args:
            checkpoint: What Lightning has read.
        """
        self.history, self.best = json.loads(checkpoint["history"]), int(checkpoint["best"])

    def _rate_at(self, step: int) -> float:
        if self._recipe.schedule == "constant":
            return 1.0
        if self._recipe.schedule == "decay":
            return 0.95 ** (step * self._settings.epochs // self._steps)
        place = min(step / self._steps, 1.0)
        if place < _WARM:
            return _CYCLE_START + (1.0 - _CYCLE_START) * place / _WARM
        return 0.5 * (1.0 + float(np.cos(np.pi * (place - _WARM) / (1.0 - _WARM))))


def log_table(history: list[dict[str, float | None]]) -> str:
    """Format the history as CSV.

    Args:
        history: Rows with the same keys [any unit].

    Returns:
        A header and one line per epoch; floats in Python's format, so that equal trainings have equal logs; empty where
        nothing was measured.
    """
    lines = [",".join(history[0])] if history else []
    told = [",".join("" if value is None else str(value) for value in row.values()) for row in history]
    return "\n".join(lines + told) + "\n"


def keeper(folder: Path) -> ModelCheckpoint:
    """Make the callback that stores a checkpoint after every epoch, to resume from.

    Args:
        folder: Folder of the checkpoint.
    """
    return ModelCheckpoint(
        dirpath=folder, filename=LAST.removesuffix(".ckpt"), save_on_train_epoch_end=True, enable_version_counter=False
    )
