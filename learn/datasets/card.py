"""The card of a data set as Markdown: contents, sources, and limits of use."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from learn.datasets.layout import DatasetFacts
from learn.datasets.split import SPLITS


def card_text(facts: DatasetFacts, counts: Mapping[str, NDArray[np.int64]]) -> str:
    """Write the card.

    Args:
        facts: The data set.
        counts: Points of each label in each split, shape (256,), int64.
    """
    settings = facts.settings
    splits = [split for split in SPLITS if split in counts]
    lines = [f"# Data set: {settings.kind}, {settings.mode}", "", *_what(facts), "", "## Splits", ""]
    lines += ["| split | bridges | pieces | draws | points |", "|---|---|---|---|---|"]
    for split in splits:
        rows = [row for row in facts.pieces if row.split == split]
        lines.append(
            f"| {split} | {len({row.bridge for row in rows})} | {len(rows)} | {sum(r.draws for r in rows)} "
            f"| {sum(row.points for row in rows)} |"
        )
    lines += [
        "",
        "Whole bridges are held out."
        if settings.split == "bridge"
        else "Pieces were shared out at random, as in the paper: pieces of one bridge that overlap are in several "
        "splits, so that scores on the held-out ones are too good.",
        "",
        "## Classes",
        "",
    ]
    lines += [f"| label | class | {' | '.join(splits)} |", "|---|---|" + "---|" * len(splits)]
    for label, name in [*enumerate(facts.classes), (255, "unlabelled")]:
        lines.append(f"| {label} | {name} | {' | '.join(str(int(counts[split][label])) for split in splits)} |")
    lines += ["", "## Sources", "", "| source | made by | bridge | split | terms |", "|---|---|---|---|---|"]
    for number, source in enumerate(facts.sources):
        found = sorted({row.split for row in facts.pieces if row.source == number})
        terms = f"{source['licence']}{', evaluate only' if source['evaluate_only'] else ''}" or "own"
        lines.append(
            f"| {source['name']} | {source['kind']} | {source['bridge'][:12]} | {', '.join(found) or 'none'} "
            f"| {terms} |"
        )
    return "\n".join(lines) + "\n"


def _what(facts: DatasetFacts) -> list[str]:
    settings = facts.settings
    if settings.mode == "metric":
        tile = settings.tile
        cut = (
            f"Metric tiles of {tile.size:g} m, {tile.stride:g} m apart, one point in each cube of {tile.voxel:g} m; "
            "heights count from a ground that is estimated from the points; no truth is needed to cut them."
        )
    elif settings.kind == "local":
        window = settings.window
        cut = (
            f"Windows of {window.length:g} m along the bridge, {window.overlap:.0%} overlap, as wide as the deck and "
            f"{window.beside:g} m, from {window.below:g} m below the ground to {window.above:g} m above the bridge; "
            "their boxes are read off the labels."
        )
    else:
        cut = f"One draw of {settings.points} points from each cloud."
    noisy = (
        "is the class noisy_point"
        if settings.noisy_class
        else "is left out of training; validation and test hold all points"
    )
    return [
        cut,
        "",
        f"- A sample has {settings.points} points. What is more uncertain than {settings.noisy:g} m {noisy}.",
        f"- A network may see positions{''.join(f', {name}' for name in facts.inputs)}; labels and uncertainty never.",
        "- Samples of validation and test visit every point of every piece, unchanged, whatever its label.",
        f"- Classes: table `{settings.table}`. Seed {settings.seed}.",
    ]
