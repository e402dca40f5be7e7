"""Make the clouds that the model of the package learns from: bridges of every family in every world, by lasers.

Usage: python -m benchmarks.shipped.clouds WORK [--only NAME…] [--seed NUMBER]

Nothing is rendered: each bridge is authored and scanned from a tripod and from an aircraft, far enough round it that
most of an airborne cloud is no bridge. Clouds of photographs and meshes are those of
`benchmarks.recon.accuracy --samples`. WORK keeps what was made: a second call goes on. Then:
`python -m benchmarks.shipped.model WORK …`.
"""

import argparse
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import falsework
from falsework.commands.console import ConsoleProgress

FAMILIES = ("beam", "arch", "girder", "slab", "suspension", "cable_stayed")
WORLDS: Mapping[str, Mapping[str, Any]] = {  # more plants and houses than a picture needs
    "countryside": {"buildings": 60, "trees": 1400, "hedge_bushes": 900, "vehicles": 60},
    "city": {"parks": 0.2, "trees": 900, "vehicles": 400},
    "hillside": {},
    "lakeside": {},
}
VOXEL = 0.1  # [m]
PULSES = (450, 650, 900, 1200)  # of a line: 5 to 14 points a square meter, another for each world


@dataclass(frozen=True)
class Row:
    """A bridge in a world.

    Attributes:
        family: Family of the bridge.
        world: A key of `WORLDS`.
        small: A short, low slab over water, as in a town.
    """

    family: str
    world: str
    small: bool = False

    @property
    def name(self) -> str:
        """Name of its folder, and of it on the command line."""
        return f"{self.world}-{'small' if self.small else self.family}"


ROWS = tuple(  # each world once, then each world with the next family: the first rows show as much as they can
    Row(FAMILIES[(turn + place) % len(FAMILIES)], world)
    for turn in range(len(FAMILIES))
    for place, world in enumerate(WORLDS)
) + tuple(Row("slab", world, small=True) for world in WORLDS)
SMALL_SPANS = ((8.0,), (12.0,), (6.0, 8.0, 6.0), (10.0,))  # [m] one row for each world
SMALL_CLEARANCE = 3.0  # [m] the least there is


def scenario_of_row(row: Row, seed: int) -> dict[str, Any]:
    """Write the scenario of a row.

    Args:
        row: Bridge and world.
        seed: Seed of the scene.
    """
    number = list(WORLDS).index(row.world)
    place = (FAMILIES.index(row.family) + number) % len(PULSES)
    small = {"service": "road", "clearance": SMALL_CLEARANCE, "slab": {"spans": SMALL_SPANS[number]}}
    return {
        "seed": seed,
        "bridge": {"family": row.family, **(small if row.small else {})},
        "site": {
            "half_width": 50.0,  # so that the world begins nearby
            "run_out": 40.0,
            **({"crossing": "river"} if row.small else {}),
        },
        "background": {"name": row.world, row.world: WORLDS[row.world]},
        "look": {"name": "clean", "texels": 256},
        "sample": [
            {"kind": "terrestrial", "id": "tls", "reach": 50.0, "angular_step": 0.35, "voxel": VOXEL},
            {"kind": "airborne", "id": "als", "reach": 150.0, "pulses_per_line": PULSES[place], "voxel": VOXEL},
        ],
        "keep": ["cloud"],
    }


def main() -> None:
    """Make what is missing."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("work", type=Path)
    parser.add_argument("--only", nargs="+", default=[row.name for row in ROWS], metavar="NAME")
    parser.add_argument("--seed", type=int, default=8101, help="of the first bridge; the others have the next ones")
    given = parser.parse_args()
    for row in ROWS:
        number = given.seed + FAMILIES.index(row.family) * len(WORLDS) + list(WORLDS).index(row.world)
        number += len(ROWS) * row.small
        if row.name in given.only:
            with ConsoleProgress() as progress:
                outcome = falsework.run(scenario_of_row(row, number), given.work / row.name, progress=progress)
            sys.stdout.write(f"{row.name}: {outcome.made} made\n")
            sys.stdout.flush()


if __name__ == "__main__":
    main()
