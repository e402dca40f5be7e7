"""Parameters that a user may fix and that are drawn otherwise: their ranges stand in the settings themselves."""

from typing import Any

import numpy as np
from pydantic import Field

from groundwork.settings import Settings


def drawn(low: float, high: float, description: str, *, ge: float | None = None, le: float | None = None) -> Any:
    """Declare an optional setting that is drawn from a range when the user leaves it out.

    Args:
        low: Least value drawn.
        high: Largest value drawn.
        description: What it is, with its unit in brackets.
        ge: Least value that a user may fix; default `low`.
        le: Largest value that a user may fix; default `high`.

    Returns:
        The pydantic field, default None.
    """
    return Field(
        None,
        ge=low if ge is None else ge,
        le=high if le is None else le,
        description=f"{description}; drawn from {low:g} to {high:g}",
        json_schema_extra={"drawn": [low, high]},
    )


def draw(settings: Settings, key: str, rng: np.random.Generator) -> float:
    """Take the value that the user fixed, or draw one: likeliest in the middle of the range, rounded to 1/1000.

    The generator advances by the same amount either way, so that fixing one value changes no other. The triangular
    law takes only sums of uniform numbers, which are the same on every platform.

    Args:
        settings: Model whose field `key` was declared with `drawn`.
        key: Name of the field.
        rng: Random stream.
    """
    share = 0.5 * (rng.random() + rng.random())
    low, high = drawn_range(type(settings), key)
    fixed = getattr(settings, key)
    return float(fixed) if fixed is not None else round(low + share * (high - low), 3)


def draw_whole(settings: Settings, key: str, rng: np.random.Generator) -> int:
    """Take the whole number that the user fixed, or draw one; every number of the range is equally likely.

    Args:
        settings: Model whose field `key` was declared with `drawn`.
        key: Name of the field.
        rng: Random stream.
    """
    low, high = drawn_range(type(settings), key)
    value = int(rng.integers(int(low), int(high) + 1))
    fixed = getattr(settings, key)
    return int(fixed) if fixed is not None else value


def drawn_range(model: type[Settings], key: str) -> tuple[float, float]:
    """Read the range that a field is drawn from.

    Args:
        model: Settings class.
        key: Name of a field declared with `drawn`.
    """
    extra = model.model_fields[key].json_schema_extra
    assert isinstance(extra, dict)
    low, high = extra["drawn"]  # pyright: ignore[reportGeneralTypeIssues, reportAssignmentType, reportOptionalIterable]
    return float(low), float(high)  # pyright: ignore[reportArgumentType]
