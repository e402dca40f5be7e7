"""The clouds of the package as a small published data set: one folder per bridge, and a card."""

from collections import Counter
from collections.abc import Collection, Sequence
from pathlib import Path

import numpy as np

from learn.demo.clouds import STEP, VOXEL, DemoCloud, write_demo_cloud
from learn.demo.demo import TEST

CARD = "README.md"
MOST_POINTS = 600_000  # 92 bytes each: less than 60 MB in all
BESIDE_SCENES = 65_000  # 6 MB, so that they and scenes with photographs are less than 60 MB in all
CUT = "--set points=1024 --set fewest=128 --set tile.size=10 --set tile.stride=10 --set tile.voxel=0.5"


def small_enough(
    clouds: Sequence[DemoCloud], most: int = MOST_POINTS, always: Collection[str] = TEST
) -> list[DemoCloud]:
    """Select some bridges, such as those of the test, and the smallest others up to the limit, in their order.

    Args:
        clouds: All clouds.
        most: Largest number of points of the selection.
        always: Names of bridges to select in any case.
    """
    room = most - sum(len(cloud.coord) for cloud in clouds if cloud.name in always)
    taken = set(always)
    for cloud in sorted((cloud for cloud in clouds if cloud.name not in always), key=lambda cloud: len(cloud.coord)):
        room -= len(cloud.coord)
        if room >= 0:
            taken.add(cloud.name)
    return [cloud for cloud in clouds if cloud.name in taken]


def write_ready_made(clouds: Sequence[DemoCloud], folder: Path, more: Sequence[str] = ()) -> int:
    """Write clouds that every command reads, with a card.

    Args:
        clouds: The clouds.
        folder: Existing folder.
        more: Lines of the card about other things in the folder.

    Returns:
        Number of points.
    """
    for cloud in clouds:
        (folder / cloud.name).mkdir()
        write_demo_cloud(cloud, folder / cloud.name)
    text = "\n".join([*card_lines(clouds), *more])
    (folder / CARD).write_text(text, encoding="utf-8")  # inside an atomic folder
    return sum(len(cloud.coord) for cloud in clouds)


def card_lines(clouds: Sequence[DemoCloud]) -> list[str]:
    """Write the card: contents and limits of the clouds, their use, and the classes of each.

    Args:
        clouds: The clouds.
    """
    total = sum(len(cloud.coord) for cloud in clouds)
    held = [name for name in TEST if name in {cloud.name for cloud in clouds}]
    return [
        "# Labeled clouds of random bridges",
        "",
        f"{len(clouds)} bridges, {total:,} points, written by `falsework dataset demo`. Apache-2.0, as the software.",
        "",
        "- Every bridge is random, and another one. The name says its family and seed.",
        f"- Points are sampled on the mesh, one a cube of {VOXEL} m, and rounded to {STEP} m.",
        "- Each has its class (`segment`) and component. Their colors, normals and instances were not kept: all zero.",
        "- Points were not seen by a camera or a laser: hidden faces are sampled, too, and nothing is noisy. A network",
        "  that learns from them knows shapes, not sensors. For clouds as sensors see them, run a scenario.",
        *([f"- Kept for the test wherever Falsework gives scores: {', '.join(held)}."] if held else []),
        "",
        "```sh",
        f"falsework dataset local bridges/*[0-9]/ -o set {CUT}",
        "falsework train set -o model --model forest",
        f"falsework export bridges/{clouds[0].name} --to laz -o for_others",
        "```",
        "",
        "| bridge | points | of each class |",
        "|---|---|---|",
        *(f"| {cloud.name} | {len(cloud.coord):,} | {_classes(cloud)} |" for cloud in clouds),
        "",
    ]


def _classes(cloud: DemoCloud) -> str:
    """List class names with their points, the largest first."""
    counts: Counter[str] = Counter()
    for (name, _), count in zip(cloud.kinds, np.bincount(cloud.kind, minlength=len(cloud.kinds)), strict=True):
        counts[name] += int(count)
    return ", ".join(f"{name} {count:,}" for name, count in counts.most_common())
