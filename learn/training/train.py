"""Training of a network and its model on disk: the same bytes for the same seed on a CPU, interrupted or not."""

import logging
import shutil
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.utils.data import DataLoader

from groundwork.canonical import canonical_json, digest
from groundwork.errors import InputError
from groundwork.files import write_text
from groundwork.progress import Progress
from learn.device import check_device, torch_device
from learn.losses import class_weights
from learn.models.backbone import completed
from learn.models.registry import build_network
from learn.sample import UNLABELED, SampleSource
from learn.seen_bridges import EARLIER
from learn.trained import (
    ModelFacts,
    as_probabilities,
    load_weights,
    read_facts,
    write_model,
)
from learn.training.calibration import fit_temperature, gather_scores
from learn.training.checkpoint import read_checkpoint
from learn.training.loader import (
    EpochOrder,
    Loaded,
    cache_of_pyramids,
    collate,
    count_labels,
    errors_of_loaders,
    expected_counts,
    hold_out,
)
from learn.training.settings import TrainSettings, recipe_of
from learn.training.start import begin_with, check_start, seen_by

NOISY = "noisy_point"
_REQUEST = "request.json"

I64 = NDArray[np.int64]


@dataclass(frozen=True)
class TrainingData:
    """Sources of the samples of a training.

    Attributes:
        training: Training samples.
        validation: Samples of other bridges, the same at every call; None holds whole bridges out of `training`.
        facts: How the samples were made; stored with the model.
    """

    training: SampleSource
    validation: SampleSource | None = None
    facts: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class _Task:
    """The samples and the request of a training.

    Attributes:
        source: Source of the training samples.
        rows: Their numbers.
        validation: Source of the validation samples.
        held: Their numbers.
        channels: Inputs of the network.
        noisy: Number of the class of noisy points if it has a separate head, or None.
        counts: Points of each class in each training sample, shape (rows, C), int64.
        request: Hash of everything that the training depends on.
    """

    source: SampleSource
    rows: Sequence[int]
    validation: SampleSource
    held: Sequence[int]
    channels: tuple[str, ...]
    noisy: int | None
    counts: I64
    request: str


def train_network(
    data: TrainingData,
    settings: TrainSettings,
    folder: Path,
    progress: Progress,
    *,
    init: Path | None = None,
    stop_after: int | None = None,
) -> None:
    """Train a network and write the model of the best epoch; an interrupted call is resumed.

    Args:
        data: Samples.
        settings: The user's settings.
        folder: Folder of the model, and of the checkpoint of an interrupted call.
        progress: Listener.
        init: A model to start from; its head is dropped if the classes differ.
        stop_after: Stop after so many epochs, to resume with another call; the schedule is that of the whole training.

    Raises:
        InputError: No samples, only one class, no GPU although one is requested, an `init` model that does not fit, an
            encoder that is to stay as it is without one, or a loss that is not finite.
    """
    _check_gpu(settings)
    with errors_of_loaders():
        _train(data, settings, folder, progress, init, stop_after)


def _train(
    data: TrainingData,
    settings: TrainSettings,
    folder: Path,
    progress: Progress,
    init: Path | None,
    stop_after: int | None,
) -> None:
    check_start(data.facts, settings, init, progress)
    torch.use_deterministic_algorithms(not trains_on_gpu(settings))
    task, classes = _set_task(data, settings, init), data.training.classes
    torch.manual_seed(settings.seed)
    network = build_network(settings.model, settings.network, len(task.channels), len(classes))
    if init is not None:
        begin_with(network, init, task.channels, classes)
    if settings.freeze_encoder:
        _freeze(network)
    progress.stage("train", settings.epochs)
    module = _fit(network, task, settings, folder, progress, stop_after)
    if len(module.history) < settings.epochs:
        return
    best = _best_weights(folder)
    load_weights(network, best, folder)
    facts = ModelFacts(
        network=settings.model,
        settings=settings.network,
        classes=classes,
        channels=task.channels,
        data={**data.facts, **({} if init is None else {EARLIER: seen_by(init)})},
        noisy=task.noisy,
        temperature=_temperature(network, task, torch_device(settings.accelerator)),
        training={
            "settings": settings.model_dump(mode="json"),
            "picked_epoch": module.best,
            "validation": module.history[module.best],
            "training_points": task.counts.sum(axis=0).tolist(),
            "training_bridges": sorted({task.source.bridge(row) for row in task.rows}),
            "validation_bridges": sorted({task.validation.bridge(row) for row in task.held}),
        },
    )
    write_model(folder, facts, best)
    for name in ("last.ckpt", "best.safetensors", _REQUEST):
        (folder / name).unlink(missing_ok=True)
    shutil.rmtree(folder / "pyramids", ignore_errors=True)


