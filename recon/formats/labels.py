"""Predicted labels of points, and the names of their columns in files."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from groundwork.errors import InputError

CLASS, CONFIDENCE, INSTANCE = NAMES = ("predicted_class", "predicted_confidence", "predicted_instance")
DTYPES = {CLASS: np.dtype("<u1"), CONFIDENCE: np.dtype("<f4"), INSTANCE: np.dtype("<u4")}


@dataclass(frozen=True, eq=False)
class Labels:
    """Labels of some points, in the order of the file.

    Attributes:
        classes: Class ids, 255 for none, shape (N,), uint8.
        confidence: Confidence of the class [1], shape (N,), float32.
        instance: Instance ids, 0 for none, shape (N,), uint32.
    """

    classes: NDArray[np.uint8]
    confidence: NDArray[np.float32]
    instance: NDArray[np.uint32]

    @property
    def columns(self) -> dict[str, NDArray[np.generic]]:
        """The columns by their names in files, shape (N,) each."""
        return {CLASS: self.classes, CONFIDENCE: self.confidence, INSTANCE: self.instance}


def refuse_labeled(path: Path, names: tuple[str, ...]) -> None:
    """Refuse a source that already holds predictions: they would be overwritten.

    Args:
        path: The source.
        names: Its columns.

    Raises:
        InputError: It holds some.
    """
    found = [name for name in NAMES if name in names]
    if found:
        raise InputError("already has predictions", where=path, field=found[0], hint="Name the original scan")
