"""Looks: sheets that tile and look like their material, bytes that repeat, materials that validate."""

import errno
import fcntl
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from pxr import Sdf, Usd, UsdGeom, UsdShade, UsdUtils, UsdValidation

from authoring.light.daylight import LightSettings, bake_light
from authoring.looks.bake import LookSettings, bake_look, bake_surface
from authoring.looks.charts import draw_charts, spread
from authoring.looks.detail import detail_texture
from authoring.looks.encode import U8
from authoring.looks.grain import grain_texture
from authoring.looks.library import SheetName, _ensure
from authoring.looks.material import MaterialRecipe, author_material, author_sheets
from authoring.looks.recipes import RECIPES
from authoring.looks.roles import LOOKS, SUITS, fill_roles
from authoring.looks.weathering import ground_patches, weather
from authoring.shapes.component import Component, Mesh
from groundwork.errors import InputError
from groundwork.marks import TEMPORARY
from tests.conftest import Count, RecordProof
from usd_schemas.tokens import ROLES

F32 = NDArray[np.floating]

_LUMA = np.array([0.2126, 0.7152, 0.0722])


def _rng(seed: int = 3) -> np.random.Generator:
    return np.random.default_rng(seed)


def _load(folder: Path, file: str) -> NDArray[np.uint8]:
    image = cv2.imread(str(folder / file), cv2.IMREAD_UNCHANGED)
    assert image is not None
    return np.asarray(image if image.ndim == 2 else image[..., [2, 1, 0, 3][: image.shape[2]]], np.uint8)


def _linear(image: NDArray[np.uint8]) -> F32:
    code = image / 255.0
    return np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4).astype(np.float32)


def _at(image: F32, meters: float, places: F32) -> F32:
    """Texels at some places of a sheet [m], shape (N,) or (N, 3)."""
    cells = np.floor(places / meters % 1 * len(image)).astype(np.int64)
    return image[cells[:, 1], cells[:, 0]]


def _box(name: str, role: str, group: str, low: tuple[float, ...], high: tuple[float, ...], chart: int) -> Component:
    """A box whose six faces lie side by side in one row of a 4-row atlas."""
    corner = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
    faces = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    axes = np.array([[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1]], np.float32)
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * 0.9 + 0.05
    st1 = np.concatenate([(square + np.array([face, chart])) / [6, 4] for face in range(6)]).astype(np.float32)
    mesh = Mesh(corner, np.full(6, 4, np.int32), faces.ravel().astype(np.int32), np.repeat(axes, 4, 0), st1 * 5, st1)
    return Component(name, "column", role, group, mesh, chart + 1)


@pytest.fixture(scope="module")
def parts() -> tuple[Component, ...]:
    """A pier, a girder of steel, a road and a parapet."""
    return (
        _box("Pier", "Role_PierConcrete", "Substructure", (0, 0, -1), (2, 6, 7), 0),
        _box("Girder", "Role_GirderSteel", "Superstructure", (0, 0, 7), (20, 1, 8.4), 1),
        _box("Road", "Role_DeckAsphalt", "Superstructure", (0, 0, 8.5), (20, 8, 8.6), 2),
        _box("Parapet", "Role_ParapetConcrete", "Furniture", (0, 0, 8.6), (20, 0.3, 9.7), 3),
    )


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, MaterialRecipe]]:
    """Every surface at an eighth of its size, in a library of its own."""
    folder, library = tmp_path_factory.mktemp("small"), tmp_path_factory.mktemp("library")
    return folder, {name: bake_surface(SheetName(name, 0, 256), folder, library=library) for name in RECIPES}


@pytest.mark.parametrize("name", sorted(set(RECIPES) - {"paint_colours", "leaves"}))  # these charts never repeat
def test_sheet_has_no_seam(small: tuple[Path, dict[str, MaterialRecipe]], name: str) -> None:
    """The step across the wrap is no larger than the largest step between neighboring lines inside."""
    folder, recipes = small
    files = (recipes[name].albedo_file, recipes[name].roughness_file, recipes[name].normal_file)
    for file in filter(None, files):
        image = _load(folder, file).astype(np.float32)
        for axis in (0, 1):
            steps = np.abs(np.roll(image, -1, axis) - image).mean(axis=tuple(k for k in range(image.ndim) if k != axis))
            assert steps[-1] <= 1.1 * steps[:-1].max()