def trains_on_gpu(settings: TrainSettings) -> bool:
    """Tell whether the training runs on a GPU, whose sums have no fixed order, so that results are not reproducible.

    Args:
        settings: The training.
    """
    return torch_device(settings.accelerator) == "cuda"


def _check_gpu(settings: TrainSettings) -> None:
    check_device(settings.accelerator, "accelerator")
    count = torch.cuda.device_count()
    if trains_on_gpu(settings) and settings.devices > count:
        raise InputError(
            "more processes than GPUs",
            field="devices",
            value=settings.devices,
            allowed=f"at most {count}",
            hint="Use fewer, or --set accelerator=cpu",
        )


def _set_task(data: TrainingData, settings: TrainSettings, init: Path | None) -> _Task:
    """Split the samples into training and validation, and count their classes."""
    source = data.training
    validation, rows, held = _shared_out(source, data.validation, settings)
    channels = _check(source, validation, rows, held, settings)
    recipe, classes = recipe_of(settings), source.classes
    noisy = classes.index(NOISY) if recipe.noise_head and NOISY in classes and len(classes) > 2 else None
    counts = count_labels(source, rows, settings.seed, settings.workers)
    if int(counts.any(axis=0).sum()) < 2:
        raise InputError(
            "all labeled points have one class; training needs at least two",
            field="classes",
            value=", ".join(classes),
            hint="Add clouds that show other classes",
        )
    request = digest(
        {
            "settings": settings,
            "classes": classes,
            "channels": channels,
            "rows": rows,
            "held": held,
            "init": None if init is None else asdict(read_facts(init)),
        }
    )
    return _Task(source, rows, validation, held, channels, noisy, counts, request)


def _shared_out(
    source: SampleSource, validation: SampleSource | None, settings: TrainSettings
) -> tuple[SampleSource, list[int], list[int]]:
    """Choose the training and validation samples: the latter of other bridges, or of bridges that are held out."""
    if validation is not None:
        return validation, list(range(len(source))), list(range(len(validation)))
    if not settings.validation:
        return source, list(range(len(source))), []
    rows, held = hold_out(source, settings.validation, settings.seed)
    unchanged = getattr(source, "unchanged", None)
    return source if unchanged is None else unchanged(), rows, held


def _check(
    source: SampleSource, validation: SampleSource, rows: Sequence[int], held: Sequence[int], settings: TrainSettings
) -> tuple[str, ...]:
    if not rows or not (held or not settings.validation):
        raise InputError(
            "too few bridges: a whole bridge is held out for validation",
            field="bridges",
            value=len({source.bridge(row) for row in range(len(source))}),
            allowed="2 or more",
            hint="Add clouds of another bridge, or use --set validation=0: then nothing is held out, "
            "and the weights of the last epoch are used",
        )
    if validation.classes != source.classes:
        raise InputError(
            "training and validation have different classes",
            field="classes",
            value=", ".join(validation.classes),
            allowed=", ".join(source.classes),
        )
    shared = {source.bridge(row) for row in rows} & {validation.bridge(row) for row in held}
    if shared and validation is not source and settings.recipe != "paper":
        raise InputError(
            "training and validation have a bridge in common",
            field="bridge",
            value=sorted(shared)[0],
            hint="Split by bridge, or train with --recipe paper",
        )
    return source.sample(rows[0], settings.seed).channels


def _freeze(network: nn.Module) -> None:
    from learn.training.module import ENCODER

    for name, weight in network.named_parameters():
        weight.requires_grad_(name.split(".")[0] not in ENCODER)


