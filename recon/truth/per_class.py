"""Fates of the points of each class, and where along the bridge there are few."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recon.points.fates import DEVIATION, FATES, KEPT
from recon.truth.windows import BACKGROUND, LENGTH, Windows
from usd_schemas.components import UNLABELED, ClassRow

U8 = NDArray[np.uint8]
I64 = NDArray[np.int64]

FEW = 50  # points of a class in a window: with fewer, a network learns little
PIXEL_WORDS = {
    "no_depth": "no depth found",
    "views": "too few photographs agree",
    "seen_through": "other photographs see through it",
    "angle": "photographs too close together",
}
"""Why pixels of a dense cloud's depth maps are in no point, by their names in its statistics."""
_MUCH = 0.5  # share of a class's points removed by `max_deviation` above which a message is printed


def describe_classes(
    segment: U8,
    fate: U8,
    copies: I64,
    coord: NDArray[np.float64],
    classes: tuple[ClassRow, ...],
    windows: Windows | None,
) -> dict[str, Any]:
    """Count the points kept and removed per class, and those kept in each window.

    A class counts as scarce only in windows that contain its surface and that the flight saw: those with any point of
    the bridge.

    Args:
        segment: Class id of every point that was made, shape (N,), uint8.
        fate: Fate of each, a number of `FATES`, shape (N,), uint8.
        copies: Number of equal points merged into each, itself included, shape (N,), int64.
        coord: Their positions [m], shape (N, 3), float64.
        classes: Class table of the cloud.
        windows: Cuts across the bridge, or None where the bridge is unknown.

    Returns:
        JSON figures: `windows` and, by name, `classes`.
    """
    count = 1 if windows is None else windows.count
    window = np.zeros(len(segment), np.int64) if windows is None else windows.of(coord)
    bridge = (segment != BACKGROUND) & (segment != UNLABELED)
    seen = np.zeros(count, bool)
    seen[window[bridge]] = True
    figures: dict[str, Any] = {}
    for row in classes:
        mine = segment == row.id
        if not mine.any() and (windows is None or not windows.present[row.id].any()):
            continue
        numbers = np.bincount(fate[mine], minlength=len(FATES))
        kept = mine & (fate == KEPT)
        dropped = {name: int(number) for name, number in zip(FATES, numbers, strict=True) if name != FATES[KEPT]}
        dropped["duplicate"] = int((copies[mine] - 1).sum())
        figures[row.name] = {"kept": int(numbers[KEPT]), "dropped": dropped}
        if windows is not None:
            inside = np.bincount(window[kept], minlength=count)
            there = windows.present[row.id] & seen
            few = int((there & (inside < FEW)).sum())
            figures[row.name] |= {"in_windows": inside.tolist(), "windows": int(there.sum()), "few_in": few}
    along = (
        None
        if windows is None
        else {
            "length": LENGTH,
            "count": count,
            "origin": windows.origin.tolist(),
            "direction": windows.direction.tolist(),
            "seen": seen.tolist(),
        }
    )
    return {"classes": figures, "windows": along}


def lost_classes(figures: Mapping[str, Any]) -> list[str]:
    """Name the classes of which `max_deviation` removed more than half.

    Args:
        figures: Result of `describe_classes`.
    """
    lost = []
    for name, row in figures["classes"].items():
        gone = row["dropped"][FATES[DEVIATION]]
        if gone > _MUCH * (row["kept"] + sum(row["dropped"].values()) - row["dropped"]["duplicate"]):
            lost.append(name)
    return lost


def scarce_classes_in_words(clouds: Iterable[Mapping[str, Any]]) -> str:
    """Name the classes that are scarce in a window, over one cloud or several; the most often scarce ones first.

    For dense clouds it also states how many of a class's pixels are in points, and why most others are not.

    Args:
        clouds: Statistics of each cloud.

    Returns:
        One line; empty where no class is scarce, or nothing is known.
    """
    few: dict[str, int] = {}
    of: dict[str, int] = {}
    pixels: dict[str, dict[str, int]] = {}
    for statistics in clouds:
        for name, row in statistics.get("pixels", {}).items():
            sums = pixels.setdefault(name, dict.fromkeys(row, 0))
            for fate, number in row.items():
                sums[fate] += number
        for name, row in statistics.get("classes", {}).items():
            if row.get("few_in"):
                few[name] = few.get(name, 0) + row["few_in"]
            of[name] = of.get(name, 0) + row.get("windows", 0)
    if not few:
        return ""
    order = sorted(few, key=lambda name: (-few[name] / of[name], name))
    named = ", ".join(f"{name} in {few[name]} of {of[name]}{_why(pixels.get(name, {}))}" for name in order)
    return f"fewer than {FEW} points in a window of {LENGTH:g} m: {named}"


def _why(pixels: Mapping[str, int]) -> str:
    """State how many of a class's pixels are in points, and why most others are not."""
    lost = {fate: pixels.get(fate, 0) for fate in PIXEL_WORDS}
    if not sum(lost.values()):
        return ""
    most = max(lost, key=lambda fate: lost[fate])
    share = pixels["in_points"] / sum(pixels.values())
    return f" ({share:.0%} of its pixels are in points; main reason: {PIXEL_WORDS[most]})"
