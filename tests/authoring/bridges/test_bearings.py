"""Bearings by themselves: sizes to the millimeter, what a skew and a flange change, how often each kind is drawn."""

import numpy as np
import pytest

from authoring.axis.alignment import Alignment
from authoring.parts.bearings import (
    Bearings,
    BearingSettings,
    _askew,
    _Row,
    _sole_plate,
    bearing_parts,
    draw_bearings,
    sole_thickness,
)
from authoring.parts.drawing import Draws
from authoring.parts.part import Part
from authoring.parts.spans import Levels, Spans
from authoring.solids.sweep import Surface


@pytest.mark.parametrize("kind", ["pad", "pot"])
@pytest.mark.parametrize("flange", [0.0, 0.43, 0.434, 0.45, 0.425])
def test_bearings_have_their_sizes(kind: str, flange: float) -> None:
    """Sole plate 15 mm wider all round, 20 mm thick; no side within 6 mm of that of the flange above; plinth beside."""
    told = Bearings(0.4, 0.3, 0.09, 0.06, 0.2, kind)
    levels = Levels(surfacing=0.1, slab=0.2, girder=1.0, pad=0.09, plinth=0.2)
    parts = bearing_parts(told, (1.5,), Spans((0.0, 20.0), 0.4, 0.05), levels, Alignment(10.0), (flange, 0.0))
    bearing, plinth = (next(part for part in parts if part.kind == f"bearing_{word}") for word in (kind, "plinth"))
    points = bearing.surface.points
    plate, lower = points[-8:], points[:-8]
    width = 0.4 if abs(0.43 - flange) > 0.006 else 0.388
    np.testing.assert_allclose(np.ptp(plate, axis=0), [0.33, width + 0.03, 0.022], atol=1e-9)
    np.testing.assert_allclose(plate.mean(axis=0)[1], 1.5, atol=1e-9)
    np.testing.assert_allclose([plate[:, 2].min(), plate[:, 2].max()], [8.68, 8.702], atol=1e-9)
    np.testing.assert_allclose(np.ptp(lower, axis=0)[1], width, atol=1e-9)
    assert bearing.parameters["width"] == width
    assert bearing.parameters["sole_plate"] == pytest.approx(0.02)
    assert bearing.parameters["height"] == pytest.approx(0.09)
    foot = plinth.surface.points
    np.testing.assert_allclose(np.ptp(foot, axis=0), [0.42, width + 0.12, 0.21], atol=1e-9)


def test_a_skewed_bearing_stays_under_its_girder() -> None:
    """Turned against its girder, its corners reach as far across as its width did."""
    for skew in (0.0, 0.2, -0.5):
        turned = _askew(Bearings(0.4, 0.3, 0.09, 0.06, 0.2), skew)
        reach = turned.pad_width * np.cos(skew) + turned.pad_length * np.sin(abs(skew))
        assert reach == pytest.approx(0.4, abs=1.5e-3)  # sizes are whole millimeters
        assert turned.pad_width / turned.pad_length == pytest.approx(4 / 3, abs=0.01)
    assert sole_thickness(turned, (0.03, -0.02)) == pytest.approx(0.02)
    assert sole_thickness(turned, (0.08, -0.06)) == pytest.approx(
        0.006 + 0.08 * (turned.pad_length / 2 + 0.015) + 0.06 * (turned.pad_width / 2 + 0.015)
    )


def test_texture_of_a_sole_plate_is_as_long_as_its_edges() -> None:
    """Its top slopes with the girder: each upright edge has another length, and the texture runs over just that."""
    plate = _sole_plate((0.3, 0.4), _Row(1.0, 1.1, (0.05, -0.02)), 1.07, 1.09)
    faces = plate.corners.reshape(-1, 4)
    heights, lengths = plate.points[faces][:, :, 2], plate.st[:, 0].reshape(-1, 4)
    places = plate.points[faces][:, :, :2]
    upright = np.linalg.norm(places - np.roll(places, 1, axis=1), axis=2) < 1e-9
    tall = np.abs(heights - np.roll(heights, 1, axis=1))[upright]
    assert len(tall) == 8
    assert np.ptp(tall) > 0.015
    np.testing.assert_allclose(np.abs(lengths - np.roll(lengths, 1, axis=1))[upright], tall, atol=1e-9)


