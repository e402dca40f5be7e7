"""Sun, sky and lamps: directions, strengths, and the orientation of the dome's picture."""

from pathlib import Path

import numpy as np
import pytest

from tests.usd_schemas.stages import SQUARE, Z_UP, read_body

GROUND = f'def Mesh "Ground" {{\n{SQUARE}}}\n'
TURN = 'float3 xformOp:rotateXYZ = ({})\nuniform token[] xformOpOrder = ["xformOp:rotateXYZ"]\n'
Y_UP = 'upAxis = "Y"\n metersPerUnit = 0.01'


@pytest.mark.parametrize(
    ("header", "turn", "direction"),
    [
        (Z_UP, "0, 0, 0", (0, 0, 1)),
        (Z_UP, "90, 0, 0", (0, -1, 0)),
        (Z_UP, "0, 90, 0", (1, 0, 0)),
        (Y_UP, "-90, 0, 0", (0, 0, 1)),
        (Y_UP, "0, 0, 0", (0, -1, 0)),
    ],
)
def test_sun_direction(header: str, turn: str, direction: tuple[float, ...], tmp_path: Path) -> None:
    """Light travels along local -z, so that the sun stands where local +z points."""
    text = 'def DistantLight "Sun" {\nfloat inputs:intensity = 2\nfloat inputs:exposure = 1\nfloat inputs:angle = 1\n'
    text += "bool inputs:normalize = 1\n"
    text += f"color3f inputs:color = (1, 0.5, 0.25)\n{TURN.format(turn)}}}\n"
    sun = read_body(tmp_path, GROUND + text, header).sun
    assert sun is not None
    np.testing.assert_allclose(sun.direction, direction, atol=1e-12)
    assert sun.radiance == pytest.approx((4.0, 2.0, 1.0))
    assert sun.angle == 1.0


@pytest.mark.parametrize(("angle", "given"), [(0.0, 1.0), (0.53, 6.7204e-5), (60.0, np.pi / 4), (180.0, np.pi)])
def test_a_sun_that_is_not_normalized_gives_by_its_disc(angle: float, given: float, tmp_path: Path) -> None:
    """Intensity is then radiance: irradiance is pi sin^2 of half the angle times it, and intensity itself at none."""
    text = f'def DistantLight "Sun" {{\nfloat inputs:intensity = 2\nfloat inputs:angle = {angle}\n}}\n'
    sun = read_body(tmp_path, GROUND + text).sun
    assert sun is not None
    assert sun.radiance == pytest.approx((2.0 * given,) * 3, rel=1e-4)
    default = read_body(tmp_path, GROUND + 'def DistantLight "Sun" {}\n').sun
    assert default is not None
    assert default.radiance == pytest.approx((3.3602,) * 3, rel=1e-4)


@pytest.mark.parametrize(("header", "unit"), [(Z_UP, 1.0), (Y_UP, 0.01)])
def test_sphere_lights(header: str, unit: float, tmp_path: Path) -> None:
    """Radiance times pi r^2 in meters; normalized, the power over 4 pi stage units squared gives that radiance."""
    text = """def Xform "Pole" {
        double3 xformOp:translate = (1, 2, 3)
        float3 xformOp:scale = (2, 2, 2)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
        def SphereLight "Plain" {
            float inputs:radius = 0.25
            float inputs:intensity = 8
            float inputs:exposure = 1
            color3f inputs:color = (1, 0.5, 0.25)
        }
        def SphereLight "Normalized" {
            float inputs:radius = 0.25
            float inputs:intensity = 8
            bool inputs:normalize = 1
        }
        def SphereLight "Point" {
            float inputs:radius = 0
            float inputs:intensity = 8
            bool inputs:normalize = 1
        }
        def SphereLight "Dark" {
            float inputs:radius = 0
        }
        def SphereLight "Hidden" {
            token visibility = "invisible"
        }
        def SphereLight "Spot" (prepend apiSchemas = ["ShapingAPI"]) {}
    }
    """
    scene = read_body(tmp_path, GROUND + text, header)
    plain, normalized, point, spot = scene.sphere_lights
    expected = np.array([1.0, 2.0, 3.0] if header == Z_UP else [1.0, -3.0, 2.0]) * unit
    np.testing.assert_allclose(plain.position, expected, atol=1e-12)
    assert plain.radius == pytest.approx(0.5 * unit)
    assert plain.intensity == pytest.approx(tuple(np.array([16.0, 8.0, 4.0]) * np.pi * (0.5 * unit) ** 2))
    radiance = 8.0 / (4 * np.pi * 0.5**2)  # the radius in stage units
    assert normalized.intensity == pytest.approx((radiance * np.pi * (0.5 * unit) ** 2,) * 3)
    assert point.intensity == pytest.approx(normalized.intensity)
    assert point.radius == 0.0
    assert spot.radius == pytest.approx(unit)
    assert {line for line in scene.warnings if "SphereLight" in line} == {
        "/Pole/Dark: a SphereLight that emits no light: left out",
        "/Pole/Spot: the shaping of a SphereLight is left out: it shines in all directions",
    }


