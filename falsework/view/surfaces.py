"""The surfaces and variants of a stage, read in a child process."""

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from falsework.children.products import read_safely
from falsework.report.cloud_view import Surfaces
from groundwork.progress import Progress

TIME_LIMIT, MEMORY_LIMIT = 600.0, 8.0  # [s], [GB]


@dataclass(frozen=True)
class VariantSet:
    """A variant set of a stage.

    Attributes:
        prim: Prim path.
        name: Name of the variant set.
        names: Its variants.
        selected: The selected variant.
    """

    prim: str
    name: str
    names: tuple[str, ...]
    selected: str


def read_surfaces(
    stage: Path,
    most: int,
    progress: Progress,
    chosen: Mapping[tuple[str, str], str] | None = None,
    reach: float | None = None,
) -> tuple[Surfaces, tuple[VariantSet, ...]]:
    """Read the surfaces of a stage.

    Args:
        stage: USD file.
        most: Largest number of triangles; small ones of the surroundings are left out first.
        progress: Listener.
        chosen: Prim path and variant set to the variant to show instead of the stage's selection.
        reach: Largest distance of shown surroundings from the bridge [m]; None: all.

    Returns:
        The surfaces, and the variant sets of the stage.

    Raises:
        InputError: Not a stage, or more than can be read safely.
    """
    from usd_schemas.reading.choices import StageChoices

    variants = tuple((prim, name, value) for (prim, name), value in sorted((chosen or {}).items()))
    choices = StageChoices(variants=variants).as_json() if variants else None
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "surfaces.npz"
        request: dict[str, Any] = {
            "stage": str(stage.absolute()),
            "most": most,
            "reach": reach,
            "file": str(file),
            "choices": choices,
        }
        answer = read_safely("falsework.children.surface_work", request, stage, progress, TIME_LIMIT, MEMORY_LIMIT)
        with np.load(file, allow_pickle=False) as stored:
            surfaces = Surfaces(stored["corners"].astype(np.float64), stored["colors"])
    sets = tuple(
        VariantSet(row["prim"], row["set"], tuple(row["names"]), row["selected"]) for row in answer["variants"]
    )
    return surfaces, sets
