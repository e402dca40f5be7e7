"""Nothing that stands on a site or in a world stands in a part of the bridge."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from authoring.backgrounds.city import CitySettings
from authoring.backgrounds.countryside import CountrysideSettings
from authoring.backgrounds.hillside import HillsideSettings
from authoring.backgrounds.lakeside import LakesideSettings
from authoring.backgrounds.registry import BackgroundSettings, build_background
from authoring.families.bridge_settings import draw_layout
from authoring.shapes.component import Component, Mesh, Scatter
from authoring.site.site import Site, SiteSettings, draw_site
from authoring.streams import stream
from tests.authoring.bridges.built import Bridge, build_on, settings_of
from tests.authoring.bridges.kernels import depth_in, winding
from tests.authoring.world_parts import Pieces

F64 = NDArray[np.float64]

TOLERANCE = 0.01  # [m]: guardrails end 7 mm inside the blocks that they are fixed to
FEW = BackgroundSettings(
    city=CitySettings(town=150.0, reach=1200.0, trees=60, vehicles=120),
    countryside=CountrysideSettings(reach=400.0, buildings=4, hedge_bushes=40, trees=60),
    hillside=HillsideSettings(reach=2500.0, houses=4, blocks=2, sheds=2, cranes=2, trees=40),
    lakeside=LakesideSettings(reach=2500.0, villas=3, town_houses=3, trees=40, boats=4),
)
# The ground, and what is laid on it: approach roads and their ballast end inside the abutments, water round the piers.
_LAID = ("road", "rail_bed", "water")
_GROWN = ("tree", "shrub", "vegetation", "rock")  # these may lean on a wall, but their feet are outside it


def bridge_on_site(family: str, seed: int, **changes: Any) -> tuple[Bridge, Site]:
    """A bridge on its site, which has fences."""
    layout, drawn = draw_layout(settings_of(family, **changes), stream(seed, "bridge"))
    settings = SiteSettings(fences=True, fine_spacing=2.0, coarse_spacing=8.0)
    site = draw_site(settings, layout, stream(seed, "site"))
    return build_on(family, seed, layout, drawn, site.ground), site


def points_of(piece: Component | Scatter, low: F64, high: F64) -> F64:
    """Vertices of a piece in a box, of plants and stones their feet, shape (N, 3)."""
    if isinstance(piece, Component):
        points = piece.mesh.points
    elif piece.kind in _GROWN:
        points = piece.positions
    else:
        reach = max(float(np.abs(mesh.points).max()) for model in piece.prototypes for _, mesh in model)
        reach *= 2.0 * float(piece.scales.max())
        near = np.flatnonzero(np.all((piece.positions > low - reach) & (piece.positions < high + reach), axis=1))
        points = np.concatenate([np.zeros((0, 3)), *(repeat(piece, int(row)) for row in near)])
    return points[np.all((points > low) & (points < high), axis=1)]


def repeat(run: Scatter, row: int) -> F64:
    """Vertices of one repeat, shape (N, 3)."""
    local = np.concatenate([mesh.points for _, mesh in run.prototypes[run.prototype[row]]]) * run.scales[row]
    cosine, sine = np.cos(run.yaw[row]), np.sin(run.yaw[row])
    return local @ np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]]) + run.positions[row]


def standing_in(bridge: Bridge, pieces: Pieces) -> list[str]:
    """Name the pieces with a point deeper than the tolerance in a solid of a bridge, and these solids."""
    solids = np.flatnonzero(bridge.closed)
    low, high = bridge.boxes[solids, 0].min(axis=0), bridge.boxes[solids, 1].max(axis=0)
    found = []
    for piece in pieces:
        if piece.group == "Ground" or (piece.name.startswith("Site_") and piece.kind in _LAID):
            continue
        points = points_of(piece, low, high)
        points = points[np.argsort(points[:, 0])]
        first, last = (np.searchsorted(points[:, 0], bridge.boxes[solids, side, 0]) for side in (0, 1))
        for solid, start, stop in zip(solids[last > first], first[last > first], last[last > first], strict=True):
            box, some = bridge.boxes[solid], points[start:stop]
            own = bridge.corners, bridge.first[solid], bridge.first[solid + 1]
            some = some[np.all((some > box[0]) & (some < box[1]), axis=1)]
            some = some[winding(some, *own) > 0] if len(some) else some
            deepest = depth_in(some, *own).max() if len(some) else 0.0
            if deepest > TOLERANCE:
                found.append(f"{piece.name} in {bridge.members[solid].name}, {deepest:.3f} m")
    return found


@pytest.mark.parametrize("seed", [1, 5])
@pytest.mark.parametrize("family", ["arch", "beam", "cable_stayed", "girder", "slab", "suspension"])
def test_nothing_on_the_site_stands_in_the_bridge(family: str, seed: int) -> None:
    """Fences, guardrails and signs of the site end outside the bridge's solids; plants and stones grow beside them."""
    bridge, site = bridge_on_site(family, seed)
    assert standing_in(bridge, site.pieces) == []


@pytest.mark.parametrize("arrangement", ["through", "half_through", "masonry"])
def test_nothing_grows_in_the_blocks_of_an_arch(arrangement: str) -> None:
    """Springings beside the deck and the cutwaters of piers have their own room on the site."""
    bridge, site = bridge_on_site("arch", 3, arch={"arrangement": arrangement})
    assert bridge.layout.blocks
    assert standing_in(bridge, site.pieces) == []


@pytest.mark.parametrize(
    ("family", "world"),
    [("suspension", "countryside"), ("cable_stayed", "city"), ("beam", "hillside"), ("arch", "lakeside")],
)
def test_nothing_of_a_world_stands_in_the_bridge(family: str, world: str) -> None:
    """Car parks, vehicles, lamps, buildings, boats and trees of a world are outside the bridge's solids."""
    bridge, site = bridge_on_site(family, 2)
    pieces = build_background(world, FEW, site, stream(2, "background"))
    assert len(pieces) > 40
    assert standing_in(bridge, pieces) == []


@pytest.mark.parametrize("kind", ["fence", "rock"])
def test_what_stands_in_the_bridge_is_found(kind: str) -> None:
    """A post and a stone in the middle of an anchor block, and none beside it."""
    bridge, _ = bridge_on_site("suspension", 1)
    (number, *_) = (n for n, member in enumerate(bridge.members) if member.kind == "anchor_block")
    inside = bridge.boxes[number].mean(axis=0)
    beside = np.array([inside[0], bridge.boxes[:, :, 1].max() + 0.5, inside[2]])
    for place, names in ((inside, [bridge.members[number].name]), (beside, [])):
        none, blank = np.zeros(0, np.int32), np.zeros((0, 3), np.float32)
        mesh = Mesh(np.zeros((1, 3)), none, none, blank, blank[:, :2])
        model, one = ((("timber", mesh),),), np.ones((1, 3))
        run = Scatter("Post", kind, "Ways", model, np.zeros(1, np.int32), place[None], np.zeros(1), one, (1,))
        assert [line.split(" in ")[1].split(",")[0] for line in standing_in(bridge, (run,))] == names
