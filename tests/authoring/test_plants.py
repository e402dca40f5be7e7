"""Plants of cards: faces and charts, what coarser pictures leave of them, their material; plots of land."""

from pathlib import Path

import numpy as np
import pytest
from pxr import Usd

from authoring.axis.alignment import Alignment, Layout
from authoring.backgrounds.terrain import grow_terrain
from authoring.backgrounds.vegetation import plant_trees
from authoring.looks.bake import bake_surface
from authoring.looks.leaves import leaves
from authoring.looks.library import SheetName
from authoring.looks.material import author_material
from authoring.looks.noise import Tile
from authoring.shapes.component import Scatter
from authoring.site.fields import USES, VERGE
from authoring.site.land import no_hills
from authoring.site.plants import bush
from authoring.site.site import SiteSettings, draw_site
from authoring.site.sprays import CELL, INSET, LIFT, ROWS, SPRAYS, cards
from authoring.streams import stream
from tests.conftest import RecordProof
from usd_schemas.reading.materials import read_material

LAYOUT = Layout(Alignment(7.0), (0.0, 18.0, 40.0), 11.5, 1.9)


def test_a_card_has_a_face_for_each_side_with_the_same_light() -> None:
    """Both faces show one cell, look away from each other, stand `LIFT` off the middle, and carry the normals given."""
    rng = np.random.default_rng(3)
    across, up = rng.normal(size=(2, 20, 3))
    up -= across * (np.sum(up * across, axis=1) / np.sum(across * across, axis=1))[:, None]
    cells = rng.integers(0, ROWS * ROWS, 20)
    normals = np.repeat(rng.normal(size=(20, 1, 3)), 4, axis=1).astype(np.float32)
    mesh = cards(rng.normal(size=(20, 3)), across, up, cells, normals.astype(np.float64))
    quads = mesh.points[mesh.corners].reshape(20, 2, 4, 3)
    facing = np.cross(quads[:, :, 1] - quads[:, :, 0], quads[:, :, 2] - quads[:, :, 1])
    facing /= np.linalg.norm(facing, axis=2, keepdims=True)
    np.testing.assert_allclose(facing[:, 0], -facing[:, 1], atol=1e-9)
    apart = np.sum((quads[:, 0].mean(axis=1) - quads[:, 1].mean(axis=1)) * facing[:, 0], axis=1)
    np.testing.assert_allclose(apart, 2 * LIFT, atol=1e-9)
    st = mesh.st.reshape(20, 8, 2)
    low = CELL * np.column_stack([cells % ROWS, cells // ROWS])
    np.testing.assert_allclose(st.min(axis=1), low + INSET, atol=1e-6)
    np.testing.assert_allclose(st.max(axis=1), low + CELL - INSET, atol=1e-6)
    assert (mesh.normals.reshape(20, 8, 3) == normals[:, :1]).all()


def test_coarser_pictures_leave_as_much_of_a_plant(record_proof: RecordProof) -> None:
    """Halving the sheet of sprays once to four times changes by at most an eighth what is seen of a plant's cell.

    So crowns neither thin out nor close with distance.
    """
    opacity = leaves(Tile(1024, 4.0, np.random.default_rng(5))).opacity
    assert opacity is not None
    worst = 0.0
    cells = [cell for kind in sorted(set(SPRAYS) - {"twigs"}) for cell in SPRAYS[kind]]
    for cell in cells:
        row, column = ROWS - 1 - cell // ROWS, cell % ROWS
        seen = opacity[row * 256 : (row + 1) * 256, column * 256 : (column + 1) * 256]
        whole = float((seen >= 0.5).mean())
        assert 0.3 < whole < 0.7
        for step in (2, 4, 8, 16):
            coarse = seen.reshape(256 // step, step, 256 // step, step).mean(axis=(1, 3))
            worst = max(worst, abs(float((coarse >= 0.5).mean()) / whole - 1))
    assert worst < 1 / 8
    record_proof("plants/what a coarser picture leaves", len(cells), 5, {"worst_share": round(worst, 3)})


def test_the_material_of_leaves_is_cut_out(tmp_path: Path) -> None:
    """A reader finds one picture with its own opacity and a threshold; nothing blends, and no detail is laid on it."""
    recipe = bake_surface(SheetName("leaves", 0, 256), tmp_path, library=tmp_path / "library")
    stage = Usd.Stage.CreateNew(str(tmp_path / "look.usda"))
    material = author_material(stage, "/Leaves", recipe)
    read = read_material(material, pytest.fail).material
    assert read is not None
    assert read.base_texture is not None
    assert read.base_texture.file.endswith("albedo.png")
    assert (read.opacity_threshold, read.blends, read.detail.file) == (0.5, False, "")


def test_a_bush_stands_within_its_size() -> None:
    """About 1 m high and wide whatever the seed, so that its size is that of the scatter."""
    for seed in range(20):
        points = np.concatenate([mesh.points for _, mesh in bush(np.random.default_rng(seed), 40)])
        assert 0.75 < points[:, 2].max() < 1.45
        assert points[:, 2].min() > -0.45  # in the ground
        assert np.abs(points[:, :2]).max() < 1.05


@pytest.mark.parametrize("land", sorted(USES))
def test_plots_lie_clear_of_ways_and_change_no_height(land: str) -> None:
    """At most one use at a place, none on roads, water, fills or beside the deck; another use moves no node.

    Nothing is strewn on what is tilled or paved.
    """
    site = draw_site(SiteSettings.model_validate({"land": land, "crossing": "road"}), LAYOUT, stream(7, "site"))
    other = draw_site(SiteSettings(land="common", crossing="road"), LAYOUT, stream(7, "site"))
    np.testing.assert_array_equal(site.field.heights, other.field.heights)
    station, left = np.random.default_rng(1).uniform((-60.0, -80.0), (100.0, 80.0), (20_000, 2)).T
    covers = site.land.shape(station, left, no_hills).covers
    used = np.array([covers[name] > 0 for name in sorted(set(USES[land]) & set(covers))])
    assert used.sum(axis=0).max() == 1
    taken = used.any(axis=0)
    assert 0.1 < taken.mean() < 0.7
    assert (np.abs(left[taken]) > LAYOUT.width / 2 + 7.9).all()
    assert (site.land.crossing.distance(station, left)[taken] > site.land.crossing.half_width + 6.9).all()
    assert (covers["embankment"][taken] < 0).all()
    for approach in site.land.approaches:
        beside = np.abs(left - approach.center(station)) - approach.half_width
        assert (beside[taken & (approach.along(station) > 0)] > VERGE - 1e-9).all()
    for run in (piece for piece in site.pieces if isinstance(piece, Scatter)):
        beside = site.land.shape(*LAYOUT.alignment.locate(run.positions), no_hills).covers
        for name in set(USES[land]) & set(beside) - {"hay"}:
            assert (beside[name] < 0).all(), (run.name, name)


@pytest.mark.parametrize("seed", range(3))
def test_no_field_and_no_hedge_on_a_steep_bank(seed: int) -> None:
    """Under a high bridge the valley's sides stay grass: nothing is tilled, mown or fenced on 20 % and more."""
    high = Layout(Alignment(24.0), (0.0, 90.0), 11.5, 1.9)
    site = draw_site(SiteSettings(land="fields", crossing="river"), high, stream(seed, "site"))
    station, left = np.random.default_rng(1).uniform((-60.0, -80.0), (150.0, 80.0), (20_000, 2)).T
    slope = site.land.steepness(station, left, no_hills)
    rise = site.land.shape(station + 3.0, left, no_hills).height - site.land.shape(station - 3.0, left, no_hills).height
    assert (slope >= np.abs(rise) / 6.0 - 1e-9).all()
    assert 0.1 < (slope > 0.25).mean() < 0.9
    covers = site.land.shape(station, left, no_hills).covers
    used = np.any([covers[name] > 0 for name in sorted(set(USES["fields"]) & set(covers))], axis=0)
    assert used.mean() > 0.05
    assert slope[used].max() < 0.2
    for run in (piece for piece in site.pieces if isinstance(piece, Scatter) and piece.name == "Site_Hedges"):
        places = high.alignment.locate(run.positions)
        assert site.land.steepness(*places, no_hills).max() < 0.2


def test_borders_of_fields_bend() -> None:
    """A border keeps within 3.2 m beyond its straight line, and swings by 0.5 m and more."""
    plots = draw_site(SiteSettings(land="fields", crossing="road"), LAYOUT, stream(7, "site")).land.plots
    assert plots is not None
    for side in (-1.0, 1.0):
        station = np.linspace(-60.0, 100.0, 400)
        shift = plots.shift(station, np.full(400, side))
        assert shift.min() >= 0.0
        assert shift.max() <= 3.2
        assert np.ptp(shift) > 0.5


@pytest.mark.parametrize("seed", range(4))
def test_trees_of_imported_surroundings_are_nearest_the_whole_bridge(seed: int) -> None:
    """They are taken by their distance from the site's stretch of the axis, times 0.25 to 1, not from its start."""
    layout = Layout(Alignment(7.0), (0.0, 150.0, 300.0), 11.5, 1.9)
    site = draw_site(SiteSettings(crossing="road", fine_spacing=2.0, coarse_spacing=8.0), layout, stream(3, "site"))
    terrain = grow_terrain(site, no_hills, 900.0)
    for run in plant_trees(terrain, (), np.zeros((0, 3)), 260, stream(seed, "trees"), 1):
        station, left = layout.alignment.locate(run.positions)
        away = np.hypot(station - np.clip(station, *site.field.stations[[0, -1]]), left)
        before = np.maximum.accumulate(away)[:-1]
        assert (0.25 * before <= away[1:] + 1e-6).all()
