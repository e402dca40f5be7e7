"""Fates of the pixels of the depth maps by class: why a class has many or few dense points."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from recon.dense.pixel_fates import PIXEL_FATES, PixelFates
from render.capture import Truth
from usd_schemas.components import UNLABELED, ClassRow

_CLASSES = 256


def describe_pixels(
    fates: PixelFates,
    rows: NDArray[np.int64],
    valid: NDArray[np.bool_],
    truth: Truth | None,
    classes: tuple[ClassRow, ...],
) -> dict[str, Any]:
    """Count the fates of pixels by the class that the photograph shows there.

    Args:
        fates: Fate of every pixel.
        rows: Row in the capture of each image of the model, shape (I,), int64.
        valid: Whether a camera of the capture is valid, shape (K,), bool; only images of these are counted.
        truth: True label images, or None.
        classes: Class table of the cloud.

    Returns:
        JSON figures by class name: number of pixels of each fate [px]; all are unlabelled without truth.
    """
    place = fates.in_photograph()
    size = fates.camera.photograph
    inside = ((place >= 0) & (place < [size.width, size.height])).all(axis=-1)
    column, row = place[inside].T
    counts = np.zeros(_CLASSES * len(PIXEL_FATES), np.int64)
    for number in np.flatnonzero(valid[rows]).tolist():
        fate = fates.of(number)[inside].astype(np.int64)
        label = np.full(len(fate), UNLABELED) if truth is None else truth.semantic(int(rows[number]))[row, column]
        counts += np.bincount(label.astype(np.int64) * len(PIXEL_FATES) + fate, minlength=len(counts))
    table = counts.reshape(_CLASSES, -1)
    return {
        one.name: dict(zip(PIXEL_FATES, table[one.id].tolist(), strict=True)) for one in classes if table[one.id].any()
    }