def built(told: Bearings, levels: Levels) -> Part:
    """Build the first bearing under a level bridge whose surface is at 10 m."""
    parts = bearing_parts(told, (0.0,), Spans((0.0, 20.0), 0.4, 0.05), levels, Alignment(10.0))
    return next(part for part in parts if part.name.startswith("Bearing"))


def boxes_of(surface: Surface, *counts: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Lower and upper corners of the pieces of a surface, of so many points each."""
    pieces = np.split(surface.points, np.cumsum(counts))
    return [(piece.min(axis=0), piece.max(axis=0)) for piece in pieces[: len(counts)]]


def test_a_pot_stands_as_its_parts_do() -> None:
    """Base plate, pot, piston and top plate, 2 mm into each other, in shares of width and height."""
    told, levels = Bearings(0.5, 0.5, 0.2, 0.06, 0.2, "pot", sole_plate=False), Levels(0.1, 0.2, 1.0, 0.2, 0.2)
    part = built(told, levels)
    low, high = 8.5 - 0.002, 8.7
    rise = low + (high - low) * np.array([0.0, 0.20, 0.62, 0.76, 1.0])
    found = boxes_of(part.surface, 8, 48, 48, 8)
    wide = (0.5, 0.86 * 0.5, 0.70 * 0.5, 0.94 * 0.5)
    ends = (
        (rise[0], rise[1]),
        (rise[1] - 0.002, rise[2]),
        (rise[2] - 0.002, rise[3] + 0.002),
        (rise[3], rise[4] + 0.002),
    )
    for (lower, upper), width, (bottom, top) in zip(found, wide, ends, strict=True):
        np.testing.assert_allclose([lower[2], upper[2]], [bottom, top], atol=1e-9)
        assert upper[1] - lower[1] == pytest.approx(width, rel=0.01)  # a circle is a polygon


def test_rubber_bulges_between_its_laminates() -> None:
    """A pad of 90 mm has four layers, 3 mm wider in the middle of each than at the steel."""
    told, levels = Bearings(0.4, 0.3, 0.09, 0.06, 0.2, sole_plate=False), Levels(0.1, 0.2, 1.0, 0.09, 0.2)
    part = built(told, levels)
    assert "sole_plate" not in part.parameters
    rings = part.surface.points.reshape(-1, 4, 3)
    assert len(rings) == 2 * 4 + 1
    widths = np.ptp(rings[:, :, 1], axis=1)
    np.testing.assert_allclose(widths, [0.394, 0.4] * 4 + [0.394], atol=1e-9)
    np.testing.assert_allclose(np.diff(rings[:, :, 2].mean(axis=1)), 0.094 / 8, atol=1e-9)


@pytest.mark.parametrize("profile", ["default", "paper"])
def test_seven_of_ten_are_pads(profile: str) -> None:
    """By default 70 : 30, sizes within their ranges; in the paper always pots of 0.3 m without sole plates."""
    found = [draw_bearings(BearingSettings(), Draws(np.random.default_rng(seed), profile)) for seed in range(600)]
    pads = [one for one in found if one.kind == "pad"]
    assert len(pads) / 600 == pytest.approx(0.7 if profile == "default" else 0.0, abs=0.05)
    assert {one.sole_plate for one in found} == {profile == "default"}
    for one in pads:
        assert 0.36 <= one.pad_width <= 0.44
        assert 0.28 <= one.pad_length <= 0.38
        assert 0.06 <= one.pad_height <= 0.12
    for one in found:
        assert one.plinth_width == pytest.approx(one.pad_width + 2 * one.plinth_margin)
        assert one.plinth_length == pytest.approx(one.pad_length + 2 * one.plinth_margin)
        if one.kind == "pot":
            assert one.pad_width == one.pad_length
            assert one.pad_height == 0.3 or profile == "default"
    fixed = draw_bearings(BearingSettings(kind="pad"), Draws(np.random.default_rng(0), profile))
    assert fixed.kind == "pad"
