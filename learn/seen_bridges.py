"""Bridges that a model has seen: those of its own training, and of the models that it began with."""

from collections.abc import Mapping
from typing import Any

EARLIER = "earlier"
"""Key, in the data facts of a model, of the bridges that the models before it have seen."""


def seen_bridges(training: Mapping[str, Any] | None, data: Mapping[str, Any]) -> list[str]:
    """Name the bridges that a model, or one that it began with, was trained on or whose scores chose its epoch.

    Args:
        training: Facts of its training; None for a model without any.
        data: Facts of its data.

    Returns:
        Hashes in ascending order.
    """
    own = training or {}
    keys = ("training_bridges", "validation_bridges")
    return sorted({*(name for key in keys for name in own.get(key) or ()), *(data.get(EARLIER) or ())})
