"""The library of sheets: independent sheets, baked once, linked; their materials follow the role's own."""

import time
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from pathlib import Path
from threading import Barrier

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdShade

from authoring.layers.geometry import BRIDGE, geometry_layer
from authoring.layers.looks import look_layer
from authoring.looks import library
from authoring.looks.bake import LookSettings, bake_look
from authoring.looks.library import SHEETS, SheetName, bake_sheets, copy_sheet, draw_sheet
from authoring.looks.noise import Bank
from authoring.looks.roles import sheet_material, sheet_numbers
from authoring.shapes.component import Component
from groundwork.errors import InputError
from tests.authoring.boxes import box


def _columns(count: int) -> tuple[Component, ...]:
    meshes = [box((3 * n, 0, 0), (3 * n + 1, 1, 6)) for n in range(count)]
    return tuple(
        Component(f"Column_{n}", "column", "Role_PierConcrete", "Substructure", mesh, n + 1)
        for n, mesh in enumerate(meshes)
    )


def _gray(name: SheetName, bank: Bank | None) -> np.ndarray:
    import cv2

    files, _ = draw_sheet(name, bank)
    return np.asarray(cv2.imdecode(np.frombuffer(files["albedo.jpg"], np.uint8), cv2.IMREAD_GRAYSCALE), np.float64)


def test_sheets_of_one_surface_have_no_place_in_common() -> None:
    """However one is moved over another, their correlation stays low: sheets drawn from one bank are independent."""
    bank = Bank()
    for surface in ("smooth_concrete", "asphalt", "paint_green_aged"):
        gray = [_gray(SheetName(surface, number, 512), bank) for number in range(SHEETS)]
        for one, two in ((0, 1), (0, 2), (1, 2)):
            a, b = (g - g.mean() for g in (gray[one], gray[two]))
            cross = np.fft.irfft2(np.fft.rfft2(a) * np.conj(np.fft.rfft2(b)), a.shape) / (a.std() * b.std() * a.size)
            assert np.abs(cross).max() < 0.35, surface


def test_a_sheet_does_not_depend_on_what_was_baked_before() -> None:
    """Alone or after others from the same bank: the same bytes."""
    name, bank = SheetName("board_concrete", 1, 256), Bank()
    draw_sheet(SheetName("masonry", 0, 256), bank)
    draw_sheet(SheetName("board_concrete", 0, 256), bank)
    assert draw_sheet(name, bank) == draw_sheet(name, Bank())


def test_sheets_are_baked_once_and_copied(tmp_path: Path) -> None:
    """Painting in a scene changes nothing else; a file that was painted on in the library is baked anew."""
    name = SheetName("rubber", 0, 256)
    place = bake_sheets([name], tmp_path / "library")[name]
    first = {path.name: path.stat().st_mtime_ns for path in place.iterdir()}
    for scene in ("one", "two"):
        copy_sheet(bake_sheets([name], tmp_path / "library")[name], tmp_path / scene, "rubber_1")
    assert {path.name: path.stat().st_mtime_ns for path in place.iterdir()} == first
    one, two = tmp_path / "one/rubber_1_albedo.jpg", tmp_path / "two/rubber_1_albedo.jpg"
    kept = place / "albedo.jpg"
    whole = kept.read_bytes()
    assert one.read_bytes() == whole
    assert all(path.stat().st_nlink == 1 for path in (one, two, kept))
    one.write_bytes(b"painted over")
    assert two.read_bytes() == kept.read_bytes() == whole
    kept.chmod(0o644)
    kept.write_bytes(b"painted over")
    copy_sheet(bake_sheets([name], tmp_path / "library")[name], tmp_path / "three", "rubber_1")
    assert (tmp_path / "three/rubber_1_albedo.jpg").read_bytes() == whole


