"""Seasons: what grows has other colors, and nothing else of a scene is another; summer is what there was before."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from authoring.backgrounds.registry import BackgroundSettings
from authoring.looks.leaves import leaves
from authoring.looks.library import SheetName, draw_sheet
from authoring.looks.noise import Tile
from authoring.looks.scenery import SCENERY, SEASONAL, worn_in
from authoring.looks.seasons import SEASONS, SUMMER, Season
from authoring.looks.sheet import Sheet
from authoring.settings import AuthoringSettings
from authoring.site.sprays import ROWS, SPRAYS
from groundwork.canonical import canonical_json, digest
from groundwork.errors import InputError
from groundwork.settings import parse_settings
from tests.authoring.small_scene import SMALL, file_bytes, write_small_scene

COUNTRY: dict[str, object] = {
    "name": "countryside",
    "countryside": {"reach": 400, "buildings": 1, "trees": 8, "hedge_bushes": 5},
}
COARSE = {**SMALL["site"], "fine_spacing": 2.0, "coarse_spacing": 8.0}  # type: ignore[dict-item]
OTHERS: tuple[Season, ...] = tuple(season for season in SEASONS if season != SUMMER)
NEEDLES = ("spruce", "pine", "twigs")


@cache
def _leaves(season: Season = SUMMER) -> Sheet:
    return leaves(Tile(512, 4.0, np.random.default_rng(5)), season)


@cache
def _drawn(surface: str, season: Season, pixels: int = 256) -> Sheet:
    recipe = SCENERY[surface]
    tile = Tile(pixels, recipe.meters, np.random.default_rng(5))
    return recipe.draw(tile) if season == SUMMER else SEASONAL[surface](tile, season)


def _cells(sheet: Sheet, kind: str) -> np.ndarray:
    """Colors of what is seen of a kind's cells [1], shape (N, 3)."""
    assert sheet.opacity is not None
    side = len(sheet.opacity) // ROWS
    found = []
    for cell in SPRAYS[kind]:
        row, column = ROWS - 1 - cell // ROWS, cell % ROWS
        place = np.s_[row * side : (row + 1) * side, column * side : (column + 1) * side]
        found.append(sheet.albedo[place][sheet.opacity[place] > 0.5])
    return np.concatenate(found)


def test_summer_is_spelled_as_before_there_were_seasons() -> None:
    """Hashes of settings, and with them the bytes of scenes and the keys of results, say nothing of summer."""
    plain, said = BackgroundSettings(), BackgroundSettings(season="summer")
    assert "season" not in canonical_json(plain)
    assert digest(plain) == digest(said)
    whole = AuthoringSettings.model_validate({"background": {"season": "autumn"}})
    assert parse_settings(AuthoringSettings, whole.model_dump(mode="json"), "test") == whole
    assert len({digest(BackgroundSettings(season=season)) for season in SEASONS}) == len(SEASONS)
    with pytest.raises(InputError, match=r"background\.season.*'spring', 'summer', 'autumn' or 'winter'"):
        parse_settings(AuthoringSettings, {"background": {"season": "fall"}}, "test")


def test_a_season_cuts_out_the_same_leaves() -> None:
    """Opacity and roughness are those of summer to the bit, and so are needles; broad leaves and grass are not."""
    summer = _leaves()
    for season in OTHERS:
        other = _leaves(season)
        assert other.opacity is not None
        assert summer.opacity is not None
        np.testing.assert_array_equal(other.opacity, summer.opacity)
        np.testing.assert_array_equal(other.roughness, summer.roughness)
        for kind in SPRAYS:
            one, two = _cells(summer, kind), _cells(other, kind)
            assert (one == two).all() == (kind in NEEDLES), (season, kind)


def test_seasons_have_their_colors() -> None:
    """Leaves, grass and fields: light and green in spring, red over green in autumn, dull in winter."""
    for kind in ("oak", "lime", "willow", "scrub", "grass"):
        mean = {season: _cells(_leaves(season), kind).mean(axis=0) for season in SEASONS}
        warm = {season: color[0] / color[1] for season, color in mean.items()}
        vivid = {season: np.ptp(color) / color.max() for season, color in mean.items()}
        assert mean["spring"].sum() > 1.1 * mean["summer"].sum(), kind
        assert warm["spring"] <= warm["summer"] < 0.9 * warm["autumn"], kind
        assert vivid["winter"] < vivid["autumn"], kind
    for surface in ("grass", "meadow", "crop", "ripe_crop", "hay", "woodland"):
        mean = {season: _drawn(surface, season).albedo.mean(axis=(0, 1)) for season in SEASONS}
        warm = {season: color[0] / color[1] for season, color in mean.items()}
        assert warm["spring"] < warm["summer"] < warm["autumn"], surface
        assert all(0.02 < color.max() < 0.35 for color in mean.values()), surface


def test_conifers_of_a_wood_stay_green() -> None:
    """A fifth of a wood and more is as in summer, and more green than red; the rest turns."""
    summer, autumn = _drawn("woodland", "summer"), _drawn("woodland", "autumn")
    same = (summer.albedo == autumn.albedo).all(axis=-1)
    assert 0.2 < same.mean() < 0.8
    assert (autumn.albedo[same][:, 1] > autumn.albedo[same][:, 0]).all()
    turned = autumn.albedo[~same]
    assert np.median(turned[:, 0] / turned[:, 1]) > 1.0
    np.testing.assert_array_equal(summer.height, autumn.height)


def test_what_does_not_grow_has_one_sheet_a_year() -> None:
    """A sheet of brick is kept once; one of grass for each season, and a season's draw is summer's in another color."""
    assert {worn_in("brick", season) for season in SEASONS} == {SUMMER}
    names = {SheetName("grass", 0, 256, worn_in("grass", season)).key for season in SEASONS}
    assert len(names) == len(SEASONS)
    summer, autumn = (draw_sheet(SheetName("grass", 0, 256, season), None)[0] for season in (SUMMER, "autumn"))
    assert summer["roughness.png"] == autumn["roughness.png"]
    assert summer["albedo.jpg"] != autumn["albedo.jpg"]


def test_a_season_changes_materials_alone(tmp_path: Path) -> None:
    """Site and background in autumn: geometry, labels, bridge, cameras and lights are the same files."""
    scenes = {}
    for season in (SUMMER, "autumn"):
        (tmp_path / season).mkdir()
        write_small_scene(tmp_path / season, background={**COUNTRY, "season": season}, site=COARSE)
        scenes[season] = file_bytes(tmp_path / season)
    one, two = scenes.values()
    assert one.keys() == two.keys()
    other = {name for name in one if one[name] != two[name]}
    wanted = {"manifest.json", "scene.usda", "site/site.usda", "background/countryside/countryside.usda"}
    pictures = {name for name in other if "/textures/" in name}
    assert other == wanted | pictures
    assert {name.rpartition("/")[2] for name in pictures} >= {"site_leaves_albedo.png", "countryside_grass_albedo.jpg"}
    assert all("albedo" in name and not name.startswith("bridge/") for name in pictures)
