"""A level card of 18 % gray renders at 0.18 at exposure 0 in Blender too, under sun, clouds and photographs."""

import json
from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdRender, UsdShade

from authoring.light.daylight import LightSettings, author_lighting, bake_light, encode_exr
from authoring.light.sky import sky_directions
from authoring.light.sun import LUMINANCE, direction
from tests.dcc.blender import run_in_blender

_LIGHTS = {
    "clear": LightSettings(cloud_cover=0.0),
    "low sun": LightSettings(cloud_cover=0.0, date="2024-12-21T09:00"),  # pyright: ignore[reportArgumentType]
    "overcast": LightSettings(cloud_cover=1.0),
    "photograph": LightSettings(sky="sky.exr"),
}


@pytest.mark.dcc
@pytest.mark.parametrize("name", _LIGHTS)
def test_gray_card_in_blender(name: str, tmp_path: Path) -> None:
    """Opened with our script: luminance within 3 %, and the irradiance of the sun as we mean it."""
    directions = sky_directions(128)
    picture = np.where(directions[..., 2:] > 0, [0.5, 0.6, 0.8], 0.1)
    picture[np.degrees(np.arccos(np.clip(directions @ direction(40.0, 90.0), -1, 1))) < 2.0] = 900.0
    (tmp_path / "sky.exr").write_bytes(encode_exr(picture.astype(np.float32)))
    photograph = tmp_path / "sky.exr" if _LIGHTS[name].sky else None
    lighting = bake_light(_LIGHTS[name], tmp_path, np.random.default_rng(1), photograph)
    stage = _card(tmp_path / "card.usda")
    author_lighting(stage, lighting)
    stage.Save()
    request = {"file": str(tmp_path / "card.usda"), "facts": str(tmp_path / "facts.json")}
    run_in_blender("gray_card.py", json.dumps(request))
    facts = json.loads((tmp_path / "facts.json").read_text())
    assert np.array(facts["colour"]) @ LUMINANCE == pytest.approx(0.18, rel=0.03)
    assert facts["suns"] == pytest.approx([max(lighting.sun_irradiance)], rel=1e-4)


def _card(path: Path) -> Usd.Stage:
    """Lay a matt gray card on the ground, with a camera above it."""
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
    card = UsdGeom.Mesh.Define(stage, "/World/Card")
    card.CreatePointsAttr([(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)])
    card.CreateFaceVertexCountsAttr([4])
    card.CreateFaceVertexIndicesAttr([0, 1, 2, 3])
    gray = UsdShade.Material.Define(stage, "/World/Grey")
    surface = UsdShade.Shader.Define(stage, "/World/Grey/Surface")
    surface.CreateIdAttr("UsdPreviewSurface")
    surface.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set(Gf.Vec3f(0.18))
    surface.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(1.0)
    surface.CreateInput("ior", Sdf.ValueTypeNames.Float).Set(1.0)
    gray.CreateSurfaceOutput().ConnectToSource(surface.ConnectableAPI(), "surface")
    UsdShade.MaterialBindingAPI.Apply(card.GetPrim()).Bind(gray)
    camera = UsdGeom.Camera.Define(stage, "/World/Eye")
    camera.AddTranslateOp().Set(Gf.Vec3d(0, 0, 5))
    camera.CreateFocalLengthAttr(200.0)
    product = UsdRender.Product.Define(stage, "/Render/Products/card")
    product.CreateResolutionAttr(Gf.Vec2i(16, 16))
    product.CreateCameraRel().SetTargets([camera.GetPath()])
    return stage
