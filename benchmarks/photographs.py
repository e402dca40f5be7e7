"""What became of folders of real photographs.

Usage: python -m benchmarks.photographs NAME=CLOUD [NAME=CLOUD …]

Each CLOUD is a cloud folder that `falsework reconstruct` made of photographs; `docs/benchmarks/photographs.md` shows
what it says of itself. The photographs are other people's: they are named, not kept here.
"""

import argparse
from pathlib import Path
from typing import Any

from benchmarks.noise import named_cloud
from groundwork.files import write_text
from recon.cloud import read_cloud

PAGE = Path(__file__).resolve().parents[1] / "docs" / "benchmarks" / "photographs.md"
HEADS = [
    "photographs",
    "cloud",
    "in the model",
    "points",
    "of the model's",
    "views of a point",
    "reprojection [px]",
    "aligned to",
    "from their GPS [m]",
]


def main() -> None:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("clouds", nargs="+", type=named_cloud, metavar="NAME=CLOUD")
    write_text(PAGE, photographs_page([(name, figures_of(folder)) for name, folder in parser.parse_args().clouds]))


def figures_of(folder: Path) -> dict[str, Any]:
    """Read what a cloud says of its photographs.

    Args:
        folder: Cloud folder.

    Returns:
        The cloud's `statistics`, with `mode` (`sparse` or `dense`), `target` and `method` of its alignment.

    Raises:
        InputError: The folder is no cloud.
    """
    cloud = read_cloud(folder)
    alignment = {key: cloud.alignment[key] for key in ("target", "method")}
    return {**cloud.statistics, **alignment, "mode": cloud.source.removeprefix("sfm-")}


def photographs_page(clouds: list[tuple[str, dict[str, Any]]]) -> str:
    """Write the table.

    Args:
        clouds: Name and figures of each cloud.
    """
    return "\n".join(
        [
            "# Real photographs",
            "",
            "Written by `python -m benchmarks.photographs`. Each folder as its authors published it, without settings",
            'but for `mode = "dense"` and the quality that is named.',
            "*Of the model's*: share of the model's points that the sparse cloud keeps (`recon.max_deviation`).",
            "*From their GPS*: median distance of the aligned cameras from where their EXIF says they were.",
            "",
            f"| {' | '.join(HEADS)} |",
            "|" + "---|" * len(HEADS),
            *(f"| {name} | {' | '.join(_cells(figures))} |" for name, figures in clouds),
            "",
        ]
    )


def _cells(figures: dict[str, Any]) -> list[str]:
    sparse, gps = figures["mode"] == "sparse", figures["target"] == "gps"
    return [
        figures["mode"],
        f"{figures['registered']} of {figures['images']}",
        f"{figures['points']:,}",
        f"{figures['points'] / max(figures['model_points'], 1):.0%}" if sparse else "",
        f"{figures['observations'] / max(figures['points'], 1):.1f}",
        f"{figures['mean_reprojection_error']:.2f}" if sparse else "",
        f"GPS, {figures['method']}" if gps else "nothing",
        f"{figures['center_error_median']:.2f}" if gps else "",
    ]


if __name__ == "__main__":
    main()
