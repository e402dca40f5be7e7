"""Settings of a suspension bridge, and the random draw of its kind, spans and cables."""

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from authoring.families.alignments import STRAIGHT_AND_SQUARE
from authoring.parts.drawing import Draws, chosen, draw, draw_option, drawn
from authoring.parts.fittings import PIPES_AND_CONDUITS
from authoring.parts.gangways import BOXES, gangways_chosen
from authoring.parts.idle_settings import LEFT_OUT, Use
from authoring.parts.piers import BETWEEN_TOWERS
from groundwork.errors import InputError
from groundwork.settings import Settings

_TOTAL = {"compact": (140.0, 260.0), "realistic": (420.0, 640.0)}  # [m] whole bridge
_LEAST_MAIN = {"compact": 80.0, "realistic": 300.0}  # [m] drawn; shorter main spans are built as girders
_PITCHES = {"compact": (3.0, 6.0), "realistic": (8.0, 18.0)}
_OVER_DECK = (1.6, 8.0)  # [m] height of the cables' lowest point that a user may set
_SAG_RATIOS = (0.05, 0.25)  # of the sag over the main span, that a user may set [1]
_PAPER_TOWER = (30.0, 40.0)  # [m] towers of the paper's generator
_PAPER_PITCH = 2.0  # [m]
_CLOSEST = 1.5  # [m] least distance between hangers


class SuspensionSettings(Settings):
    """A suspension bridge; omitted values are drawn at random."""

    uses: ClassVar = (
        Use("side_spans", ("straight",), ("side_ratio",)),
        Use("side_spans", ("suspended",), ("suspended_ratio",)),
        Use("tower_height", LEFT_OUT, ("over_deck",)),
        Use("deck", BOXES, ("gangways",)),
    )
    shared_uses: ClassVar = (
        *STRAIGHT_AND_SQUARE,
        PIPES_AND_CONDUITS,
        Use("side_spans", ("straight",), BETWEEN_TOWERS),
    )
    size: Literal["compact", "realistic"] | None = chosen(
        {"compact": 70, "realistic": 30},
        "Size of the bridge: compact 140 to 260 m long, realistic 420 to 640 m long with a main span of at least 300 "
        "m; `main` may be up to 1000 m",
        paper={"compact": 1},
    )
    deck: Literal["steel_box", "plate_girder"] | None = chosen(
        {"steel_box": 45, "plate_girder": 55}, "Deck: closed box, or two plate girders with floor beams"
    )
    side_spans: Literal["straight", "suspended"] | None = chosen(
        {"suspended": 45, "straight": 55},
        "straight: straight backstays, side spans on piers; suspended: side spans on hangers",
        paper={"suspended": 1},
    )
    main: float | None = Field(
        default=None, ge=40.0, le=1000.0, description="Main span [m]; drawn from a range that depends on `size`"
    )
    side_ratio: float | None = drawn(
        0.20, 0.34, "Side span over main span with straight backstays [1]", ge=0.20, le=0.50, paper=(0.5, 0.5)
    )
    suspended_ratio: float | None = drawn(
        0.32, 0.50, "Side span over main span with suspended side spans [1]", ge=0.25, le=0.50, paper=(0.5, 0.5)
    )
    sag_ratio: float | None = drawn(
        1.0 / 12.0,
        1.0 / 8.0,
        "Sag ratio: sag of the main cables over the main span [1]",
        ge=_SAG_RATIOS[0],
        le=_SAG_RATIOS[1],
    )
    over_deck: float | None = drawn(
        2.0, 4.0, "Height of the lowest point of the main cables above the deck [m]", ge=_OVER_DECK[0], le=_OVER_DECK[1]
    )
    tower_height: float | None = Field(
        default=None,
        ge=7.0,
        le=140.0,
        description="Height of the saddles above the deck [m]; left out: sag plus `over_deck`. If it is given, "
        "`over_deck` follows from it, and a sag that is left out is adjusted so that the cables stay 1.6 to 8 m "
        "above the deck",
    )
    pitch: float | None = Field(
        default=None,
        ge=_CLOSEST,
        le=25.0,
        description="Distance between hangers [m]; drawn compact 3 to 6, realistic 8 to 18; in profile paper 2",
    )
    cable_ratio: float | None = drawn(
        1500.0,
        2000.0,
        "Largest main span over cable diameter; the cables are as thick as a stress of 680 MPa under dead load and "
        "traffic needs, and at least 0.14 m (compact) or 0.25 m (realistic); in profile paper 0.20 m [1]",
        ge=800.0,
    )
    hanger_diameter: float | None = drawn(
        0.04, 0.08, "Diameter of a hanger, more where the load needs it [m]", ge=0.025, le=0.15, paper=(0.10, 0.10)
    )
    slenderness: float | None = drawn(150.0, 300.0, "Main span over the deck's depth; the depth has a minimum [1]")
    air: float | None = drawn(
        0.03,
        0.05,
        "Lowest height of the deck's soffit above z = 0, over the main span [1]",
        ge=0.0,
        le=0.15,
        paper=(0.0, 0.0),
    )
    slab: float | None = drawn(0.20, 0.26, "Thickness of the deck slab [m]", ge=0.16, le=0.45)
    leg: float | None = drawn(0.9, 1.15, "Factor for the section of the towers' legs [1]", ge=0.7, le=1.6)
    overhang: float | None = drawn(0.40, 0.55, "Length of the deck beyond its last bearing line [m]", ge=0.30, le=0.80)
    gap: float | None = drawn(0.06, 0.12, "Width of the expansion gaps at the abutments [m]", ge=0.03, le=0.20)
    gangways: bool | None = gangways_chosen()


