"""A model between one and what was trained further from it: what the further training forgot comes back in part.

Usage: python -m benchmarks.shipped.mean BEFORE AFTER OUT [--share NUMBER]

Every weight is the mean of both. A network that was trained a little further and the one that it began with lie in one
valley of the loss, and what lies between is often better than either (Wortsman et al., Robust fine-tuning of zero-shot
models, 2022).
"""

import argparse
from dataclasses import replace
from pathlib import Path

from groundwork.errors import InputError
from learn.trained import read_facts, read_weights, write_model


def mean_model(before: Path, after: Path, share: float, out: Path) -> None:
    """Write the weighted mean of two models; all that is no weight is that of the second.

    Args:
        before: Model that the further training began with.
        after: Model that came of it.
        share: Share of the second one [1].
        out: Where to.

    Raises:
        InputError: They are not of one network and one list of classes.
    """
    first, second = read_facts(before), read_facts(after)
    for name in ("network", "settings", "classes", "channels"):
        if getattr(first, name) != getattr(second, name):
            raise InputError("another model than the one before", where=after, field=name)
    old, new = read_weights(before), read_weights(after)
    weights = {
        name: ((1.0 - share) * old[name] + share * value).to(value.dtype) if value.is_floating_point() else value
        for name, value in new.items()
    }
    temperature = float(f"{first.temperature ** (1.0 - share) * second.temperature**share:.3g}")
    training = {**(second.training or {}), "share_of_last": share}
    write_model(out, replace(second, temperature=temperature, training=training), weights)


def main() -> None:
    """Write the mean."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("before", type=Path)
    parser.add_argument("after", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--share", type=float, default=0.5, help="share of AFTER [1]")
    given = parser.parse_args()
    mean_model(given.before, given.after, given.share, given.out)


if __name__ == "__main__":
    main()
