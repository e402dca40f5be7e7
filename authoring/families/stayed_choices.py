"""Settings of a cable-stayed bridge, and the random draw of its kind and its spans."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar, Literal, NoReturn

from pydantic import Field

from authoring.families.alignments import STRAIGHT_AND_SQUARE
from authoring.parts.box_decks import DeckKind
from authoring.parts.deck_top import DeckTop, SuitedTop
from authoring.parts.drawing import Draws, chosen, chosen_by, draw, drawn, option_at
from authoring.parts.fittings import PIPES_AND_CONDUITS
from authoring.parts.gangways import BOXES, gangways_chosen
from authoring.parts.idle_settings import Use
from authoring.parts.piers import BETWEEN_TOWERS
from authoring.parts.pylons import PylonShape
from authoring.parts.roadway import RoadwaySettings
from authoring.parts.stays import Arrangement
from authoring.streams import weighted_choice
from groundwork.errors import InputError
from groundwork.settings import Settings

_SHAPES = {"a": 0.20, "h": 0.25, "portal": 0.20, "diamond": 0.20, "mast": 0.15}
_LEANING_STAYS = {"fan": 0.45, "semi_fan": 0.55}
_ARRANGEMENTS = {
    "a": _LEANING_STAYS,
    "h": {"fan": 0.25, "semi_fan": 0.50, "harp": 0.25},
    "portal": {"fan": 0.15, "semi_fan": 0.35, "harp": 0.50},
    "diamond": _LEANING_STAYS,
    "mast": {"fan": 0.30, "semi_fan": 0.40, "harp": 0.30},
}
_PLANES = {"mast": {1: 1.0}, "diamond": {1: 0.3, 2: 0.7}, "h": {2: 1.0}}
_DECKS = {
    1: {"concrete_box": 0.60, "steel_box": 0.40},
    2: {"edge_beam": 0.45, "plate_girder": 0.30, "steel_box": 0.25},
}
_UNDER_ONE = frozenset(_DECKS[1]) - frozenset(_DECKS[2])  # decks that two planes do not carry
_ONE_PLANE_SHAPES = {shape: _SHAPES[shape] for shape in ("diamond", "mast")}
_HARP_SHAPES = {"mast": 1.0}  # of these, with upright stays
_PITCHES = {
    ("compact", True): (3.5, 5.5),
    ("compact", False): (5.0, 8.0),
    ("realistic", True): (5.0, 10.0),
    ("realistic", False): (10.0, 16.0),
}
_LEANING = ("a", "diamond")
_UPRIGHT = ("h", "portal", "mast")
_DIAMETERS = {"compact": (0.06, 0.12), "realistic": (0.10, 0.25)}
# [m] whole bridge; shorter bridges are built as girders: pylons and stays are not economical there
_TOTAL = {"compact": {1: (100.0, 230.0), 2: (130.0, 250.0)}, "realistic": {1: (144.0, 480.0), 2: (144.0, 480.0)}}
_LEAST_MAIN = {1: 55.0, 2: 70.0}  # [m] drawn
LEAST_PITCH = 2.5  # [m]
_PAPER_HEIGHT = 36.0  # [m] of the paper's pylons


class CableStayedSettings(Settings):
    """A cable-stayed bridge; omitted values are drawn at random."""

    uses: ClassVar = (
        Use("pylons", (2,), ("side_ratio", "height_ratio")),
        Use("pylons", (1,), ("back_ratio", "single_height_ratio")),
        Use("shape", ("a", "h", "diamond", "mast"), ("strip",)),
        Use("arrangement", ("semi_fan",), ("zone",)),
        Use("deck", BOXES, ("gangways",)),
    )
    shared_uses: ClassVar = (
        *STRAIGHT_AND_SQUARE,
        PIPES_AND_CONDUITS,
        *(
            Use(choice, options, ("roadway.divided", "roadway.median"))
            for choice, options in (
                ("planes", (2,)),
                ("shape", ("a", "h", "portal", "diamond")),
                ("deck", ("edge_beam", "plate_girder", "steel_box")),
            )
        ),
        Use("anchor_piers", (True,), BETWEEN_TOWERS),
    )
    size: Literal["compact", "realistic"] | None = chosen(
        {"compact": 0.7, "realistic": 0.3},
        "Size of the bridge: compact 100 to 250 m long, realistic 144 to 480 m long; `main` may be up to 400 m",
        paper={"compact": 1},
    )
    pylons: Literal[1, 2] | None = chosen({1: 0.4, 2: 0.6}, "Number of pylons")
    shape: PylonShape | None = chosen(
        _SHAPES,
        "Shape of the pylons",
        among="; a mast needs a road with an even number of lanes, a and diamond need a high deck: otherwise h "
        "replaces them",
    )
    arrangement: Arrangement | None = chosen_by(
        {"on a and diamond": _LEANING_STAYS, **{f"on {shape}": _ARRANGEMENTS[shape] for shape in _UPRIGHT}},
        "Arrangement of the stays in elevation",
    )
    planes: Literal[1, 2] | None = chosen_by(
        {"on a mast": _PLANES["mast"], "on a diamond": _PLANES["diamond"], "on other shapes": _PLANES["h"]},
        "Number of planes of stays",
    )
    deck: DeckKind | None = chosen_by({"under two planes": _DECKS[2], "under one plane": _DECKS[1]}, "Deck")
    main: float | None = Field(
        default=None, ge=30.0, le=400.0, description="Main span [m]; drawn from a range that depends on `size`"
    )
    side_ratio: float | None = drawn(
        0.35, 0.45, "Side span over main span with two pylons [1]", ge=0.30, le=0.50, paper=(0.40, 0.50)
    )
    back_ratio: float | None = drawn(
        0.65, 1.0, "Side span over main span with one pylon [1]", ge=0.45, le=1.0, paper=(1.0, 1.0)
    )
    height_ratio: float | None = drawn(
        0.20, 0.25, "Height of two pylons above the deck, over the main span [1]", ge=0.12, le=0.35
    )
    single_height_ratio: float | None = drawn(
        0.40, 0.45, "Height of one pylon above the deck, over the main span [1]", ge=0.25, le=0.60
    )
    air: float | None = drawn(
        0.03,
        0.05,
        "Lowest height of the deck's soffit above z = 0, over the main span [1]",
        ge=0.0,
        le=0.15,
        paper=(0.0, 0.0),
    )
    anchor_piers: bool | None = chosen(
        {True: 0.6, False: 0.4}, "Anchor piers, at most 36 m apart, under side spans of 40 m or more", paper={False: 1}
    )
    zone: float | None = drawn(
        0.55, 0.68, "Height of the lowest anchor of a semi-fan over the pylon's height [1]", ge=0.40, le=0.85
    )
    pitch: float | None = Field(
        default=None,
        ge=LEAST_PITCH,
        le=20.0,
        description="Distance between the lower anchors of the stays [m]; drawn compact 3.5 to 5.5 (concrete) or 5 to "
        "8 (steel), realistic 5 to 10 or 10 to 16; in profile paper 7 stays on each side",
    )
    stay_diameter: float | None = Field(
        default=None,
        ge=0.05,
        le=0.30,
        description="Diameter of a stay with its sheath [m]; drawn compact 0.06 to 0.12, realistic 0.10 to 0.25, "
        "but more where the load needs it; in profile paper 0.10",
    )
    slenderness: float | None = drawn(100.0, 250.0, "Main span over the deck's depth; the depth has a minimum [1]")
    slab: float | None = drawn(0.22, 0.28, "Thickness of the deck slab [m]", ge=0.18, le=0.45)
    strip: float | None = drawn(
        0.7, 1.1, "Width of the edge strip outside the parapets, where stays are anchored [m]", ge=0.5, le=2.4
    )
    leg: float | None = drawn(0.9, 1.15, "Factor for the section of the pylons' legs [1]", ge=0.7, le=1.6)
    overhang: float | None = drawn(0.40, 0.55, "Length of the deck beyond its last bearing line [m]", ge=0.30, le=0.80)
    gap: float | None = drawn(0.06, 0.12, "Width of the expansion gaps at the abutments [m]", ge=0.03, le=0.20)
    gangways: bool | None = gangways_chosen()


@dataclass(frozen=True)
class Choice:
    """The kind of a cable-stayed bridge.

    Attributes:
        size: `compact` or `realistic`.
        pylons: 1 or 2.
        shape: Shape of the pylons.
        arrangement: Arrangement of the stays.
        planes: Number of planes of stays, 1 or 2.
        deck: Kind of deck.
        main: Main span [m].
        side: Side span [m].
        pitch: Wanted distance between feet [m]; 0 for seven stays.
        diameter: Diameter of a stay [m].
    """

    size: str
    pylons: int
    shape: PylonShape
    arrangement: Arrangement
    planes: int
    deck: DeckKind
    main: float
    side: float
    pitch: float
    diameter: float

    @property
    def supports(self) -> tuple[float, ...]:
        """Stations of the bearing lines [m]."""
        total = round(self.main + self.side * (2 if self.pylons == 2 else 1), 3)
        return (0.0, self.side, round(self.side + self.main, 3), total)[: 2 + self.pylons]


@dataclass(frozen=True)
class RandomDraws:
    """Random numbers for the kind of a bridge, drawn before checking which kinds fit.

    Attributes:
        size: Share of the sizes [1].
        pylons: Share of their number [1].
        shape: Share of the shapes [1].
        arrangement: Share of the arrangements [1].
        planes: Share of the number of planes [1].
        deck: Share of the kinds of deck [1].
        ratios: Side span over main span [1] with two pylons and with one.
        main: Share of the main spans [1].
        pitch: Share of the pitches [1].
        diameter: Share of the diameters [1].
        profile: `default` or `paper`.
    """

    size: float
    pylons: float
    shape: float
    arrangement: float
    planes: float
    deck: float
    ratios: tuple[float, float]
    main: float
    pitch: float
    diameter: float
    profile: str


def draw_random(settings: CableStayedSettings, draws: Draws) -> RandomDraws:
    """Draw all values that the kind of a bridge depends on.

    Args:
        settings: Values set by the user.
        draws: Random stream and profile of the bridge.
    """
    size, pylons, shape, arrangement, planes, deck = (draws.random() for _ in range(6))
    ratios = draw(settings, "side_ratio", draws), draw(settings, "back_ratio", draws)
    main = 0.5 * (draws.random() + draws.random())
    pitch, diameter = draws.random(), draws.random()
    return RandomDraws(size, pylons, shape, arrangement, planes, deck, ratios, main, pitch, diameter, draws.profile)


def suited_top(settings: CableStayedSettings) -> SuitedTop | None:
    """State which decks suit a single plane of stays, if the user set one; None if any does.

    Args:
        settings: Values set by the user.
    """
    one_plane = settings.planes == 1 or settings.deck in _UNDER_ONE or settings.shape == "mast"
    return SuitedTop(("road",), (2, 4, 6)) if one_plane else None


def beside_median(settings: CableStayedSettings, roadway: RoadwaySettings) -> CableStayedSettings:
    """Ask for two planes of stays, if a raised median is set, which one plane would replace, and they are open.

    Args:
        settings: Values set by the user.
        roadway: Values set by the user for the road.
    """
    free = settings.planes is None and suited_top(settings) is None
    return settings.model_copy(update={"planes": 2}) if roadway.divided and free else settings


def choose(settings: CableStayedSettings, top: DeckTop, randoms: RandomDraws, fits: Callable[[Choice], bool]) -> Choice:
    """Choose the kind of the bridge and its spans.

    The shape is decided first: an H replaces a drawn shape whose legs do not fit, or a mast if the stays have one
    plane. This is checked both for the drawn
    bridge and for the bridge with the user's values, so that requesting the drawn values changes nothing.

    Args:
        settings: Values set by the user.
        top: Surfacing, parapets and fittings of the deck.
        randoms: Random numbers for the values that the user did not set.
        fits: Checks whether legs and stays of such a bridge are outside the traffic's clearance.
    """
    divided = top.roadway is not None and top.roadway.lanes % 2 == 0
    one_plane = settings.planes == 1 or settings.deck in _UNDER_ONE
    if settings.shape is not None:
        return _choice(settings, settings.shape, randoms, divided)
    shape = weighted_choice(_SHAPES, randoms.shape)
    if one_plane and (shape not in _PLANES or shape == "h" or (shape == "diamond" and settings.arrangement == "harp")):
        shape = weighted_choice(_HARP_SHAPES if settings.arrangement == "harp" else _ONE_PLANE_SHAPES, randoms.shape)
    two_planes = settings.planes == 2 or settings.deck in set(_DECKS[2]) - set(_DECKS[1])
    if (two_planes or not divided) if shape == "mast" else (shape in _LEANING and settings.arrangement == "harp"):
        shape = "h"  # values set by the user have priority
    if one_plane:
        choice = _choice(settings, shape, randoms, divided)
        return choice if shape == "mast" or fits(choice) else _choice(settings, "mast", randoms, divided)
    if shape == "h":
        return _choice(settings, shape, randoms, divided)
    open_settings = settings.model_copy(update={"arrangement": None, "planes": None, "deck": None})
    as_drawn = _choice(open_settings, shape, randoms, divided)
    if not fits(as_drawn):
        return _choice(settings, "h", randoms, divided)
    choice = _choice(settings, shape, randoms, divided)
    return choice if choice == as_drawn or fits(choice) else _choice(settings, "h", randoms, divided)


def _choice(settings: CableStayedSettings, shape: str, randoms: RandomDraws, divided: bool) -> Choice:
    """Assemble a bridge of one shape."""
    paper = randoms.profile == "paper"
    size = option_at(settings, "size", randoms.size, randoms.profile)
    pylons = option_at(settings, "pylons", randoms.pylons, randoms.profile)
    arrangement = settings.arrangement or weighted_choice(_ARRANGEMENTS[shape], randoms.arrangement)
    single = shape == "mast" or (divided and settings.deck in (None, *_DECKS[1]))
    planes = weighted_choice(_PLANES.get(shape if single else "h", _PLANES["h"]), randoms.planes)
    planes = settings.planes or (1 if settings.deck in _UNDER_ONE else planes)
    _refuse(settings, shape, arrangement, planes, divided)
    deck = settings.deck or weighted_choice(_DECKS[planes], randoms.deck)
    if deck not in _DECKS[planes]:
        _wrong("deck", deck, f"{', '.join(_DECKS[planes])} under {planes} plane(s) of stays", "Choose one of them")
    side_ratio = randoms.ratios[0] if pylons == 2 else randoms.ratios[1]
    main = settings.main or _main(size, pylons, side_ratio, randoms)
    low, high = _PITCHES[size, deck in ("edge_beam", "concrete_box")]
    pitch = settings.pitch or (0.0 if paper else round(low + randoms.pitch * (high - low), 2))
    low, high = (0.10, 0.10) if paper else _DIAMETERS[size]
    diameter = settings.stay_diameter or round(low + randoms.diameter * (high - low), 3)
    side = round(main * side_ratio, 1)
    return Choice(size, pylons, shape, arrangement, planes, deck, main, side, pitch, diameter)  # pyright: ignore


def drawn_main(settings: CableStayedSettings, randoms: RandomDraws) -> float:
    """Find the main span before anything is fitted to it [m].

    Args:
        settings: Values set by the user.
        randoms: Random numbers for the values that the user did not set.
    """
    size = option_at(settings, "size", randoms.size, randoms.profile)
    pylons = option_at(settings, "pylons", randoms.pylons, randoms.profile)
    return settings.main or _main(size, pylons, randoms.ratios[0 if pylons == 2 else 1], randoms)


def _main(size: str, pylons: int, ratio: float, randoms: RandomDraws) -> float:
    if randoms.profile == "paper":
        low, high = (3.0, 6.0) if pylons == 2 else (0.75, 1.5)
        return round(_PAPER_HEIGHT * (low + randoms.main * (high - low)), 1)
    low, high = _TOTAL[size][pylons]
    parts = 1.0 + ratio * (2 if pylons == 2 else 1)
    return round(max(low * (high / low) ** randoms.main / parts, _LEAST_MAIN[pylons]), 1)


def _refuse(settings: CableStayedSettings, shape: str, arrangement: str, planes: int, divided: bool) -> None:
    asked = "planes" if settings.planes else "deck"  # what needs the single plane, unless a mast does
    lanes = planes == 1 and not divided
    if planes == 1 and shape not in _ONE_PLANE_SHAPES and not (lanes and settings.shape is None):
        allowed = "2" if asked == "planes" else ", ".join(_DECKS[2])
        hint = f"Choose a mast or a diamond, or leave {asked} out"
        _wrong(asked, getattr(settings, asked), f"{allowed} with the shape {shape}", hint)
    if planes == 2 and shape == "mast":
        _wrong("planes", planes, "1 with a mast", "Leave it out")
    if lanes:
        where = "shape" if settings.shape == "mast" else asked
        _wrong(
            where,
            getattr(settings, where),
            "a road of 2, 4 or 6 lanes with room for a median",
            'Set bridge.service = "road" and bridge.roadway.lanes = 2',
        )
    if arrangement == "harp" and shape in _LEANING:
        _wrong(
            "arrangement", arrangement, "fan or semi_fan on inclined legs", "Choose shape h, portal or mast for a harp"
        )


def _wrong(field: str, value: object, allowed: str, hint: str) -> NoReturn:
    raise InputError(
        "does not fit the other choices",
        field=f"bridge.cable_stayed.{field}",
        value=value,
        allowed=allowed,
        hint=hint,
    )


def with_longer_spans(choice: Choice, factor: float) -> Choice:
    """Lengthen all spans.

    Args:
        choice: Kind of the bridge.
        factor: Factor of the lengths [1].
    """
    return replace(choice, main=round(choice.main * factor, 1), side=round(choice.side * factor, 1))


def with_median(top: DeckTop, width: float) -> DeckTop:
    """Separate the directions of a road by a median for members; the family builds the median itself.

    Args:
        top: Surfacing, parapets and fittings of the deck.
        width: Of the median between the inner edge lines [m].
    """
    assert top.roadway is not None
    return replace(top, roadway=replace(top.roadway, median=width, divided=False))
