"""`bridge.family` as a table of weights: which family is drawn, and that nothing else moves."""

from dataclasses import asdict
from typing import Any

import pytest

from authoring.families.bridge_settings import BridgeSettings, draw_layout
from authoring.streams import stream
from groundwork.errors import InputError
from groundwork.settings import parse_settings


def drawn_family(family: Any, seed: int) -> tuple[str, dict[str, Any]]:
    """Draw one bridge; give its family and everything else."""
    settings = parse_settings(BridgeSettings, {"family": family}, "test")
    layout, drawn = draw_layout(settings, stream(seed, "bridge"))
    return drawn.family, {"layout": asdict(layout), **asdict(drawn)}


def test_weights_are_how_often_a_family_is_drawn() -> None:
    """Two to one over many seeds, nothing of a family with weight 0, and the order of the table does not count."""
    seeds = range(300)
    found = [drawn_family({"beam": 2.0, "slab": 1.0, "arch": 0.0}, seed)[0] for seed in seeds]
    assert set(found) == {"beam", "slab"}
    assert 0.57 < found.count("beam") / len(found) < 0.76
    assert [drawn_family({"slab": 1, "arch": 0, "beam": 2}, seed)[0] for seed in seeds] == found


def test_weights_change_no_other_draw() -> None:
    """The bridge that weights choose is the bridge that its name alone gives, to the last value."""
    for seed in range(12):
        family, record = drawn_family({"beam": 1.0, "slab": 1.0}, seed)
        assert drawn_family(family, seed) == (family, record)


@pytest.mark.parametrize(
    ("family", "words"),
    [
        ("bream", "bream"),
        ({"bream": 1.0}, "bream"),
        ({}, "nothing"),
        ({"beam": 0.0}, "all weights are 0"),
        ({"beam": -1.0}, "weight of beam"),
        ({"beam": "much"}, "weight of beam"),
    ],
)
def test_bad_weights_name_the_field(family: Any, words: str) -> None:
    """One line that names the key and what is allowed."""
    with pytest.raises(InputError, match=words) as caught:
        drawn_family(family, 0)
    assert "family" in str(caught.value)
    assert "allowed" in str(caught.value)
    assert "\n" not in str(caught.value)
