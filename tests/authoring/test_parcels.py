"""Fields: they begin beside the approach roads, keep to their side of the axis, and do not overlap."""

import numpy as np
import pytest

from authoring.axis.alignment import Alignment, Layout
from authoring.backgrounds.parcels import ROADSIDE, ROW, crop_fields, draw_parcels
from authoring.backgrounds.terrain import Terrain, grow_terrain, rolling_hills
from authoring.site.site import SiteSettings, draw_site
from authoring.streams import stream


@pytest.fixture(scope="module")
def terrain() -> Terrain:
    """The land round a road bridge over a river."""
    layout = Layout(Alignment(7.0), (0.0, 18.0, 40.0), 11.5, 1.9, "road", 8.0, 3.4)
    site = draw_site(SiteSettings(crossing="river", fine_spacing=1.6, coarse_spacing=5.0), layout, stream(7, "site"))
    inner = (float(site.field.stations[0]), float(site.field.stations[-1]), -80.0, 80.0)
    return grow_terrain(site, rolling_hills(site.land, inner, 42.0, stream(7, "hills")), 2000.0)


@pytest.mark.parametrize("seed", range(4))
def test_fields_do_not_overlap(terrain: Terrain, seed: int) -> None:
    """No place lies in two fields, and each place of a field is on the field's side of the axis."""
    parcels = draw_parcels(terrain, np.random.default_rng(seed))
    rng = np.random.default_rng(9)
    station, left = rng.uniform(-500.0, 540.0, 20_000), rng.uniform(-500.0, 500.0, 20_000)
    depth = np.stack([parcel.inside(station, left) for parcel in parcels])
    assert (depth > 0.0).sum(axis=0).max() == 1
    for parcel, inside in zip(parcels, depth > 0.0, strict=True):
        assert (np.sign(left[inside]) == parcel.side).all()
        line = parcel.outline(2.0)
        assert len(line)
        assert (parcel.side * line[:, 1] >= 0.0).all()
        assert parcel.inside(*line.T).max() < 1e-9


@pytest.mark.parametrize("seed", range(4))
def test_fields_begin_beside_the_roads(terrain: Terrain, seed: int) -> None:
    """Beyond the strip nearly all land within 90 m of the axis is divided into fields; none is tilled on the road."""
    rng = np.random.default_rng(seed)
    parcels = draw_parcels(terrain, rng)
    station, left = rng.uniform(terrain.inner[1], terrain.inner[1] + 200.0, 4000), rng.uniform(0.0, 1.0, 4000)
    left = (ROADSIDE + ROW * left) * rng.choice((-1.0, 1.0), 4000)
    depth = np.stack([parcel.inside(station, left) for parcel in parcels])
    assert (depth > 0.0).any(axis=0).mean() > 0.9
    nodes = terrain.nodes()
    for approach in terrain.land.approaches:
        road = (approach.along(nodes[0]) > 0.0) & (np.abs(nodes[1] - approach.center(nodes[0])) < approach.half_width)
        assert all((values[road] < 0.0).all() for _, values in crop_fields(terrain, parcels))
