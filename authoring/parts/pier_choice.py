"""The choice of pier and cap for a deck: the weights, and which combinations are excluded."""

from typing import Literal

import numpy as np

from authoring.parts.drawing import IN_PAPER, Draws, UnsuitedDeck
from authoring.parts.idle_settings import LEFT_OUT, Use
from authoring.parts.shafts import APART
from authoring.streams import weighted_choice
from groundwork.errors import InputError

PierKind = Literal["wall", "single", "multi", "hammerhead", "pi_frame", "y", "v"]
CapKind = Literal["drop", "tapered", "inverted_t", "cantilevered", "integral"]

WIDEST_STEM = 13.0  # [m] largest cap length on one stem
WIDEST_FRAME = 17.0  # [m] largest cap length on two legs
LEAST_UPSTAND, BESIDE_UPSTAND = 0.15, 0.06  # [m] of an inverted T's stem; both gaps between it and the plinths
ROWS_APART = LEAST_UPSTAND + BESIDE_UPSTAND  # [m] least distance between two rows of plinths with a stem between them
LEAST_DIAMETER = 0.6  # [m] of one of several columns
_COLUMNS = {"pi_frame": 2}  # number of columns of kinds with a fixed number other than one
_COLUMN_PITCH = 7.0  # [m] largest distance of columns
_CLEAR_PITCH = 2.2  # least distance as a multiple of their diameter
END_SHARE = 0.2  # length of the cap beyond the columns' pitches, taken from the number of these [1]

_NARROW: dict[str, float] = {
    "wall": 14.0,
    "single": 20.0,
    "multi": 22.0,
    "hammerhead": 18.0,
    "pi_frame": 10.0,
    "y": 9.0,
    "v": 7.0,
}
_WIDE: dict[str, float] = {"wall": 18.0, "multi": 67.0, "pi_frame": 15.0}
_COLUMN_CAPS = {"drop": 30.0, "tapered": 45.0, "inverted_t": 25.0}
_CAPS: dict[str, dict[str, float]] = {
    "wall": {"drop": 80.0, "inverted_t": 20.0},
    "single": _COLUMN_CAPS,
    "multi": _COLUMN_CAPS,
    "hammerhead": {"cantilevered": 1.0},
    "pi_frame": {"integral": 1.0},
    "y": {"drop": 1.0},
    "v": {"drop": 1.0},
}
_PAPER_CAPS = {"drop": 50.0, "tapered": 50.0}
PAPER_KINDS: tuple[PierKind, ...] = ("pi_frame",)
PAPER_KINDS_UNDER_CONCRETE: tuple[PierKind, ...] = ("single", "multi")
KINDS = {  # by the bridges for which they are drawn
    f"for caps up to {WIDEST_STEM:g} m long": _NARROW,
    f"for longer caps (no pi_frame over {WIDEST_FRAME:g} m)": _WIDE,
    IN_PAPER: dict.fromkeys(PAPER_KINDS, 1.0),
    f"{IN_PAPER} under concrete girders": dict.fromkeys(PAPER_KINDS_UNDER_CONCRETE, 1.0),
}
CAPS = {  # by the bridges for which they are drawn
    "on wall": _CAPS["wall"],
    "on single and multi": _COLUMN_CAPS,
    "on hammerhead": _CAPS["hammerhead"],
    "on pi_frame": _CAPS["pi_frame"],
    "on y and v": _CAPS["y"],
    f"{IN_PAPER} on single and multi": _PAPER_CAPS,
}
USES = (  # the keys of `[bridge.pier]` that only some piers have
    Use("kind", ("wall", "single", "multi", "hammerhead"), ("column_shape",)),
    Use("kind", ("multi", "pi_frame"), ("diameter",)),
    Use("kind", ("single", "hammerhead", "y", "v"), ("hammerhead_diameter",)),
    Use("kind", ("wall",), ("wall_thickness", "wall_share")),
    Use("kind", ("single", "multi", "hammerhead"), ("taper",)),
    Use("cap", ("tapered", "cantilevered"), ("taper",)),
    Use("columns", (2, 3, 4, 5), ("diameter",)),
    Use("columns", (1,), ("hammerhead_diameter",)),
    Use("columns", LEFT_OUT, ("wall_thickness", "wall_share")),
    Use("battered", (True,), ("batter",)),
)


