"""The conductor: from settings and a seed to a folder of layers that composes into one stage."""

from dataclasses import asdict
from itertools import islice
from pathlib import Path

import numpy as np
from pxr import Usd

from authoring.alignment import Layout
from authoring.backgrounds.registry import build_background
from authoring.component import Component, Scatter
from authoring.families.registry import build_bridge
from authoring.layers.background import background_layer
from authoring.layers.bridge import bridge_layer, payload_layer
from authoring.layers.geometry import BACKGROUND, BRIDGE, SITE, Asset, geometry_layer, roles_of
from authoring.layers.layer import export
from authoring.layers.lighting import lighting_layer
from authoring.layers.looks import look_layer
from authoring.layers.render_settings import render_layer
from authoring.layers.root import edits_layer, root_layer
from authoring.layers.semantics import semantics_layer
from authoring.layers.site import site_layer
from authoring.layers.surveys import survey_layer, surveys_layer
from authoring.layout import DrawnBridge, draw_layout
from authoring.lighting import bake_sky
from authoring.looks.bake import bake_look, bake_surface
from authoring.looks.material import MaterialRecipe
from authoring.looks.roles import LOOKS
from authoring.settings import AuthoringSettings
from authoring.site import Site, draw_site
from authoring.streams import stream
from authoring.surveys.path import CameraPath
from authoring.surveys.registry import plan_survey
from authoring.surveys.subject import make_subject
from groundwork.canonical import folder_digest
from groundwork.files import space_errors, write_manifest
from groundwork.progress import Progress

FORMAT_VERSION = 1
NO_BACKGROUND = "none"

Pieces = tuple[Component | Scatter, ...]


def author_scene(settings: AuthoringSettings, seed: int, folder: Path, progress: Progress) -> None:
    """Author a whole scene.

    Args:
        settings: What the scenario says.
        seed: Seed of the scene; each layer draws from a stream of its own.
        folder: Existing empty folder; afterwards it holds `scene.usda` and can be moved as a whole.
        progress: Listener.
    """
    progress.stage("author", 7)
    layout, drawn = draw_layout(settings.bridge, stream(seed, "bridge"))
    site = draw_site(settings.site, layout, stream(seed, "site"))
    bridge = build_bridge(layout, drawn, site.ground)
    progress.advance(1)
    with space_errors(folder):
        _write_asset(SITE, site.pieces, folder / "site")
        recipes = _surfaces(site.pieces, folder / "site", settings.look.texels, seed)
        export(site_layer(recipes), folder / "site/site.usda")
        progress.advance(2)
        _write_bridge(settings, layout, drawn, bridge, folder / "bridge", seed)
        progress.advance(3)
        subject = make_subject(bridge, site.pieces)
        paths = [plan_survey(survey, subject, seed) for survey in settings.survey]
        _write_surveys(paths, folder / "surveys")
        progress.advance(4)
        backgrounds = _write_background(settings, site, folder / "background", seed)
        progress.advance(5)
        export(lighting_layer(bake_sky(settings.light, folder, stream(seed, "light"))), folder / "lighting.usda")
        progress.advance(6)
        export(render_layer(paths), folder / "render.usda")
        export(edits_layer(), folder / "edits/user.usda")
        images = max(len(path.poses) for path in paths)
        root = root_layer(settings.look.name, settings.background.name, backgrounds, images)
        export(root, folder / "scene.usda")
        _write_manifest(settings, seed, folder)
    progress.advance(7)


def _write_bridge(
    settings: AuthoringSettings, layout: Layout, drawn: DrawnBridge, bridge: Pieces, folder: Path, seed: int
) -> None:
    _write_asset(BRIDGE, bridge, folder)
    export(payload_layer(), folder / "payload.usda")
    others = (name for name in LOOKS if name != settings.look.name)
    names = [settings.look.name, *islice(others, 1)]  # a second look, so that a swap needs no authoring
    for name in names:
        place = folder / "looks" / name
        place.mkdir(parents=True)
        recipes = bake_look(settings.look, name, place, bridge, stream(seed, f"look/{name}"))
        export(look_layer(recipes), place / "look.usda")
    files = {name: f"./looks/{name}/look.usda" for name in names}
    spans = tuple(np.diff(layout.supports).tolist())
    export(bridge_layer(settings.bridge.family, spans, layout.width, asdict(drawn), files), folder / "bridge.usda")


def _write_surveys(paths: list[CameraPath], folder: Path) -> None:
    for path in paths:
        export(survey_layer(path), folder / f"{path.id}.usdc")
    export(surveys_layer([path.id for path in paths]), folder / "surveys.usda")


def _write_background(settings: AuthoringSettings, site: Site, folder: Path, seed: int) -> dict[str, str]:
    name = settings.background.name
    if name == NO_BACKGROUND:
        return {NO_BACKGROUND: ""}
    pieces = build_background(name, settings.background, site, stream(seed, "background"))
    place = folder / name
    _write_asset(BACKGROUND, pieces, place)
    recipes = _surfaces(pieces, place, settings.look.texels, seed)
    export(background_layer(name, recipes), place / f"{name}.usda")
    return {NO_BACKGROUND: "", name: f"./background/{name}/{name}.usda"}


def _write_asset(asset: Asset, pieces: Pieces, folder: Path) -> None:
    export(geometry_layer(asset, pieces), folder / "geometry.usdc")
    export(semantics_layer(asset, pieces), folder / "semantics.usdc")


def _surfaces(pieces: Pieces, folder: Path, texels: int, seed: int) -> dict[str, MaterialRecipe]:
    # One stream a surface, the same for site and background: their grass is one grass, and goes on over the border.
    return {name: bake_surface(name, folder, stream(seed, f"surface/{name}"), texels) for name in roles_of(pieces)}


def _write_manifest(settings: AuthoringSettings, seed: int, folder: Path) -> None:
    record = {
        "format": "falsework.scene",
        "format_version": FORMAT_VERSION,
        "seed": seed,
        "settings": settings,
        "versions": {"usd": ".".join(str(part) for part in Usd.GetVersion()), "numpy": np.__version__},
        "scene": folder_digest(folder),
    }
    write_manifest(folder, record, "manifest.json")
