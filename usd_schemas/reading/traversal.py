"""Default time code and traversal of a stage, and guards against invalid values."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Tf, Usd, UsdGeom

from groundwork.errors import InputError
from usd_schemas.reading.parse_errors import reason_of

# The first sample if there are samples, else the default: what a still image of the stage shows.
EARLIEST = Usd.TimeCode.EarliestTime()

# Errors that numpy or the bindings of USD raise if the type of a value differs from its schema.
MISTYPED = (ValueError, TypeError, LookupError, AttributeError, OverflowError, RuntimeError, Tf.ErrorException)

COMPOSED = Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)


class UnreadableMeshError(Exception):
    """A mesh whose arrays contradict each other; the text describes how."""


def composed_prims(stage: Usd.Stage) -> Iterator[Usd.Prim]:
    """Walk every active, defined, loaded prim, including those inside instances, but not prototypes of instancers.

    Args:
        stage: Composed stage.
    """
    prims = iter(Usd.PrimRange.Stage(stage, COMPOSED))
    for prim in prims:
        yield prim
        if prim.IsA(UsdGeom.PointInstancer):
            prims.PruneChildren()


@contextmanager
def guarded(prim: Usd.Prim, warn: Callable[[str], None], what: str = "left out") -> Iterator[None]:
    """Skip a prim with values of wrong types with a warning, instead of failing.

    Args:
        prim: The prim.
        warn: Called with one line where it could not be read.
        what: What happens to it, for the warning.
    """
    try:
        yield
    except (*MISTYPED, InputError) as error:
        reason = reason_of(error) if str(error).strip() else type(error).__name__
        warn(f"{prim.GetPath()}: a value of a wrong type for its schema ({reason}): {what}")


def table_of(value: Any, width: int) -> NDArray[np.float64] | None:
    """Convert a value to rows of numbers.

    Args:
        value: Value of an attribute.
        width: Numbers in a row.

    Returns:
        Rows [any unit], shape (N, width), float64, empty for no value; None if the value is something else.
    """
    if value is None:
        return np.zeros((0, width))
    try:
        rows = np.array(value, np.float64)
    except (ValueError, TypeError):
        return None
    if rows.size == 0:
        return np.zeros((0, width))
    return rows if rows.ndim == 2 and rows.shape[1] == width else None


def numbers_of(value: Any) -> NDArray[np.int64] | None:
    """Convert a value to whole numbers.

    Args:
        value: Value of an attribute.

    Returns:
        Numbers, shape (N,), int64, empty for no value; None if the value is something else.
    """
    try:
        rows = np.array([] if value is None else value)
        if rows.size == 0:
            return np.zeros(0, np.int64)
        return rows.astype(np.int64) if rows.ndim == 1 and rows.dtype.kind in "iu" else None
    except (ValueError, TypeError):
        return None
