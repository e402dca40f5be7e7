"""The colors of land: measured albedos, without a shine on top of them, and with a change of tone over a field."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdShade

from authoring.exchange.glb import constant_shines, write_glb
from authoring.looks.bake import bake_surface, open_ground
from authoring.looks.library import SheetName
from authoring.looks.material import author_material
from authoring.looks.scenery import SCENERY
from usd_schemas.flat_scene import Material, Texture
from usd_schemas.reading.materials import read_material

Bounds = tuple[tuple[float, float, float], tuple[float, float, float]]
# Least and most of linear red, green and blue [1]. Green turf reflects 4 to 6, 7 to 10 and 3 to 4 %; straw and soil in
# it add red. Crowns of woods are darker, dry stalks are twice as bright, moist soil is about 12, 9 and 6 %.
TURF: Bounds = (0.040, 0.070, 0.025), (0.065, 0.100, 0.040)
CROWNS: Bounds = (0.025, 0.045, 0.012), (0.050, 0.080, 0.030)
LAND: dict[str, Bounds] = {
    "grass": TURF,
    "meadow": TURF,
    "crop": ((0.040, 0.065, 0.025), (0.070, 0.100, 0.042)),
    "hay": ((0.120, 0.110, 0.050), (0.190, 0.180, 0.095)),
    "ripe_crop": ((0.180, 0.140, 0.060), (0.260, 0.210, 0.105)),
    "soil": ((0.100, 0.075, 0.050), (0.145, 0.115, 0.085)),
    "furrows": ((0.080, 0.065, 0.045), (0.130, 0.105, 0.080)),
    "gravel": ((0.150, 0.140, 0.120), (0.230, 0.210, 0.190)),
    "woodland": CROWNS,
    "foliage": CROWNS,
}


def _material(surface: str, folder: Path) -> Material:
    """Bake a surface, author it on a stage, and read it as a renderer does."""
    stage = Usd.Stage.CreateNew(str(folder / "look.usda"))
    recipe = bake_surface(SheetName(surface, 0, 128), folder, library=folder / "library")
    found = read_material(author_material(stage, "/Land", recipe), lambda line: pytest.fail(line)).material
    assert found is not None
    return found


@pytest.mark.parametrize("surface", LAND)
def test_land_reflects_what_was_measured(surface: str, tmp_path: Path) -> None:
    """The mean of each picture lies between the bounds in every channel, and nothing is mirrored on top of it."""
    material = _material(surface, tmp_path)
    assert material.is_matt
    assert material.base_texture is not None
    coded = np.asarray(cv2.imread(material.base_texture.file))[..., ::-1] / 255.0
    mean = np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4).mean(axis=(0, 1))
    low, high = LAND[surface]
    assert (mean >= low).all(), mean
    assert (mean <= high).all(), mean


def test_what_is_built_shines(tmp_path: Path) -> None:
    """Only earth, stones and what grows are matt: concrete, paint and water keep the shine of a dielectric."""
    assert not _material("concrete", tmp_path).is_matt
    assert {name for name, recipe in SCENERY.items() if recipe.matt} == {*LAND, "rock", "cliff", "bark"}


def test_a_glb_says_what_is_matt(tmp_path: Path) -> None:
    """Land has a specular factor of 0 in a GLB, which would else shine as glass does; concrete has its default."""
    stage = Usd.Stage.CreateNew(str(tmp_path / "land.usda"))
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
    for number, surface in enumerate(("grass", "concrete")):
        recipe = bake_surface(SheetName(surface, 0, 128), tmp_path, library=tmp_path / "library")
        mesh = UsdGeom.Mesh.Define(stage, f"/World/{surface}")
        mesh.CreatePointsAttr([(number, 0, 0), (number + 1, 0, 0), (number, 1, 0)])
        mesh.CreateFaceVertexCountsAttr([3])
        mesh.CreateFaceVertexIndicesAttr([0, 1, 2])
        UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(author_material(stage, f"/World/Land_{surface}", recipe))
    stage.Save()
    write_glb(tmp_path / "land.usda", tmp_path / "land.glb", lambda line: None)
    data = (tmp_path / "land.glb").read_bytes()
    tree = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])
    told = {row["name"]: row.get("extensions", {}).get("KHR_materials_specular") for row in tree["materials"]}
    assert told == {
        "Land_grass": {"specularFactor": 0.0, "specularColorFactor": [1.0, 1.0, 1.0]},
        "Land_concrete": None,
    }
    assert tree["extensionsUsed"] == ["KHR_materials_specular"]


def test_a_shine_that_a_glb_cannot_tell_is_left_out() -> None:
    """Pictures of shine, and materials of one name with different shine, keep the default of a GLB."""
    black, gray = (0.0, 0.0, 0.0), (0.5, 0.5, 0.5)
    materials = (
        Material("/A/Paint", gray, specular=black),
        Material("/B/Paint", gray),
        Material("/A/Sand", gray, specular=black),
        Material("/B/Sand", gray, specular=black),
        Material("/A/Tiles", gray, specular=black, specular_texture=Texture("tiles.png", srgb=True)),
    )
    assert constant_shines(materials) == {"Sand": black}


def test_tone_changes_over_a_field() -> None:
    """Over more than 10 m green varies by 4 to 9 %, red more than green: worn parts are yellower, lush ones greener.

    Without swathes it was 2 %: from the air a meadow was of one color.
    """
    factors = open_ground(2048, 0)
    texel = 160.0 / len(factors)
    broad = cv2.GaussianBlur(factors, (0, 0), 10.0 / texel)
    inner = broad[len(broad) // 8 : -len(broad) // 8, len(broad) // 8 : -len(broad) // 8]
    green, warmth = inner[..., 1], inner[..., 0] / inner[..., 1]
    assert 0.04 < green.std() < 0.09
    assert warmth.std() > 0.015
    assert np.corrcoef(green.ravel(), warmth.ravel())[0, 1] > 0.5
