"""Downloads of the gallery: each scenario beside a sheet makes what the sheet's first row shows."""

import re
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from authoring.scene import author_scene
from authoring.settings import AuthoringSettings
from docs.pictures import FAMILIES, RECIPES, WORLDS
from falsework.gallery import combinations, families, looks, worlds
from falsework.scenario import Scenario, load_scenario, scene_seed

DOCS = Path(__file__).resolve().parents[2] / "docs"


class Asked(Exception):
    """What a sheet was about to author."""


def asked(take: Callable[[], Any], module: Any, monkeypatch: pytest.MonkeyPatch) -> tuple[AuthoringSettings, int]:
    """Tell which settings and seed a sheet authors, without authoring them."""

    def stop(settings: AuthoringSettings, seed: int, *_: Any) -> None:
        raise Asked(settings, seed)

    assert module.author_scene is author_scene
    monkeypatch.setattr(module, "author_scene", stop)
    with pytest.raises(Asked) as told:
        take()
    settings, seed = told.value.args
    return settings, seed


def first_seed(picture: str) -> int:
    """Give the seed of the first row of a sheet."""
    (words,) = (recipe.words for recipe in RECIPES if picture in recipe.pictures)
    return int(words[words.index("--seed") + 1])


def scenario_beside(name: str) -> Scenario:
    """Read a scenario that the gallery offers; it must say nothing that it is not asked for."""
    return load_scenario(DOCS / "gallery" / f"{name}.toml")


@pytest.mark.parametrize("family", FAMILIES)
def test_a_scenario_makes_the_bridge_of_its_sheet(family: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """It says the seed that the sheet was given: the same scene, bridge, site, world and look."""
    row = first_seed(f"gallery/{family}.jpg")
    settings, seed = asked(lambda: families.photograph(family, row), families, monkeypatch)
    given = scenario_beside(family)
    assert given.seed == row
    assert scene_seed(row, 0) == seed
    assert (given.bridge, given.site, given.background) == (settings.bridge, settings.site, settings.background)
    assert (given.look.name, given.light) == (settings.look.name, settings.light)


@pytest.mark.parametrize("world", WORLDS)
def test_a_scenario_makes_the_world_of_its_sheet(world: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """It says the seed that the sheet was given: the same scene, bridge, site, world, look and light."""
    row = first_seed(f"worlds/{world}.jpg")
    settings, seed = asked(lambda: worlds.photograph_world(world, row), worlds, monkeypatch)
    given = scenario_beside(world)
    assert given.seed == row
    assert scene_seed(row, 0) == seed
    assert (given.bridge, given.site, given.background) == (settings.bridge, settings.site, settings.background)
    assert (given.look.name, given.light) == (settings.look.name, settings.light)


def test_a_scenario_makes_the_looks_of_their_sheet(monkeypatch: pytest.MonkeyPatch) -> None:
    """It says the seed that the sheet was given: the same bridge in every look."""
    row = first_seed("looks/looks.jpg")
    settings, seed = asked(lambda: looks.photograph_look("aged", row, 256), looks, monkeypatch)
    given = scenario_beside("looks")
    assert given.seed == row
    assert scene_seed(row, 0) == seed
    assert (given.bridge, given.site, given.background) == (settings.bridge, settings.site, settings.background)
    assert set(given.variants.look) == set(looks.LOOKS)


def test_a_scenario_makes_the_combinations_of_their_sheets(monkeypatch: pytest.MonkeyPatch) -> None:
    """It says the seed that the sheets were given: the same bridge in every world and look."""
    row = first_seed("combinations/city.jpg")
    given = scenario_beside("combinations")
    take = partial(combinations.photograph_combinations, "arch", row, given.variants.background, tuple(looks.LOOKS))
    settings, seed = asked(lambda: list(take()), combinations, monkeypatch)
    assert given.seed == row
    assert scene_seed(row, 0) == seed
    assert (given.bridge, given.site, given.background) == (settings.bridge, settings.site, settings.background)
    assert (given.look.name, given.light) == (settings.look.name, settings.light)
    assert given.variants == settings.variants


def test_the_gallery_links_what_makes_it() -> None:
    """Every picture of the page stands in the list of recipes, every link leads to a file, every scenario is linked."""
    page = (DOCS / "gallery.md").read_text(encoding="utf-8")
    links = re.findall(r"\]\(([^)#]+)\)", page)
    assert [link for link in links if not (DOCS / link).is_file()] == []
    pictures = {picture for recipe in RECIPES for picture in recipe.pictures}
    assert {link.removeprefix("images/") for link in links if link.startswith("images/")} <= pictures
    assert {f"gallery/{path.name}" for path in (DOCS / "gallery").iterdir()} <= set(links)
