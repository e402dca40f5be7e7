"""What a prediction needs of a model, and how one is found by its name."""

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
from learn.sample import Sample

F32 = NDArray[np.float32]


class PointModel(Protocol):
    """A trained model, whatever is inside."""

    @property
    def classes(self) -> tuple[str, ...]:
        """Name of each class, in the order of the probabilities."""
        ...

    @property
    def table(self) -> str:
        """Table that the classes are of; `falsework` also for component kinds."""
        ...

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of `learn.datasets.patch.CHANNELS` that it sees."""
        ...

    @property
    def tile(self) -> TileSettings:
        """The tiles that it was trained on."""
        ...

    @property
    def points(self) -> int:
        """Points of a draw."""
        ...

    def probabilities(self, samples: Sequence[Sample]) -> list[F32]:
        """Say how likely each class is at each point.

        Args:
            samples: Clouds as in training.

        Returns:
            For each sample probabilities [1], shape (N, K), float32.
        """
        ...


def shipped_folder() -> Path:
    """Give the folder of the model that comes with the package; its README.md is the model's card.

    Raises:
        MissingError: This installation was built without it.
    """
    folder = Path(str(files("learn").joinpath("shipped")))
    if not (folder / "model.json").is_file():
        raise MissingError(
            "this installation has no model of its own",
            field="--model",
            hint="Name a model that falsework train has written",
        )
    return folder


def named_model(name: str) -> PointModel:
    """Read a trained model, or call a function of the user's own that makes one.

    Args:
        name: Folder that `falsework train` has written, or `module:function`; the module is looked for in the folder
            that the command is called in, too. Empty: the model of the package.

    Raises:
        InputError: No such folder, module or function, or what it gives is not a model.
    """
    if not name:
        name = str(shipped_folder())
    if Path(name).is_dir():
        from learn.predict.trained_model import read_trained_model  # torch is imported for a trained model alone

        return read_trained_model(Path(name))
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
        raise InputError(f"not called without arguments: {error}", field="--model", value=name) from None
    lacking = [
        word for word in ("classes", "table", "channels", "tile", "points", "probabilities") if not hasattr(model, word)
    ]
    if lacking:
        raise InputError("does not return a model", field="--model", value=name, allowed=f"with {lacking[0]}")
    return model
