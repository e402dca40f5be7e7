"""Imported cities: CityJSON read as it is specified, a place that is free, and surroundings that join the site."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from authoring.axis.alignment import Alignment, Layout
from authoring.imported.asset import city_components, is_city, read_city, write_city
from authoring.imported.cityjson import read_cityjson
from authoring.imported.model import Building, CityModel
from authoring.imported.place import BESIDE, MOST_BUILT, built_map, choose_place
from authoring.imported.rings import ring_triangles
from authoring.imported.surroundings import CLEAR, build_city_world
from authoring.shapes.component import FIRST_BACKGROUND_ID, LAST_ID, Component, Scatter, triangle_corners
from authoring.site.site import Site, SiteSettings, draw_site
from authoring.streams import stream
from groundwork.errors import InputError
from tests.conftest import Count, RecordProof
from usd_schemas.components import class_of

F64 = NDArray[np.float64]

LAYOUT = Layout(Alignment(7.0, 0.015, 0.4), (0.0, 18.0, 40.0), 11.5, 1.9, "road", 8.0, 3.4)
TILE = Path(__file__).resolve().parents[3] / "shared/data/cityjson_the_hague_01.json"
BOX = [[[0, 3, 2, 1]], [[4, 5, 6, 7]], [[0, 1, 5, 4]], [[1, 2, 6, 5]], [[2, 3, 7, 6]], [[3, 0, 4, 7]]]
SEMANTICS = {
    "surfaces": [{"type": "GroundSurface"}, {"type": "RoofSurface"}, {"type": "WallSurface"}],
    "values": [[0, 1, 2, 2, 2, 2]],
}


def box_corners(x: float, y: float, size: tuple[float, float, float]) -> list[list[float]]:
    """Corners of an upright box, lower ones first, counter-clockwise from above [m]."""
    a, b, c = size
    return [[x + i, y + j, z] for z in (0.0, c) for i, j in ((0.0, 0.0), (a, 0.0), (a, b), (0.0, b))]


def document(**changes: Any) -> dict[str, Any]:
    """A city of one box of 10 x 8 x 6 m with a part, in millimeters about a far origin."""
    vertices = [[round(1000 * v) for v in row] for row in box_corners(0.0, 0.0, (10.0, 8.0, 6.0))]
    solid = {"type": "Solid", "lod": "2", "boundaries": [BOX], "semantics": SEMANTICS}
    rough = {"type": "Solid", "lod": "1", "boundaries": [BOX[:1]]}
    return {
        "type": "CityJSON",
        "version": "2.0",
        "transform": {"scale": [0.001] * 3, "translate": [78000.0, 457000.0, 2.0]},
        "metadata": {"title": "A box", "referenceSystem": "EPSG:7415"},
        "CityObjects": {
            "House": {"type": "Building", "children": ["Part"]},
            "Part": {"type": "BuildingPart", "parents": ["House"], "geometry": [rough, solid]},
        },
        "vertices": vertices,
        **changes,
    }


def read(folder: Path, content: Any) -> CityModel:
    """Read a document from a file."""
    file = folder / "city.json"
    file.write_text(content if isinstance(content, str) else json.dumps(content))
    return read_cityjson(file, lambda line: None)


def area(triangles: F64) -> float:
    """Total area [m2]."""
    return float(
        0.5
        * np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1).sum()
    )


def star(rng: np.random.Generator, radius: float, count: int) -> F64:
    """A star-shaped ring, counter-clockwise [m], shape (count, 2)."""
    angle = np.linspace(0.0, 2 * np.pi, count, endpoint=False)
    reach = radius * rng.uniform(0.6, 1.0, count)
    return np.column_stack([reach * np.cos(angle), reach * np.sin(angle)])


def shoelace(ring: F64) -> float:
    """Area of a plane ring [m2]."""
    x, y = ring.T
    return float(0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


@pytest.mark.parametrize("seed", range(12))
def test_rings_with_holes_keep_their_area_and_side(seed: int) -> None:
    """Triangles of a polygon in any plane: area by the shoelace formula, holes left out, all facing its normal."""
    rng = np.random.default_rng(seed)
    outer = star(rng, 10.0, int(rng.integers(3, 40)))
    holes = [
        star(rng, 0.8, int(rng.integers(3, 9)))[::-1] + 2.2 * np.array([np.cos(turn), np.sin(turn)])
        for turn in np.linspace(0.0, 2 * np.pi, int(rng.integers(0, 4)), endpoint=False)
    ]
    frame = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    frame *= np.sign(np.linalg.det(frame))
    rings = [np.column_stack([ring, np.zeros(len(ring))]) @ frame.T + 5.0 for ring in (outer, *holes)]
    triangles = ring_triangles(rings)
    assert area(triangles) == pytest.approx(shoelace(outer) + sum(shoelace(hole) for hole in holes), rel=1e-9)
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]) @ frame[:, 2]
    assert (normal > -1e-12).all()


def test_solid_is_read_at_its_finest_with_semantics(tmp_path: Path) -> None:
    """The box of level 2, not of level 1; its part counts as the building; meters about the middle; attribution."""
    model = read(tmp_path, document())
    (building,) = model.buildings
    assert building.name == "House"
    assert area(building.walls) == pytest.approx(2 * (10 + 8) * 6)
    assert area(building.roofs) == pytest.approx(80.0)
    assert np.abs(model.extent).max() == pytest.approx(5.0)
    assert building.corners[:, 2].min() == 0.0
    assert model.attribution["title"] == "A box"
    assert model.attribution["crs"] == "EPSG:7415"
    assert model.attribution["origin"] == "78005.000 457004.000 2.000"


def test_versions_sequences_templates_and_missing_semantics_say_the_same(tmp_path: Path) -> None:
    """Version 1.0 without a transform, a sequence, an instanced template and bare faces all give the same box."""
    whole = read(tmp_path, document()).buildings[0]
    plain = document(version="1.0", vertices=box_corners(0.0, 0.0, (10.0, 8.0, 6.0)))
    del plain["transform"]
    lines = document(CityObjects={}, vertices=[])
    feature = {key: document()[key] for key in ("CityObjects", "vertices")} | {"type": "CityJSONFeature"}
    feature["vertices"] = document(transform=None)["vertices"]
    sequence = f"{json.dumps(lines)}\n{json.dumps(feature | {'transform': document()['transform']})}\n"
    template = {"type": "Solid", "lod": "2", "boundaries": [BOX], "semantics": SEMANTICS}
    instance = {
        "type": "GeometryInstance",
        "template": 0,
        "boundaries": [0],
        "transformationMatrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1],
    }
    instanced = document(CityObjects={"House": {"type": "Building", "geometry": [instance]}})
    instanced["geometry-templates"] = {
        "templates": [template],
        "vertices-templates": box_corners(0.0, 0.0, (10.0, 8.0, 6.0)),
    }
    bare = document()
    del bare["CityObjects"]["Part"]["geometry"][1]["semantics"]
    for other in (plain, sequence, instanced, bare):
        building = read(tmp_path, other).buildings[0]
        assert area(building.walls) == pytest.approx(area(whole.walls))
        assert area(building.roofs) == pytest.approx(area(whole.roofs))


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (json.dumps(document())[:400], "not readable as JSON"),
        ("[" * 100_000, "not readable as JSON"),
        ({"type": "FeatureCollection"}, "not CityJSON"),
        (document(version="9.0"), "unknown version"),
        (document(vertices=[[float("nan"), 0, 0]] * 8), "not finite|NaN is not"),
        (document(vertices=document()["vertices"][:3]), "a vertex that does not exist"),
        (document(vertices=[[10**15, 0, 0], *document()["vertices"][1:]]), "km from its middle"),
        (document(CityObjects={}), "neither buildings nor ground"),
        (document(transform={"scale": 1}), "invalid CityJSON"),
    ],
)
def test_bad_files_are_told_in_one_line(tmp_path: Path, content: Any, problem: str) -> None:
    """Truncated, nested, foreign, not finite, out of range: an error that names the file."""
    with pytest.raises(InputError, match=problem) as caught:
        read(tmp_path, content)
    assert "city.json" in str(caught.value)
    assert "\n" not in str(caught.value)


def town() -> CityModel:
    """Blocks of 24 x 14 m on a grid of streets, on ground that rises to the east and lies 30 m up."""
    rng = np.random.default_rng(5)
    buildings = []
    for i in range(-13, 13):
        for j in range(-16, 16):
            if rng.random() < 0.75 and not (abs(i) < 4 and abs(j) < 6):
                size = (24.0, 14.0, float(rng.integers(2, 6)) * 3.1 + 0.6)
                corners = np.array(box_corners(34.0 * i, 24.0 * j, size))
                corners[:, 2] += 30.0 + 0.01 * 34.0 * i
                faces = np.concatenate([ring_triangles([corners[face[0]]]) for face in BOX])
                buildings.append(Building(f"B{i}_{j}", faces[4:], faces[2:4]))
    edge = np.array([[-480.0, -420.0], [480.0, -420.0], [480.0, 420.0], [-480.0, 420.0]])
    ground = np.column_stack([edge, 30.0 + 0.01 * edge[:, 0]])
    return CityModel(tuple(buildings), ground[[[0, 1, 2], [0, 2, 3]]], {"source": "town"})


@pytest.fixture(scope="module")
def site() -> Site:
    """A site over a road."""
    return draw_site(SiteSettings(crossing="road"), LAYOUT, stream(7, "site"))


def test_world_comes_back_as_it_was_written(tmp_path: Path) -> None:
    """Names, attribution, and every triangle of walls, roofs and ground to 0.1 mm."""
    model = town()
    folder = tmp_path / "town"
    folder.mkdir()
    file = write_city(model, folder, "town")
    assert is_city(file)
    assert is_city(folder)
    assert not is_city(tmp_path / "nothing")
    again = read_city(folder)
    assert again.attribution == model.attribution
    assert [b.name for b in again.buildings] == sorted(b.name for b in model.buildings)
    before = {b.name: b for b in model.buildings}
    for building in again.buildings:
        np.testing.assert_allclose(building.walls, before[building.name].walls, atol=1e-4)
        np.testing.assert_allclose(building.roofs, before[building.name].roofs, atol=1e-4)
    np.testing.assert_allclose(again.terrain, model.terrain, atol=1e-4)


def test_too_many_buildings_are_refused() -> None:
    """There are only so many instance ids."""
    one = town().buildings[0]
    crowd = CityModel((one,) * ((LAST_ID - FIRST_BACKGROUND_ID) // 2 + 1), np.zeros((0, 3, 3)), {})
    with pytest.raises(InputError, match="too many"):
        city_components(crowd, "City", FIRST_BACKGROUND_ID)


def inside(buildings: tuple[Building, ...], xy: F64) -> NDArray[np.bool_]:
    """Tell which places lie under a roof, triangle by triangle, shape (N,), bool."""
    found = np.zeros(len(xy), bool)
    for a, b, c in np.concatenate([building.roofs for building in buildings])[:, :, :2]:
        sides = [
            (q[0] - p[0]) * (xy[:, 1] - p[1]) - (q[1] - p[1]) * (xy[:, 0] - p[0]) for p, q in ((a, b), (b, c), (c, a))
        ]
        found |= np.all(np.array(sides) >= 0, axis=0) | np.all(np.array(sides) <= 0, axis=0)
    return found


def test_places_are_free_by_brute_force(site: Site) -> None:
    """At 20 places at most 2 % of the deck and 5 m beside it lies under a roof; there and back is rigid."""
    model = town()
    places = [choose_place(model, site, stream(seed, "background")) for seed in range(20)]
    assert len({place.center for place in places}) == 20
    s, left = np.meshgrid(np.arange(-BESIDE, 40.0 + BESIDE, 0.7), np.arange(-10.7, 10.8, 0.7))
    deck = LAYOUT.alignment.point(s.ravel(), left.ravel(), np.zeros(s.size))[:, :2]
    for place in places:
        assert inside(model.buildings, place.to_city(deck)).mean() <= MOST_BUILT + 0.005
        np.testing.assert_allclose(place.to_scene(place.to_city(deck)), deck, atol=1e-9)
        corners = place.to_city(site.extent)
        assert (corners >= model.extent[0]).all()
        assert (corners <= model.extent[1]).all()


def test_no_place_is_an_error(site: Site) -> None:
    """A world that is one roof has no place for a bridge."""
    slab = np.array([[-400.0, -400.0, 9.0], [400.0, -400.0, 9.0], [400.0, 400.0, 9.0], [-400.0, 400.0, 9.0]])
    roof = CityModel((Building("all", np.zeros((0, 3, 3)), ring_triangles([slab])),), np.zeros((0, 3, 3)), {})
    assert built_map(roof).built.mean() > 0.9
    with pytest.raises(InputError, match="no place for this bridge"):
        choose_place(roof, site, stream(0, "background"))


def check_world(pieces: tuple[Component | Scatter, ...], site: Site) -> int:
    """Keep-out empty, buildings clear of the roads, everything labeled background, ids unique; count buildings."""
    (box,) = site.keep_out
    solids = [piece for piece in pieces if isinstance(piece, Component)]
    ids = [piece.instance_id for piece in solids]
    for run in (piece for piece in pieces if isinstance(piece, Scatter)):
        assert class_of(run.kind) == "background"
        assert not box.contains(run.positions).any(), run.name
        ids += run.instance_ids
    assert len(set(ids)) == len(ids)
    houses = [piece for piece in solids if piece.group == "Buildings"]
    for piece in solids:
        assert class_of(piece.kind) == "background"
        assert not box.contains(piece.mesh.points, margin=1e-6).any(), piece.name
    land = site.land
    station, left = land.layout.alignment.locate(np.concatenate([house.mesh.points for house in houses]))
    for approach in land.approaches:
        aside = np.abs(left - approach.center(station)) - approach.half_width
        assert (aside[approach.along(station) > 0.0] > CLEAR - 0.1).all()
    return sum(house.name.endswith("_Roof") for house in houses)


def test_world_round_the_site(site: Site) -> None:
    """Most of the town stands, on the ground, clear of the strip and of the roads; its windows are on its walls."""
    model = town()
    pieces = build_city_world(model, site, stream(3, "background"))
    assert check_world(pieces, site) > 0.6 * len(model.buildings)
    ground = tuple(p for p in pieces if isinstance(p, Component) and p.group in ("Ground", "Ways"))
    corners, _ = triangle_corners(ground)
    tops = corners.reshape(-1, 3)
    walls = [p for p in pieces if isinstance(p, Component) and p.name.endswith("_Walls")]
    for wall in walls[::7]:
        foot, middle = wall.mesh.points[:, 2].min(), wall.mesh.points[:, :2].mean(axis=0)
        near = tops[np.argpartition(np.linalg.norm(tops[:, :2] - middle, axis=1), 4)[:4], 2]
        assert foot < near.max() + 0.5, wall.name
        assert wall.mesh.points[:, 2].max() > near.min() + 3.0, wall.name
    (windows,) = (p for p in pieces if isinstance(p, Scatter) and p.name == "City_Windows")
    assert len(windows.positions) > 1000


def test_real_tile(site: Site, proof_count: Count, record_proof: RecordProof) -> None:
    """A city tile as its publisher made it: every building, and a valid world at random sites of it."""
    if not TILE.is_file():
        pytest.skip("the tile lies beside the project, not in it")
    model = read_cityjson(TILE, lambda line: None)
    assert len(model.buildings) == 844
    count = proof_count(1, 20)
    stand = [check_world(build_city_world(model, site, stream(seed, "background")), site) for seed in range(count)]
    assert min(stand) > 400
    record_proof("worlds/imported city sites", count, 0, {"buildings standing, least": min(stand)})
