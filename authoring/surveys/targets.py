"""Targets of an inspection: every member of a bridge, and its surface in stretches."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from authoring.surveys.subject import Subject
from authoring.surveys.surface_samples import SurfaceSamples, sample_surfaces

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

DENSITY = 1.0  # samples per square meter [1/m²]
LIMITS = (36, 20_000)  # fewest and most samples of a member


@dataclass(frozen=True, eq=False)
class Targets:
    """Samples of a bridge's surface, grouped twice.

    Attributes:
        samples: The samples; their components are the members.
        stretch: Stretch of each sample, shape (N,), int64.
        stretch_member: Member of each stretch: a row of `samples.ids`, shape (S,), int64.
    """

    samples: SurfaceSamples
    stretch: I64
    stretch_member: I64


def cut_targets(subject: Subject, stretch: float, members: NDArray[np.integer]) -> Targets:
    """Sample a bridge, and cut each member into stretches: within a cube, and facing one of six directions.

    Args:
        subject: The bridge.
        stretch: Edge of the cubes [m].
        members: Instance ids of the inspected members, shape (K,), int.
    """
    own = np.isin(subject.bridge_ids, members)
    samples = sample_surfaces(subject.bridge[own], subject.bridge_ids[own], DENSITY, LIMITS)
    low = np.full((len(samples.ids), 3), np.inf)
    np.minimum.at(low, samples.component, samples.points)
    # Cubes begin at each member's own corner, so that a small one is not divided by chance.
    cube = np.floor((samples.points - low[samples.component]) / stretch).astype(np.int64)
    axis = np.argmax(np.round(np.abs(samples.normals), 6), axis=1)
    side = 2 * axis + (np.take_along_axis(samples.normals, axis[:, None], axis=1)[:, 0] > 0.0)
    keys = np.column_stack([samples.component, side, cube])
    unique, number = np.unique(keys, axis=0, return_inverse=True)
    return Targets(samples, number.reshape(-1).astype(np.int64), unique[:, 0])
