"""Clearance between the ground and a bridge's road."""

import numpy as np

from authoring.axis.alignment import Layout
from authoring.shapes.component import F64
from groundwork.errors import InputError


def refuse_hill(layout: Layout, stations: F64, lefts: F64, heights: F64) -> None:
    """Refuse ground that lies above the road.

    Args:
        layout: The bridge's axis.
        stations: Along the axis, between the abutments [m], shape (S,), float64.
        lefts: From the axis to the left, on the deck [m], shape (L,), float64.
        heights: Of the ground at each station and offset [m], shape (S, L), float64.

    Raises:
        InputError: The ground reaches the road.
    """
    axis = layout.alignment
    road = axis.height(stations)[:, None] + axis.crossfall(stations)[:, None] * lefts
    over = float((heights - road).max(initial=-1.0))
    if over > 0.0:
        raise InputError(
            f"the ground lies {over:.1f} m above the deck",
            field="bridge.clearance",
            allowed="ground below the deck between the abutments",
            hint=f"Raise it by {np.ceil(10.0 * over + 10.0) / 10.0:.1f} m, or choose a lower site or a smaller "
            "site.relief",
        )
