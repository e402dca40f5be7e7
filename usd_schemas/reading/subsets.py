"""Face subsets of a mesh."""

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom

from usd_schemas.reading.traversal import COMPOSED, EARLIEST, numbers_of

I64 = NDArray[np.int64]


def subset_faces(prim: Usd.Prim) -> list[tuple[Usd.Prim, str, I64]]:
    """List the face subsets of a mesh.

    Args:
        prim: A Mesh.

    Returns:
        Subset prim, family name, and face numbers, shape (K,), int64, in namespace order.
    """
    found = []
    for child in prim.GetFilteredChildren(COMPOSED):
        if child.IsA(UsdGeom.Subset):
            subset = UsdGeom.Subset(child)
            if subset.GetElementTypeAttr().Get() == UsdGeom.Tokens.face:
                indices = numbers_of(subset.GetIndicesAttr().Get(EARLIEST))
                indices = np.full(1, -1, np.int64) if indices is None else indices  # of another type: no face
                found.append((child, str(subset.GetFamilyNameAttr().Get() or ""), indices))
    return found
