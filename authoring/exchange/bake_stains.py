"""Fine detail and stains together, as the renderer multiplies them: the twin of `render/shaders/material.glsl`."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]

_WHOLE = np.float32(0.5)  # deviation of a stain that covers everything [1]
_RAGGED = np.float32(6.0)  # change of a faint stain over the deviation of the detail [1]
_BENT = np.float32(1 / 1300)  # shift of its edges over that of an octave, in widths of the texture [1]
_SHIFTS = ((0.0, 0.0), (1.0, 1.0), (1.0, -1.0))  # directions in which the octaves shift it
_FAINTEST = np.float32(1e-3)  # share that counts as none [1]


def detail_factors(octaves: list[F32], macro: Callable[[F32], F32] | None) -> F32:
    """Multiply the octaves of fine detail by the stains of a macro texture, whose edges follow the detail.

    Args:
        octaves: Deviation from 1 of each octave's factor [1], shape (N, 1) each, float32; for none an empty list.
        macro: Looks up the macro texture at positions that are shifted by so much [widths], shape (N, 2), and returns
            its values, shape (N, 3); None for none.

    Returns:
        Factors of the base color [1], shape (N, 3), (N, 1) without macro texture, or (1, 1) with neither, float32.
    """
    detail: F32 = np.ones((1, 1), np.float32)
    shift: F32 = np.zeros((1, 2), np.float32)
    for octave, direction in zip(octaves, _SHIFTS, strict=False):
        detail = (detail * (1 + octave)).astype(np.float32, copy=False)
        shift = (shift + octave * (_BENT * np.array([direction], np.float32))).astype(np.float32, copy=False)
    if macro is None:
        return detail
    stain = 2 * macro(shift) - 1
    share = np.clip(np.abs(stain).max(axis=1, keepdims=True) / _WHOLE, _FAINTEST, 1)
    ragged = np.where(stain.sum(axis=1, keepdims=True) < 0, _RAGGED * (1 - share), np.float32(0))
    return (detail * (1 + stain * np.clip(1 + ragged * (1 - detail), 0, 1 / share))).astype(np.float32, copy=False)
