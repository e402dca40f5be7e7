"""Draw the axis of a bridge: straight, arc, clothoids, S or wave in plan; grade, crest or sag; crossfall and skew."""

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from authoring.axis.alignment import Alignment, VerticalCurve
from authoring.axis.plan_curve import Element, PlanCurve, sine_elements
from authoring.axis.road_section import ABUTMENT_BACK
from authoring.parts.drawing import Draws, chosen, draw, draw_option, drawn
from authoring.parts.idle_settings import Use
from authoring.streams import told_shares
from groundwork.errors import InputError
from groundwork.settings import Settings

LARGEST_TURN = float(np.radians(35.0))  # largest angle between the axis and its chord
LEAST_RADIUS = {"road": 60.0, "rail": 300.0}  # [m], over the squared cosine of the skew
STEEPEST = {"road": 0.05, "rail": 0.025}  # [1]
WAVE_RADIUS = 150.0  # [m], least of a sine wave
FADE = 15.0  # [m] least length of a change of crossfall
EDGE_RISE = 0.015  # [1] largest rise of a deck's edge relative to the axis
RAIL_PITCH = 1.505  # [m] between the middles of two rails: crossfall is cant divided by this
_SPAN_RADII = 5.0  # least drawn radius in spans: precast girders are not curved more
_SQUARE = {"skewed": 0.4, "square": 0.6}
_SIZES = {  # sizes that not every axis has: the key of the choice, and the options with this size, first the usual one
    "radius": ("kind", ("arc", "clothoid", "s")),
    "amplitude": ("kind", ("sine",)),
    "wave": ("kind", ("sine",)),
    "crest_radius": ("profile", ("crest", "sag")),
}
_MAY_BEND = ("beam", "girder", "slab")
STRAIGHT_AND_SQUARE = (  # rules of the families whose axes are straight, with square supports and without crest
    Use("", _MAY_BEND, ("alignment.kind",), plain="straight"),
    Use("", _MAY_BEND, ("alignment.skew",), plain=0.0),
    Use("", _MAY_BEND, ("alignment.profile",), plain="grade"),
    Use("", _MAY_BEND, tuple(f"alignment.{key}" for key in (*_SIZES, "turn", "spiral", "superelevation", "cant"))),
)


class AlignmentSettings(Settings):
    """The axis of a bridge; omitted values are drawn at random.

    Source: shares, radii, grades, crossfalls and skews by common road and rail practice; the wave by the public Random
    Bridge Generator.
    """

    uses: ClassVar = (
        Use("kind", ("arc", "clothoid", "s", "sine"), ("turn",)),
        Use("kind", ("clothoid", "s"), ("spiral",)),
        Use("kind", ("arc", "clothoid", "s"), ("superelevation", "cant"), drawn=False),
    )
    kind: Literal["straight", "arc", "clothoid", "s", "sine"] | None = chosen(
        {"straight": 40, "arc": 30, "clothoid": 20, "s": 10},
        "Axis in plan. clothoid: an arc between two clothoids; s: two opposite arcs with a clothoid between them",
        paper={"sine": 1},
    )
    turn: Literal["left", "right"] | None = chosen({"left": 50, "right": 50}, "Direction of the first curve")
    radius: float | None = drawn(
        60.0,
        900.0,
        "Radius of the arcs [m]; railways at least 300; if it is set but `kind` is not, an axis that would be straight "
        "or a sine becomes an arc; drawn log-uniformly",
        le=20_000.0,
    )
    spiral: float | None = drawn(
        0.20, 0.35, "Length of a clothoid, as a share of the bridge's length [1]", ge=0.05, le=0.45
    )
    amplitude: float | None = drawn(
        0.0, 20.0, "Amplitude a of the sine a sin(x / b) [m]; if it is set but `kind` is not, the axis is a sine"
    )
    wave: float | None = drawn(
        60.0,
        1000.0,
        "Scale b of the sine a sin(x / b) [m]; b^2 / a is at least 150 m; if it is set but `kind` is not, the axis is "
        "a sine",
        paper=(20.0, 1000.0),
    )
    profile: Literal["grade", "crest", "sag"] | None = chosen(
        {"grade": 60, "crest": 30, "sag": 10},
        "Vertical alignment: a straight grade, or a parabola over the bridge",
        paper={"grade": 1},
    )
    crest_radius: float | None = drawn(
        600.0,
        4000.0,
        "Radius of the crest or sag [m]; if it is set but `profile` is not, a profile that would be a grade becomes a "
        "crest",
        ge=300.0,
        le=50_000.0,
    )
    superelevation: float | None = drawn(0.02, 0.06, "Superelevation of a road in arcs [1]", ge=0.0, le=0.06)
    cant: float | None = drawn(0.03, 0.15, "Cant of a track in arcs, measured over 1.505 m [m]", ge=0.0, le=0.15)
    skew: float | None = drawn(
        5.0,
        30.0,
        f"Skew of the supports, to either side; 0 is square [deg]; bridges are {told_shares(_SQUARE)}",
        ge=-30.0,
    )


