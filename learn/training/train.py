"""A training from samples to a model on disk: the same bytes for the same seed on a CPU, interrupted or not."""

import logging
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from torch import Tensor, nn
from torch.utils.data import DataLoader

from groundwork.canonical import canonical_json, digest
from groundwork.errors import InputError
from groundwork.files import write_text
from groundwork.progress import Progress
from learn.losses import class_weights
from learn.models.registry import build_network
from learn.sample import UNLABELLED, SampleSource
from learn.trained import ModelFacts, as_probabilities, load_weights, read_facts, read_weights, write_model
from learn.training.loader import EpochOrder, Loaded, collate, count_labels, expected_counts, hold_out
from learn.training.settings import TrainSettings, recipe_of

NOISY = "noisy_point"
_REQUEST = "request.json"
_CALIBRATION_POINTS = 200_000

I64 = NDArray[np.int64]


def train_network(
    source: SampleSource,
    validation: SampleSource | None,
    settings: TrainSettings,
    folder: Path,
    progress: Progress,
    *,
    data: Mapping[str, Any] | None = None,
    init: Path | None = None,
    cache: Path | None = None,
    stop_after: int | None = None,
) -> None:
    """Train a network and write the model of the best epoch; goes on where a former call was stopped.

    Args:
        source: Training samples.
        validation: Samples of other bridges, the same at every call; None holds whole bridges out of `source`.
        settings: What the user chose.
        folder: Where the model goes; what an interrupted call left there is gone on from.
        progress: Listener.
        data: How the samples were made: kept with the model.
        init: A model to begin with; its head stays behind where the classes are others.
        cache: Folder of the pyramids of validation, or None.
        stop_after: Stop after so many epochs, to go on with another call; the learning rates are those of the whole.

    Raises:
        InputError: No samples, one class alone, or a model to begin with that does not fit.
    """
    torch.use_deterministic_algorithms(True)
    validation, rows, held = _shared_out(source, validation, settings)
    channels = _check(source, validation, rows, held, settings)
    recipe, classes = recipe_of(settings), source.classes
    noisy = classes.index(NOISY) if recipe.noise_head and NOISY in classes and len(classes) > 2 else None
    counts = count_labels(source, rows, settings.seed)
    if int(counts.any(axis=0).sum()) < 2:
        raise InputError(
            "nothing to tell apart: the labelled points are of one class",
            field="classes",
            value=", ".join(classes),
            hint="Add clouds that show other classes",
        )
    torch.manual_seed(settings.seed)
    network = build_network(settings.model, settings.network, len(channels), len(classes))
    if init is not None:
        begin_with(network, init, channels, classes)
    if settings.freeze_encoder:
        _freeze(network)
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
    progress.stage("train", settings.epochs)
    module = _fit(
        network,
        (source, rows),
        (validation, held),
        settings,
        folder,
        progress,
        request=request,
        channels=channels,
        counts=counts,
        noisy=noisy,
        cache=cache,
        stop_after=stop_after,
    )
    if len(module.history) < settings.epochs:
        return
    best = _best_weights(folder)
    load_weights(network, best, folder)
    facts = ModelFacts(
        network=settings.model,
        settings=settings.network,
        classes=classes,
        channels=channels,
        data=data or {},
        noisy=noisy,
        temperature=_temperature(network, validation, held, channels, noisy),
        training={
            "settings": settings.model_dump(mode="json"),
            "picked_epoch": module.best,
            "validation": module.history[module.best],
            "training_points": counts.sum(axis=0).tolist(),
            "training_bridges": sorted({source.bridge(row) for row in rows}),
            "validation_bridges": sorted({validation.bridge(row) for row in held}),
        },
    )
    write_model(folder, facts, best)
    for name in ("last.ckpt", "best.safetensors", _REQUEST):
        (folder / name).unlink(missing_ok=True)


def begin_with(network: nn.Module, folder: Path, channels: tuple[str, ...], classes: tuple[str, ...]) -> None:
    """Give a network the weights of a model, its last layer left out where the classes are others.

    Args:
        network: The network.
        folder: A model.
        channels: Inputs of the network.
        classes: Its classes.

    Raises:
        InputError: Other inputs, or another network.
    """
    facts, weights = read_facts(folder), read_weights(folder)
    if facts.channels != channels:
        raise InputError(
            "the model to begin with has other inputs",
            where=folder,
            field="--init",
            value=", ".join(facts.channels),
            allowed=", ".join(channels),
        )
    if facts.classes != classes:
        own = network.state_dict()
        last = max((name for name in own if name.startswith("head.")), key=lambda name: int(name.split(".")[1]))
        head = last.rsplit(".", 1)[0] + "."
        weights = {name: own[name] if name.startswith(head) else value for name, value in weights.items()}
    load_weights(network, weights, folder)