def choose_kind(
    fixed: tuple[PierKind | None, CapKind | None, int | None],
    cap_length: float,
    upstand: float,
    draws: Draws,
    paper_kinds: tuple[PierKind, ...] = (),
) -> tuple[str, str]:
    """Take or draw the kind of pier and the kind of its cap.

    Args:
        fixed: Kind, cap and number of columns that the user set.
        cap_length: Length of the cap [m].
        upstand: Room for an inverted T's stem between the rows of plinths [m].
        draws: Random stream and profile of the bridge.
        paper_kinds: The kinds to draw from, if not empty.

    Raises:
        InputError: The given values exclude each other, or the deck is too wide for them.
    """
    kind, cap, columns = fixed
    weights = dict.fromkeys(map(str, paper_kinds), 1.0) or (_NARROW if cap_length <= WIDEST_STEM else _WIDE)
    if cap_length > WIDEST_FRAME and not paper_kinds:
        weights = {name: weight for name, weight in weights.items() if name != "pi_frame"}
    possible = weights if kind is None else {str(kind): 1.0}
    suited = {k: w for k, w in possible.items() if _suits(k, cap, columns)}
    if kind is None and not any(cap_length <= _widest(k) for k in suited):
        # The user's settings need a kind that would not be drawn here.
        suited = {k: 1.0 for k in _NARROW if _suits(k, cap, columns)} or suited
    if not suited:
        raise _contradiction(kind, cap, columns)
    suited = {k: w for k, w in suited.items() if cap_length <= _widest(k)} or suited
    share = draws.random()
    chosen = weighted_choice(possible, share)
    if chosen not in suited:  # only kinds that do not fit the user's values are drawn again
        chosen = weighted_choice(suited, share)
    _check_width(chosen, fixed, cap_length)
    caps = _PAPER_CAPS if paper_kinds and chosen in ("single", "multi") else _CAPS[chosen]
    caps = {name: w for name, w in caps.items() if name != "inverted_t" or upstand >= LEAST_UPSTAND}
    drawn_cap = draws.choose(caps)
    if cap == "inverted_t" and upstand < LEAST_UPSTAND:
        raise InputError(
            f"leaves only {upstand:.2f} m for the stem of the inverted T between two rows of plinths",
            field="bridge.pier.cap",
            value=cap,
            allowed=f"at least {LEAST_UPSTAND:g} m; here drop or tapered",
            hint=f"Choose another cap{' or shorter plinths' if upstand > 0.0 else ''}, or leave the cap out",
        )
    return chosen, cap or drawn_cap


def column_count(kind: str, width: float, cap_length: float, diameter: float, share: float) -> int:
    """Take as many columns as the deck's width needs, or one more, and no more than fit the cap.

    Args:
        kind: Kind of pier; only `multi` has a free number.
        width: Deck width [m].
        cap_length: Length of the cap [m].
        diameter: Of a column [m].
        share: Random number from 0 to 1: from 0.5 on one more [1].
    """
    if kind != "multi":
        return _COLUMNS.get(kind, 1)
    room = max(2, int(cap_length / (_CLEAR_PITCH * diameter)))  # a short cap under a narrow box has room for few
    least = max(2, int(np.ceil(0.8 * width / _COLUMN_PITCH)))
    return min(least + int(2.0 * share), 5, room)


def check_columns(columns: int | None, diameter: float | None, pitch: float, share: float) -> None:
    """Refuse a given number of columns that would be too thin on their cap, or thinner than their given diameter.

    Args:
        columns: Number that the user set; None: it was drawn to fit.
        diameter: Diameter that the user set [m].
        pitch: Distance between the columns [m].
        share: Width of a column over that diameter [1].
    """
    least = share * (diameter or LEAST_DIAMETER) + 2.0 * APART
    if columns is None or columns < 2 or pitch >= least - 1e-9:
        return
    most = int(pitch * (columns - END_SHARE) / least + END_SHARE)
    raise UnsuitedDeck(
        f"columns {pitch:.2f} m apart have no room beside each other, which takes {least:.2f} m",
        field="bridge.pier.columns",
        value=columns,
        allowed=f"at most {max(most, 1)} here",
        hint="Choose fewer or thinner columns, or a wider deck",
    )


def _suits(kind: str, cap: str | None, columns: int | None) -> bool:
    if cap is not None and cap not in _CAPS[kind]:
        return False
    return {
        "multi": columns is None or columns > 1,
        "pi_frame": columns in (None, 2),
        "single": columns in (None, 1),
        "hammerhead": columns in (None, 1),
    }.get(kind, columns is None)


def _contradiction(kind: str | None, cap: str | None, columns: int | None) -> InputError:
    if kind is not None and cap is not None and cap not in _CAPS[kind]:
        return InputError(
            f"a pier of kind {kind} has no such cap",
            field="bridge.pier.cap",
            value=cap,
            allowed=" or ".join(_CAPS[kind]),
            hint="Change the cap or the kind, or leave one of them out",
        )
    if kind is None:
        return InputError(
            f"a pier of {columns} columns has no cap {cap}",
            field="bridge.pier.cap",
            value=cap,
            allowed="drop, tapered or inverted_t",
            hint="Leave one of them out",
        )
    allowed = {"multi": "2 to 5", "pi_frame": "2", "single": "1", "hammerhead": "1"}.get(kind, "none: leave it out")
    return InputError(
        f"not a number of columns for a pier of kind {kind}",
        field="bridge.pier.columns",
        value=columns,
        allowed=allowed,
        hint="Change the number or the kind, or leave one of them out",
    )


def _widest(kind: str) -> float:
    """Look up the longest cap that a kind of pier carries [m]."""
    return {"wall": 1e9, "multi": 1e9, "pi_frame": WIDEST_FRAME + 4.0}.get(kind, WIDEST_STEM + 3.0)


def _check_width(chosen: str, fixed: tuple[PierKind | None, CapKind | None, int | None], cap_length: float) -> None:
    """Refuse a deck that is too wide for the kind; `fixed`: kind, cap and number of columns that the user set."""
    widest = _widest(chosen)
    if cap_length > widest:
        key, value = next(
            (pair for pair in zip(("kind", "cap", "columns"), fixed, strict=True) if pair[1]), ("kind", None)
        )
        raise UnsuitedDeck(
            f"a pier of kind {chosen} cannot carry a cap {cap_length:.1f} m long",
            field=f"bridge.pier.{key}",
            value=value,
            allowed=f"caps up to {widest:g} m; here multi or wall, 2 columns or more",
            hint="Choose one of these, or a narrower deck",
        )
