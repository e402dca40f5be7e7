"""The conductor: creates from settings and a seed a folder of layers that compose into one stage."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from itertools import islice
from pathlib import Path

import numpy as np
from pxr import Sdf

from authoring.axis.alignment import Layout
from authoring.backgrounds.registry import BACKGROUNDS
from authoring.families.bridge_settings import DrawnBridge, draw_layout
from authoring.families.registry import build_bridge
from authoring.layers.assets import Pieces, bake_site, write_asset
from authoring.layers.bridge import bridge_layer, payload_layer
from authoring.layers.geometry import BRIDGE, SITE
from authoring.layers.layer import export
from authoring.layers.lighting import lighting_layer
from authoring.layers.provenance import author_provenance
from authoring.layers.render_settings import CLASSES, render_layer
from authoring.layers.root import bounds_of, edits_layer, root_layer
from authoring.layers.site import site_layer
from authoring.layers.surveys import survey_layer, surveys_layer
from authoring.layers.taxonomy import taxonomy_layer
from authoring.layers.variant import variant_layer
from authoring.looks.roles import LOOKS
from authoring.scenes.labels import write_labels
from authoring.scenes.manifest import SceneRecipe, write_scene_manifest
from authoring.settings import AuthoringSettings
from authoring.site.site import draw_site
from authoring.streams import stream
from authoring.surveys.path import CameraPath
from authoring.surveys.registry import plan_survey
from authoring.surveys.subject import make_subject
from authoring.variants.write import NO_BACKGROUND, made_from, write_background, write_light, write_look
from groundwork.canonical import digest
from groundwork.errors import InputError
from groundwork.files import space_errors
from groundwork.progress import Progress
from usd_schemas import tokens
from usd_schemas.taxonomies import BASE, taxonomy


@dataclass(frozen=True)
class GivenFiles:
    """Files and folders of the user, by their names in the settings.

    Attributes:
        worlds: Imported worlds of `[background]` and `[variants]`.
        skies: Photographed skies of `[light]` and `[[variants.light]]`.
        surfaces: Folders of surfaces of `[look]`.
    """

    worlds: Mapping[str, Path] = field(default_factory=dict[str, Path])
    skies: Mapping[str, Path] = field(default_factory=dict[str, Path])
    surfaces: Mapping[str, Path] = field(default_factory=dict[str, Path])


NO_FILES = GivenFiles()


def author_scene(
    settings: AuthoringSettings,
    seed: int,
    folder: Path,
    progress: Progress,
    given: GivenFiles = NO_FILES,
) -> None:
    """Author a whole scene.

    Args:
        settings: Settings of the scenario.
        seed: Seed of the scene; each layer has a separate random stream.
        folder: Existing empty folder; afterwards it holds `scene.usda` and can be moved as a whole.
        progress: Listener.
        given: The user's own files.
    """
    worlds = given.worlds
    for name in (settings.background.name, *settings.variants.background):
        if name not in BACKGROUNDS and name not in worlds:
            raise InputError(
                "unknown background",
                field="background.name",
                value=name,
                allowed=", ".join((*BACKGROUNDS, *worlds)),
            )
    progress.stage("author", 7)
    layout, drawn = draw_layout(settings.bridge, stream(seed, "bridge"))
    site = draw_site(settings.site, layout, stream(seed, "site"))
    bridge = build_bridge(layout, drawn, site.ground)
    progress.advance(1)
    with space_errors(folder):
        write_asset(SITE, site.pieces, folder / "site")
        recipes = bake_site(site, folder / "site", settings.look.texels, seed, settings.background.season, bridge)
        site_root = author_provenance(site_layer(recipes), "/Site", made_from(settings, seed, "site"))
        export(site_root, folder / "site/site.usda")
        progress.advance(2)
        _write_bridge(SceneRecipe(settings, seed), layout, drawn, bridge, folder, given.surfaces, water=site.waterline)
        progress.advance(3)
        subject = make_subject(bridge, site.pieces)
        paths = [plan_survey(survey, subject, seed) for survey in settings.survey]
        _write_surveys(paths, folder / "surveys")
        progress.advance(4)
        names = dict.fromkeys((NO_BACKGROUND, settings.background.name, *settings.variants.background))
        backgrounds = {name: write_background(settings, seed, name, site, folder, worlds.get(name)) for name in names}
        progress.advance(5)
        lights = settings.variants.lights(settings.light)
        files = {name: write_light(light, seed, name, folder, given.skies) for name, light in lights.items()}
        export(lighting_layer(files), folder / "lighting.usda")
        progress.advance(6)
        export(render_layer(paths), folder / "render.usda")
        export(taxonomy_layer(taxonomy(BASE)), folder / CLASSES)
        export(edits_layer(), folder / "edits/user.usda")
        images = max((len(path.poses) for path in paths), default=1)
        root = root_layer(settings.look.name, settings.background.name, backgrounds, images, bounds_of(bridge))
        author_provenance(root, tokens.WORLD, {"seed": str(seed), "settings": digest(settings)})
        export(root, folder / "scene.usda")
        write_labels(settings.labels, folder)
        _write_variants(settings, root, folder)
        write_scene_manifest(SceneRecipe(settings, seed), folder)
    progress.advance(7)


def _write_bridge(
    recipe: SceneRecipe,
    layout: Layout,
    drawn: DrawnBridge,
    bridge: Pieces,
    folder: Path,
    surfaces: Mapping[str, Path],
    *,
    water: float | None,
) -> None:
    settings, seed, folder = recipe.settings, recipe.seed, folder / "bridge"
    write_asset(BRIDGE, bridge, folder)
    export(payload_layer(), folder / "payload.usda")
    asked = dict.fromkeys((settings.look.name, *settings.variants.look))
    others = (name for name in LOOKS if name not in asked)
    names = [*asked, *islice(others, max(2 - len(asked), 0))]  # at least two: another look is then at hand
    files = {name: write_look(recipe, name, bridge, folder, given=surfaces, waterline=water) for name in names}
    spans = tuple(np.diff(layout.supports).tolist())
    facts = {**asdict(drawn), "alignment": asdict(layout.alignment)}
    layer = bridge_layer(drawn.family, spans, layout.width, facts, files)
    export(author_provenance(layer, "/Bridge", made_from(settings, seed, "bridge")), folder / "bridge.usda")


def _write_surveys(paths: list[CameraPath], folder: Path) -> None:
    for path in paths:
        export(survey_layer(path), folder / f"{path.id}.usdc")
    export(surveys_layer([path.id for path in paths]), folder / "surveys.usda")


def _write_variants(settings: AuthoringSettings, root: Sdf.Layer, folder: Path) -> None:
    for name, selections in settings.variants.combinations().items():
        export(variant_layer(root, "scene.usda", selections), folder / f"variant_{name}.usda")
