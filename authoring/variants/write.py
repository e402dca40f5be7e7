"""One look, background or light on disk: a separate folder, with the same bytes whenever it is written."""

from collections.abc import Mapping
from pathlib import Path

from authoring.backgrounds.registry import BACKGROUNDS, build_background
from authoring.backgrounds.site_changes import NO_CHANGES
from authoring.imported.asset import read_city
from authoring.imported.skin import skin_recipes
from authoring.imported.surroundings import build_city_world
from authoring.layers.assets import Pieces, bake_surfaces, write_asset
from authoring.layers.background import background_layer
from authoring.layers.geometry import BACKGROUND, roles_of
from authoring.layers.layer import export
from authoring.layers.lighting import light_layer
from authoring.layers.looks import look_layer
from authoring.layers.on_site import FILE, on_site_layer
from authoring.layers.provenance import author_provenance
from authoring.layers.repeats import with_own_ids
from authoring.layers.worlds import WorldFiles
from authoring.light.daylight import LightSettings, bake_light
from authoring.looks.bake import NO_FOLDERS, bake_look
from authoring.looks.seasons import SUMMER
from authoring.scenes.manifest import SceneRecipe
from authoring.settings import AuthoringSettings
from authoring.shapes.component import FIRST_EDIT_ID, Component
from authoring.site.site import Site
from authoring.streams import stream
from groundwork.canonical import digest

NO_BACKGROUND = "none"
_SECTIONS = {"bridge": ("bridge",), "site": ("bridge", "site"), "background": ("bridge", "site", "background")}


def made_from(settings: AuthoringSettings, seed: int, asset: str) -> dict[str, str]:
    """List the settings that an asset depends on; looks and surveys do not affect the bridge.

    Args:
        settings: Settings of the scenario.
        seed: Seed of the scene.
        asset: `bridge`, `site` or `background`.
    """
    sections: dict[str, object] = {name: getattr(settings, name) for name in _SECTIONS[asset]}
    if asset == "site" and settings.background.season != SUMMER:  # the only value of its surroundings that a site uses
        sections["season"] = settings.background.season
    return {"seed": str(seed), "settings": digest(sections)}


def write_look(
    recipe: SceneRecipe,
    name: str,
    bridge: Pieces,
    folder: Path,
    *,
    given: Mapping[str, Path] = NO_FOLDERS,
    base: str = "",
    waterline: float | None = None,
) -> str:
    """Bake a look for a bridge.

    Args:
        recipe: The inputs of the scene's authoring.
        name: Name of the look.
        bridge: Pieces of the bridge.
        folder: Folder of the bridge.
        given: Users' folders of surfaces by their names in the settings.
        base: Look of the roles without a fitting surface of the user; the one of that name when empty.
        waterline: Height of the river around piers [m]; None where none stands in it.

    Returns:
        Its file, relative to that folder.
    """
    file = f"./looks/{name}/look.usda"
    place = (folder / file).parent
    place.mkdir(parents=True, exist_ok=True)
    recipes = bake_look(
        recipe.settings.look,
        base or name,
        place,
        bridge,
        stream(recipe.seed, f"look/{name}"),
        given=given,
        waterline=waterline,
    )
    export(look_layer(recipes), folder / file)
    return file


def write_background(
    settings: AuthoringSettings, seed: int, name: str, site: Site, folder: Path, world: Path | None = None
) -> WorldFiles:
    """Build a background round a site.

    Args:
        settings: Settings of the scenario.
        seed: Seed of the scene.
        name: Name of the background.
        site: The site.
        folder: Scene folder.
        world: Imported world for the site, instead of a procedural one.

    Returns:
        Its files, relative to that folder.
    """
    if name == NO_BACKGROUND:
        return WorldFiles("")
    file = f"./background/{name}/{name}.usda"
    place = (folder / file).parent
    made, rng = made_from(settings, seed, "background"), stream(seed, "background")
    season, changes = settings.background.season, NO_CHANGES
    if world is None:
        pieces, skins = build_background(name, settings.background, site, rng), ()
        changes = BACKGROUNDS[name].change(site, stream(seed, "background/site"))
    else:
        model = read_city(world)
        pieces, made = build_city_world(model, site, rng), {**made, **model.attribution}
        used = set(roles_of(pieces))
        skins = tuple(skin for skin in model.skins if skin.role in used)
    pieces = with_own_ids(pieces, FIRST_EDIT_ID - 1)
    write_asset(BACKGROUND, pieces, place)
    roles = {skin.role for skin in skins}
    own = tuple(piece for piece in pieces if not (isinstance(piece, Component) and piece.role in roles))
    baked = bake_surfaces(own, place, settings.look.texels, seed, season, changes.names())
    recipes = {role: baked[role] for role in roles_of(own)} | skin_recipes(skins, place)
    layer = background_layer(name, recipes)
    export(author_provenance(layer, "/Background", made, is_ours=world is None), folder / file)
    if changes == NO_CHANGES:
        return WorldFiles(file)
    export(on_site_layer(name, site.pieces, changes, baked), place / FILE)
    return WorldFiles(file, f"./background/{name}/{FILE}")


def write_light(settings: LightSettings, seed: int, name: str, folder: Path, skies: Mapping[str, Path]) -> str:
    """Bake a light; all lights of a scene have the same clouds.

    Args:
        settings: Time, place and weather.
        seed: Seed of the scene.
        name: Name of the light.
        folder: Scene folder.
        skies: Photographed skies by their name in `light.sky`.

    Returns:
        Its file, relative to that folder.

    Raises:
        InputError: The photographed sky is missing, or is not a sky.
    """
    picture = skies.get(settings.sky, Path(settings.sky)) if settings.sky else None
    file = f"./lights/{name}/light.usda"
    place = (folder / file).parent
    place.mkdir(parents=True, exist_ok=True)
    export(light_layer(bake_light(settings, place, stream(seed, "light"), picture)), folder / file)
    return file
