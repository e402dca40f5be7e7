"""Members that have no room beside each other at sizes that each setting alone allows: refused by name, in one line."""

import re
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from authoring.families.bridge_settings import BridgeSettings, draw_layout
from authoring.streams import stream
from groundwork.errors import InputError
from groundwork.settings import parse_settings
from tests.authoring.bridges.built import make_bridge
from tests.authoring.bridges.draws_seen import merged
from tests.authoring.bridges.invariants import closed_and_outward, no_degenerate_triangle

SLAB_TRACK = {"bed": "slab", "spacing": 3.5, "sleeper_length": 2.8, "slab_shoulder": 0.5}
ON_SLABS = {"family": "beam", "service": "rail_double", "track": SLAB_TRACK}
PLINTHS = {
    "family": "slab",
    "service": "rail_single",
    "slab": {"bearings": 5},
    "bearing": {"kind": "pad", "pad_width": 0.9, "plinth_margin": 0.15},
}
COLUMNS = {"family": "slab", "service": "rail_single", "pier": {"columns": 5}, "slab": {"spans": [9.0, 9.0]}}
THICK = {**COLUMNS, "service": "rail_double", "pier": {"columns": 4, "diameter": 2.4}}
CLOSE: dict[str, Any] = {"arrangement": "deck", "span": 30.0, "bays": 20, "span_to_rise": 3.0, "approach": 4.0}
BANKS = {"family": "arch", "arch": CLOSE, "abutment": {"footing": True, "footing_toe": 2.0}}
SEMICIRCLE: dict[str, Any] = {"span_count": 2, "span": 35.0, "rise_ratio": 0.5}
THICK_RING = {
    "family": "arch",
    "arch": {"arrangement": "masonry", "shape": "circle", "masonry": {**SEMICIRCLE, "span_to_ring": 12.0}},
}
RAIL = {"family": "beam", "parapet": {"shape": "wall_rail", "low_wall": 0.8, "railing_height": 0.8}}


@pytest.mark.parametrize(
    ("bridge", "field", "mend"),
    [
        (
            {"family": "beam", "beam": {"girder": {"shape": "u", "wide_bottom": 0.8, "web": 0.35}}},
            "beam.girder.web",
            {},
        ),
        (PLINTHS, "slab.bearings", {"slab": {"bearings": 2}}),
        (ON_SLABS, "track.spacing", {"track": {"spacing": 3.9}}),
        (COLUMNS, "pier.columns", {"pier": {"columns": 3}}),
        (THICK, "pier.columns", {"pier": {"diameter": 0.6}}),
        (BANKS, "arch.bays", {"arch": {"bays": 6}}),
        (THICK_RING, "arch.masonry.span_to_ring", {"arch": {"masonry": {"span_to_ring": 21.0}}}),
        (RAIL, "parapet.low_wall", {"parapet": {"low_wall": 0.5}}),
    ],
)
def test_no_room(bridge: dict[str, Any], field: str, mend: dict[str, Any]) -> None:
    """The line names the setting and what it allows; with a value that it allows the bridge is drawn."""
    for seed in range(5):
        with pytest.raises(InputError, match=re.escape(f"bridge.{field}: ")) as caught:
            draw_layout(parse_settings(BridgeSettings, bridge, "test"), stream(seed, "bridge"))
        found = re.search(r"allowed: (?:bearings )?at (?:most|least) \d+\.?\d* (?:m|here)?", str(caught.value))
        assert found, str(caught.value)
        assert "\n" not in str(caught.value)
        if mend:
            draw_layout(parse_settings(BridgeSettings, merged(bridge, mend), "test"), stream(seed, "bridge"))


@pytest.mark.parametrize(
    ("span", "bays", "rise"), [(30.0, 20, 3.0), (30.0, 20, 8.0), (30.0, 14, 3.0), (150.0, 20, 3.0)]
)
def test_piers_on_banks_have_room(span: float, bays: int, rise: float) -> None:
    """Footings on the banks, the springings' blocks and the abutments lie apart along the bridge."""
    own = {**CLOSE, "span": span, "bays": bays, "span_to_rise": rise}
    for seed in range(3):
        bridge = make_bridge("arch", seed, arch=own, abutment={"battered": False, "footing": False})
        among = re.compile(r"Bank_Pier_\d+_Footing|Springing_\d|Abutment_\d+_Wall")
        pairs = zip(bridge.members, bridge.bridge_coordinates, strict=True)
        found = sorted(
            (p[:, 0].min(), p[:, 0].max(), member.name) for member, p in pairs if among.fullmatch(member.name)
        )
        assert len(found) > 10
        gaps = [after[0] - before[1] for before, after in pairwise(found)]
        assert min(gaps) > 0.04
        widths = [high - low for low, high, name in found if name.startswith("Bank")]
        assert min(widths) > bridge.drawn.record.arch.bents.length + 0.19
        assert np.ptp(widths) < 1e-6


@pytest.mark.parametrize("shape", ["circle", "parabola", "catenary"])
@pytest.mark.parametrize(
    ("span", "rise", "ring", "fill"),
    [(4.0, 0.5, 12.0, 0.2), (4.0, 0.15, 12.0, 0.2), (35.0, 0.5, None, 0.2), (35.0, 0.15, 35.0, 1.5)],
)
def test_masonry_at_its_extremes(shape: str, span: float, rise: float, ring: float | None, fill: float) -> None:
    """Rings end within the abutments' blocks, no triangle is degenerate, every member is closed and outward."""
    own: dict[str, Any] = {"span_count": 2, "span": span, "rise_ratio": rise, "crown_fill": fill, "span_to_ring": ring}
    bridge = make_bridge("arch", 3, arch={"arrangement": "masonry", "shape": shape, "masonry": own})
    assert all(np.isfinite(member.mesh.points).all() for member in bridge.members)
    assert no_degenerate_triangle(bridge) == []
    assert closed_and_outward(bridge) == []
    viaduct = bridge.drawn.record.arch.viaduct
    first, last = viaduct.rib(0).edge(1.0)[0], viaduct.rib(1).edge(1.0)[-1]
    assert viaduct.ends[0] + 0.09 < first[0]
    assert last[0] < viaduct.ends[1] - 0.09