@pytest.mark.parametrize(("draw", "low", "high"), [(detail_texture, 0.25, 0.45), (grain_texture, 0.25, 0.32)])
def test_detail_is_a_zero_mean_factor_that_tiles(draw: Callable[[], U8], low: float, high: float) -> None:
    """Mean 0.5 within 1/512 in every quarter-period average of the whole, enough contrast, no seam."""
    gray = draw()
    assert abs(gray.mean() / 255 - 0.5) < 1 / 512
    assert low < (gray / 127.5 - 1).std() < high
    steps = np.abs(np.roll(gray.astype(int), -1, 0) - gray).mean(axis=1)
    assert steps[-1] <= 1.1 * steps[:-1].max()


def test_detail_keeps_the_mean_albedo(
    small: tuple[Path, dict[str, MaterialRecipe]], proof_count: Count, record_proof: RecordProof
) -> None:
    """Mean color with the detail is that without it within 2 %, and the sheet's file has the mean that it states."""
    folder, recipes = small
    places = _rng().uniform(0, 2000, (proof_count(20_000, 100_000), 2))
    pictures = {"detail": detail_texture() / 255.0, "grain": grain_texture() / 255.0}
    worst = 0.0
    for name, recipe in recipes.items():
        image = _load(folder, recipe.albedo_file)
        assert image.shape[2] == (4 if recipe.cut_out else 3), name
        albedo = _linear(image[..., :3])
        seen = image[..., 3] / 255 if recipe.cut_out else np.ones(image.shape[:2])
        mean = (albedo * seen[..., None]).sum(axis=(0, 1)) / seen.sum()
        assert mean == pytest.approx(recipe.color, rel=0.02, abs=0.003), name
        gray = pictures[RECIPES[name].picture]
        color, factor = _at(albedo, recipe.sheet, places), np.ones(len(places))
        for period, amplitude in zip(recipe.periods, recipe.amplitudes, strict=True):
            factor *= 1 + amplitude * (2 * _at(gray, period, places) - 1)
        change = (color * factor[:, None]).mean(axis=0) / color.mean(axis=0) - 1
        worst = max(worst, float(np.abs(change).max()))
    assert worst < 0.02
    record_proof("looks/detail keeps the mean albedo", len(recipes), 3, {"worst_share": round(worst, 4)})


@pytest.mark.parametrize(
    ("names", "low", "high"),
    [
        ([name for name in RECIPES if "concrete" in name and "_clean" not in name], 0.22, 0.49),
        ([f"{name}_concrete_clean" for name in ("board", "panel", "smooth", "deck", "coated")], 0.40, 0.60),
        (["asphalt"], 0.05, 0.12),
        (["asphalt_clean"], 0.02, 0.05),
        (["grass", "meadow"], 0.05, 0.15),
        (["foliage"], 0.03, 0.10),
        (["soil", "bark", "timber"], 0.07, 0.20),
        (["gravel", "rock", "masonry", "brick"], 0.12, 0.35),
        (["water", "rubber", "window"], 0.02, 0.08),
        (["road_marking", "plaster"], 0.38, 0.65),
        (["galvanised_steel"], 0.25, 0.45),
        (["weathering_steel", "weathering_steel_aged"], 0.03, 0.12),
        (["rubble", "granite", "sandstone", "brickwork"], 0.10, 0.40),
        (["tarred_timber", "ballast_basalt"], 0.03, 0.12),
        (["galvanised_steel_clean"], 0.45, 0.65),
    ],
)
def test_albedo_is_that_of_the_material(
    small: tuple[Path, dict[str, MaterialRecipe]], names: list[str], low: float, high: float
) -> None:
    """Linear luminance lies in the measured range of the material."""
    for name in names:
        assert low <= float(np.asarray(small[1][name].color) @ _LUMA) <= high, name


def test_no_surface_is_neon(small: tuple[Path, dict[str, MaterialRecipe]]) -> None:
    """But for paints no mean color is more saturated than turf or fired clay; nothing is whiter than fresh paint."""
    folder, recipes = small
    for name, recipe in recipes.items():
        assert name.startswith("paint_") or 1 - min(recipe.color) / max(recipe.color) < 0.8, name
        assert np.quantile(_linear(_load(folder, recipe.albedo_file)[..., :3]), 0.99) < 0.9, name
    red, green, blue = recipes["grass"].color
    assert green > red > blue


def test_every_role_and_surface_has_a_recipe() -> None:
    """The tables agree with each other and with the roles that geometry may bind."""
    for name in LOOKS:
        for seed in range(20):
            surfaces, years = fill_roles(name, _rng(seed))
            assert tuple(surfaces) == ROLES
            assert set(surfaces.values()) <= set(RECIPES)
            assert 0 < years <= 2
    assert set(SUITS) == set(ROLES)


