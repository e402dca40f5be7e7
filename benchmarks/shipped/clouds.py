"""Make the clouds that the model of the package learns from: bridges of every family in every world, by lasers.

Usage: python -m benchmarks.shipped.clouds WORK [--only NAME…] [--seed NUMBER] [--bare FIRST:END]

Nothing is rendered: each bridge is authored and scanned from a tripod and from an aircraft, far enough round it that
most of an airborne cloud is no bridge. `--bare` makes bridges on their site alone, without a world round it: a third of
the time for each. Clouds of photographs are those of a run of `scenarios/learning.toml`. WORK keeps what was made: a
second call goes on. Then: `python -m benchmarks.shipped.model WORK …`.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
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
BARE_SAMPLES: Sequence[Mapping[str, Any]] = (  # one after the other; the tripod for all
    {"kind": "airborne", "id": "als", "reach": 40.0, "pulses_per_line": 650, "voxel": VOXEL},
    {"kind": "mobile", "id": "mls", "reach": 40.0, "voxel": VOXEL},
    {"kind": "mesh", "id": "mesh", "reach": 12.0, "density": 60.0, "voxel": VOXEL},
)


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


def bare_scenario(number: int, seed: int) -> dict[str, Any]:
    """Write the scenario of a bridge without a world round its site.

    Args:
        number: Counts these bridges; it sets the family and the second sampler.
        seed: Seed of the first one's scene.
    """
    more = BARE_SAMPLES[number // len(FAMILIES) % len(BARE_SAMPLES)]
    return {
        "seed": seed + number,
        "bridge": {"family": FAMILIES[number % len(FAMILIES)]},
        "background": {"name": "none"},
        "look": {"name": "clean", "texels": 256},
        "sample": [{"kind": "terrestrial", "id": "tls", "reach": 30.0, "angular_step": 0.35, "voxel": VOXEL}, more],
        "keep": ["cloud"],
    }


def make(scenario: Mapping[str, Any], folder: Path) -> None:
    """Make the clouds of a scenario that are missing.

    Args:
        scenario: The scenario.
        folder: Output folder of its run.
    """
    with ConsoleProgress() as progress:
        outcome = falsework.run(dict(scenario), folder, progress=progress)
    sys.stdout.write(f"{folder.name}: {outcome.made} made\n")
    sys.stdout.flush()


def main() -> None:
    """Make what is missing."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("work", type=Path)
    parser.add_argument("--only", nargs="+", default=[row.name for row in ROWS], metavar="NAME")
    parser.add_argument("--seed", type=int, default=8101, help="of the first bridge; the others have the next ones")
    parser.add_argument("--bare", metavar="FIRST:END", help="bridges without a world, instead of the others")
    given = parser.parse_args()
    if given.bare:
        for number in range(*map(int, given.bare.split(":"))):
            make(bare_scenario(number, given.seed), given.work / f"bare-{number:03d}")
        return
    for row in ROWS:
        number = given.seed + FAMILIES.index(row.family) * len(WORLDS) + list(WORLDS).index(row.world)
        number += len(ROWS) * row.small
        if row.name in given.only:
            make(scenario_of_row(row, number), given.work / row.name)


if __name__ == "__main__":
    main()
