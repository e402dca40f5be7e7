"""The six bridges of the picture of families and worlds, and the runs that reconstruct them."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import falsework
from groundwork.progress import Progress

IMAGES = 60  # of a flight, or more where a long bridge needs them


@dataclass(frozen=True)
class HeroBridge:
    """A bridge, and where it is shown.

    Attributes:
        world: Background of its picture; its cloud is made in the countryside.
        family: Family of the bridge.
        service: What it carries, as in a scenario.
        own: Settings of its family.
        seed: Seed of the scenario.
    """

    world: str
    family: str
    service: str
    own: Mapping[str, Any]
    seed: int

    @property
    def scenario(self) -> dict[str, Any]:
        """The run that makes its cloud."""
        return {
            "seed": self.seed,
            "bridge": {"family": self.family, "service": self.service, self.family: dict(self.own)},
            "background": {"name": "countryside"},
            "look": {"name": "random", "texels": 1024},
            "survey": [{"kind": "global", "images": IMAGES, "width": 960, "height": 720}],
            "recon": {"mode": "dense", "quality": "medium"},
            "keep": ["stage", "cloud"],
        }


BRIDGES = (
    HeroBridge("lakeside", "suspension", "road", {"size": "compact", "main": 40.0, "pitch": 5.0}, 4029),
    HeroBridge("hillside", "arch", "road", {}, 4016),
    HeroBridge("city", "cable_stayed", "road", {"main": 60.0}, 4018),
    HeroBridge("countryside", "girder", "rail_double", {"spans": [22.0, 26.0]}, 4033),
    HeroBridge("lakeside", "beam", "rail_double", {"spans": [16.0, 20.0, 16.0]}, 4032),
    HeroBridge("city", "slab", "road", {"spans": [10.0, 12.0, 10.0]}, 4013),
)


def reconstruct(bridge: HeroBridge, work: Path, progress: Progress) -> Path:
    """Make the cloud of a bridge, if it is not there.

    Args:
        bridge: Which one.
        work: Folder that keeps the runs.
        progress: Listener.

    Returns:
        Folder of the scene.
    """
    run = work / f"{bridge.family}-{bridge.world}"
    falsework.run(bridge.scenario, run, progress=progress)
    return run / "scenes" / "0000"
