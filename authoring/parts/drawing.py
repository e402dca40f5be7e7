"""Declaration of parameters that a user may set and that are otherwise drawn at random."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import Field

from authoring.streams import Option, told_shares, weighted_choice
from groundwork.errors import InputError
from groundwork.settings import Settings


@dataclass(frozen=True)
class Draws:
    """Source of the parameters that the user did not set.

    Attributes:
        rng: Random stream of the bridge.
        profile: `default`: ranges of engineering practice; `paper`: known ranges of the paper's generator.
    """

    rng: np.random.Generator
    profile: str = "default"

    def random(self) -> float:
        """Draw a number from 0 up to 1 [1]."""
        return float(self.rng.random())

    def choose(self, weights: Mapping[Option, float]) -> Option:
        """Draw one option.

        Args:
            weights: How often each option is drawn, any scale [1]; their order counts.
        """
        return weighted_choice(weights, self.random())


IN_PAPER = "in profile paper"  # begins the conditions of a table that are those of this profile


class UnsuitedDeck(InputError):
    """The deck is too wide or too narrow for what the user set; one that was drawn may be drawn again."""


def drawn(
    low: float,
    high: float,
    description: str,
    *,
    ge: float | None = None,
    le: float | None = None,
    paper: tuple[float, float] | None = None,
) -> Any:
    """Declare an optional setting that is drawn from a range if the user does not set it.

    Args:
        low: Least value drawn [any unit].
        high: Largest value drawn [any unit].
        description: What it is, with its unit in brackets.
        ge: Least value that a user may set [any unit]; default `low`.
        le: Largest value that a user may set [any unit]; default `high`.
        paper: Range that the profile `paper` draws from [any unit]; default: the same.

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
    """Take the value that the user set, or draw one: likeliest in the middle of the range, rounded to 1/1000.

    The generator advances by the same amount in both cases, so that setting one value changes no other. The triangular
    distribution needs only sums of uniform numbers, which are the same on every platform.

    Args:
        settings: Model whose field `key` was declared with `drawn`.
        key: Name of the field.
        draws: Random stream and profile.

    Returns:
        The value, in the unit that the field states [any unit].
    """
    share = 0.5 * (draws.random() + draws.random())
    low, high = drawn_range(type(settings), key, draws.profile)
    fixed = getattr(settings, key)
    return float(fixed) if fixed is not None else round(low + share * (high - low), 3)


