"""The spans of slab, beam and girder bridges: drawn or given, checked, and placed along the axis."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from pydantic import Field

from authoring.parts.bearings import Bearings
from authoring.parts.drawing import Draws, draw, draw_option
from authoring.parts.idle_settings import LEFT_OUT, Use
from authoring.parts.idle_settings import SEVERAL as SEVERAL_SPANS
from authoring.parts.pier_choice import ROWS_APART
from authoring.parts.spans import Spans
from groundwork.errors import InputError
from groundwork.settings import Settings

SEVERAL = " of bridges with several spans"
PAPER_SPAN = 10.0  # [m]: the Random Bridge Generator puts a pier every 10 m
_UNDER_PLINTH = 0.02  # [m] smallest length of a girder beyond its plinth


@dataclass(frozen=True)
class SpanRule:
    """Limits of a family's spans.

    Attributes:
        family: Key of the family in `[bridge]`.
        members: Name of the spanning members for users.
        shortest: Least span that a user may set [m].
        longest: Largest span that a user may set [m].
        drawn: Least and largest inner span that is drawn [m]: uniform for slabs, log-uniform for girders.
        shortest_end: Least end span that is drawn, unless the inner spans are shorter [m].
        one_row: Whether continuous members have one row of bearings at each pier.
        end_shares: Least and largest ratio of end span to inner span of continuous slabs; other slabs have equal spans
            [1]; empty for girders, which have a setting `end_share`.
    """

    family: str
    members: str
    shortest: float
    longest: float
    drawn: tuple[float, float]
    shortest_end: float
    one_row: bool
    end_shares: tuple[float, ...] = ()


def of_spans(*several: str) -> tuple[Use, ...]:
    """State what spans that are set make meaningless, in a family with `spans` and `span_count`.

    Args:
        several: Keys that have an effect only with several spans; `end_share` only with three, if `spans` is empty.
    """
    drawn = ("span_count", "end_share") if "end_share" in several else ("span_count",)
    most = tuple(range(3, 21))
    ends = (Use("span_count", most, ("end_share",)),) if "end_share" in several else ()
    more = tuple(key for key in several if key != "end_share")
    return (
        Use("spans", LEFT_OUT, drawn),
        *ends,
        Use("spans", SEVERAL_SPANS, more),
        Use("span_count", SEVERAL_SPANS, more),
    )


PIERS_BETWEEN_SPANS = (Use("spans", SEVERAL_SPANS, ("pier",)), Use("span_count", SEVERAL_SPANS, ("pier",)))


class SpanLengths(Settings):
    """Settings that slabs, beams and girders have in common; each family documents their meaning."""

    spans: tuple[float, ...] = Field(
        default=(), description="Lengths of the spans, bearing line to bearing line [m]; empty: drawn"
    )


class SpanSettings(SpanLengths):
    """Settings that beams and girders have in common."""

    continuous: bool | None = Field(default=None, description="Members are continuous over the piers")


@dataclass(frozen=True)
class OwnDraws:
    """Values of the spans that a family draws itself.

    Attributes:
        count: Number of spans if they are drawn.
        fit: Adapts a drawn inner span [m] to the rest of the bridge.
        continuous: Members are continuous over the piers; None: set by `continuous`, or drawn.
        suited: Options of `continuous` that suit what the user set; None for both.
        apart: The user set caps with a stem between two rows of plinths.
    """

    count: int
    fit: Callable[[float], float] = lambda span: span
    continuous: bool | None = None
    suited: tuple[bool, ...] | None = None
    apart: bool = False


def draw_spans(rule: SpanRule, settings: SpanLengths, own: OwnDraws, bearings: Bearings, draws: Draws) -> Spans:
    """Draw spans: equal inner spans, shorter end spans.

    Args:
        rule: Limits of the spans.
        settings: Values set by the user; also has `overhang` and `gap`, and for girders `end_share` and `continuous`.
        own: Values that the family draws itself.
        bearings: Bearings and plinths under them.
        draws: Random stream and profile of the bridge.

    Raises:
        InputError: A given span is out of range.
    """
    overhang, gap = draw(settings, "overhang", draws), draw(settings, "gap", draws)
    if own.apart and getattr(settings, "overhang", None) is None:
        least = 0.5 * (bearings.plinth_length - gap + ROWS_APART)
        overhang = max(overhang, round(float(np.ceil(1000.0 * least - 1e-6)) / 1000.0, 3))  # no more than is needed
    (low, high), at = rule.drawn, draws.random()
    inner = own.fit(round(float(low + (high - low) * at if rule.end_shares else low * (high / low) ** at), 1))
    if rule.end_shares:
        low, high = rule.end_shares
        share = low + (high - low) * draws.random()
    else:
        share = draw(settings, "end_share", draws)
    through = own.continuous
    if through is None:
        through = draw_option(settings, "continuous", draws, suited=own.suited)
    if draws.profile == "paper":
        inner, share = PAPER_SPAN, getattr(settings, "end_share", None)
        if share is not None and not settings.spans and share * inner < rule.shortest:
            raise InputError(
                f"end spans too short for {rule.members}: in profile paper the others have {inner:g} m",
                field=f"bridge.{rule.family}.end_share",
                value=share,
                allowed=f"at least {rule.shortest / inner:g}",
                hint=f"Choose a larger one, or set bridge.{rule.family}.spans",
            )
    elif rule.end_shares and not through:
        share = None
    lengths = settings.spans or _regular(rule, own.count, inner, share)
    return _lay_out(rule, lengths, (overhang, gap), bearings, continuous=through)


def _lay_out(
    rule: SpanRule, lengths: tuple[float, ...], ends: tuple[float, float], bearings: Bearings, *, continuous: bool
) -> Spans:
    """Place spans from station 0 on; `ends`: least overhang of a member, and expansion gap [m]."""
    for length in lengths:
        if not rule.shortest <= length <= rule.longest:
            nearest = min(max(length, rule.shortest), rule.longest)
            raise InputError(
                f"a span that is too short or too long for {rule.members}",
                field=f"bridge.{rule.family}.spans",
                value=length,
                allowed=f"{rule.shortest:g} to {rule.longest:g} m",
                hint=f"The nearest valid value is {nearest:g} m; or choose another family",
            )
    # A plinth must be under the end of its own span.
    overhang = max(ends[0], round(0.5 * bearings.plinth_length + _UNDER_PLINTH, 3))
    supports = tuple(round(float(station), 3) for station in np.cumsum([0.0, *lengths]))
    through = continuous and len(lengths) > 1
    return Spans(supports, overhang, ends[1], continuous=through, one_row=through and rule.one_row)


def _regular(rule: SpanRule, count: int, inner: float, share: float | None) -> tuple[float, ...]:
    """Compute equal inner spans between two shorter end spans [m]; one or two, or all without a share, are equal."""
    if count < 3 or share is None:
        return (inner,) * count
    end = max(round(inner * share, 1), min(rule.shortest_end, inner))
    return (end, *[inner] * (count - 2), end)
