"""Training, validation and test splits: by whole bridges, or at random as in the paper."""

from collections.abc import Sequence

import numpy as np

from groundwork.canonical import digest
from groundwork.errors import InputError
from learn.datasets.labeled_cloud import SourceFacts
from learn.datasets.settings import DatasetSettings

TRAIN, VAL, TEST = SPLITS = ("train", "val", "test")


def split_bridges(sources: Sequence[SourceFacts], settings: DatasetSettings) -> dict[str, str]:
    """Assign every bridge to one split by the hash of its shape, so that all its looks and sensors stay together.

    Bridges are ordered by a hash of their hash and the seed, and split by the shares; with three or more bridges, no
    wanted split is empty. Bridges that are reserved for the test, or must not be used for training, are assigned to the
    test first.

    Args:
        sources: All sources.
        settings: Shares, seed and bridges for the test.

    Returns:
        Split of each bridge.

    Raises:
        InputError: A bridge named for the test is missing, or one is used for training and reserved for the test.
    """
    bridges = sorted({source.bridge for source in sources}, key=lambda bridge: digest([settings.seed, bridge]))
    held = {source.bridge for source in sources if source.evaluate_only or source.test}
    for name in settings.test:
        found = [bridge for bridge in bridges if bridge.startswith(name)]
        if not name or len(found) != 1:
            raise InputError(
                "is not the beginning of the name of exactly one bridge",
                field="test",
                value=name,
                allowed=", ".join(bridge[:12] for bridge in bridges),
            )
        held.update(found)
    free = [bridge for bridge in bridges if bridge not in held]
    train, val, test = settings.shares
    if held:  # the test has its bridges: the rest is divided between the other two
        rest = train + val
        train, val, test = (train / rest, val / rest, 0.0) if rest > 0 else (0.0, 0.0, 1.0)
    counts = _counts(len(free), (train, val, test))
    names = [name for name, count in zip(SPLITS, counts, strict=True) for _ in range(count)]
    return {**dict(zip(free, names, strict=True)), **dict.fromkeys(sorted(held), TEST)}


def _counts(total: int, shares: tuple[float, float, float]) -> list[int]:
    """Round the shares to whole numbers; at least one for each share above 0 if there are enough bridges."""
    exact = np.array(shares) * total
    counts = np.floor(exact).astype(int)
    for place in np.argsort(-(exact - counts), kind="stable")[: total - counts.sum()]:
        counts[place] += 1
    for place in range(3):
        if shares[place] > 0 and counts[place] == 0 and counts.max() > 1:
            counts[np.argmax(counts)] -= 1
            counts[place] = 1
    return counts.tolist()


def split_at_random(source: SourceFacts, number: int, settings: DatasetSettings) -> str:
    """Draw the split of one piece at random: overlapping pieces of a bridge may be in different splits.

    Bridges that are reserved for the test, or must not be used for training, are in the test.

    Args:
        source: Its source.
        number: Number of the piece in the source.
        settings: Shares, seed and bridges for the test.
    """
    if source.evaluate_only or source.test or source.bridge.startswith(settings.test):
        return TEST
    drawn = int(digest([settings.seed, source.digest, number])[:12], 16) / 16**12
    return SPLITS[int(np.searchsorted(np.cumsum(settings.shares)[:2], drawn, side="right"))]
