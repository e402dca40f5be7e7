"""Sizes of an axis that the user sets: they choose an axis that has them, or are refused."""

import re
from typing import Any

import numpy as np
import pytest

from authoring.axis.alignment import Alignment
from authoring.families.bridge_settings import BridgeSettings, draw_layout
from authoring.shapes.component import F64
from authoring.streams import stream
from groundwork.errors import InputError
from groundwork.settings import parse_settings
from tests.authoring.bridges.test_alignment import drawn


def bends(axis: Alignment) -> F64:
    """Curvatures of an axis at the ends of its elements, without sign, shape (N,)."""
    return np.abs([value for element in axis.plan for value in (element.begin, element.end)])


def test_a_size_chooses_an_axis_that_has_it() -> None:
    """With a radius no axis is straight, and those that bend anyway keep their kind; so with a wave and a crest."""
    kinds = []
    for seed in range(40):
        free, wound = drawn(seed), drawn(seed, radius=300.0)
        assert bends(wound).max() == pytest.approx(1.0 / 300.0)
        assert len(wound.plan) == max(
            len(free.plan), 1
        )  # an arc, clothoids and an S have different numbers of elements
        assert (wound.skew, wound.crest) == (free.skew, free.crest)
        kinds.append(len(free.plan))
        assert len(drawn(seed, amplitude=4.0, wave=90.0).plan) > 3
        crest = drawn(seed, crest_radius=3000.0).crest
        assert crest is not None
        assert abs(crest.radius) == 3000.0
        assert free.crest is None or np.sign(crest.radius) == np.sign(free.crest.radius)
    assert {0, 1, 3} <= set(kinds)


@pytest.mark.parametrize(
    ("own", "field"),
    [
        ({"kind": "straight", "radius": 300.0}, "radius"),
        ({"kind": "sine", "radius": 300.0}, "radius"),
        ({"kind": "arc", "amplitude": 4.0}, "amplitude"),
        ({"profile": "grade", "crest_radius": 3000.0}, "crest_radius"),
    ],
)
def test_a_size_without_effect_is_refused(own: dict[str, Any], field: str) -> None:
    """One line names the size and the choice that excludes it, whatever the seed; arches refuse every such size."""
    for seed in range(5):
        with pytest.raises(InputError, match=re.escape(f"bridge.alignment.{field}: has no effect with")) as caught:
            drawn(seed, **own)
        assert "\n" not in str(caught.value)
    settings = parse_settings(BridgeSettings, {"family": "arch", "alignment": {field: own[field]}}, "test")
    with pytest.raises(InputError, match=re.escape(f"bridge.alignment.{field}: has no effect with bridge.family")):
        draw_layout(settings, stream(1, "bridge"))


def test_two_sizes_that_exclude_each_other_are_refused() -> None:
    """Where no kind is set, the line does not speak of one: it names the size that does not go with the other."""
    for seed in range(5):
        with pytest.raises(InputError, match=r"^bridge\.alignment\.wave: no axis has this and another size") as caught:
            drawn(seed, radius=300.0, wave=90.0)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("field", "value"), [("turn", "left"), ("spiral", 0.3), ("superelevation", 0.04)])
@pytest.mark.parametrize("family", ["arch", "suspension", "cable_stayed"])
def test_a_straight_family_refuses_what_bends_an_axis(family: str, field: str, value: object) -> None:
    """Direction, transition and tilt of a curve have no effect there, so they are refused by name."""
    settings = parse_settings(BridgeSettings, {"family": family, "alignment": {field: value}}, "test")
    with pytest.raises(InputError, match=re.escape(f"bridge.alignment.{field}: has no effect with bridge.family")):
        draw_layout(settings, stream(1, "bridge"))
