"""The gallery of worlds: eyes where people stand, measures in closed form, and the figures of rendered worlds."""

from pathlib import Path

import numpy as np
import pytest

from authoring.axis.alignment import Alignment, Layout
from authoring.site.site import SiteSettings, draw_site
from authoring.streams import stream
from falsework.cli import main
from falsework.gallery.measures import Measures, Picture, dead_share, horizon_dip, measure_picture
from falsework.gallery.world_views import VIEWS, world_views
from falsework.gallery.worlds import WorldShots, photograph_world, world_table
from tests.conftest import Count, RecordProof
from usd_schemas.pinhole import Pinhole, look_at

CAMERA = Pinhole(96, 72, 64.0, 64.0, 48.0, 36.0)
LOW = slice(0, 3)  # the views of people, not of birds
MOST_DRAWN = 450_000


@pytest.mark.parametrize("crossing", ["river", "road", "rail"])
def test_eyes_are_where_people_stand(crossing: str) -> None:
    """1.7 m over ground or water, below the deck's top, one under the deck, one 5 m from a pier; birds fly above."""
    layout = Layout(Alignment(8.0), (0.0, 25.0, 50.0, 75.0), 11.5, 1.9)
    drawn = SiteSettings.model_validate({"crossing": crossing, "fine_spacing": 2.0})
    site = draw_site(drawn, layout, stream(3, "site"))
    poses = world_views(layout, site)
    assert poses.shape == (len(VIEWS), 4, 4)
    eyes = poses[:, :3, 3]
    water = site.land.crossing.level if site.land.crossing.depth > 0 else -np.inf
    np.testing.assert_allclose(eyes[LOW, 2] - np.maximum(site.ground(eyes[LOW, :2]), water), 1.7, atol=1e-6)
    station, left = layout.alignment.locate(eyes)
    assert abs(left[1]) < 0.5 * layout.width
    nearest = np.min(np.abs(station[2] - np.array(layout.supports)))
    assert np.hypot(nearest, abs(left[2]) - 0.5 * layout.width) == pytest.approx(5.0, abs=0.1)
    assert eyes[3, 2] > 20.0
    for pose in poses:
        np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-9)


def test_measures_of_a_drawn_picture() -> None:
    """Sky under the horizon, flat patches, the median and the kinds of things are what was drawn."""
    pose = look_at(np.array([0.0, 0.0, 2.0]), np.array([10.0, 0.0, 2.0]))
    depth = np.full((72, 96), np.inf, np.float32)
    depth[36:] = 9.0
    instance = np.zeros((72, 96), np.uint32)
    instance[36:], instance[50:, :40], instance[60:61, 60:61] = 40_000, 45_000, 45_007
    image = np.random.default_rng(1).integers(90, 111, (72, 96, 3)).astype(np.uint8)
    kinds = {40_000: "ground", 45_000: "tree", 45_007: "vehicle"}
    picture = Picture(image, depth, instance, pose, CAMERA)
    found = measure_picture(picture, kinds, 0.0)
    assert found.sky_below == 0
    assert found.things == ("ground", "tree", "vehicle")
    assert found.flat_patches == 0.0
    assert found.luminance == pytest.approx(100.0, abs=1.5)
    depth[70:, 3:8] = np.inf
    assert measure_picture(picture, kinds, 0.0).sky_below == 10
    flat = np.full((72, 96), 77.0)
    flat[:24] = np.arange(96)
    assert dead_share(flat, np.zeros((72, 96), bool)) == pytest.approx(2 / 3)
    assert horizon_dip(100.0) == pytest.approx(np.arccos(6.371e6 / (6.371e6 + 100.0)), rel=1e-3)


@pytest.mark.slow
@pytest.mark.proof_only
@pytest.mark.parametrize("world", ["city", "countryside", "hillside", "lakeside"])
def test_worlds_look_right_from_everywhere(world: str, proof_count: Count, record_proof: RecordProof) -> None:
    """Seeds in a row, looks and lights in turn: no hole in the land, no flat patch, light under the deck, company."""
    count = proof_count(1, 6)
    shots = [photograph_world(world, seed) for seed in range(count)]
    found = [measure for shot in shots for measure in shot.measures]
    low = [measure for shot in shots for measure in shot.measures[LOW]]
    holes = sum(measure.sky_below for measure in found)
    assert holes == 0
    assert np.quantile([measure.flat_patches for measure in found], 0.95) < 0.02
    assert np.mean([len(measure.things) >= 4 for measure in low]) >= 0.9
    under = [shot.measures[1].luminance for shot in shots]
    assert 40.0 <= min(under) <= max(under) <= 180.0
    drawn = float(np.quantile([measure.triangles for measure in found], 0.95))
    most = max(shot.total for shot in shots)
    assert most <= 1_500_000
    record_proof(
        f"worlds/{world}/views",
        len(found),
        0,
        {
            "rays_down_to_sky": holes,
            "under_deck_median_min": round(min(under)),
            "under_deck_median_max": round(max(under)),
            "frames_with_four_kinds": round(float(np.mean([len(m.things) >= 4 for m in low])), 3),
            "dead_patches_p95": round(float(np.quantile([m.flat_patches for m in found], 0.95)), 4),
            "triangles_in_all_max": most,
            "triangles_drawn_p95": round(drawn),
            "over_the_budget": max(round(drawn) - MOST_DRAWN, 0),
        },
    )


def test_a_table_says_how_many_triangles_views_have() -> None:
    """The line below it: nearly all views, those from the ground alone, the fullest view, the largest scene."""
    counts = ((100_000, 200_000, 300_000, 900_000), (100_000, 200_000, 300_000, 500_000))
    rows = [
        WorldShots("city 0: clean, noon", (), tuple(Measures(0, 0.0, 99.0, ("tree",), count) for count in row), total)
        for row, total in zip(counts, (1_000_000, 2_000_000), strict=True)
    ]
    *_, last = world_table(rows)
    every = np.quantile(np.array(counts), 0.95)
    assert last == (
        f"Triangles of a view: {every:,.0f} in 95 % of them (300,000 in 95 % of those from the ground), "
        "900,000 at most; in a whole scene 2,000,000 at most."
    )


def test_unknown_worlds_are_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One line, and the names that there are."""
    with pytest.raises(SystemExit) as done:
        main(["gallery", "worlds", "-o", str(tmp_path / "out"), "--world", "moon"])
    assert done.value.code == 2
    assert "lakeside" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