def draw_whole(settings: Settings, key: str, draws: Draws) -> int:
    """Take the whole number that the user set, or draw one; every number of the range is equally likely.

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
    weights: Mapping[Any, float],
    description: str,
    *,
    among: str = "",
    paper: Mapping[Any, float] | None = None,
    ge: int | None = None,
    le: int | None = None,
) -> Any:
    """Declare an optional choice that is drawn if the user does not set it.

    Args:
        weights: How often each option is drawn, any scale [1]; True comes before False.
        description: What it is.
        among: Which bridges the shares apply to, such as " of those with several spans"; default: all.
        paper: How often the profile `paper` draws each option [1]; default: the same.
        ge: Least number that a user may set [any unit].
        le: Largest number that a user may set [any unit].

    Returns:
        The pydantic field, default None; its description ends with the shares.
    """
    told = "" if paper is None else f"; in profile paper {told_shares(paper)}"
    extra: dict[str, Any] = {"chosen": [*map(list, weights.items())]}
    extra["paper"] = extra["chosen"] if paper is None else [*map(list, paper.items())]
    description = f"{description}; drawn {told_shares(weights)}{among}{told}"
    return Field(None, ge=ge, le=le, description=description, json_schema_extra=extra)


def chosen_by(
    tables: Mapping[str, Mapping[Any, float]], description: str, *, paper: Mapping[Any, float] | None = None
) -> Any:
    """Declare an optional choice whose shares depend on the bridge.

    Args:
        tables: How often each option is drawn, any scale [1], by condition: "on roads", "under one plane of stays".
        description: What it is.
        paper: How often the profile `paper` draws each option [1]; default: those of `tables`.

    Returns:
        The pydantic field, default None; its description ends with the shares.
    """
    told = "" if paper is None else f"; in profile paper {told_shares(paper)}"
    cases = "; ".join(f"{where}: {told_shares(weights)}" for where, weights in tables.items())
    extra: dict[str, Any] = {} if paper is None else {"paper": [*map(list, paper.items())]}
    if own := [weights for where, weights in tables.items() if where.startswith(IN_PAPER)]:
        extra["cases"] = [[option, weight] for weights in own for option, weight in weights.items()]
    return Field(None, description=f"{description}; drawn {cases}{told}", json_schema_extra=extra)


def option_at(
    settings: Settings,
    key: str,
    share: float,
    profile: str,
    weights: Mapping[Any, float] | None = None,
    *,
    suited: Collection[Any] | None = None,
) -> Any:
    """Take the option that the user set, or the one at a cumulative share of all weights.

    Args:
        settings: Model whose field `key` was declared with `chosen` or `chosen_by`.
        key: Name of the field.
        share: From 0 up to 1 [1].
        profile: `default` or `paper`.
        weights: Weights of the options that this bridge may have [1]; default: those of the field. The profile `paper`
            draws among these options by its own shares, if the field has shares for it and one of them is above 0.
        suited: Options that suit what else the user set; default: all. Another option is drawn again among these, with
            the same share.
    """
    fixed = getattr(settings, key)
    if fixed is not None:
        return fixed
    extra: Any = type(settings).model_fields[key].json_schema_extra or {}
    if suited is not None:
        usual = option_at(settings, key, share, profile, weights)
        every = dict(extra["chosen"]) if weights is None else weights
        fitting = {option: weight for option, weight in every.items() if option in suited}
        return usual if usual in suited or not fitting else option_at(settings, key, share, profile, fitting)
    if profile == "paper" and "paper" in extra:
        shares = {option: part for option, part in extra["paper"] if weights is None or weights.get(option, 0.0) > 0.0}
        if any(shares.values()):
            return weighted_choice(shares, share)
    return weighted_choice(dict(extra["chosen"]) if weights is None else weights, share)


def draw_option(
    settings: Settings,
    key: str,
    draws: Draws,
    weights: Mapping[Any, float] | None = None,
    *,
    suited: Collection[Any] | None = None,
) -> Any:
    """Take the option that the user set, or draw one; the generator advances by the same amount in both cases.

    Args:
        settings: Model whose field `key` was declared with `chosen` or `chosen_by`.
        key: Name of the field.
        draws: Random stream and profile.
        weights: Weights of the options that this bridge may have [1]; default: those of the field. The profile `paper`
            draws among these options by its own shares, if the field has shares for it and one of them is above 0.
        suited: Options that suit what else the user set; default: all.
    """
    return option_at(settings, key, draws.random(), draws.profile, weights, suited=suited)


def drawn_range(model: type[Settings], key: str, profile: str = "default") -> tuple[float, float]:
    """Read the range that a field is drawn from.

    Args:
        model: Settings class.
        key: Name of a field declared with `drawn`.
        profile: `default` or `paper`.

    Returns:
        Lowest and highest value, in the unit that the field states [any unit].
    """
    extra = model.model_fields[key].json_schema_extra
    assert isinstance(extra, dict)
    low, high = extra["paper" if profile == "paper" else "drawn"]  # pyright: ignore
    return float(low), float(high)  # pyright: ignore[reportArgumentType]


def check_depth(field: str, depth: float, span: float, ratios: tuple[float, float]) -> None:
    """Refuse a given depth that does not fit the span.

    Args:
        field: Key of the depth.
        depth: The given depth [m].
        span: Longest span [m].
        ratios: Least and largest span over depth [1].

    Raises:
        InputError: The span is too long or too short for this depth.
    """
    least = float(np.ceil(100.0 * span / ratios[1] - 1e-6)) / 100.0
    most = float(np.floor(100.0 * span / ratios[0] + 1e-6)) / 100.0
    if not span / ratios[1] - 1e-3 <= depth <= span / ratios[0] + 1e-3:  # of a fitted span, which was rounded
        raise InputError(
            f"does not fit a span of {span:g} m",
            field=field,
            value=depth,
            allowed=f"{least:g} to {most:g} m here, span over depth {ratios[0]:g} to {ratios[1]:g}",
            hint=f"The nearest valid value is {min(max(depth, least), most):g} m",
        )
