"""The start of a training from the weights of another model."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from torch import nn

from groundwork.errors import InputError
from groundwork.progress import Progress
from learn.seen_bridges import seen_bridges
from learn.trained import check_scaling, load_weights, read_facts, read_weights
from learn.training.settings import TrainSettings


def check_start(facts: Mapping[str, Any], settings: TrainSettings, init: Path | None, progress: Progress) -> None:
    """Check the model that a training starts from, and tell of samples that are cut otherwise than its own.

    Args:
        facts: How the samples were made.
        settings: The training.
        init: The model; None for random weights.
        progress: Listener.

    Raises:
        InputError: Samples of another scale, or an encoder that is to stay as it is without a model.
    """
    if init is not None:
        before = read_facts(init)
        check_scaling(before, facts, init)
        if words := _other_cutting(before.data, facts):
            progress.note(f"the samples are cut otherwise than those of {init}: cut them again with {words}")
    elif settings.freeze_encoder:
        raise InputError(
            "the weights of the encoder are random, and would stay so",
            field="--freeze-encoder",
            value=True,
            hint="Name a model to start from with --init, or leave --freeze-encoder out",
        )


def _other_cutting(before: Mapping[str, Any], now: Mapping[str, Any]) -> str:
    """Give the options of `falsework dataset` that cut as for a model's training; "" if the samples are cut so."""
    earlier, current = (facts.get("settings") or {} for facts in (before, now))
    if earlier.get("mode") != "metric" or current.get("mode") != "metric":
        return ""
    tile = current.get("tile", {})
    other = {key: value for key, value in earlier.get("tile", {}).items() if tile.get(key) != value}
    return " ".join(f"--set tile.{key}={value!r}" for key, value in other.items()) if other.keys() - {"stride"} else ""


def begin_with(network: nn.Module, folder: Path, channels: tuple[str, ...], classes: tuple[str, ...]) -> None:
    """Load the weights of a model into a network, without its last layer if the classes differ.

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
            "the --init model has other inputs",
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


def seen_by(init: Path) -> list[str]:
    """Name the bridges that a model, or one that it began with, has seen in training.

    Args:
        init: Its folder.
    """
    before = read_facts(init)
    return seen_bridges(before.training, before.data)
