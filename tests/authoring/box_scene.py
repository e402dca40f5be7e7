"""The bridge of boxes as a whole scene on disk, with flat colors: valid, and quick to write."""

from pathlib import Path

from pxr import UsdGeom, UsdLux

from authoring.layers.assets import Pieces
from authoring.layers.background import background_layer
from authoring.layers.bridge import bridge_layer, payload_layer
from authoring.layers.geometry import BACKGROUND, BRIDGE, SITE, geometry_layer, roles_of
from authoring.layers.layer import export, new_stage
from authoring.layers.looks import look_layer
from authoring.layers.render_settings import CLASSES, render_layer
from authoring.layers.root import bounds_of, edits_layer, root_layer
from authoring.layers.semantics import semantics_layer
from authoring.layers.site import site_layer
from authoring.layers.surveys import survey_layer, surveys_layer
from authoring.layers.taxonomy import taxonomy_layer
from authoring.layers.worlds import WorldFiles
from authoring.looks.material import MaterialRecipe
from authoring.shapes.component import Component
from authoring.surveys.registry import plan_survey
from authoring.surveys.settings import GlobalSettings
from authoring.surveys.subject import make_subject
from tests.authoring.boxes import box, box_bridge, flat_site
from usd_schemas import tokens
from usd_schemas.taxonomies import BASE, taxonomy

FAR: Pieces = (
    Component("Background_House", "building", "brick", "Buildings", box((0, 100, -1), (10, 110, 8)), 45_000),
)
SHADES = {"weathered": 0.3, "clean": 0.6}


def write_box_scene(folder: Path, far: Pieces = FAR) -> Path:
    """Write the scene, with something in the background, into an empty folder and return its `scene.usda`."""
    bridge, site = box_bridge(), flat_site()
    assets = ((BRIDGE, bridge, "bridge"), (SITE, site, "site"), (BACKGROUND, far, "background/house"))
    for asset, pieces, place in assets:
        export(geometry_layer(asset, pieces), folder / place / "geometry.usdc")
        export(semantics_layer(asset, pieces), folder / place / "semantics.usda")
    export(site_layer(_flat(roles_of(site), 0.4)), folder / "site/site.usda")
    export(background_layer("house", _flat(roles_of(far), 0.5)), folder / "background/house/house.usda")
    for look, shade in SHADES.items():
        export(look_layer(_flat(roles_of(bridge), shade)), folder / f"bridge/looks/{look}/look.usda")
    export(payload_layer(), folder / "bridge/payload.usda")
    looks = {look: f"./looks/{look}/look.usda" for look in SHADES}
    export(bridge_layer("beam", (18.0, 22.0), 10.0, {}, looks), folder / "bridge/bridge.usda")
    path = plan_survey(GlobalSettings(), make_subject(bridge, site), 1)
    export(survey_layer(path), folder / f"surveys/{path.id}.usdc")
    export(surveys_layer([path.id]), folder / "surveys/surveys.usda")
    export(render_layer([path]), folder / "render.usda")
    export(taxonomy_layer(taxonomy(BASE)), folder / CLASSES)
    export(edits_layer(), folder / "edits/user.usda")
    stage = new_stage("World")
    UsdGeom.Scope.Define(stage, tokens.ENVIRONMENT)
    sun = UsdLux.DistantLight.Define(stage, f"{tokens.ENVIRONMENT}/Sun")
    sun.CreateIntensityAttr(4.0)
    sun.CreateNormalizeAttr(True)
    export(stage.GetRootLayer(), folder / "lighting.usda")
    backgrounds = {"none": WorldFiles(""), "house": WorldFiles("./background/house/house.usda")}
    export(root_layer("weathered", "house", backgrounds, len(path.poses), bounds_of(bridge)), folder / "scene.usda")
    return folder / "scene.usda"


def _flat(roles: tuple[str, ...], gray: float) -> dict[str, MaterialRecipe]:
    return {role: MaterialRecipe(role, color=(gray, gray, gray)) for role in roles}
