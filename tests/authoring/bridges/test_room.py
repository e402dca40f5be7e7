"""Members that have no room beside each other at sizes that each setting alone allows: refused by name, in one line."""

import re
from typing import Any

import pytest

from authoring.families.bridge_settings import BridgeSettings, draw_layout
from authoring.streams import stream
from groundwork.errors import InputError
from groundwork.settings import parse_settings
from tests.authoring.bridges.draws_seen import merged

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
        (RAIL, "parapet.low_wall", {"parapet": {"low_wall": 0.5}}),
    ],
)
def test_no_room(bridge: dict[str, Any], field: str, mend: dict[str, Any]) -> None:
    """The line names the setting and what it allows; with a value that it allows the bridge is drawn."""
    for seed in range(5):
        with pytest.raises(InputError, match=re.escape(f"bridge.{field}: ")) as caught:
            draw_layout(parse_settings(BridgeSettings, bridge, "test"), stream(seed, "bridge"))
        found = re.search(r"allowed: (?:bearings )?at (?:most|least) \d+\.?\d* (?:m|here)", str(caught.value))
        assert found, str(caught.value)
        assert "\n" not in str(caught.value)
        if mend:
            draw_layout(parse_settings(BridgeSettings, merged(bridge, mend), "test"), stream(seed, "bridge"))