@pytest.mark.parametrize(("header", "unit"), [(Z_UP, 1.0), (Y_UP, 0.01)])
def test_panels(header: str, unit: float, tmp_path: Path) -> None:
    """RectLights and DiskLights: radiance times area in meters; normalized, divided by the area in stage units."""
    text = """def Xform "Pole" {
        double3 xformOp:translate = (1, 2, 3)
        float3 xformOp:scale = (%s, 2, 2)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
        def RectLight "Plain" {
            float inputs:width = 0.5
            float inputs:height = 0.25
            float inputs:intensity = 8
            color3f inputs:color = (1, 0.5, 0.25)
        }
        def RectLight "Normalized" {
            float inputs:width = 0.5
            float inputs:height = 0.25
            float inputs:intensity = 8
            bool inputs:normalize = 1
            asset inputs:texture:file = @softbox.exr@
        }
        def DiskLight "Disk" {
            float inputs:radius = 0.25
            float inputs:intensity = 8
        }
        def RectLight "Flat" {
            float inputs:width = 0
        }
    }
    """
    for sign in (2, -2):
        scene = read_body(tmp_path, GROUND + text % sign, header)
        plain, normalized, disk = scene.sphere_lights
        expected = np.array([1.0, 2.0, 3.0] if header == Z_UP else [1.0, -3.0, 2.0]) * unit
        np.testing.assert_allclose(plain.position, expected, atol=1e-12)
        assert plain.intensity == pytest.approx(tuple(np.array([8.0, 4.0, 2.0]) * (1.0 * 0.5) * unit**2))
        assert normalized.intensity == pytest.approx((8.0 * unit**2,) * 3)
        assert disk.intensity == pytest.approx((8.0 * np.pi * (0.5 * unit) ** 2,) * 3)
        assert plain.sides is not None
        across, up = np.array(plain.sides)
        assert np.linalg.norm(across) == pytest.approx(0.5 * unit)
        assert np.linalg.norm(up) == pytest.approx(0.25 * unit)
        shines = np.cross(up, across)
        down = [0, 0, -1] if header == Z_UP else [0, 1, 0]  # the local -z, mirrored or not
        np.testing.assert_allclose(shines / np.linalg.norm(shines), down, atol=1e-12)
    said = {line for line in scene.warnings if "Light" in line}
    assert said == {
        "/Pole/Flat: a RectLight that emits no light: left out",
        "/Pole/Normalized: the texture of a RectLight is left out: it shines uniformly",
    }


def test_the_first_visible_light_counts(tmp_path: Path) -> None:
    """Hidden lights, and those without diffuse and specular light, do not shine; further ones and others are named."""
    lights = 'def DistantLight "Hidden" {\ntoken visibility = "invisible"\n}\ndef DistantLight "Idle" {\n'
    lights += 'float inputs:diffuse = 0\nfloat inputs:specular = 0\n}\ndef DistantLight "A" {\n'
    lights += "float inputs:intensity = 3\nbool inputs:normalize = 1\n}\n"
    lights += 'def DistantLight "B" {}\ndef CylinderLight "Tube" {}\n'
    scene = read_body(tmp_path, GROUND + lights)
    assert scene.sun is not None
    assert scene.sun.radiance == (3.0, 3.0, 3.0)
    assert "/B: DistantLight is left out" in scene.warnings
    assert "/Tube: CylinderLight is left out" in scene.warnings
    assert not any("Idle" in line or "Hidden" in line for line in scene.warnings)
    assert read_body(tmp_path, GROUND).sun is None


@pytest.mark.parametrize(
    ("kind", "header", "turn", "pole", "middle"),
    [
        ("DomeLight", Z_UP, "0, 0, 0", (0, 1, 0), (0, 0, 1)),
        ("DomeLight", Z_UP, "90, 0, 0", (0, 0, 1), (0, -1, 0)),
        ("DomeLight", Y_UP, "0, 0, 0", (0, 0, 1), (0, -1, 0)),
        ("DomeLight_1", Z_UP, "0, 0, 0", (0, 0, 1), (0, -1, 0)),
        ("DomeLight_1", Y_UP, "0, 0, 0", (0, 0, 1), (0, -1, 0)),
        ("DomeLight_1", Z_UP, "0, 0, 90", (0, 0, 1), (1, 0, 0)),
    ],
)
def test_dome_orientation(
    kind: str, header: str, turn: str, pole: tuple[float, ...], middle: tuple[float, ...], tmp_path: Path
) -> None:
    """The pole and the middle of the picture point where UsdLux says."""
    (tmp_path / "sky.hdr").write_bytes(b"")
    text = f'def {kind} "Sky" {{\nasset inputs:texture:file = @./sky.hdr@\n{TURN.format(turn)}}}\n'
    dome = read_body(tmp_path, GROUND + text, header).dome
    assert dome is not None
    rotation = np.array(dome.rotation)
    np.testing.assert_allclose(rotation @ [0, 1, 0], pole, atol=1e-12)
    np.testing.assert_allclose(rotation @ [0, 0, 1], middle, atol=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    assert dome.file == str(tmp_path.resolve() / "sky.hdr")


def test_missing_sky_is_plain(tmp_path: Path) -> None:
    """A dome whose picture is gone keeps its color, with a warning."""
    scene = read_body(tmp_path, GROUND + 'def DomeLight "Sky" {\nasset inputs:texture:file = @./no.exr@\n}\n')
    assert scene.dome is not None
    assert scene.dome.file == ""
    assert "/Sky: no texture ./no.exr: the dome has one color" in scene.warnings
