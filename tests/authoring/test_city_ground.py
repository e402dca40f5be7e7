"""The ground beside a bridge in a city: other surfaces and hidden plants, composed by USD, with the same site."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from pxr import Sdf, Usd, UsdGeom, UsdShade

from authoring.axis.alignment import Alignment, Layout
from authoring.backgrounds.city_ground import change_site, city_surfaces
from authoring.backgrounds.registry import BACKGROUNDS
from authoring.backgrounds.site_changes import NO_CHANGES
from authoring.backgrounds.site_lots import find_lots
from authoring.edits.edits_left_out import edits_left_out
from authoring.edits.matching import match_stages
from authoring.exchange.flatten import flatten_scene
from authoring.layers.on_site import ON_SITE
from authoring.looks.recipes import RECIPES
from authoring.scenes.add_survey import ALONE
from authoring.scenes.validate import validate_scene
from authoring.shapes.component import Component, Scatter
from authoring.site.covers import COVERS, cover_name
from authoring.site.site import Site, SiteSettings, draw_site
from authoring.streams import stream
from authoring.surveys.stage_subject import stage_subject
from authoring.variants.add import set_choices
from tests.authoring.small_scene import SMALL, file_bytes, write_small_scene
from usd_schemas import tokens
from usd_schemas.reading.stage_reader import read_stage

F64 = NDArray[np.float64]
Bindings = dict[str, str]

LAYOUT = Layout(Alignment(7.0), (0.0, 18.0, 40.0), 11.5, 1.9, "road", 8.0, 3.4)
RURAL = {"furrows", "crop", "ripe_crop", "hay", "meadow", "soil"}
TUFTS = f"{tokens.SITE}/SiteGeom/SitePlants/Site_Tufts"
FENCES = [
    f"{tokens.SITE}/SiteGeom/SiteWays/Site_Fence_{number}_{side}_{what}"
    for number in (0, 1)
    for side in "LR"
    for what in ("Posts", "Wires")
]
TOWN = {"name": "none", "city": {"town": 150.0, "reach": 1200.0, "trees": 0, "vehicles": 0, "density": 0.1}}
OWN = {"site": {**SMALL["site"], "land": "fields", "fences": True}}  # type: ignore[dict-item]


@pytest.fixture(scope="module")
def authored(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, bytes]]:
    """Author a bridge in an empty world, and choose a city afterwards; give its scene, and its files before."""
    root = write_small_scene(tmp_path_factory.mktemp("city"), background=TOWN, **OWN)
    before = file_bytes(root.parent)
    set_choices(root, {"background": "city"}, print)
    return root, before


@pytest.fixture(scope="module")
def scene(authored: tuple[Path, dict[str, bytes]]) -> Path:
    """Give the scene in the city."""
    return authored[0]


def select(stage: Usd.Stage, world: str) -> Usd.Stage:
    """Select a world on a stage, in memory."""
    stage.SetEditTarget(stage.GetSessionLayer())
    stage.GetPrimAtPath(tokens.BACKGROUND).GetVariantSet("background").SetVariantSelection(world)
    return stage


def ground(stage: Usd.Stage) -> Bindings:
    """Name the bound material of every piece of the site's ground."""
    pieces = stage.GetPrimAtPath(f"{tokens.SITE}/SiteGeom/SiteGround").GetChildren()
    bound = {piece.GetName(): UsdShade.MaterialBindingAPI(piece).ComputeBoundMaterial()[0] for piece in pieces}
    return {name: material.GetPath().name if material else "" for name, material in bound.items()}


def surface(material: str) -> str:
    """Name the surface of a material of the site."""
    return material.partition("_Photo")[0].removeprefix("Site_").removeprefix("city_")


def shape(prim: Usd.Prim) -> dict[str, object]:
    """Read all values of a prim but what it looks like."""
    looks = ("visibility", "invisibleIds", "material:binding")
    return {
        found.GetName(): found.Get()
        for found in prim.GetAttributes()
        if found.HasValue() and found.GetName() not in looks
    }


def test_the_city_paves_and_mows(scene: Path) -> None:
    """In the city no ground is tilled, wild or bare; banks are of stone; each piece keeps the image of its square."""
    drawn = ground(select(Usd.Stage.Open(str(scene)), "none"))
    town = ground(Usd.Stage.Open(str(scene)))
    assert RURAL - {"meadow"} & {surface(material) for material in drawn.values()}
    assert not RURAL & {surface(material) for material in town.values()}
    assert {cover_name(name) for name, material in town.items() if surface(material) == "pavement"} >= {"worn"}
    assert {surface(town[name]) for name in town if cover_name(name) in ("bank", "shore")} == {"masonry"}
    for name, material in town.items():
        assert material.partition("_Photo")[2] == drawn[name].partition("_Photo")[2], name