@dataclass(frozen=True)
class SuspensionChoice:
    """The kind of a suspension bridge and its main lines.

    Attributes:
        size: `compact` or `realistic`.
        deck: `steel_box` or `plate_girder`.
        suspended: Whether hangers carry the side spans.
        main: Main span [m].
        side: Side span [m].
        crown: Height of the cables' axis in the saddles above the deck [m].
        low: Height of the cables' lowest point above the deck [m].
        pitch: Wanted distance between hangers [m].
        cable: Diameter of a main cable [m].
        hanger: Diameter of a hanger [m].
        slenderness: Main span over the deck's depth [1].
    """

    size: str
    deck: Literal["steel_box", "plate_girder"]
    suspended: bool
    main: float
    side: float
    crown: float
    low: float
    pitch: float
    cable: float
    hanger: float
    slenderness: float

    @property
    def supports(self) -> tuple[float, float, float, float]:
        """Stations of abutments and towers [m]."""
        return 0.0, self.side, round(self.side + self.main, 3), round(2.0 * self.side + self.main, 3)


def choose_suspension(settings: SuspensionSettings, draws: Draws) -> SuspensionChoice:
    """Draw the kind of the bridge, its spans and its cables.

    Args:
        settings: Values set by the user.
        draws: Random stream and profile of the bridge.
    """
    paper = draws.profile == "paper"
    size, deck = draw_option(settings, "size", draws), draw_option(settings, "deck", draws)
    suspended = draw_option(settings, "side_spans", draws) == "suspended"
    ratio = draw(settings, "side_ratio", draws), draw(settings, "suspended_ratio", draws)
    side_ratio = ratio[1] if suspended else ratio[0]
    share, tower_share = 0.5 * (draws.random() + draws.random()), draws.random()
    low, high = _TOTAL[size]
    main = round(max(low * (high / low) ** share / (1.0 + 2.0 * side_ratio), _LEAST_MAIN[size]), 1)
    tower = _PAPER_TOWER[0] + tower_share * (_PAPER_TOWER[1] - _PAPER_TOWER[0])
    main = settings.main or (round(tower * (3.0 + 3.0 * share), 1) if paper else main)
    sag, over = draw(settings, "sag_ratio", draws) * main, draw(settings, "over_deck", draws)
    if paper and settings.sag_ratio is None and settings.tower_height is None:
        sag = 0.65 * tower - over  # sag from 90 % of the tower's height to the deck at 25 % of it
        sag = float(np.clip(sag, _SAG_RATIOS[0] * main, _SAG_RATIOS[1] * main))  # where the main span is set
    if settings.tower_height and settings.sag_ratio is None:
        sag = float(np.clip(sag, settings.tower_height - _OVER_DECK[1], settings.tower_height - _OVER_DECK[0]))
    low, high = _PITCHES[size]
    drawn_pitch = round(low + draws.random() * (high - low), 2)
    crown = settings.tower_height or round(sag + over, 2)
    low = round(crown - sag, 3)
    thinnest = 0.14 if size == "compact" else 0.25
    ratio = settings.cable_ratio if paper else draw(settings, "cable_ratio", draws)
    cable = 0.20 if ratio is None else round(max(main / ratio, thinnest), 3)
    hanger = draw(settings, "hanger_diameter", draws)
    return SuspensionChoice(
        size,
        deck,
        suspended,
        main,
        round(main * side_ratio, 1),
        crown,
        low,
        settings.pitch or (_PAPER_PITCH if paper else drawn_pitch),
        cable,
        hanger,
        draw(settings, "slenderness", draws),
    )