@dataclass(frozen=True)
class Carried:
    """Data of a bridge for which an axis is drawn.

    Attributes:
        supports: Stations of the bearing lines, abutments first and last [m].
        half_width: Half the deck's width [m].
        service: `road` or `rail`.
        straight: Arches and cables need a straight axis with square supports and no crest.
    """

    supports: tuple[float, ...]
    half_width: float
    service: str
    straight: bool


def draw_alignment(
    settings: AlignmentSettings, carried: Carried, mean_grade: tuple[float, bool], draws: Draws
) -> Alignment:
    """Draw an axis; its height is that of a finished surface that begins at 0.

    Args:
        settings: Values set by the user.
        carried: The bridge.
        mean_grade: Rise of the road per meter, mean over the bridge [1], and whether it was drawn.
        draws: Random stream and profile of the bridge.

    Raises:
        InputError: A value set by the user does not fit the bridge.
    """
    supports, half_width, service = carried.supports, carried.half_width, carried.service
    length, paper, (grade, free) = supports[-1], draws.profile == "paper", mean_grade
    kind, profile, turn = (draw_option(settings, key, draws) for key in ("kind", "profile", "turn"))
    radius_share, skewed, skew_sign = (
        draws.random(),
        draws.choose(_SQUARE) == "skewed",
        1.0 if draws.random() < 0.5 else -1.0,
    )
    sizes = {
        key: draw(settings, key, draws)
        for key in ("spiral", "amplitude", "wave", "crest_radius", "superelevation", "cant", "skew")
    }
    if carried.straight:
        kind, profile, skew = "straight", "grade", 0.0
    else:
        kind, profile = _with_sizes(settings, "kind", kind), _with_sizes(settings, "profile", profile)
        drawn_skew = skew_sign * sizes["skew"] if skewed and not paper else 0.0
        skew = float(np.radians(settings.skew if settings.skew is not None else drawn_skew))
    if settings.skew is None and settings.radius is not None:  # values set by the user have priority
        widest = float(np.arccos(np.sqrt(min(LEAST_RADIUS[service] / settings.radius, 1.0))))
        skew = float(np.clip(skew, -widest, widest)) + 0.0
    if profile != "grade" and free and settings.crest_radius is not None:  # so that the ends are not too steep
        room = max(STEEPEST[service] - 0.5 * length / settings.crest_radius, 0.0)
        grade = float(np.trunc(1e6 * np.clip(grade, -room, room)) / 1e6)
    _check_grade(grade, service)
    least = LEAST_RADIUS[service] / np.cos(skew) ** 2
    plan: tuple[Element, ...] = ()
    falls: tuple[tuple[float, float], ...] = ()
    sign = 1.0 if turn == "left" else -1.0
    if kind == "sine":
        plan = _wave(settings, sign * sizes["amplitude"], sizes["wave"], length, max(least, WAVE_RADIUS))
    elif kind != "straight":
        radius = _radius(settings, kind, sizes["spiral"], supports, least, radius_share)
        plan = _elements(kind, sign / radius, sizes["spiral"], length)
        fall = sizes["cant"] / RAIL_PITCH if service == "rail" else sizes["superelevation"]
        if kind == "s" and (settings.cant if service == "rail" else settings.superelevation) is None:
            fall = min(fall, round(0.4 * length * EDGE_RISE / half_width, 4))  # an S changes sides over a short length
        falls = _falls(kind, -sign * fall, sizes["spiral"] * length, length, half_width)
    crest = _crest(settings, profile, sizes["crest_radius"], length, abs(grade), STEEPEST[service])
    begin = grade if crest is None else round(grade + 0.5 * length / crest.radius, 6)
    return Alignment(0.0, begin, plan=plan, skew=skew, crest=crest, falls=falls)


def _with_sizes(settings: AlignmentSettings, key: str, option: str) -> str:
    """Replace a drawn option that has no size set by the user; refuse a size that the option set by the user lacks."""
    chosen_already = getattr(settings, key) is not None
    for size, (choice, options) in _SIZES.items():
        value = getattr(settings, size)
        if choice != key or value is None:
            continue
        if option not in options:
            if chosen_already and getattr(settings, key) is None:
                raise InputError(
                    f"no axis has this and another size that is set: each needs a {key} of its own",
                    field=f"bridge.alignment.{size}",
                    value=value,
                    hint=f"Leave one of them out, or set bridge.alignment.{key}",
                )
            if chosen_already:
                raise InputError(
                    f"has no effect with bridge.alignment.{key} = {option!r}",
                    field=f"bridge.alignment.{size}",
                    value=value,
                    allowed=f"with {key} = {' or '.join(map(repr, options))}",
                    hint=f"Set bridge.alignment.{key} to one of these, or leave {size} out",
                )
            option = options[0]
        chosen_already = True
    return option


