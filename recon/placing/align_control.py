"""Alignment to ground control: marked points are triangulated and fitted to their surveyed positions."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundwork.errors import InputError
from recon.placing.align import Alignment, Target, stand_upright
from recon.placing.align_gps import align_to_fixes
from recon.placing.control_fit import SurveyedPoints, fit_to_points
from recon.placing.gps_fit import Fit
from recon.placing.gravity import GravityCues, gravity_cues
from recon.placing.ground_control import ControlPoint, GroundControl
from recon.placing.marked_places import MarkedPlace, find_places, mark_variances
from recon.placing.place_errors import PlaceErrors, expected_errors
from recon.placing.scale_bars import scale_of_bars
from recon.placing.similarity import Similarity
from recon.sfm.colmap_model import SparseModel
from render.capture import Capture

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

POINTS, BARS = "control points", "scale bars"
_LEAST_POINTS = 3
_DECIMALS = -2  # decimals: the origin in a plane system is rounded to 100 of its units


@dataclass(frozen=True)
class ControlFit:
    """Result of an alignment to ground control.

    Attributes:
        alignment: The alignment.
        kind: `control points`, or `scale bars` alone, where GPS or gravity determine the rest.
        facts: JSON: residuals of every point and bar, and the origin.
    """

    alignment: Alignment
    kind: str
    facts: dict[str, Any]


def align_to_control(
    model: SparseModel,
    rows: I64,
    target: Target,
    capture: Capture,
    control: GroundControl,
    rng: np.random.Generator,
) -> ControlFit:
    """Align a model to surveyed points or, if there are fewer than three, scale it by bars.

    Args:
        model: Reconstruction.
        rows: Row in the capture of each image of the model, shape (I,), int64.
        target: The measurements of GPS and gimbals.
        capture: Photographs.
        control: Points, marks and bars.
        rng: Source of the initial triples of points.

    Returns:
        The alignment and its residuals.

    Raises:
        InputError: A mark outside its image; points that do not determine the frame; or too few points that two
            registered photographs show, and no bar.
    """
    places = find_places(model, capture, control)
    known = [point for point in control.points if point.position is not None and point.name in places]
    bars = [bar for bar in control.bars if bar.ends[0] in places and bar.ends[1] in places]
    if len(known) < _LEAST_POINTS and not bars:
        raise InputError(
            f"only {len(known)} of {len(control.points)} control points are marked in two registered photographs",
            where=control.file,
            allowed=f"{_LEAST_POINTS} or more, or a scale bar between marked points",
            hint="Mark each point in more photographs",
        )
    if len(known) < _LEAST_POINTS:
        alignment = _scaled(model, rows, target, places, control, rng)
        return ControlFit(alignment, BARS, _bar_facts(alignment.similarity, places, control))
    coordinates = np.array([point.position for point in known], np.float64)
    origin = _origin(capture, control, coordinates)
    goal = control.system.local(coordinates, origin)
    source, sigma = np.array([places[point.name].place for point in known]), np.array([point.sigma for point in known])
    variances = dict(zip(places, mark_variances(list(places.values())), strict=True))
    spread = np.array([variances[point.name] * places[point.name].covariance for point in known])
    gimbal = None if target.gimbal is None else target.gimbal[rows]
    levels = gravity_cues(target.level(model.poses, rows), gimbal)
    fit, errors = _fixed_frame(SurveyedPoints(source, goal, sigma, spread), levels, control.file, rng)
    alignment = replace(
        stand_upright(model.poses, rows, target), similarity=fit.similarity, method=POINTS, errors=errors
    )
    residuals = fit.similarity.move(source) - goal
    facts = {
        "control_points": [
            _point_facts(point, places[point.name], off, bool(agrees))
            for point, off, agrees in zip(known, residuals, fit.agreeing, strict=True)
        ],
        "origin": {"system": control.system.name, **_origin_facts(control, origin)},
        **_bar_facts(fit.similarity, places, control),
    }
    return ControlFit(alignment, POINTS, facts)


def _fixed_frame(
    points: SurveyedPoints, levels: GravityCues, file: Path, rng: np.random.Generator
) -> tuple[Fit, PlaceErrors]:
    """Fit points of the model to surveyed ones; refuse points that do not determine scale, tilt and heading."""
    fit = fit_to_points(points, levels, rng)
    errors = None if fit is None else expected_errors(fit, np.zeros(3))
    if fit is None or errors is None or errors.unfixed():
        wide = "" if errors is None else f" ({errors.unfixed()})"
        raise InputError(
            f"the control points do not determine a coordinate frame{wide}",
            where=file,
            hint="Use points that do not lie on one line, and check that each is marked correctly",
        )
    return fit, errors


def _point_facts(point: ControlPoint, place: MarkedPlace, off: F64, agrees: bool) -> dict[str, Any]:
    return {
        "name": point.name,
        "images": place.images,
        "error": off.tolist(),
        "distance": float(np.linalg.norm(off)),
        "pixels": place.pixels,
        "agrees": agrees,
    }


def _scaled(
    model: SparseModel,
    rows: I64,
    target: Target,
    places: Mapping[str, MarkedPlace],
    control: GroundControl,
    rng: np.random.Generator,
) -> Alignment:
    """Scale by bars a model that GPS, or gravity alone, has placed; the centroid of its cameras stays."""
    bars = [bar for bar in control.bars if bar.ends[0] in places and bar.ends[1] in places]
    scale, unsure = scale_of_bars(bars, dict(places))
    base = (
        align_to_fixes(model.poses, rows, target, rng)
        if target.kind == "gps"
        else stand_upright(model.poses, rows, target)
    )
    middle = model.poses[:, :3, 3].mean(axis=0)
    there = base.similarity.move(middle[None])[0]
    rotation = base.similarity.rotation
    similarity = Similarity(scale, rotation, there - scale * rotation @ middle)
    errors = base.errors if base.errors is not None and not base.unfixed else None
    stated = (
        PlaceErrors(100.0 * unsure, np.nan, np.nan, np.nan) if errors is None else replace(errors, scale=100.0 * unsure)
    )
    away = similarity.move(model.poses[:, :3, 3]) - target.centers[rows]
    if target.sigmas is not None:
        away = np.where(np.isfinite(target.sigmas[rows]), away, 0.0)  # a fix without a height says nothing about it
    far = np.linalg.norm(away, axis=1)
    center_errors = base.center_errors.copy()
    center_errors[rows] = np.where(np.isnan(center_errors[rows]), np.nan, far)
    return replace(base, similarity=similarity, method=BARS, errors=stated, unfixed="", center_errors=center_errors)


def _origin(capture: Capture, control: GroundControl, coordinates: F64) -> tuple[float, float, float]:
    """Choose the origin of the cloud: that of its GPS, else the first point; in a plane system, near all points."""
    if control.system.zone is None:
        east, north = np.round(coordinates[:, :2].mean(axis=0), _DECIMALS)
        return float(east), float(north), 0.0
    origin = capture.facts.get("origin")
    if isinstance(origin, dict):
        return float(origin["latitude"]), float(origin["longitude"]), float(origin["height"])
    latitude, longitude, up = control.system.geographic(coordinates[:1])[0]
    return float(latitude), float(longitude), float(up)


def _origin_facts(control: GroundControl, origin: tuple[float, float, float]) -> dict[str, float]:
    """Describe the origin [m], or [deg] and [m]: the cloud is in meters, whatever the unit of the file."""
    if control.system.zone is None:
        return {"east": origin[0] * control.system.unit, "north": origin[1] * control.system.unit, "up": origin[2]}
    return dict(zip(("latitude", "longitude", "height"), origin, strict=True))


def _bar_facts(similarity: Similarity, places: Mapping[str, MarkedPlace], control: GroundControl) -> dict[str, Any]:
    rows = []
    for bar in control.bars:
        if bar.ends[0] in places and bar.ends[1] in places:
            one, other = similarity.move(np.array([places[name].place for name in bar.ends]))
            rows.append(
                {"ends": list(bar.ends), "length": bar.length, "error": float(np.linalg.norm(one - other)) - bar.length}
            )
    return {"scale_bars": rows} if rows else {}
