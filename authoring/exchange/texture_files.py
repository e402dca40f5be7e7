"""Textures of a stage, which may come from anywhere, as arrays."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundwork.errors import InputError
from groundwork.foreign_file import check_regular

Picture = NDArray[np.uint8]


def read_color(file: str) -> Picture:
    """Read the colors of a texture.

    Args:
        file: Texture.

    Returns:
        Levels of blue, green and red, shape (H, W, 3), uint8.

    Raises:
        InputError: It is no regular file, or no image.
    """
    import cv2

    return _read(file, cv2.IMREAD_COLOR).astype(np.uint8, copy=False)


def read_all(file: str) -> NDArray[Any]:
    """Read all channels of a texture in their own type.

    Args:
        file: Texture.

    Returns:
        Levels, shape (H, W), or blue, green, red and perhaps opacity, shape (H, W, 3) or (H, W, 4).

    Raises:
        InputError: It is no regular file, or no image.
    """
    import cv2

    return _read(file, cv2.IMREAD_UNCHANGED)


def _read(file: str, flags: int) -> NDArray[Any]:
    import cv2

    check_regular(Path(file))
    found = cv2.imread(file, flags)
    if found is None:
        raise InputError("not readable as an image", where=file)
    return found
