"""The interface of every network: geometry for the loader, logits from features and geometry."""

from collections.abc import Mapping
from pathlib import Path
from typing import Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from learn.neighborhoods.batches import Batches
from learn.neighborhoods.cache import cached_pyramid
from learn.neighborhoods.searcher import Points, Rows, Searcher
from learn.neighborhoods.trees import Trees

F32 = NDArray[np.float32]

COORD = "coord"
"""The key under which a geometry holds the positions themselves."""

Geometry = Mapping[str, Tensor]
"""`coord` (B, N, 3), float32, and the arrays of a pyramid with a batch axis in front, int64: rows within each cloud."""


class Backbone(Protocol):
    """A network of `learn.models`: a torch module with these additional methods."""

    def pyramid(self, coord: Points, search: Searcher[Points, Rows]) -> Mapping[str, Rows]:
        """Search the neighborhoods of one cloud or of a batch.

        The loader calls it for one cloud, and its result is stored in the cache; on a GPU it is called for a batch.

        Args:
            coord: Positions [m or 1], shape (N, 3), float32; of a batch with an axis in front.
            search: What searches.

        Returns:
            Named arrays of row numbers: `kept{l}`, shape (points of level l,), others shape (rows, neighbors).
        """
        ...

    def pyramid_parameters(self) -> object:
        """Return the parameters that determine the pyramid beside the positions: the rest of the cache's key."""
        ...

    def forward(self, features: Tensor, geometry: Geometry) -> Tensor:
        """Compute logits for every point and class.

        Args:
            features: Inputs [1], shape (B, N, C), float32.
            geometry: Of the B clouds `coord` [m or 1], shape (B, N, 3), float32, and the pyramids, shape (B, rows) or
                (B, rows, neighbors), int64.

        Returns:
            Logits [1], shape (B, N, classes), float32.
        """
        ...


def geometry_of(
    backbone: Backbone, coord: F32, cache: Path | None = None, moved: F32 | None = None
) -> dict[str, Tensor]:
    """Make the geometry of one cloud, without the batch axis.

    Args:
        backbone: The network.
        coord: Positions that the neighborhoods are searched in [m or 1], shape (N, 3), float32.
        cache: Folder of pyramids, or None.
        moved: The same points after augmentation [m or 1], shape (N, 3), float32; None: not augmented.

    Returns:
        `coord` [m or 1], shape (N, 3), float32, and the pyramid, shape (rows,) or (rows, neighbors), int64.
    """
    arrays = cached_pyramid(cache, coord, backbone.pyramid_parameters(), lambda cloud: backbone.pyramid(cloud, Trees()))
    geometry = {name: torch.from_numpy(rows.astype(np.int64)) for name, rows in arrays.items()}
    seen = coord if moved is None else moved
    return {COORD: torch.from_numpy(np.ascontiguousarray(seen, dtype=np.float32)), **geometry}


def completed(backbone: Backbone, geometry: Geometry) -> Geometry:
    """Search the neighborhoods of a batch where its tensors lie, if the loader has not.

    Args:
        backbone: The network.
        geometry: `coord` [m or 1], shape (B, N, 3), float32, and the pyramids, shape (B, rows) or (B, rows, neighbors),
            int64, or no pyramids.

    Returns:
        `coord` [m or 1], shape (B, N, 3), float32, and the pyramids, shape (B, rows) or (B, rows, neighbors), int64.
    """
    if len(geometry) > 1:
        return geometry
    with torch.no_grad():
        return {**geometry, **backbone.pyramid(geometry[COORD], Batches())}


def batched(geometries: list[dict[str, Tensor]]) -> dict[str, Tensor]:
    """Stack the geometries of clouds with the same number of points.

    Args:
        geometries: One per cloud, from `geometry_of`: `coord` [m or 1], shape (N, 3), float32, and pyramids, shape
            (rows,) or (rows, neighbors), int64.

    Returns:
        One geometry with a batch axis: `coord` [m or 1], shape (B, N, 3), float32, and pyramids, shape (B, rows) or (B,
        rows, neighbors), int64.
    """
    return {name: torch.stack([geometry[name] for geometry in geometries]) for name in geometries[0]}