def test_who_comes_second_waits_and_takes_what_is_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Scenes that are authored at once bake a sheet once, and none loses it while it reads it."""
    name, drawn = SheetName("board_concrete", 0, 64), []
    both = Barrier(2, timeout=120)

    def slow(sheet: SheetName, bank: Bank | None) -> tuple[dict[str, bytes], dict[str, object]]:
        drawn.append(sheet)
        time.sleep(0.2)
        return draw_sheet(sheet, bank)

    def author(scene: str) -> str:
        both.wait()
        place = bake_sheets([name], tmp_path / "library")[name]
        return copy_sheet(place, tmp_path / scene, "pier").albedo

    monkeypatch.setattr(library, "draw_sheet", slow)
    with ThreadPoolExecutor(2) as pool:
        assert list(pool.map(author, ("one", "two"))) == ["./one/pier_albedo.jpg", "./two/pier_albedo.jpg"]
    assert drawn == [name]


def test_a_cache_that_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    """A file where the folder should be: the message names the variable that mends it."""
    (tmp_path / "library").write_text("")
    with pytest.raises(InputError, match="FALSEWORK_CACHE"):
        bake_sheets([SheetName("board_concrete", 0, 64)], tmp_path / "library")


def test_library_moves_with_the_environment(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """`FALSEWORK_CACHE` names the folder, else the user's cache folder holds it."""
    monkeypatch.setenv("FALSEWORK_CACHE", str(tmp_path))
    assert library.cache_folder() == tmp_path
    monkeypatch.delenv("FALSEWORK_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "x"))
    assert library.cache_folder() == tmp_path / "x/falsework/sheets"


def test_neighbors_wear_different_sheets() -> None:
    """All three sheets are in use, the first component wears the first, hardly any two neighbors the same."""
    numbers = list(sheet_numbers(_columns(60)).values())
    assert numbers[0] == 0
    assert set(numbers) == set(range(SHEETS))
    assert min(numbers.count(k) for k in range(SHEETS)) >= 15
    assert sum(a == b for a, b in pairwise(numbers)) <= 3


def test_sheets_follow_the_material_of_their_role(tmp_path: Path) -> None:
    """Bound materials differ in their files alone; a change of the role's material changes all of its sheets."""
    columns = _columns(6)
    recipes = bake_look(
        LookSettings(texels=256), "clean", tmp_path, columns, np.random.default_rng(1), library=tmp_path / "library"
    )
    look_layer(recipes).Export(str(tmp_path / "look.usda"))
    geometry_layer(BRIDGE, columns).Export(str(tmp_path / "geometry.usdc"))
    stage = Usd.Stage.CreateNew(str(tmp_path / "bridge.usda"))
    stage.GetRootLayer().subLayerPaths = ["./geometry.usdc"]
    stage.OverridePrim("/Bridge/BridgeLooks").GetReferences().AddReference("./look.usda", "/Look")
    bound = [
        UsdShade.MaterialBindingAPI(stage.GetPrimAtPath(BRIDGE.prim(column))).ComputeBoundMaterial()[0]
        for column in columns
    ]
    assert {material.GetPrim().GetName() for material in bound} == {
        sheet_material("Role_PierConcrete", number) for number in range(SHEETS)
    }
    files = set()
    for material in bound:
        surface = material.ComputeSurfaceSource()[0]
        color = surface.GetInput("diffuseColor").GetConnectedSources()[0][0].source
        assert surface.GetPath().HasPrefix(material.GetPath())
        assert color.GetPath().HasPrefix(material.GetPath())
        files.add(UsdShade.Shader(color.GetPrim()).GetInput("file").Get().resolvedPath)
    assert len(files) == SHEETS
    role = UsdShade.Shader(stage.GetPrimAtPath(f"{BRIDGE.material('Role_PierConcrete')}/Surface"))
    role.GetInput("diffuseColor").DisconnectSource()
    role.GetInput("diffuseColor").Set((0.6, 0.1, 0.1))
    for material in bound:
        painted = material.ComputeSurfaceSource()[0].GetInput("diffuseColor")
        assert not painted.HasConnectedSource()
        assert tuple(painted.Get()) == (np.float32(0.6), np.float32(0.1), np.float32(0.1))


def test_roles_of_others_need_no_sheets() -> None:
    """A site's pieces bind the one material that they name."""
    assert sheet_material("grass", 0) == "grass"
    assert Sdf.Path.IsValidIdentifier(sheet_material("Role_Ballast", 2))
