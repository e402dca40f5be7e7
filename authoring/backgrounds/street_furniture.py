"""Objects in a town's streets: lamps, traffic lights, signs, railings."""

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.kerbs import Spots, beside_approaches, joined, kerbside, scatter
from authoring.backgrounds.river_quays import START, has_quays, quay_line
from authoring.backgrounds.street_models import PANEL, fence_panels, lamp, signs, traffic_light
from authoring.backgrounds.streets import KERB_GAP, TownPlan
from authoring.backgrounds.terrain import Terrain
from authoring.shapes.component import Scatter
from authoring.site.covers import to_world

F64 = NDArray[np.float64]

_DETAILED = 35.0  # distance to the site up to which railings are modeled in detail [m]
_FURNISHED = 260.0  # distance to the site up to which streets have furniture [m]


def furniture(plan: TownPlan, terrain: Terrain, rng: np.random.Generator) -> list[Scatter]:
    """Place lamps, traffic lights, signs and fences.

    Args:
        plan: The town.
        terrain: The terrain.
        rng: Random stream.

    Returns:
        Their runs.
    """
    lamps = [kerbside(plan, 0.7, 27.0, 6.0, _FURNISHED), *beside_approaches(plan, terrain, KERB_GAP + 0.6, 30.0)]
    rails = []
    if has_quays(terrain.land):
        low, high = terrain.inner[2:]
        for start, sign in ((low - START, -1.0), (high + START, 1.0)):
            for bank in (-1.0, 1.0):
                lamps.append(_landward(terrain, start + sign * np.arange(6.0, 330.0, 30.0), bank, 1.6))
                line = quay_line(terrain, start + sign * np.arange(0.0, 330.0, PANEL), bank, 0.25)
                free = terrain.clear(*terrain.land.layout.alignment.locate(line)) > 0.3
                rails.append(_panels(line).only(free[:-1] & free[1:]))
    elif terrain.land.crossing.kind == "rail":
        rails += _along_railway(terrain)
    lights = kerbside(plan, 0.6, 1e4, 1.2, 260.0)
    plates = kerbside(plan, 0.6, 61.0, 11.0, _FURNISHED)
    kinds = rng.integers(0, len(signs()), len(plates.places)).astype(np.float64)
    turned = Spots(plates.places, plates.yaw + np.pi / 2 * rng.choice((-1.0, 1.0), len(plates.yaw)))
    return [
        *scatter("Lamps", "lamp_post", "Furniture", (lamp(),), 0, joined(lamps)),
        *scatter("TrafficLights", "traffic_sign", "Furniture", (traffic_light(),), 0, lights),
        *scatter("Signs", "traffic_sign", "Furniture", signs(), kinds, turned),
        *scatter("Railings", "fence", "Furniture", fence_panels(), _plain(plan, joined(rails)), joined(rails)),
    ]


def _along_railway(terrain: Terrain) -> list[Spots]:
    """Fence a railway on both sides, outside the site."""
    crossing, axis, found = terrain.land.crossing, terrain.land.layout.alignment, []
    for start, sign in ((terrain.inner[2] - 1.0, -1.0), (terrain.inner[3] + 1.0, 1.0)):
        lefts = start + sign * np.arange(0.0, 300.0, PANEL)
        for side in (-1.0, 1.0):
            station = crossing.center(lefts) + side * (crossing.half_width + 4.6) * crossing.stretch(lefts)
            level = terrain.height(station, lefts)
            panels = _panels(to_world(axis, np.column_stack([station, lefts, level])))
            found.append(panels.only(terrain.clear(station, lefts)[:-1] > PANEL + 0.3))
    return found


def _panels(places: F64) -> Spots:
    """Turn each fence panel towards the next post."""
    step = np.diff(places[:, :2], axis=0)
    return Spots(places[:-1], np.arctan2(step[:, 1], step[:, 0]))


def _plain(plan: TownPlan, spots: Spots) -> F64:
    """Find which panels are far enough for the simple model: 0 or 1, shape (N,), float64."""
    return (plan.land.look(plan.land.away, spots.places[:, :2], 1e4) > _DETAILED).astype(np.float64)


def _landward(terrain: Terrain, lefts: F64, bank: float, back: float) -> Spots:
    """Place lamps along a quay, their arms across the promenade, away from the water."""
    places, behind = (quay_line(terrain, lefts, bank, away) for away in (back, back + 1.0))
    ahead = np.gradient(places[:, :2], axis=0)
    aside = np.column_stack([-ahead[:, 1], ahead[:, 0]])
    aside *= np.sign(np.sum(aside * (behind - places)[:, :2], axis=1, keepdims=True))
    return Spots(places, np.arctan2(aside[:, 1], aside[:, 0]))
