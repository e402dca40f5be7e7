"""The vote of one point as one would write it down: what `recon.truth.annotate` must equal, and is timed against."""

from collections.abc import Sequence

from recon.truth.noise_figures import THRESHOLD


def plain_verdict(
    label: Sequence[int], instance: Sequence[int], margin: Sequence[float], depth_error: Sequence[float]
) -> tuple[int, int, float, float]:
    """Put the observations of one point to the vote.

    Args:
        label: Class that each observation shows, N of them.
        instance: Its instance.
        margin: Its distance to the next label edge [px].
        depth_error: Its depth error [m].

    Returns:
        Class, instance, confidence [1] and margin [px] of the point.
    """
    near = max(THRESHOLD, min(depth_error))
    voters = [row for row, error in enumerate(depth_error) if error <= near]
    winner = _favorite([label[row] for row in voters], [depth_error[row] for row in voters])
    agreeing = [row for row in voters if label[row] == winner]
    owner = _favorite([instance[row] for row in agreeing], [depth_error[row] for row in agreeing])
    return winner, owner, sum(name == winner for name in label) / len(label), max(margin)


def _favorite(names: list[int], errors: list[float]) -> int:
    votes, least = dict[int, int](), dict[int, float]()
    for name, error in zip(names, errors, strict=True):
        votes[name] = votes.get(name, 0) + 1
        least[name] = min(least.get(name, error), error)
    return min(votes, key=lambda name: (-votes[name], least[name], name))
