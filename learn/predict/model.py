"""The interface of a model for prediction, and loading of a model by its name."""

import sys
from collections.abc import Sequence
from importlib import import_module
from importlib.resources import files
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from groundwork.errors import InputError, MissingError
from learn.datasets.settings import TileSettings
from learn.device import Device
from learn.sample import Sample

F32 = NDArray[np.float32]


class PointModel(Protocol):
    """Interface of a trained model."""

    @property
    def classes(self) -> tuple[str, ...]:
        """List the class names, in the order of the probabilities."""
        ...

    @property
    def table(self) -> str:
        """Return the name of the class table; `falsework` also for component kinds."""
        ...

    @property
    def channels(self) -> tuple[str, ...]:
        """List its input channels, names of `learn.datasets.patch.CHANNELS`."""
        ...

    @property
    def tile(self) -> TileSettings:
        """Return the settings of the tiles that it was trained on."""
        ...

    @property
    def points(self) -> int:
        """Return the number of points of a draw."""
        ...

    def probabilities(self, samples: Sequence[Sample]) -> list[F32]:
        """Compute the probability of each class at each point.

        Args:
            samples: Clouds as in training.

        Returns:
            For each sample probabilities [1], shape (N, K), float32.
        """
        ...


def shipped_folder() -> Path:
    """Return the folder of the model of the package; its README.md is the model's card.

    Raises:
        MissingError: This installation does not contain it.
    """
    folder = Path(str(files("learn").joinpath("shipped")))
    if not (folder / "model.json").is_file():
        raise MissingError(
            "this installation does not contain the model of the package",
            hint="Name a folder that falsework train has written",
        )
    return folder


def named_model(name: str, device: Device = "cpu") -> PointModel:
    """Read a trained model, or call a user's function that makes one.

    Args:
        name: Folder that `falsework train` has written, or `module:function`; the module is also searched in the
            current folder. Empty: the model of the package.
        device: Where a trained network predicts; a model of the user's own chooses for itself.

    Raises:
        InputError: No such folder, module or function, or its result is not a model.
    """
    if not name:
        name = str(shipped_folder())
    if Path(name).is_dir():
        from learn.predict.trained_model import read_trained_model  # torch is imported only for a trained model

        return read_trained_model(Path(name), device)
    module, colon, function = name.partition(":")
    if not colon or not function or "/" in module:
        raise InputError(
            "no such model",
            field="--model",
            value=name,
            allowed="a folder that falsework train has written, or module:function",
        )
    here = str(Path.cwd())
    if here not in sys.path:
        sys.path.insert(0, here)
    try:
        found: Any = getattr(import_module(module), function)
    except (ImportError, AttributeError) as error:
        raise InputError(f"no such model: {error}", field="--model", value=name) from None
    try:
        model = found()
    except TypeError as error:
        raise InputError(f"cannot be called without arguments: {error}", field="--model", value=name) from None
    lacking = [
        word for word in ("classes", "table", "channels", "tile", "points", "probabilities") if not hasattr(model, word)
    ]
    if lacking:
        raise InputError(
            "returns an object that is not a model",
            field="--model",
            value=name,
            allowed=f"an object with the attribute {lacking[0]}",
        )
    return model
