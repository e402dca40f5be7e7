"""Component kinds of points, such as `pier_cap`: a list for the cloud, and the row of each point in it."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from usd_schemas.flat_scene import InstanceRow


def component_kinds(instances: Iterable[InstanceRow]) -> tuple[str, ...]:
    """List the kinds of some instances, sorted; the first is empty, for points without one.

    Args:
        instances: The instances of a scene.
    """
    return ("", *sorted({row.component for row in instances} - {""}))


def kind_rows(instance: NDArray[np.uint32], instances: Iterable[InstanceRow]) -> NDArray[np.uint16]:
    """Find the kind of each point.

    Args:
        instance: Instance id of each point, 0 for none, shape (N,), uint32.
        instances: The instances of the scene.

    Returns:
        Rows of `component_kinds`, 0 for unknown instances, shape (N,), uint16.
    """
    known = sorted(instances, key=lambda row: row.id)
    kinds = component_kinds(known)
    ids = np.array([0, *(row.id for row in known)])
    rows = np.array([0, *(kinds.index(row.component) for row in known)], np.uint16)
    at = np.minimum(np.searchsorted(ids, instance), len(ids) - 1)
    return np.where(ids[at] == instance, rows[at], 0).astype(np.uint16)
