"""The bridges and flights that the page about accuracy has a row of, as scenarios."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

FAMILIES = ("slab", "beam", "girder", "arch", "suspension", "cable_stayed")
SERVICES = {"road": "road", "rail": "rail_double"}
SURVEYS: Mapping[str, Mapping[str, Any]] = {
    "local": {"kind": "local", "length": 20.0, "images": [50, 70]},
    "global": {"kind": "global", "images": 80},
    "inspection": {
        "kind": "mix",
        "legs": [{"kind": "global", "images": 40, "spacing": 8.0}, {"kind": "inspection", "cover": "members"}],
    },
}
SHORT: Mapping[str, Mapping[str, Any]] = {  # 83 to 252 images show every member of them three times
    "slab": {"spans": [9.0, 9.0]},
    "beam": {"spans": [14.0]},
    "girder": {"spans": [18.0, 18.0]},
    "arch": {"arrangement": "masonry", "masonry": {"span_count": 2, "span": 10.0}},
    "suspension": {"size": "compact", "main": 40.0, "pitch": 5.0},
    "cable_stayed": {"main": 30.0},
}
MODES = ("sparse", "dense")
SAMPLES: tuple[Mapping[str, Any], ...] = (  # as in scenarios/learning.toml
    {"kind": "mesh", "density": 120.0, "reach": 12.0, "voxel": 0.05},
    {"kind": "mesh", "id": "visible", "density": 120.0, "reach": 12.0, "voxel": 0.05, "min_views": 3},
    {"kind": "terrestrial", "id": "tls", "reach": 40.0, "angular_step": 0.35, "voxel": 0.05},
)


@dataclass(frozen=True)
class Row:
    """A bridge and a flight.

    Attributes:
        family: Family of the bridge.
        service: road or rail, a key of `SERVICES`.
        survey: A key of `SURVEYS`.
    """

    family: str
    service: str
    survey: str

    @property
    def name(self) -> str:
        """Name of its folder, and of it on the command line."""
        return f"{self.survey}-{self.family}-{self.service}"


ROWS = (
    *(
        Row(family, service, survey)
        for survey in SURVEYS
        for family in FAMILIES
        for service in (SERVICES if survey == "local" else ("road",))
    ),
    *(Row(family, "rail", "global") for family in FAMILIES),  # last: the place of a row is the seed of its bridge
)


def scenario_of_row(row: Row, seed: int, samples: bool = False) -> dict[str, Any]:
    """Write the scenario of a row.

    Args:
        row: Bridge and flight.
        seed: Seed of the scene.
        samples: Whether the bridge is sampled on its mesh and by a laser, too.
    """
    bridge: dict[str, Any] = {"family": row.family, "service": SERVICES[row.service]}
    inspected = row.survey == "inspection"
    sampled = samples and (row.survey == "local" or (row.survey == "global" and row.service == "road"))
    if inspected:
        bridge[row.family] = dict(SHORT[row.family])
    return {
        "seed": seed,
        "bridge": bridge,
        "background": {"name": "countryside"},
        "look": {"name": "random", "texels": 1024},
        "survey": [{**SURVEYS[row.survey], "width": 960, "height": 720}],
        "sample": [dict(sample) for sample in SAMPLES] if sampled else [],
        "sensor": {"noise": True},
        "recon": {"mode": "dense" if inspected else "both", "quality": "medium"},
        "keep": ["stage", "cloud"],
    }
