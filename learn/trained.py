"""A trained model on disk: weights as safetensors, everything else as JSON; no code is executed on reading."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any, cast

import numpy as np
import torch
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.torch import load, save
from torch import Tensor, nn

from groundwork.errors import InputError, MissingError
from groundwork.files import read_json, write_bytes, write_json
from groundwork.foreign_file import read_regular
from learn.device import Device, check_device, torch_device
from learn.losses import merge_noise
from learn.models.backbone import COORD, Backbone, Geometry, batched, completed, geometry_of
from learn.models.covariance import covariance_features
from learn.models.forest import forest_probabilities
from learn.models.registry import build_network
from learn.neighborhoods.batches import MANY
from learn.sample import Sample

F32 = NDArray[np.float32]

FORMAT = "falsework.model"
FORMAT_VERSION = 1
FACTS, WEIGHTS = "model.json", "model.safetensors"
FOREST = "forest"
LEAST_SHARE = 1e-4
"""Share of a class that no tree has seen at a leaf [1]: logits of zero would not be finite, and a forest of a hundred
trees cannot tell rarer classes."""
_POSITIONS = ("x", "y", "z")


@dataclass(frozen=True)
class ModelFacts:
    """Description of a model, without its weights.

    Attributes:
        network: Row of `learn.models.registry.NETWORKS`, or `forest`.
        settings: Its settings.
        classes: Name of each class, in the order of the probabilities.
        channels: Name of each input.
        data: How its samples were made (table, tiles, scale): facts of the data set.
        noisy: Number of the class with a separate head; None if it is a class like the others.
        temperature: Divisor of the logits, fitted on validation samples [1].
        training: How it was trained.
    """

    network: str
    settings: Mapping[str, Any]
    classes: tuple[str, ...]
    channels: tuple[str, ...]
    data: Mapping[str, Any]
    noisy: int | None = None
    temperature: float = 1.0
    training: Mapping[str, Any] | None = None


@dataclass(frozen=True)
class TrainedNetwork:
    """A trained network for prediction.

    Attributes:
        facts: What it is.
        module: The network, in evaluation mode.
    """

    facts: ModelFacts
    module: nn.Module

    @property
    def classes(self) -> tuple[str, ...]:
        """Name of each class, in the order of the probabilities."""
        return self.facts.classes

    @property
    def channels(self) -> tuple[str, ...]:
        """Name of each input."""
        return self.facts.channels

    def probabilities(self, samples: Sequence[Sample], cache: Path | None = None) -> list[F32]:
        """Say how likely each class is at each point.

        Args:
            samples: Clouds as in training.
            cache: Folder of pyramids, or None.

        Returns:
            For each sample probabilities [1], shape (N, K), float32.
        """
        for sample in samples:
            check_channels(sample, self.facts.channels)
        device, network = next(self.module.parameters()).device, cast("Backbone", self.module)
        found: list[F32] = []
        for size, group in groupby(samples, key=lambda sample: len(sample.coord)):
            if device.type == "cpu" or size > MANY:
                for sample in group:
                    geometry = batched([geometry_of(network, sample.coord, cache)])
                    found += self._scored([sample], {name: rows.to(device) for name, rows in geometry.items()})
            else:  # a GPU takes all clouds of one size at once, and searches their neighborhoods itself
                alike = list(group)
                coord = torch.from_numpy(np.stack([sample.coord for sample in alike])).float().to(device)
                found += self._scored(alike, completed(network, {COORD: coord}))
        return found

    def _scored(self, samples: Sequence[Sample], geometry: Geometry) -> list[F32]:
        features = torch.from_numpy(np.stack([sample.features for sample in samples])).to(geometry[COORD].device)
        with torch.no_grad():
            logits = self.module(features, geometry)
        return list(as_probabilities(logits, self.facts.noisy, self.facts.temperature).cpu().numpy())


@dataclass(frozen=True)
class TrainedForest:
    """A trained forest for prediction.

    Attributes:
        facts: What it is.
        arrays: As `learn.models.forest.grow_forest`: `first`, shape (T + 1,); of every node `column`, `threshold`,
            `left`, `right`, shape (M,), and `share`, shape (M, classes).
    """

    facts: ModelFacts
    arrays: Mapping[str, NDArray[Any]]

    @property
    def classes(self) -> tuple[str, ...]:
        """Name of each class, in the order of the probabilities."""
        return self.facts.classes

    @property
    def channels(self) -> tuple[str, ...]:
        """Name of each input."""
        return self.facts.channels

    def probabilities(self, samples: Sequence[Sample]) -> list[F32]:
        """Say how likely each class is at each point.

        Args:
            samples: Clouds as in training.

        Returns:
            For each sample probabilities [1], shape (N, K), float32.
        """
        for sample in samples:
            check_channels(sample, self.facts.channels)
        scales = tuple(int(scale) for scale in self.facts.settings["scales"])
        shares = [forest_probabilities(self.arrays, forest_inputs(sample, scales)) for sample in samples]
        if self.facts.temperature == 1.0:
            return shares
        return [as_probabilities(share_logits(rows), None, self.facts.temperature).numpy() for rows in shares]


def share_logits(shares: F32) -> Tensor:
    """Convert the mean shares of a forest's trees to logits, whose softmax is the shares again.

    Args:
        shares: Of each class [1], shape (N, K), float32; none counts as less than `LEAST_SHARE`.

    Returns:
        Logits [1], shape (N, K), float64.
    """
    return torch.from_numpy(shares).double().clamp(min=LEAST_SHARE).log()


def forest_inputs(sample: Sample, scales: Sequence[int]) -> F32:
    """Compute the features of a forest: covariance features, and the inputs other than positions.

    Args:
        sample: A cloud.
        scales: Numbers of neighbors.

    Returns:
        One row a point [m or 1], shape (N, C), float32.
    """
    others = [number for number, name in enumerate(sample.channels) if name not in _POSITIONS]
    return np.concatenate([covariance_features(sample.coord, scales), sample.features[:, others]], axis=1)


def read_model(folder: Path, device: Device = "cpu") -> TrainedNetwork | TrainedForest:
    """Read a trained model of any kind.

    Args:
        folder: A model.
        device: Where a network predicts; a forest always uses the processor.

    Raises:
        InputError: Not a model, weights that do not fit it, or no GPU although one is requested.
    """
    facts = read_facts(folder)
    if facts.network != FOREST:
        return read_network(folder, device)
    arrays = {name: value.numpy() for name, value in read_weights(folder).items()}
    scales = facts.settings.get("scales")
    if not isinstance(scales, list) or not all(isinstance(scale, int) and scale > 0 for scale in scales):
        raise InputError("a damaged model", where=folder / FACTS, field="settings.scales", value=scales)
    if "share" not in arrays or arrays["share"].shape[-1] != len(facts.classes):
        raise InputError("a damaged forest, or one with other classes", where=folder / WEIGHTS, field="share")
    return TrainedForest(facts, arrays)


def as_probabilities(logits: Tensor, noisy: int | None, temperature: float) -> Tensor:
    """Convert logits to probabilities.

    Args:
        logits: Shape (N, K).
        noisy: Number of the class with a head of its own, or None.
        temperature: Divisor of the logits [1].

    Returns:
        Probabilities [1], shape (N, K), float32.
    """
    cooled = logits / temperature
    return (merge_noise(cooled, noisy).exp() if noisy is not None else cooled.softmax(dim=-1)).float()


def check_channels(sample: Sample, channels: tuple[str, ...]) -> None:
    """Refuse a sample whose inputs are not those of the training.

    Args:
        sample: A cloud.
        channels: Inputs of the model.

    Raises:
        InputError: Other channels, or another order.
    """
    if sample.channels != channels:
        raise InputError(
            "these are not the channels of the model",
            field="channels",
            value=", ".join(sample.channels),
            allowed=", ".join(channels),
        )


def write_model(folder: Path, facts: ModelFacts, weights: Mapping[str, Tensor]) -> None:
    """Write a model.

    Args:
        folder: Folder of the model; made if absent.
        facts: What it is.
        weights: Its arrays by name, shape (...), any type.
    """
    folder.mkdir(parents=True, exist_ok=True)
    # safetensors sorts by type and name, so that equal weights give equal bytes
    write_bytes(folder / WEIGHTS, save({name: value.contiguous() for name, value in weights.items()}))
    write_json(
        folder / FACTS,
        {
            "format": FORMAT,
            "format_version": FORMAT_VERSION,
            "network": facts.network,
            "settings": facts.settings,
            "classes": facts.classes,
            "channels": facts.channels,
            "data": facts.data,
            "noisy": facts.noisy,
            "temperature": facts.temperature,
            "training": facts.training,
        },
    )


def read_facts(folder: Path) -> ModelFacts:
    """Read the description of a model.

    Args:
        folder: A model.

    Raises:
        InputError: Not a model, of another version, or damaged.
    """
    path = folder / FACTS
    if not path.is_file():
        raise MissingError(
            f"not a model: no {FACTS}",
            where=folder,
            hint="Name a folder that falsework train has written",
        )
    record = read_json(path)
    if not isinstance(record, dict) or record.get("format") != FORMAT:
        raise InputError("not a model", where=path, allowed=FORMAT)
    if record.get("format_version") != FORMAT_VERSION:
        raise InputError(
            "a model of another version",
            where=path,
            field="format_version",
            value=record.get("format_version"),
            allowed=str(FORMAT_VERSION),
        )
    try:
        facts = ModelFacts(
            network=str(record["network"]),
            settings=dict(record["settings"]),
            data=dict(record["data"]),
            classes=tuple(map(str, record["classes"])),
            channels=tuple(map(str, record["channels"])),
            noisy=record["noisy"],
            temperature=float(record["temperature"]),
            training=record["training"],
        )
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"a damaged model: {error}", where=path, hint="Train it again, or copy it again") from None
    if not facts.classes or not facts.temperature > 0 or facts.noisy not in (None, *range(len(facts.classes))):
        raise InputError("a damaged model", where=path, field="classes, noisy or temperature")
    return facts


def read_weights(folder: Path) -> dict[str, Tensor]:
    """Read the arrays of a model.

    Args:
        folder: A model.

    Returns:
        Arrays by name, shape (...), any type.

    Raises:
        InputError: Missing or damaged.
    """
    path = folder / WEIGHTS
    try:
        return load(read_regular(path))
    except MissingError:
        raise MissingError("no weights", where=path) from None
    except (SafetensorError, ValueError, KeyError, json.JSONDecodeError) as error:
        raise InputError(f"not readable as safetensors: {error}", where=path, hint="Copy it again") from None


def read_network(folder: Path, device: Device = "cpu") -> TrainedNetwork:
    """Read a trained network.

    Args:
        folder: A model.
        device: Where it predicts.

    Raises:
        InputError: Not a network, weights that do not fit it, or no GPU although one is requested.
    """
    check_device(device)
    facts = read_facts(folder)
    module = build_network(facts.network, facts.settings, len(facts.channels), len(facts.classes), folder / FACTS)
    load_weights(module, read_weights(folder), folder / WEIGHTS)
    return TrainedNetwork(facts, module.to(torch_device(device)).eval())


def check_scaling(facts: ModelFacts, data: Mapping[str, Any], where: Path) -> None:
    """Refuse samples that are scaled differently from those of a model's training.

    Args:
        facts: The model.
        data: How the samples were made.
        where: Data set or model, for the error message.

    Raises:
        InputError: Another scale.
    """
    before, now = facts.data.get("scaling"), data.get("scaling")
    if before and now and dict(before) != dict(now):
        raise InputError(
            "the samples have another scale than those of the model's training",
            where=where,
            field="tile.scale",
            value=f"{now.get('kind')} {now.get('length')}",
            allowed=f"{before.get('kind')} {before.get('length')}",
        )


def load_weights(module: nn.Module, weights: Mapping[str, Tensor], where: Path) -> None:
    """Load weights into a network.

    Args:
        module: The network.
        weights: Arrays by name, shape (...), any type.
        where: File of the weights, for the error message.

    Raises:
        InputError: A name or a shape does not fit.
    """
    wanted = {name: tuple(value.shape) for name, value in module.state_dict().items()}
    for name in sorted(wanted.keys() | weights.keys()):
        found = tuple(weights[name].shape) if name in weights else None
        if found != wanted.get(name):
            raise InputError(
                "weights that do not fit the network",
                where=where,
                field=name,
                value=found,
                allowed=str(wanted.get(name)),
            )
    module.load_state_dict(dict(weights))