def test_random_look_draws_each_role_from_all_that_suit_it() -> None:
    """Over many seeds every surface that suits a role comes, in all ages; the same seed gives the same look."""
    drawn = [fill_roles("random", _rng(seed))[0] for seed in range(200)]
    for role, suits in SUITS.items():
        bases = {look[role].removesuffix("_clean").removesuffix("_aged") for look in drawn}
        assert bases == set(suits)
    ends = {look["Role_PierConcrete"].rpartition("_")[2] for look in drawn}
    assert {"clean", "aged"} < ends
    assert fill_roles("random", _rng(5)) == fill_roles("random", _rng(5))


def test_look_fills_the_roles_in_use_only(tmp_path: Path, parts: tuple[Component, ...]) -> None:
    """One recipe for each role of the parts; another part changes no sheet of the others."""
    settings = LookSettings(texels=256)
    library = tmp_path / "library"
    some = bake_look(settings, "weathered", tmp_path / "some", parts[:2], _rng(), library=library)
    more = bake_look(settings, "weathered", tmp_path / "more", parts, _rng(), library=library)
    assert list(some) == ["Role_PierConcrete", "Role_GirderSteel"]
    assert len(more) == 4
    for recipe in some.values():
        assert (tmp_path / "some" / recipe.albedo_file).read_bytes() == (
            tmp_path / "more" / recipe.albedo_file
        ).read_bytes()


def test_unknown_names_say_what_is_allowed(tmp_path: Path) -> None:
    """A look or surface that nobody knows is a one-line error."""
    with pytest.raises(InputError, match="allowed: weathered, clean, aged, random"):
        bake_look(LookSettings(), "shiny", tmp_path, (), _rng())
    with pytest.raises(InputError, match="grass"):
        bake_surface(SheetName("lava", 0, 2048), tmp_path)


_BAKED = ("board_concrete", "grass", "gravel", "painted_steel", "foliage", "road_marking")
_BAKE = """
import sys; from pathlib import Path; import numpy as np
from authoring.looks.bake import bake_surface
from authoring.looks.library import SheetName
from authoring.light.daylight import LightSettings, bake_light
folder = Path(sys.argv[1])
for name in sys.argv[2:]:
    bake_surface(SheetName(name, 0, 256), folder, library=folder / "library")
bake_light(LightSettings(sky_height=64), folder, np.random.default_rng(9))
"""


def test_bytes_repeat_on_an_older_processor(small: tuple[Path, dict[str, MaterialRecipe]], tmp_path: Path) -> None:
    """A process with vector instructions switched off and another hash order: the same bytes as in this one."""
    older = {"NPY_DISABLE_CPU_FEATURES": "X86_V4 X86_V3", "OPENBLAS_CORETYPE": "Nehalem", "PYTHONHASHSEED": "7"}
    words = [sys.executable, "-W", "ignore", "-c", _BAKE, str(tmp_path / "older"), *_BAKED]
    subprocess.run(words, check=True, env={**os.environ, **older})
    bake_light(LightSettings(sky_height=64), tmp_path / "here", _rng(9))
    found = {file.name: file.read_bytes() for file in (tmp_path / "older/textures").iterdir()}
    wanted = {name: (tmp_path / "here" if name == "sky.exr" else small[0]) / "textures" / name for name in found}
    assert len(found) > 14
    assert [name for name, file in wanted.items() if file.read_bytes() != found[name]] == []