def _check_grade(grade: float, service: str) -> None:
    steepest = STEEPEST[service]
    if abs(grade) > steepest:
        raise InputError(
            f"too steep for a {service} bridge",
            field="bridge.grade",
            value=grade,
            allowed=f"{-steepest:g} to {steepest:g}",
            hint=f"The nearest valid value is {np.copysign(steepest, grade):g}",
        )


def _elements(kind: str, curvature: float, spiral: float, length: float) -> tuple[Element, ...]:
    ramp = spiral * length
    if kind == "arc":
        return (Element(length, curvature, curvature),)
    if kind == "clothoid":
        middle = Element(length - 2.0 * ramp, curvature, curvature)
        return Element(ramp, 0.0, curvature), middle, Element(ramp, curvature, 0.0)
    arc = 0.5 * (length - ramp)
    turn = Element(ramp, curvature, -curvature)
    return Element(arc, curvature, curvature), turn, Element(arc, -curvature, -curvature)


def _falls(kind: str, fall: float, ramp: float, length: float, half_width: float) -> tuple[tuple[float, float], ...]:
    """List where the crossfall changes: it grows on the approaches and the clothoids, and changes sides in an S.

    A deck's edge rises against the axis by no more than `EDGE_RISE`, if an S is long enough for it.
    """
    if fall == 0.0:
        return ()
    run = max(FADE, half_width * abs(fall) / EDGE_RISE)
    reach = min(ramp, length / 2.0 - 0.01) if kind == "clothoid" else -ABUTMENT_BACK
    first = ((min(reach - run, 0.0), 0.0), (reach, fall))
    last = fall
    middle: tuple[tuple[float, float], ...] = ()
    if kind == "s":
        turn = min(max(ramp, 2.0 * run), 0.8 * length)
        middle, last = ((0.5 * (length - turn), fall), (0.5 * (length + turn), -fall)), -fall
    return (*first, *middle, (length - reach, last), (max(length - reach + run, length), 0.0))


def _radius(
    settings: AlignmentSettings, kind: str, spiral: float, supports: tuple[float, ...], least: float, share: float
) -> float:
    length = supports[-1]
    turning = least
    while (turn := PlanCurve(_elements(kind, 1.0 / turning, spiral, length)).largest_turn) > LARGEST_TURN:
        turning *= 1.001 * turn / LARGEST_TURN
    if settings.radius is None:
        low = max(least, turning, _SPAN_RADII * float(np.diff(supports).max()))
        return round(low * (max(900.0, 1.5 * low) / low) ** share, 1)
    if settings.radius < max(least, turning):
        rule = (
            f"the axis may turn at most {np.degrees(LARGEST_TURN):g} deg from its chord"
            if turning > least
            else f"the smallest radius of this bridge is {least:.1f} m"
        )
        raise InputError(
            f"too small: {rule}",
            field="bridge.alignment.radius",
            value=settings.radius,
            allowed=f"at least {max(least, turning):.1f} m",
            hint=f"The nearest valid value is {np.ceil(10.0 * max(least, turning)) / 10.0:.1f}",
        )
    return settings.radius


def _wave(
    settings: AlignmentSettings, amplitude: float, scale: float, length: float, least: float
) -> tuple[Element, ...]:
    """Limit the curvature of a wave, which the Random Bridge Generator does not."""
    most = scale * scale / least
    while PlanCurve(sine_elements(min(most, 20.0), scale, length)).largest_turn > LARGEST_TURN:
        most = 0.9 * min(most, 20.0)
    if settings.amplitude is not None and abs(amplitude) > most:
        raise InputError(
            f"the wave has a radius below {least:.0f} m, or turns more than 35 deg from its chord",
            field="bridge.alignment.amplitude",
            value=settings.amplitude,
            allowed=f"at most {most:.2f} m",
            hint=f"The nearest valid value is {np.floor(100.0 * most) / 100.0:.2f}, or a larger bridge.alignment.wave",
        )
    bounded = float(np.copysign(min(abs(amplitude), most), amplitude))
    return sine_elements(bounded, scale, length) if bounded else ()


def _crest(
    settings: AlignmentSettings, profile: str, radius: float, length: float, grade: float, steepest: float
) -> VerticalCurve | None:
    if profile == "grade":
        return None
    room = steepest - grade
    least = 0.5 * length / room if room > 0.0 else np.inf
    if settings.crest_radius is not None and radius < least:
        raise InputError(
            f"the ends of the bridge become steeper than {steepest:g}",
            field="bridge.alignment.crest_radius",
            value=radius,
            allowed=f"at least {least:.0f} m",
            hint=f"The nearest valid value is {np.ceil(least):.0f}",
        )
    if not np.isfinite(least):
        return None
    return VerticalCurve(0.0, length, (1.0 if profile == "crest" else -1.0) * max(radius, float(np.ceil(least))))
