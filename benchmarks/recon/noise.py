"""Where the noisy points of clouds lie, and how far their uncertainty finds what is off.

Usage: python -m benchmarks.recon.noise NAME=CLOUD [NAME=CLOUD …]

Each CLOUD is a cloud folder with truth. Most figures are those that the reconstruction left in its `cloud.json`;
`docs/benchmarks/noise.md` shows them side by side.
"""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from benchmarks.page import write_page
from groundwork.errors import InputError
from recon.cloud import read_cloud

PAGE = Path(__file__).resolve().parents[2] / "docs" / "benchmarks" / "noise.md"


def main() -> None:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("clouds", nargs="+", type=named_cloud, metavar="NAME=CLOUD")
    write_page(PAGE, noise_page([(name, noise_of(folder)) for name, folder in parser.parse_args().clouds]), __file__)


def named_cloud(word: str) -> tuple[str, Path]:
    """Read an argument of the form NAME=CLOUD.

    Args:
        word: The argument.

    Returns:
        Name and cloud folder.

    Raises:
        ArgumentTypeError: There is no folder in it.
    """
    name, _, folder = word.partition("=")
    if not folder:
        raise argparse.ArgumentTypeError("NAME=CLOUD, as in 'demo=out/scenes/0000/cloud/global'")
    return name, Path(folder)


def noise_of(folder: Path) -> dict[str, Any]:
    """Read the noise figures of a cloud.

    Args:
        folder: Cloud folder.

    Returns:
        What `recon.truth.noise_figures.describe_noise` found, `points` and `mode` of the cloud, and `same_class`: of
        the noisy points that are not off the surface, the share with the class of that surface [1].

    Raises:
        InputError: The cloud has no truth.
    """
    cloud = read_cloud(folder)
    noise = cloud.statistics.get("noise")
    if noise is None:
        raise InputError("has no uncertainty", where=folder, hint="Take a cloud of a capture with truth")
    columns, limit = cloud.columns, noise["threshold"]
    there = (columns["uncertainty"] > limit) & (columns["surface_distance"] <= limit)
    same = columns["segment"][there] == columns["surface_class"][there]
    share = float(same.mean()) if len(same) else None
    return {**noise, "points": len(cloud), "mode": cloud.source.removeprefix("sfm-"), "same_class": share}


def noise_page(clouds: list[tuple[str, dict[str, Any]]]) -> str:
    """Write the two tables.

    Args:
        clouds: Name and figures of each cloud.
    """
    first = clouds[0][1]
    limit, bands = f"{first['threshold']:g} m", [_band(band) for band in first["by_distance"]]
    rates = [("displacement", "recall"), ("surface_distance", "precision"), ("surface_distance", "recall")]
    heads = [*(f"{kind.replace('_', ' ')}, {rate}" for kind, rate in rates), "of the surface's class"]
    lines = [
        "# Noisy points",
        "",
        "Written by `python -m benchmarks.recon.noise`. A point is noisy when its uncertainty, the median over its",
        f"views of true depth against reconstructed depth, exceeds {limit}. By distance from the nearest camera that",
        "saw it: ",
        *_table(["noisy", "points", *bands], clouds, _by_distance),
        "",
        f"A point is off when it lies more than {limit} from the place that its pixels truly show (displacement), or",
        "from the nearest true surface (surface distance). Precision: share of the noisy points that are off. Recall:",
        "share of the points off that are noisy. A point that is noisy is displaced by definition: its depth is off by",
        "as much at least, so the precision against displacement is 1 by definition, and only recall is shown.",
        "",
        *_table(
            heads,
            clouds,
            lambda noise: [
                *(_percent(noise[f"against_{kind}"][rate]) for kind, rate in rates),
                _percent(noise["same_class"]),
            ],
        ),
        "",
        "Against the surface precision is low: many a noisy point is on a surface, though not where its pixels look.",
        "Most of these have the class of that surface (last column): along it, a point may slide without leaving it.",
        "The others lie at edges, where a pixel shows what is behind.",
        "",
    ]
    return "\n".join(lines)


def _table(
    heads: list[str], clouds: list[tuple[str, dict[str, Any]]], cells: Callable[[dict[str, Any]], list[str]]
) -> list[str]:
    lines = [f"| {name} | {noise['mode']} | {' | '.join(cells(noise))} |" for name, noise in clouds]
    return [f"| cloud | mode | {' | '.join(heads)} |", "|---|---|" + "---|" * len(heads), *lines]


def _by_distance(noise: dict[str, Any]) -> list[str]:
    bands = noise["by_distance"]
    shares = [f"{_percent(band['noisy_share'])} of {band['points']:,}" for band in bands]
    noisy = sum(band["noisy_share"] * band["points"] for band in bands if band["points"])
    return [_percent(noisy / max(noise["points"], 1)), f"{noise['points']:,}", *shares]


def _band(band: dict[str, Any]) -> str:
    return f"from {band['from']:g} m" if band["to"] is None else f"{band['from']:g} to {band['to']:g} m"


def _percent(share: float | None) -> str:
    return "" if share is None else f"{share:.1%}"


if __name__ == "__main__":
    main()
