"""The checkpoint of an interrupted training: checked before a training continues from it."""

from pathlib import Path
from typing import Any
from zipfile import ZIP_STORED, ZipFile

import torch

from groundwork.errors import InputError
from groundwork.foreign_file import check_regular


def read_checkpoint(path: Path) -> dict[str, Any]:
    """Read a checkpoint; its check sums are compared first, because PyTorch skips them, and nothing in it executes.

    Args:
        path: The file.

    Returns:
        What was stored; tensors have shape (...), any type.

    Raises:
        InputError: Damaged, or not a checkpoint.
    """
    check_regular(path)
    try:
        with ZipFile(path) as packed:
            if any(part.compress_type != ZIP_STORED for part in packed.infolist()) or packed.testzip() is not None:
                raise ValueError("a part has changed")
        found = torch.load(path, map_location="cpu", weights_only=True)
    except Exception as error:  # the parsers of both may raise any exception
        raise InputError(
            f"a damaged checkpoint: {type(error).__name__}",
            where=path,
            hint="Remove it; the training then starts again",
        ) from None
    if not isinstance(found, dict):
        raise InputError("not a checkpoint", where=path, hint="Remove it; the training then starts again")
    return found