def test_charts_know_the_place_of_each_texel(parts: tuple[Component, ...]) -> None:
    """The affine map of a triangle gives back the corners of the box, and all six faces are drawn."""
    charts = draw_charts(list(parts), 240)
    pier = parts[0].mesh
    texel = np.stack([pier.st1[:, 0] * 240, (1 - pier.st1[:, 1]) * 240], axis=1)
    for number, (x, y) in enumerate(texel):
        triangle = np.flatnonzero(charts.owner == 0)[2 * (number // 4) + (number % 4 == 3)]
        place = charts.place[triangle] + charts.across[triangle] * x + charts.down[triangle] * y
        assert place == pytest.approx(pier.points[pier.corners[number]], abs=1e-4)
    drawn = charts.triangle >= 0
    assert drawn.mean() == pytest.approx(0.81, abs=0.04)
    assert len(np.unique(charts.triangle)) == 4 * 12 + 1


def test_weather_keeps_the_mean_and_muddies_the_foot(parts: tuple[Component, ...]) -> None:
    """Factors average 1 over every role; the foot of a pier is darker than its middle; new work is nearly even."""
    charts = draw_charts(list(parts), 480)
    covered = charts.triangle >= 0
    owner = charts.owner[charts.triangle[covered]]
    old, new = weather(list(parts), 480, 1.0, _rng()), weather(list(parts), 480, 0.15, _rng())
    for number in range(len(parts)):
        assert old[covered][owner == number].mean() == pytest.approx(1, abs=0.002)
    assert new[covered].std() < 0.5 * old[covered].std()
    assert (old[:: 480 - 1, :: 480 - 1] == 1).all()  # what has no chart looks up the corner
    row, column = np.nonzero(covered)
    triangle = charts.triangle[covered]
    height = charts.place[triangle, 2] + charts.across[triangle, 2] * column + charts.down[triangle, 2] * row
    wall = (owner == 0) & (np.abs(charts.normal[triangle, 2]) < 0.1)
    shown = old[covered].mean(axis=1)
    assert shown[wall & (height < -0.5)].mean() < 0.9 * shown[wall & (height > 2) & (height < 4)].mean()


def test_gaps_take_the_nearest_value() -> None:
    """What lies outside all charts repeats the chart beside it."""
    image, covered = np.zeros((9, 9, 3), np.float32), np.zeros((9, 9), bool)
    image[4, 1], image[4, 7] = (1, 2, 3), (4, 5, 6)
    covered[4, 1] = covered[4, 7] = True
    filled = spread(image, covered)
    assert filled[0, 0].tolist() == [1, 2, 3]
    assert filled[8, 8].tolist() == [4, 5, 6]


def test_ground_patches_fade_out() -> None:
    """Mean 1, and 1 along the border, where the background's ground goes on."""
    factors = ground_patches(256, _rng())
    assert factors.mean(axis=(0, 1)) == pytest.approx([1, 1, 1], abs=0.01)
    for edge in (factors[0], factors[-1], factors[:, 0], factors[:, -1]):
        assert np.abs(edge - 1).max() < 1 / 255
    assert factors.std() > 0.08


def test_materials_validate_and_resolve(tmp_path: Path, parts: tuple[Component, ...]) -> None:
    """A look's layer passes UsdValidation and finds every texture, also after the folder has moved."""
    recipes = bake_look(LookSettings(texels=256), "weathered", tmp_path / "a", parts, _rng(), library=tmp_path / "l")
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1)
    stage.SetDefaultPrim(UsdGeom.Scope.Define(stage, "/Look").GetPrim())
    for role, recipe in recipes.items():
        author_material(stage, f"/Look/{role}", recipe)
        author_sheets(stage, f"/Look/{role}", recipe)
    author_material(stage, "/Look/Plain", MaterialRecipe("plain"))
    stage.GetRootLayer().Export(str(tmp_path / "a" / "look.usda"))
    (tmp_path / "a").rename(tmp_path / "b")
    file = str(tmp_path / "b" / "look.usda")
    _, assets, missing = UsdUtils.ComputeAllDependencies(Sdf.AssetPath(file))
    assert not missing
    assert len(assets) >= 4 * 2 + 2
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    errors = UsdValidation.ValidationContext(validators).Validate(Usd.Stage.Open(file))
    assert [error.GetErrorAsString() for error in errors] == []
    assert str(tmp_path) not in Path(file).read_text()


def test_material_network_follows_the_preview_specification(tmp_path: Path) -> None:
    """Color spaces, repeat, placement by sheet size, normal scale and bias, and the detail schema."""
    recipe = bake_surface(SheetName("brick", 0, 256), tmp_path, library=tmp_path / "library")
    stage = Usd.Stage.CreateInMemory()
    material = author_material(stage, "/Brick", recipe)
    surface = material.ComputeSurfaceSource()[0]
    assert surface.GetShaderId() == "UsdPreviewSurface"
    for name, space in (("diffuseColor", "sRGB"), ("roughness", "raw"), ("normal", "raw")):
        texture = UsdShade.Shader(surface.GetInput(name).GetConnectedSources()[0][0].source.GetPrim())
        assert texture.GetInput("sourceColorSpace").Get() == space
        assert texture.GetInput("wrapS").Get() == texture.GetInput("wrapT").Get() == "repeat"
        assert texture.GetInput("file").Get().path.startswith("./textures/brick_")
        placed = UsdShade.Shader(texture.GetInput("st").GetConnectedSources()[0][0].source.GetPrim())
        assert tuple(placed.GetInput("scale").Get()) == pytest.approx((1 / recipe.sheet, 1 / recipe.sheet))
        reader = UsdShade.Shader(placed.GetInput("in").GetConnectedSources()[0][0].source.GetPrim())
        assert reader.GetInput("varname").Get() == "st"
    prim = material.GetPrim()
    assert "FalseworkDetailAPI" in prim.GetAppliedSchemas()
    assert prim.GetAttribute("falsework:detail:texture").Get().path == "./textures/detail.png"
    assert list(prim.GetAttribute("falsework:detail:periods").Get()) == pytest.approx(recipe.periods)


def test_normals_point_out_and_tilt_the_right_way(tmp_path: Path) -> None:
    """Mean normal is +z; the left flank of each tile's roll tilts to -u and the right one to +u."""
    recipe = bake_surface(SheetName("roof_tile", 0, 1024), tmp_path, library=tmp_path / "library")
    normal = _load(tmp_path, recipe.normal_file) / 127.5 - 1
    assert normal.mean(axis=(0, 1)) == pytest.approx([0, 0, 0.9], abs=0.12)
    across = normal[..., 0].mean(axis=0).reshape(20, -1) if normal.shape[1] % 20 == 0 else normal[..., 0].mean(axis=0)
    phase = (np.arange(normal.shape[1]) + 0.5) / normal.shape[1] * 20 % 1
    across = across.ravel()
    assert across[(phase > 0.15) & (phase < 0.35)].mean() < -0.1
    assert across[(phase > 0.65) & (phase < 0.85)].mean() > 0.1


def test_wheel_tracks_follow_the_edge_of_the_road() -> None:
    """The dark bands lie a quarter of the width from each edge, 0.88 m to either side, and on old roads only."""
    box = _box("Road", "Role_DeckAsphalt", "Superstructure", (0, 0, 8.5), (20, 20, 8.6), 0)
    even = (box.mesh.st1 * np.array([1, 4 / 6])).astype(np.float32)  # texels as long as wide, as in a bridge's atlas
    road = [replace(box, mesh=replace(box.mesh, st1=even))]
    charts = draw_charts(road, 600)
    row, column = np.nonzero(charts.triangle >= 0)
    triangle = charts.triangle[row, column]
    place = charts.place[triangle] + charts.across[triangle] * column[:, None] + charts.down[triangle] * row[:, None]
    top = (charts.normal[triangle, 2] > 0.9) & (np.abs(place[:, 0] - 10) < 3)
    darker = []
    for age in (1.0, 0.0):
        shown = np.mean([weather(road, 600, age, _rng(seed))[row, column].mean(axis=1) for seed in range(4)], axis=0)
        strips = [shown[top & (np.abs(place[:, 1] - y) < 0.25)].mean() for y in np.arange(0.5, 20)]
        darker.append(1 - np.mean([strips[k] for k in (2, 7, 12, 17)]) / np.mean([strips[k] for k in (4, 5, 14, 15)]))
    assert darker[0] < -0.04
    assert abs(darker[1]) < 0.02


@pytest.mark.parametrize("number", [None, errno.EOPNOTSUPP])
def test_two_bakers_of_one_sheet_do_not_collide(
    number: int | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What a killed one left is swept where there are locks; where there are none, two at once both have the sheet."""
    left = tmp_path / f"{TEMPORARY}0123456789abcdef-key"
    left.mkdir()
    others, bakers = [], [1]

    def make() -> tuple[dict[str, bytes], dict[str, object]]:
        if number is not None and bakers:
            bakers.pop()
            others.append(_ensure(tmp_path, "key", make))
        return {"a.png": b"pixels"}, {}

    def refuse(handle: int, operation: int) -> None:
        raise OSError(number, "no locks")

    if number is not None:
        monkeypatch.setattr(fcntl, "flock", refuse)
    place = _ensure(tmp_path, "key", make)
    assert (place / "a.png").read_bytes() == b"pixels"
    assert left.exists() == (number is not None)
    assert others == ([place] if number is not None else [])
    assert len([path for path in tmp_path.iterdir() if path.is_dir() and path != left]) == 1
    (place / "a.png").chmod(0o644)
    (place / "a.png").write_bytes(b"painted")
    assert (_ensure(tmp_path, "key", make) / "a.png").read_bytes() == b"pixels"