def test_only_appearance_changes(scene: Path) -> None:
    """Shape, labels and ids of every prim of the site are equal in both worlds, value by value."""
    stage = Usd.Stage.Open(str(scene))
    prims = [prim.GetPath() for prim in Usd.PrimRange(stage.GetPrimAtPath(f"{tokens.SITE}/SiteGeom"))]
    town = {path: shape(stage.GetPrimAtPath(path)) for path in prims}
    select(stage, "none")
    assert [prim.GetPath() for prim in Usd.PrimRange(stage.GetPrimAtPath(f"{tokens.SITE}/SiteGeom"))] == prims
    assert len(prims) > 30
    assert town == {path: shape(stage.GetPrimAtPath(path)) for path in prims}


def test_a_city_changes_no_file_of_the_site(authored: tuple[Path, dict[str, bytes]]) -> None:
    """Choosing a city adds a folder, and lines to the root layer: the site inherits; each other file stays as it is."""
    scene, before = authored
    after = file_bytes(scene.parent)
    added = {name for name in after if name not in before}
    assert {name.split("/")[1] for name in added} == {"city"}
    changed = {name for name in before if before[name] != after[name]}
    assert changed == {"scene.usda", "manifest.json"}
    assert b"inherits" not in before["scene.usda"]
    assert b"inherits = </World/Background/OnSite>" in after["scene.usda"]
    assert validate_scene(scene) == []


def test_every_way_to_open_it_agrees(scene: Path, tmp_path: Path) -> None:
    """Without payloads, the site alone, through a reference, flattened: the same surfaces, the same hidden plants."""
    town = ground(Usd.Stage.Open(str(scene)))
    flattened = tmp_path / "flat.usdc"
    assert flatten_scene(scene, flattened) == []
    outer = Usd.Stage.CreateInMemory()
    outer.OverridePrim("/World").GetReferences().AddReference(str(scene))
    ways = (
        Usd.Stage.Open(str(scene), Usd.Stage.LoadNone),
        Usd.Stage.OpenMasked(str(scene), Usd.StagePopulationMask([tokens.SITE])),
        outer,
        Usd.Stage.Open(str(flattened)),
    )
    for way in ways:
        assert ground(way) == town
        for path in (TUFTS, *FENCES):
            assert UsdGeom.Imageable(way.GetPrimAtPath(path)).ComputeVisibility() == UsdGeom.Tokens.invisible
    assert not ways[-1].GetPrimAtPath(ON_SITE)
    assert Usd.Stage.Open(str(scene)).GetPrimAtPath(ON_SITE).IsAbstract()
    assert not select(Usd.Stage.Open(str(scene)), "none").GetPrimAtPath(ON_SITE)


def test_the_renderer_reads_the_new_surface_and_the_picture_of_the_site(scene: Path) -> None:
    """Flags near the bridge: the city's sheet, without relief of what lay there, and the image of the site's square."""
    flat = read_stage(scene)
    (paved,) = [one for one in flat.materials if one.name.endswith("Site_city_pavement_Photo0")]
    (grass,) = [one for one in flat.materials if one.name.endswith("Site_grass_Photo0")]
    assert paved.base_texture is not None
    assert Path(paved.base_texture.file).name == "city_pavement_albedo.jpg"
    assert paved.normal_texture is None
    assert grass.is_matt
    assert not paved.is_matt  # though the soil below it is
    assert paved.detail.macro_file == grass.detail.macro_file != ""
    drawn = {row.path for row in flat.instances}
    assert drawn.isdisjoint({TUFTS, *FENCES})
    assert {TUFTS, *FENCES} <= {row.path for row in read_stage(scene, choices=ALONE).instances}


def test_flights_do_not_depend_on_the_city(scene: Path) -> None:
    """What a survey keeps clear of is the same in every world, also the plants that the city hides."""
    own = stage_subject(read_stage(scene, choices=ALONE))
    as_shown = stage_subject(read_stage(scene))
    empty = Usd.Stage.Open(str(scene))
    select(empty, "none").Export(str(scene.parent / "none_test.usdc"))
    try:
        apart = stage_subject(read_stage(scene.parent / "none_test.usdc"))
    finally:
        (scene.parent / "none_test.usdc").unlink()
    np.testing.assert_array_equal(own.obstacle_ids, apart.obstacle_ids)
    assert len(as_shown.obstacle_ids) < len(own.obstacle_ids)


def test_what_is_hidden_is_not_told_as_deleted(scene: Path, tmp_path: Path) -> None:
    """A program that imports only what is visible deletes nothing: neither tufts nor fences; a visible run is named."""
    stage = Usd.Stage.Open(str(scene))
    shrubs = TUFTS.replace("Tufts", "Shrubs")
    stage.Flatten().Export(str(tmp_path / "other.usda"))
    other = Usd.Stage.Open(str(tmp_path / "other.usda"))
    for path in (TUFTS, shrubs):
        other.GetPrimAtPath(path).SetActive(False)
    fences = [path for path in FENCES if other.GetPrimAtPath(path).SetActive(False)]
    assert len(fences) == 8
    matches = match_stages(stage, other)
    assert matches.missing == ()
    assert match_stages(select(Usd.Stage.Open(str(scene)), "none"), other).missing == tuple(
        sorted(map(Sdf.Path, fences))
    )
    lines = edits_left_out(stage, other, matches)
    assert not any("Site_Tufts" in line for line in lines)
    assert any("Site_Shrubs" in line for line in lines)