def _fit(
    network: Any, task: _Task, settings: TrainSettings, folder: Path, progress: Progress, stop_after: int | None
) -> Any:
    import lightning

    from learn.training.module import LAST, Segmentation, TrainingPlan, keeper

    continued = (folder / LAST).is_file() and _former(folder) == task.request
    if continued:
        read_checkpoint(folder / LAST)  # Lightning reads it again, and checks nothing
    write_text(folder / _REQUEST, canonical_json(task.request))
    recipe = recipe_of(settings)
    loader, fixed = _loaders(network, task, settings, folder)
    weights = class_weights(expected_counts(task.counts, recipe.class_aware), recipe.weights)
    steps = settings.epochs * -(-len(task.rows) // (settings.batch * settings.devices))
    module = Segmentation(network, TrainingPlan(settings, recipe, weights, task.noisy, steps), folder, progress)
    epochs = settings.epochs if stop_after is None else min(stop_after, settings.epochs)
    logging.getLogger("lightning.pytorch").setLevel(logging.ERROR)  # it prints advice on devices and services
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Lightning's advice on loaders and logging does not apply here
        trainer = lightning.Trainer(
            max_epochs=epochs,
            accelerator=settings.accelerator,
            devices=settings.devices,
            strategy="auto" if settings.devices == 1 else "ddp_fork",
            deterministic=not trains_on_gpu(settings),
            precision=settings.precision,
            logger=False,
            callbacks=[keeper(folder)],
            enable_progress_bar=False,
            enable_model_summary=False,
            num_sanity_val_steps=0,
            default_root_dir=folder,
            use_distributed_sampler=False,
        )
        trainer.fit(
            module,
            loader,
            fixed if task.held else None,
            ckpt_path=str(folder / LAST) if continued else None,
            weights_only=True,
        )
    if trainer.interrupted:
        raise KeyboardInterrupt
    if settings.devices > 1:  # the results of the processes are in their checkpoint
        module.on_load_checkpoint(torch.load(folder / LAST, weights_only=True))
    _check_finite(module.history, settings)
    return module


def _check_finite(history: Sequence[Mapping[str, float | None]], settings: TrainSettings) -> None:
    """Refuse a training whose loss is not finite; the module has stopped it in that epoch."""
    for row in history:
        if not np.isfinite(row["loss"] or 0.0):
            raise InputError(
                f"the training diverged: in epoch {(row['epoch'] or 0) + 1:.0f} its loss is not finite",
                field="learning_rate",
                value=settings.learning_rate or recipe_of(settings).learning_rate,
                hint="Lower learning_rate with --set, or train with precision 32-true",
            )


def _loaders(
    network: Any, task: _Task, settings: TrainSettings, folder: Path
) -> tuple[DataLoader[Any], DataLoader[Any]]:
    """Make the loaders: training samples differ in each epoch, validation samples never change."""
    recipe, here = recipe_of(settings), not trains_on_gpu(settings)  # a GPU searches the neighborhoods itself
    several: dict[str, Any] = {
        "collate_fn": collate,
        "num_workers": settings.workers,
        "persistent_workers": settings.workers > 0,  # each number carries the seed of its epoch's draw
        "pin_memory": not here,
    }
    drawn = Loaded(task.source, network, task.channels, settings.seed, doubt=recipe.doubt, searched=here)
    order = EpochOrder(task.rows, settings.seed, task.counts, recipe.class_aware)
    cache = cache_of_pyramids(folder, task.validation, task.held)
    same = Loaded(task.validation, network, task.channels, settings.seed, cache, searched=here)
    return (
        DataLoader(drawn, batch_size=settings.batch, sampler=order, **several),
        DataLoader(same, batch_size=settings.batch, sampler=[(0, row, 0) for row in task.held], **several),
    )


def _former(folder: Path) -> str | None:
    path = folder / _REQUEST
    return path.read_text(encoding="utf-8").strip('"') if path.is_file() else None


def _best_weights(folder: Path) -> dict[str, Tensor]:
    from safetensors.torch import load

    from learn.training.module import BEST

    return load((folder / BEST).read_bytes())


def _temperature(network: Any, task: _Task, device: str) -> float:
    """Fit the temperature on the labeled points of the validation."""
    samples = Loaded(task.validation, network.to(device).eval(), task.channels, 0, searched=device == "cpu")

    def score(row: int) -> tuple[Tensor, Tensor]:
        item = collate([samples[0, row, 0]])
        geometry = completed(network, {name: rows.to(device) for name, rows in item["geometry"].items()})
        with torch.no_grad():
            found = network(item["features"].to(device), geometry)[0].cpu()
        known = item["labels"][0] != UNLABELED
        return found[known].double(), item["labels"][0][known]

    gathered = gather_scores(task.held, score)
    if gathered is None:
        return 1.0
    return fit_temperature(*gathered, lambda scores, by: as_probabilities(scores, task.noisy, by))
