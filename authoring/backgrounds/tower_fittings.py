"""Parts of facades and roofs: windows, name boards, awnings, air handlers, stair heads, tanks, masts."""

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.facades import MIDDLE, NEAR, openings
from authoring.backgrounds.quads import placed
from authoring.backgrounds.street_models import roof_plant, shop_fronts, window_models
from authoring.backgrounds.towers import Tower
from authoring.shapes.component import Scatter

F64 = NDArray[np.float64]

_FRAMED = 30.0  # distance to the site up to which windows have frames [m]
WINDOWS = 14_000  # largest number of windows
_BLINDS = 4  # models of each kind of window
_SHOP = 3  # kind of window of shops
_FASCIA = 0.07  # projection of the shops' fascia beyond the piers [m]
_SMALL = 9.0  # narrowest roof with equipment [m]
_HIGH = 90.0  # height of buildings from which on they have masts [m]


def window_runs(towers: tuple[Tower, ...], strip: F64, rng: np.random.Generator) -> list[Scatter]:
    """Place windows in the facades near the site, the nearest first, and signs over the shops.

    Args:
        towers: Buildings.
        strip: Corners of the site in plan [m], shape (4, 2), float64.
        rng: Random stream.

    Returns:
        A run of windows and one of name boards and awnings; none where no building is near.
    """
    near = sorted((tower for tower in towers if tower.away < NEAR), key=lambda tower: tower.away)
    found = [openings(tower, strip) for tower in near]
    if not found:
        return []
    count = np.array([len(part.yaw) for part in found])
    shop = np.concatenate([part.shop for part in found])
    kinds = np.where(shop, _SHOP, np.repeat([tower.style.window for tower in near], count))
    places, yaw = np.concatenate([part.places for part in found]), np.concatenate([part.yaw for part in found])
    sizes = np.concatenate([part.sizes for part in found])
    blinds = np.where(shop, 0, rng.integers(0, _BLINDS, len(yaw)))
    plain = np.repeat([tower.away for tower in near], count) > _FRAMED
    models = window_models()
    which = (_BLINDS * kinds + blinds + plain * (len(models) // 2))[:WINDOWS].astype(np.int32)
    scales = np.column_stack([sizes[:, 0], np.ones(len(sizes)), sizes[:, 1]])[:WINDOWS]
    windows = Scatter(
        "City_Windows", "window", "Buildings", models, which, places[:WINDOWS], yaw[:WINDOWS], scales, (0,)
    )
    out = np.repeat([tower.style.pier[1] + _FASCIA for tower in near], count)
    signed = shop & (rng.uniform(size=len(shop)) < 0.45)
    if not signed.any():
        return [windows]
    outward = np.column_stack([np.sin(yaw), -np.cos(yaw), np.zeros(len(yaw))])
    models = shop_fronts()
    chosen = rng.integers(0, len(models), int(signed.sum())).astype(np.int32)
    spots = (places + out[:, None] * outward)[signed]
    widths = np.column_stack([sizes[signed, 0] + 0.4, np.ones((int(signed.sum()), 2))])
    return [
        windows,
        Scatter("City_ShopFronts", "building", "Buildings", models, chosen, spots, yaw[signed], widths, (0,)),
    ]


def roof_runs(towers: tuple[Tower, ...], rng: np.random.Generator) -> list[Scatter]:
    """Place equipment on the roofs, each item in a separate quarter.

    Args:
        towers: Buildings.
        rng: Random stream.

    Returns:
        One run, or none.
    """
    places: list[F64] = [np.zeros((0, 3))]
    yaw: list[F64] = [np.zeros(0)]
    which = [np.zeros(0, np.int32)]
    for tower in towers:
        x0, x1, y0, y1 = tower.tiers[-1].rim
        if min(x1 - x0, y1 - y0) < _SMALL or tower.away > 1.4 * MIDDLE:
            continue
        tank = tower.style.name == "punched" and rng.uniform() < 0.4
        kinds = [1, 2 if tank else 0, 3 if tower.height > _HIGH else 0, 0][: int(rng.integers(2, 5))]
        quarters = rng.permutation(4)[: len(kinds)]
        x, y = x0 + (x1 - x0) * (0.3 + 0.4 * (quarters % 2)), y0 + (y1 - y0) * (0.3 + 0.4 * (quarters // 2))
        local = np.column_stack([x, y, np.full(len(kinds), tower.height)])
        places.append(placed(local[:, None], tower.spot, tower.heading)[:, 0])
        yaw.append(tower.heading + np.pi / 2 * rng.integers(0, 4, len(kinds)).astype(np.float64))
        which.append(np.array(kinds, np.int32))
    spots = np.concatenate(places)
    if not len(spots):
        return []
    place = (np.concatenate(which), spots, np.concatenate(yaw), np.ones((len(spots), 3)))
    return [Scatter("City_RoofPlant", "building", "Buildings", roof_plant(), *place, (0,))]
