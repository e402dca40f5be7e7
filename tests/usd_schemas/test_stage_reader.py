"""The reader as a whole: bad files, the origin hash, and its speed."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdUtils, Vt

from groundwork.errors import InputError, MissingError
from tests.usd_schemas.stages import SQUARE, area, read_body, write_stage
from usd_schemas.flat_scene import world_triangles
from usd_schemas.reading.stage_reader import read_stage

GROUND = f'def Mesh "Ground" {{\n{SQUARE}}}\n'


def test_bad_files_are_one_line(tmp_path: Path) -> None:
    """Missing, a folder, another format, or a syntax error: one line each that names the file."""
    with pytest.raises(MissingError, match="no such file"):
        read_stage(tmp_path / "gone.usda")
    with pytest.raises(InputError, match="is a folder"):
        read_stage(tmp_path)
    other = tmp_path / "notes.txt"
    other.write_text("hello")
    broken = tmp_path / "broken.usda"
    broken.write_text("#usda 1.0\ndef Xform {")
    torn = tmp_path / "torn.usdc"
    torn.write_bytes(b"PXR-USDC\x00\x08\x00\x00" + bytes(40))
    for path in (other, broken, torn):
        with pytest.raises(InputError, match="not readable as USD") as caught:
            read_stage(path)
        assert "\n" not in str(caught.value)
        assert str(path) in str(caught.value)


@pytest.mark.parametrize("unit", ["0", "-1", "nan", "inf"])
def test_a_unit_that_is_no_length(unit: str, tmp_path: Path) -> None:
    """It is named as such, not as a stage without geometry."""
    with pytest.raises(InputError, match=r"stage\.usda: metersPerUnit: the stage's unit is not a length \(found "):
        read_body(tmp_path, GROUND, f'upAxis = "Z"\n metersPerUnit = {unit}')


def test_missing_layers_are_warnings(tmp_path: Path) -> None:
    """A reference that leads nowhere is named without this machine's folders."""
    scene = read_body(tmp_path, GROUND + 'def "Lost" (references = @./gone.usda@) {}\n')
    assert any("gone.usda" in line for line in scene.warnings)
    assert not any(str(tmp_path) in line for line in scene.warnings)


def test_origin_follows_content_not_place(tmp_path: Path) -> None:
    """The same stage elsewhere has the same origin; one byte in a texture or sublayer gives another."""
    here = tmp_path / "here"
    here.mkdir()
    (here / "a.png").write_bytes(b"1")
    write_stage(here, 'def DomeLight "Sky" {\nasset inputs:texture:file = @./a.png@\n}\n', name="light.usda")
    path = write_stage(here, GROUND, "subLayers = [@./light.usda@]")
    first = read_stage(path)
    assert first.dome is not None
    there = tmp_path / "there"
    shutil.copytree(here, there)
    assert read_stage(there / "stage.usda").origin == first.origin
    (there / "a.png").write_bytes(b"2")
    second = read_stage(there / "stage.usda").origin
    assert second != first.origin
    write_stage(there, 'def DomeLight "Sky" {\nfloat inputs:intensity = 2\n}\n', name="light.usda")
    assert read_stage(there / "stage.usda").origin not in (first.origin, second)


def test_binary_and_package_read_the_same(tmp_path: Path) -> None:
    """usda, usdc and usdz of one stage give the same triangles."""
    path = write_stage(tmp_path, GROUND + 'def Sphere "S" {}\n')
    stage = Usd.Stage.Open(str(path))
    stage.Export(str(tmp_path / "stage.usdc"))
    assert UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(str(path)), str(tmp_path / "stage.usdz"))
    corners = world_triangles(read_stage(path))[0]
    for name in ("stage.usdc", "stage.usdz"):
        np.testing.assert_array_equal(world_triangles(read_stage(tmp_path / name))[0], corners)


def test_twice_the_same(tmp_path: Path) -> None:
    """Two readings agree in every array and row, instances included."""
    body = 'class "P" {\n' + GROUND + "}\n"
    for number in range(4):
        body += f'def Xform "I{number}" (instanceable = true\n references = </P>) {{}}\n'
    one, two = (read_body(tmp_path, body) for _ in range(2))
    for part in ("geometry", "draws"):
        for name, values in vars(getattr(one, part)).items():
            np.testing.assert_array_equal(values, getattr(getattr(two, part), name))
    assert (one.materials, one.instances, one.warnings) == (two.materials, two.instances, two.warnings)


def test_many_prims_are_read_whole(tmp_path: Path) -> None:
    """A stage of 1,200 meshes, 346,000 triangles: every draw, every vertex, all of the area."""
    stage = Usd.Stage.CreateNew(str(tmp_path / "many.usdc"))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    side = 12
    x, y = np.meshgrid(np.arange(side + 1), np.arange(side + 1))
    points = np.stack([x, y, np.sin(x)], axis=-1).reshape(-1, 3).astype(np.float32)
    first = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).reshape(-1)
    quads = np.stack([first, first + 1, first + side + 2, first + side + 1], axis=1).reshape(-1)
    for number in range(1200):
        mesh = UsdGeom.Mesh.Define(stage, f"/World/Group_{number // 50:02d}/Mesh_{number:04d}")
        mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
        mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(side * side, 4, np.int32)))
        mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(quads.astype(np.int32)))
        mesh.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(np.tile(np.array([0, 0, 1], np.float32), (len(quads), 1))))
        mesh.SetNormalsInterpolation(UsdGeom.Tokens.faceVarying)
        uv = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, "faceVarying")
        uv.Set(Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(points[quads, :2])))
        mesh.AddTranslateOp().Set(Gf.Vec3d(20.0 * (number % 40), 20.0 * (number // 40), 0.0))
    stage.Save()
    scene = read_stage(tmp_path / "many.usdc")
    assert len(scene.draws.part) == 1200
    assert len(scene.geometry.positions) == 1200 * (side + 1) ** 2
    assert area(scene) > 1200 * side * side