def site_of(seed: int, crossing: str, land: str | None = None) -> Site:
    """Draw a site."""
    return draw_site(SiteSettings.model_validate({"crossing": crossing, "land": land}), LAYOUT, stream(seed, "site"))


def test_wild_shrubs_and_plants_on_car_parks_are_hidden_and_no_others() -> None:
    """By distances to rectangles: a visible shrub is a lime; a lime or hedge is hidden on a lot or its drive's side."""
    hidden = 0
    for seed in (5, 6):
        site = site_of(seed, "road", "fields")
        changes = change_site(site, stream(seed, "background/site"))
        ends = [
            lot.world(np.array([[0, 0], [lot.size[0], 0], [lot.size[0], 99.0], [0, 99.0]])) for lot in find_lots(site)
        ]
        lots = np.array([corners[rows] for corners in ends for rows in ([0, 1, 2], [0, 2, 3])])
        for name in ("Site_Shrubs", "Site_Hedges"):
            (run,) = [piece for piece in site.pieces if isinstance(piece, Scatter) and piece.name == name]
            rows = np.isin(np.arange(len(run.positions)), changes.hidden.get(name, ()))
            planted = np.full(len(rows), True) if name == "Site_Hedges" else run.prototype % 3 == 2  # lime
            assert rows[~planted].all()
            away = distances(run.positions[:, :2], lots)
            assert away[~rows].min() > 0.99  # 1 m, by the exact distance to a side
            assert away[rows & planted].max(initial=0.0) < 1.5  # at a corner, 1 m to both sides
            hidden += int((rows & planted).sum())
    assert hidden > 5


def distances(points: F64, corners: F64) -> F64:
    """Find the distance of points to triangles in plan, 0 inside [m], shape (N,)."""
    least = np.full(len(points), np.inf)
    for a, b, c in corners:
        edges, inside = [], np.ones(len(points), bool)
        for start, end in ((a, b), (b, c), (c, a)):
            along, to = end - start, points - start
            inside &= along[0] * to[:, 1] - along[1] * to[:, 0] >= 0.0
            share = np.clip(to @ along / (along @ along), 0.0, 1.0)
            edges.append(np.hypot(*(to - share[:, None] * along).T))
        least = np.minimum(least, np.where(inside, 0.0, np.min(edges, axis=0)))
    return least


@pytest.mark.parametrize("crossing", ["road", "rail", "river"])
def test_the_table_names_covers_and_surfaces(crossing: str) -> None:
    """Each rule names a cover and a surface; tracks keep gravel, and only a river has banks of stone."""
    site = site_of(1, crossing)
    surfaces = city_surfaces(site.land)
    assert set(surfaces) <= {cover.name for cover in COVERS}
    assert set(surfaces.values()) | set(change_site(site, stream(1, "background/site")).names()) <= set(RECIPES)
    assert ("verge" in surfaces) == (crossing == "road")
    assert ("worn" in surfaces) == (crossing != "rail")
    assert ("bank" in surfaces) == (crossing == "river")
    ways = {piece.name for piece in site.pieces if isinstance(piece, Component) and piece.group != "Ground"}
    assert not ways & set(change_site(site, stream(1, "background/site")).surfaces)


def test_other_worlds_leave_the_site_as_it_is() -> None:
    """Open country, lake and hillside, which have fields of their own, change nothing."""
    site = site_of(3, "river")
    for name, world in BACKGROUNDS.items():
        changes = world.change(site, stream(3, "background/site"))
        assert (changes == NO_CHANGES) == (name != "city")


def test_an_edit_is_stronger_than_the_city(scene: Path) -> None:
    """A user who shows the tufts again in the layer of edits sees them, in the city too."""
    stage = Usd.Stage.Open(str(scene))
    assert UsdGeom.Imageable(stage.GetPrimAtPath(TUFTS)).ComputeVisibility() == UsdGeom.Tokens.invisible
    edits = Sdf.Layer.Find(str(scene.parent / "edits/user.usda"))
    with Usd.EditContext(stage, edits):
        UsdGeom.Imageable(stage.GetPrimAtPath(TUFTS)).GetVisibilityAttr().Set(UsdGeom.Tokens.inherited)
    assert UsdGeom.Imageable(stage.GetPrimAtPath(TUFTS)).ComputeVisibility() == UsdGeom.Tokens.inherited
    edits.Reload(force=True)