def check_sag(settings: SuspensionSettings, choice: SuspensionChoice) -> None:
    """Refuse cables that pass through the deck or high above it, and towers too low for any sag.

    Args:
        settings: Values set by the user.
        choice: Kind of the bridge.
    """
    low, sag = choice.low, choice.crown - choice.low
    ratio = sag / choice.main
    if settings.sag_ratio is None and not _SAG_RATIOS[0] - 1e-9 <= ratio <= _SAG_RATIOS[1] + 1e-9:
        lowest = round(_SAG_RATIOS[0] * choice.main + _OVER_DECK[0], 2)
        highest = round(_SAG_RATIOS[1] * choice.main + _OVER_DECK[1], 2)
        raise InputError(
            f"does not fit a main span of {choice.main:g} m",
            field="bridge.suspension.tower_height",
            value=choice.crown,
            allowed=f"{lowest:g} to {highest:g} m here",
            hint=f"The nearest valid value is {lowest if choice.crown < lowest else highest:g} m",
        )
    if _OVER_DECK[0] - 1e-9 <= low <= _OVER_DECK[1] + 1e-9:
        return
    through = low < _OVER_DECK[0]
    side, bound = ("most", _OVER_DECK[0]) if through else ("least", _OVER_DECK[1])
    other = "least" if through else "most"
    fitting = (choice.crown - bound) / choice.main
    ratio_told = f"a sag ratio of at {side} {fitting:.4f}, or " if fitting <= _SAG_RATIOS[1] else ""
    raise InputError(
        f"saddles {choice.crown:g} m above the deck and a sag of {sag:.2f} m put the lowest point of the cables "
        f"{low:.2f} m above the deck",
        field="bridge.suspension.sag_ratio" if settings.sag_ratio else "bridge.suspension.tower_height",
        value=settings.sag_ratio or settings.tower_height,
        allowed=f"{ratio_told}a tower height of at {other} {sag + bound:.2f} m here",
        hint="Choose a higher tower or a smaller sag" if through else "Choose a lower tower or a larger sag",
    )


def hanger_stations(
    low: float, high: float, pitch: float, least: float = 0.0, *, drawn_pitch: bool = False
) -> tuple[float, ...]:
    """Place hangers evenly.

    Args:
        low: Station of the first [m].
        high: Station of the last [m].
        pitch: Wanted distance [m].
        least: Least distance at which their clamps are clear of each other [m].
        drawn_pitch: Whether the distance was drawn; then it is reduced if there is no room for three.

    Returns:
        Stations, rising, the first and the last as given [m].

    Raises:
        InputError: There is no room for three, or they are too close.
    """
    closest = max(_CLOSEST, least)
    if high - low < 2.0 * closest:
        raise InputError(
            f"leaves a length of {high - low:.1f} m for three hangers",
            field="bridge.suspension.main",
            allowed=f"hangers at least {closest:.2f} m apart",
            hint="Choose a longer main span, or longer side spans",
        )
    bays = round((high - low) / pitch)
    if bays < 2 and drawn_pitch:
        bays = 2
    if bays < 2:
        raise InputError(
            f"leaves no room for three hangers on a length of {high - low:.1f} m",
            field="bridge.suspension.pitch",
            value=pitch,
            allowed=f"at most {0.5 * (high - low):.1f} m here",
            hint="Reduce it, or choose longer spans",
        )
    if (high - low) / bays < least:
        fitting = (high - low) / (int((high - low) / least) + 0.5)
        raise InputError(
            f"leaves no room between hangers, whose clamps need {least:.3f} m",
            field="bridge.suspension.pitch",
            value=pitch,
            allowed=f"at least {np.ceil(100.0 * fitting + 1e-6) / 100.0:.2f} m here",
            hint="Increase it",
        )
    return tuple(round(float(s), 6) for s in np.linspace(low, high, bays + 1))
