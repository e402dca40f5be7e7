"""Parameters that a user may fix and that are drawn otherwise: their ranges stand in the settings themselves."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from pydantic import Field

from groundwork.errors import InputError
from groundwork.settings import Settings

Name = TypeVar("Name")


@dataclass(frozen=True)
class Draws:
    """Where the open parameters of a bridge come from.

    Attributes:
        rng: Random stream of the bridge.
        profile: `default`: ranges of engineering practice; `paper`: what is known of the paper's generator.
    """

    rng: np.random.Generator
    profile: str = "default"

    def random(self) -> float:
        """Draw a number from 0 up to 1."""
        return float(self.rng.random())

    def choose(self, weights: Mapping[str, float]) -> str:
        """Draw one name.

        Args:
            weights: How often each name is drawn, any scale; their order counts.
        """
        return weighted_choice(weights, self.random())


def weighted_choice(weights: Mapping[Name, float], share: float) -> Name:
    """Find the name that lies at a share of all weights.

    Args:
        weights: How often each name is drawn, any scale; their order counts.
        share: From 0 up to 1.
    """
    edges = np.cumsum(list(weights.values()))
    return list(weights)[int(np.searchsorted(edges[:-1], share * edges[-1], side="right"))]


def drawn(
    low: float,
    high: float,
    description: str,
    *,
    ge: float | None = None,
    le: float | None = None,
    paper: tuple[float, float] | None = None,
) -> Any:
    """Declare an optional setting that is drawn from a range when the user leaves it out.

    Args:
        low: Least value drawn.
        high: Largest value drawn.
        description: What it is, with its unit in brackets.
        ge: Least value that a user may fix; default `low`.
        le: Largest value that a user may fix; default `high`.
        paper: Range that the profile `paper` draws from; default: the same.

    Returns:
        The pydantic field, default None.
    """
    told = f"; in profile paper from {paper[0]:g} to {paper[1]:g}" if paper else ""
    return Field(
        None,
        ge=min((low, *(paper or ()))) if ge is None else ge,
        le=max((high, *(paper or ()))) if le is None else le,
        description=f"{description}; drawn from {low:g} to {high:g}{told}",
        json_schema_extra={"drawn": [low, high], "paper": list(paper or (low, high))},
    )


def draw(settings: Settings, key: str, draws: Draws) -> float:
    """Take the value that the user fixed, or draw one: likeliest in the middle of the range, rounded to 1/1000.

    The generator advances by the same amount either way, so that fixing one value changes no other. The triangular
    law takes only sums of uniform numbers, which are the same on every platform.

    Args:
        settings: Model whose field `key` was declared with `drawn`.
        key: Name of the field.
        draws: Random stream and profile.
    """
    share = 0.5 * (draws.random() + draws.random())
    low, high = drawn_range(type(settings), key, draws.profile)
    fixed = getattr(settings, key)
    return float(fixed) if fixed is not None else round(low + share * (high - low), 3)


def draw_whole(settings: Settings, key: str, draws: Draws) -> int:
    """Take the whole number that the user fixed, or draw one; every number of the range is equally likely.

    Args:
        settings: Model whose field `key` was declared with `drawn`.
        key: Name of the field.
        draws: Random stream and profile.
    """
    low, high = drawn_range(type(settings), key, draws.profile)
    value = int(draws.rng.integers(int(low), int(high) + 1))
    fixed = getattr(settings, key)
    return int(fixed) if fixed is not None else value


def chosen(
    weights: Mapping[Any, float], description: str, *, among: str = "", paper: Mapping[Any, float] | None = None
) -> Any:
    """Declare an optional choice that is drawn when the user leaves it out.

    Args:
        weights: How often each option is drawn, any scale; True comes before False.
        description: What it is.
        among: Which bridges the shares speak of, such as " of those with several spans"; default: all.
        paper: How often the profile `paper` draws each option; default: the same.

    Returns:
        The pydantic field, default None; its description ends with the shares.
    """
    told = "" if paper is None else f"; in profile paper {_shares(paper)}"
    extra: dict[str, Any] = {"chosen": [*map(list, weights.items())]}
    extra["paper"] = extra["chosen"] if paper is None else [*map(list, paper.items())]
    return Field(None, description=f"{description}; drawn {_shares(weights)}{among}{told}", json_schema_extra=extra)


def draw_option(settings: Settings, key: str, draws: Draws) -> Any:
    """Take the option that the user fixed, or draw one; the generator advances by the same amount either way.

    Args:
        settings: Model whose field `key` was declared with `chosen`.
        key: Name of the field.
        draws: Random stream and profile.
    """
    extra: Any = type(settings).model_fields[key].json_schema_extra
    option = weighted_choice(dict(extra["paper" if draws.profile == "paper" else "chosen"]), draws.random())
    fixed = getattr(settings, key)
    return option if fixed is None else fixed


def _shares(weights: Mapping[Any, float]) -> str:
    """Say how often each option is drawn: "ballast 65 %, slab 35 %", "true 40 %", "never", "always pot"."""
    total = sum(weights.values())
    parts = {option: f"{100.0 * weight / total:.3g} %" for option, weight in weights.items() if weight}
    if set(parts) <= {True, False}:
        true = parts.get(True)
        return "never" if true is None else "always" if len(parts) == 1 else f"true {true}"
    if len(parts) == 1:
        return f"always {next(iter(parts))}"
    if len(set(parts.values())) == 1:
        *most, last = parts
        return f"{', '.join(most)} and {last} alike"
    return ", ".join(f"{option} {share}" for option, share in parts.items())


def drawn_range(model: type[Settings], key: str, profile: str = "default") -> tuple[float, float]:
    """Read the range that a field is drawn from.

    Args:
        model: Settings class.
        key: Name of a field declared with `drawn`.
        profile: `default` or `paper`.
    """
    extra = model.model_fields[key].json_schema_extra
    assert isinstance(extra, dict)
    low, high = extra["paper" if profile == "paper" else "drawn"]  # pyright: ignore
    return float(low), float(high)  # pyright: ignore[reportArgumentType]


def check_depth(field: str, depth: float, span: float, ratios: tuple[float, float]) -> None:
    """Refuse a fixed depth that does not go with the span.

    Args:
        field: Key of the depth.
        depth: Depth that was fixed [m].
        span: Longest span [m].
        ratios: Least and largest span over depth [1].

    Raises:
        InputError: The span is too long or too short for this depth.
    """
    least = float(np.ceil(100.0 * span / ratios[1] - 1e-6)) / 100.0
    most = float(np.floor(100.0 * span / ratios[0] + 1e-6)) / 100.0
    if not least <= depth <= most:
        raise InputError(
            f"incompatible with a span of {span:g} m",
            field=field,
            value=depth,
            allowed=f"{least:g} to {most:g} m here, span over depth {ratios[0]:g} to {ratios[1]:g}",
            hint=f"The nearest is {min(max(depth, least), most):g} m",
        )
