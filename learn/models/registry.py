"""The networks by name."""

from collections.abc import Callable, Mapping
from typing import Any

from torch import nn

from groundwork.errors import InputError
from groundwork.settings import Settings, parse_settings
from learn.models.pointnet2 import PointNet2, PointNet2Settings
from learn.models.pointnext import PointNext, PointNextSettings
from learn.models.randlanet import RandlaNet, RandlaNetSettings

Factory = Callable[[Any, int, int], nn.Module]
"""Settings, number of inputs, number of classes → a module that is a `learn.models.backbone.Backbone`."""

NETWORKS: Mapping[str, tuple[type[Settings], Factory]] = {
    "pointnet2-ssg": (PointNet2Settings, PointNet2),
    "pointnet2-msg": (PointNet2Settings, PointNet2),
    "pointnext-s": (PointNextSettings, PointNext),
    "pointnext-b": (PointNextSettings, PointNext),
    "randlanet": (RandlaNetSettings, RandlaNet),
}


def build_network(
    name: str, values: Mapping[str, Any], inputs: int, classes: int, where: object = "--model"
) -> nn.Module:
    """Build an untrained network.

    Args:
        name: A row of `NETWORKS`.
        values: Settings of the network, without its kind.
        inputs: Channels of a sample.
        classes: Number of classes.
        where: File or option of the values, for the error message.

    Returns:
        The network; its weights are drawn from torch's generator.

    Raises:
        InputError: No such network, or an unknown setting.
    """
    if name not in NETWORKS:
        raise InputError("no such network", where=where, value=name, allowed=", ".join(NETWORKS))
    model, factory = NETWORKS[name]
    return factory(parse_settings(model, {**values, "kind": name}, where), inputs, classes)
