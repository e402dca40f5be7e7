"""Sun and sky: directions, strengths, and the orientation of the dome's picture."""

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
    text += f"color3f inputs:color = (1, 0.5, 0.25)\n{TURN.format(turn)}}}\n"
    sun = read_body(tmp_path, GROUND + text, header).sun
    assert sun is not None
    np.testing.assert_allclose(sun.direction, direction, atol=1e-12)
    assert sun.radiance == pytest.approx((4.0, 2.0, 1.0))
    assert sun.angle == 1.0


def test_the_first_visible_light_counts(tmp_path: Path) -> None:
    """Hidden lights do not shine; further ones and other kinds are named."""
    lights = 'def DistantLight "Hidden" {\ntoken visibility = "invisible"\n}\ndef DistantLight "A" {\n'
    lights += 'float inputs:intensity = 3\n}\ndef DistantLight "B" {}\ndef SphereLight "Bulb" {}\n'
    scene = read_body(tmp_path, GROUND + lights)
    assert scene.sun is not None
    assert scene.sun.radiance == (3.0, 3.0, 3.0)
    assert "/B: DistantLight is left out" in scene.warnings
    assert "/Bulb: SphereLight is left out" in scene.warnings
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
    """A dome whose picture is gone keeps its colour, with a warning."""
    scene = read_body(tmp_path, GROUND + 'def DomeLight "Sky" {\nasset inputs:texture:file = @./no.exr@\n}\n')
    assert scene.dome is not None
    assert scene.dome.file == ""
    assert "/Sky: no texture ./no.exr: the dome is plain" in scene.warnings
