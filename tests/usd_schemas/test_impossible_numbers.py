"""A number that cannot be, in a camera, a light, a class table or a material, costs that alone, and is named."""

from pathlib import Path

import numpy as np
import pytest

from tests.usd_schemas.stages import SQUARE, area, read_body
from usd_schemas.flat_scene import FlatScene

GOOD = f'def Mesh "Good" {{\n{SQUARE}\n}}\n'
CALIBRATION = "int2 falsework:cal:imageSize = (64, 48)\n" + "\n".join(
    f"double falsework:cal:{name} = {value}" for name, value in (("fx", 50.0), ("fy", 50.0), ("cx", 32.0), ("cy", 24.0))
)
CAMERAS = {
    "no focal length": CALIBRATION.replace("fx = 50.0", "fx = 0"),
    "a negative focal length": CALIBRATION.replace("fy = 50.0", "fy = -3"),
    "a focal length that is no number": CALIBRATION.replace("fx = 50.0", "fx = nan"),
    "a principal point at infinity": CALIBRATION.replace("cx = 32.0", "cx = inf"),
    "no pixels": CALIBRATION.replace("(64, 48)", "(0, 48)"),
    "too many pixels": CALIBRATION.replace("(64, 48)", "(200000, 48)"),
    "a lens that is no number": f"{CALIBRATION}\ndouble falsework:cal:k1 = nan",
    "fixes that are no numbers": "double3 falsework:gps:localPosition.timeSamples = { 0: (nan, 0, 0) }",
    "times that are no numbers": "double falsework:survey:captureTime.timeSamples = { 0: nan }",
}
LIGHTS = {
    "sun at infinity": ("DistantLight", "float inputs:intensity = inf"),
    "sun that is no number": ("DistantLight", "float inputs:angle = nan"),
    "negative sun": ("DistantLight", "float inputs:intensity = -1"),
    "flat sun": (
        "DistantLight",
        'double3 xformOp:scale = (1, 1, 0)\nuniform token[] xformOpOrder = ["xformOp:scale"]',
    ),
    "negative sky": ("DomeLight", "float inputs:intensity = -1"),
    "sky that is no number": ("DomeLight", "color3f inputs:color = (nan, 0, 0)"),
}
TABLES = {
    "ids of words": 'string[] falsework:classIds = ["a", "b"]',
    "ids beyond a byte": "int[] falsework:classIds = [1, 300]",
    "colors that are no numbers": "color3f[] falsework:classColors = [(nan, 0, 0), (0, 0, 0)]",
    "colors of words": 'string[] falsework:classColors = ["red", "blue"]',
    "bright colors": "color3f[] falsework:classColors = [(300, 0, 0), (0, 0, 0)]",
    "negative colors": "color3f[] falsework:classColors = [(-4, 0, 0), (0, 0, 0)]",
    "labels that are no list": 'string falsework:labelNames = "one"\nstring[] falsework:labelClasses = ["deck"]',
}


def sound(scene: FlatScene) -> None:
    """The mesh beside is drawn whole, all numbers are finite, and there is a warning."""
    assert area(scene) == pytest.approx(4.0)
    assert scene.warnings
    for track in scene.cameras:
        assert np.isfinite(track.poses).all()
        assert track.gps is None
        assert "capture_times" not in track.facts


@pytest.mark.parametrize("case", CAMERAS)
def test_a_camera_with_impossible_numbers(case: str, tmp_path: Path) -> None:
    """It is drawn with the lens of USD, or without its fixes."""
    with np.errstate(all="raise"):
        scene = read_body(tmp_path, f'{GOOD}def Camera "Bad" {{\n{CAMERAS[case]}\n}}\n')
    sound(scene)
    assert all(track.calibration is None for track in scene.cameras)


@pytest.mark.parametrize("case", LIGHTS)
def test_a_light_with_impossible_numbers(case: str, tmp_path: Path) -> None:
    """It is left out."""
    kind, lines = LIGHTS[case]
    scene = read_body(tmp_path, f'{GOOD}def {kind} "Bad" {{\n{lines}\n}}\n')
    sound(scene)
    assert scene.sun is None
    assert scene.dome is None


@pytest.mark.parametrize("case", TABLES)
def test_a_class_table_with_impossible_values(case: str, tmp_path: Path) -> None:
    """Classes or colors are those that Falsework has; every color has three bytes."""
    names = 'string[] falsework:classNames = ["deck", "pier"]'
    table = f'def "Vars" {{\ndef RenderVar "semantic" {{\n{names}\n{TABLES[case]}\n}}\n}}\n'
    scene = read_body(tmp_path, f'{GOOD}def "Render" {{\n{table}}}\n')
    sound(scene)
    assert all(0 <= byte <= 255 for row in scene.classes for byte in row.color)
    assert ("pier" in {row.name for row in scene.classes}) == ("classIds" not in TABLES[case])


def test_parameters_that_are_no_object_are_left_out(tmp_path: Path) -> None:
    """JSON of another kind costs no geometry, and leaves a table that can be read again."""
    for text in ("[1]", "5", "null"):
        line = f'string falsework:component:parameters = "{text}"\nint falsework:component:instanceId = 3'
        scene = read_body(tmp_path, f'def Mesh "Good" {{\n{SQUARE}\n{line}\n}}\n')
        assert area(scene) == pytest.approx(4.0)
        assert all(row.parameters == {} for row in scene.instances)
