"""COLMAP's camera models: where directions appear in a photograph."""

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]

TWO_FOCALS = ("PINHOLE", "OPENCV")  # models with a focal length for each axis
BENDS = ("k1", "k2", "p1", "p2")


def parameter_names(model: str, count: int) -> tuple[str, ...]:
    """Name the parameters of a model in COLMAP's order.

    Args:
        model: COLMAP's name of the model.
        count: Number of its parameters.
    """
    focal = ("fx", "fy") if model in TWO_FOCALS else ("f",)
    return (*focal, "cx", "cy", *BENDS)[:count]


def project(plane: F64, model: str, params: F64) -> F64:
    """Project directions.

    Args:
        plane: Directions at depth 1 [1], shape (N, 2), float64.
        model: COLMAP's name of the model.
        params: Its parameters in COLMAP's order [px] [1], shape (K,), float64.

    Returns:
        Pixels [px], shape (N, 2), float64, pixel centers at +0.5.
    """
    two = model in TWO_FOCALS
    focal = params[:2] if two else params[:1]
    center = params[2:4] if two else params[1:3]
    k1, k2, p1, p2 = [*params[4 if two else 3 :], 0.0, 0.0, 0.0, 0.0][:4]
    square = (plane**2).sum(axis=1, keepdims=True)
    bent = plane * (1.0 + k1 * square + k2 * square**2)
    if p1 or p2:
        x, y = plane[:, :1], plane[:, 1:]
        bent = bent + np.hstack(
            [2 * p1 * x * y + p2 * (square + 2 * x * x), p1 * (square + 2 * y * y) + 2 * p2 * x * y]
        )
    return bent * focal + center