def _shared_out(
    source: SampleSource, validation: SampleSource | None, settings: TrainSettings
) -> tuple[SampleSource, list[int], list[int]]:
    """Say what is trained on, and what is validated on: samples of other bridges, or of bridges that are held out."""
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
            "too few bridges: a whole one is held out for validation",
            field="bridges",
            value=len({source.bridge(row) for row in range(len(source))}),
            allowed="2 or more",
            hint="Add clouds of another bridge, or give --set validation=0: nothing is held out then, "
            "and the last epoch is taken",
        )
    if validation.classes != source.classes:
        raise InputError(
            "training and validation have other classes",
            field="classes",
            value=", ".join(validation.classes),
            allowed=", ".join(source.classes),
        )
    shared = {source.bridge(row) for row in rows} & {validation.bridge(row) for row in held}
    if shared and validation is not source and settings.recipe != "paper":
        raise InputError(
            "validation shows bridges of the training",
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
    network: Any,
    training: tuple[SampleSource, Sequence[int]],
    held: tuple[SampleSource, Sequence[int]],
    settings: TrainSettings,
    folder: Path,
    progress: Progress,
    *,
    request: str,
    channels: tuple[str, ...],
    counts: I64,
    noisy: int | None,
    cache: Path | None,
    stop_after: int | None,
) -> Any:
    import lightning

    from learn.training.module import LAST, Segmentation, keeper

    going_on = (folder / LAST).is_file() and _former(folder) == request
    write_text(folder / _REQUEST, canonical_json(request))
    recipe = recipe_of(settings)
    order = EpochOrder(training[1], settings.seed, counts, recipe.class_aware)
    weights = class_weights(expected_counts(counts, recipe.class_aware), recipe.weights)
    several: dict[str, Any] = {"collate_fn": collate, "num_workers": settings.workers}
    drawn = Loaded(training[0], network, channels, settings.seed, doubt=recipe.doubt)
    loader = DataLoader(drawn, batch_size=settings.batch, sampler=order, **several)
    same = Loaded(held[0], network, channels, settings.seed, cache)
    fixed = DataLoader(same, batch_size=settings.batch, sampler=[(0, row) for row in held[1]], **several)
    steps = settings.epochs * -(-len(training[1]) // (settings.batch * settings.devices))
    module = Segmentation(network, settings, recipe, weights, noisy, steps, folder, progress)
    epochs = settings.epochs if stop_after is None else min(stop_after, settings.epochs)
    logging.getLogger("lightning.pytorch").setLevel(logging.ERROR)  # it advises on devices and services
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Lightning's advice on loaders and logging is for nobody here
        trainer = lightning.Trainer(
            max_epochs=epochs,
            accelerator=settings.accelerator,
            devices=settings.devices,
            strategy="auto" if settings.devices == 1 else "ddp_fork",
            deterministic=True,
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
            fixed if held[1] else None,
            ckpt_path=str(folder / LAST) if going_on else None,
            weights_only=True,
        )
    if trainer.interrupted:
        raise KeyboardInterrupt
    if settings.devices > 1:  # what the processes have seen is in their checkpoint
        module.on_load_checkpoint(torch.load(folder / LAST, weights_only=True))
    return module


def _former(folder: Path) -> str | None:
    path = folder / _REQUEST
    return path.read_text(encoding="utf-8").strip('"') if path.is_file() else None


def _best_weights(folder: Path) -> dict[str, Tensor]:
    from safetensors.torch import load

    from learn.training.module import BEST

    return load((folder / BEST).read_bytes())


def _temperature(
    network: Any, source: SampleSource, rows: Sequence[int], channels: tuple[str, ...], noisy: int | None
) -> float:
    """Fit the temperature at which the labelled points of validation are likeliest, to three digits."""
    samples, logits, labels, count = Loaded(source, network.eval(), channels, 0), [], [], 0
    for row in rows:
        item = collate([samples[0, row]])
        with torch.no_grad():
            found = network(item["features"], item["geometry"])[0]
        known = item["labels"][0] != UNLABELLED
        logits.append(found[known].double())
        labels.append(item["labels"][0][known])
        count += int(known.sum())
        if count >= _CALIBRATION_POINTS:
            break
    if not count:
        return 1.0
    scores, target = torch.cat(logits), torch.cat(labels)[:, None]

    def loss(power: float) -> float:
        likely = as_probabilities(scores, noisy, float(np.exp(power))).gather(1, target)
        return -float(likely.clamp(min=1e-12).log().mean())

    found_power = minimize_scalar(loss, bounds=(np.log(0.05), np.log(20.0)), method="bounded").x
    return float(f"{np.exp(found_power):.3g}")
