"""Where things stand: instances, point instancers, visibility and purpose, against UsdGeom's own bounding boxes."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from pxr import Usd, UsdGeom

from groundwork.errors import InputError
from tests.usd_schemas.stages import SQUARE, area, bounds, read_body, volume, write_stage
from usd_schemas.reading.stage_reader import read_stage

F64 = NDArray[np.float64]

XFORM = 'uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ", "xformOp:scale"]\n'


def moved(move: str = "0, 0, 0", turn: str = "0, 0, 0", scale: str = "1, 1, 1") -> str:
    """Write a transform."""
    return (
        f"double3 xformOp:translate = ({move})\nfloat3 xformOp:rotateXYZ = ({turn})\n"
        f"float3 xformOp:scale = ({scale})\n{XFORM}"
    )


def usd_bounds(path: Path) -> F64:
    """Ask USD for the box of what default and render purpose show, shape (2, 3)."""
    stage = Usd.Stage.Open(str(path))
    cache = UsdGeom.BBoxCache(Usd.TimeCode.EarliestTime(), ["default", "render"])
    box = cache.ComputeWorldBound(stage.GetPseudoRoot()).ComputeAlignedRange()
    return np.array([box.GetMin(), box.GetMax()])


def check_bounds(folder: Path, body: str) -> F64:
    """Compare our box with USD's; give it back."""
    path = write_stage(folder, body)
    found = bounds(read_stage(path))
    np.testing.assert_allclose(found, usd_bounds(path), rtol=1e-6, atol=1e-5)
    return found


def test_nested_transforms_and_reset(tmp_path: Path) -> None:
    """Parents pass on their transforms, up to a prim that resets the stack."""
    inner = f'def Cube "C" {{\n{moved("1, 2, 3", "0, 0, 90", "1, 2, 1")}}}\n'
    reset = moved("5, 5, 5").replace('["xformOp:translate"', '["!resetXformStack!", "xformOp:translate"')
    body = f'def Xform "A" {{\n{moved("10, 0, 0", "90, 0, 0", "2, 2, 2")}{inner}def Cube "R" {{\n{reset}}}\n}}\n'
    check_bounds(tmp_path, body)


def test_scenegraph_instances(tmp_path: Path) -> None:
    """Instanceable references, one inside another: geometry once, a draw for each."""
    body = 'class "Post" {\n def Cube "Body" {\n' + moved("0, 0, 1", scale="0.1, 0.1, 1") + "}\n}\n"
    body += 'class "Pair" {\n'
    for name, place in (("L", "-1, 0, 0"), ("R", "1, 0, 0")):
        body += f'def Xform "{name}" (instanceable = true\n references = </Post>) {{\n{moved(place)}}}\n'
    body += "}\n"
    for number in range(3):
        body += f'def Xform "P{number}" (instanceable = true\n references = </Pair>) {{\n'
        body += moved(f"0, {4 * number}, 0", f"0, 0, {30 * number}") + "}\n"
    check_bounds(tmp_path, body)
    scene = read_stage(tmp_path / "stage.usda")
    assert len(scene.geometry.part_first) == 1
    assert len(scene.draws.part) == 6
    assert volume(scene) == pytest.approx(6 * 0.2 * 0.2 * 2)
    assert len(scene.instances) == 6


INSTANCER = """
def PointInstancer "Trees" {{
    {extra}
    rel prototypes = [</Trees/Protos/Small>, </Trees/Protos/Tall>]
    int[] protoIndices = [0, 1, 0, 1]
    point3f[] positions = [(0, 0, 0), (10, 0, 0), (0, 10, 0), (10, 10, 5)]
    quath[] orientations = [(1, 0, 0, 0), (0.70710678, 0, 0, 0.70710678), (1, 0, 0, 0), (1, 0, 0, 0)]
    float3[] scales = [(1, 1, 1), (1, 2, 1), (2, 2, 2), (1, 1, 1)]
    int64[] ids = [100, 101, 102, 103]
    {move}
    {scope} "Protos" {{
        def Cube "Small" {{
            double size = 1
            double3 xformOp:translate = (0, 0, 0.5)
            uniform token[] xformOpOrder = ["xformOp:translate"]
        }}
        def Xform "Tall" {{
            double3 xformOp:translate = (0, 0, 3)
            uniform token[] xformOpOrder = ["xformOp:translate"]
            def Cube "Trunk" {{
                double size = 1
                float3 xformOp:scale = (0.5, 0.25, 6)
                uniform token[] xformOpOrder = ["xformOp:scale"]
            }}
        }}
    }}
}}
"""


def test_point_instancer(tmp_path: Path) -> None:
    """Every point draws its prototype where USD says, and no prototype stands at the origin."""
    check_bounds(tmp_path, INSTANCER.format(extra="", move=moved("100, 0, 0", "0, 0, 90"), scope="def Scope"))
    scene = read_stage(tmp_path / "stage.usda")
    assert volume(scene) == pytest.approx(1 + 8 + 0.75 * 2 + 0.75, rel=1e-3)
    assert len(scene.draws.part) == 4
    assert len(scene.geometry.part_first) == 2
    assert [row.path for row in scene.instances] == ["/Trees"]


def test_prototypes_under_over(tmp_path: Path) -> None:
    """Prototypes that are hidden from other readers under an `over` are drawn all the same."""
    scene = read_body(tmp_path, INSTANCER.format(extra="", move="", scope="over"))
    assert volume(scene) == pytest.approx(1 + 8 + 0.75 * 2 + 0.75, rel=1e-3)


def test_invisible_ids(tmp_path: Path) -> None:
    """Hidden points are not drawn, and the others keep their ids."""
    extra = "int64[] invisibleIds = [101]\n uniform int[] falsework:component:instanceIds = [7, 8, 9, 10]"
    scene = read_body(tmp_path, INSTANCER.format(extra=extra, move="", scope="def Scope"))
    assert volume(scene) == pytest.approx(1 + 8 + 0.75, rel=1e-3)
    assert sorted(scene.draws.instance.tolist()) == [7, 9, 10]
    assert [row.id for row in scene.instances] == [7, 9, 10]


def test_nested_point_instancers(tmp_path: Path) -> None:
    """An instancer of instancers multiplies: transforms against USD, ids from the outermost."""
    inner = INSTANCER.format(extra="", move="", scope="def Scope").replace("/Trees/", "/Outer/Protos/Trees/")
    body = f"""def PointInstancer "Outer" {{
        rel prototypes = [</Outer/Protos>]
        int[] protoIndices = [0, 0]
        point3f[] positions = [(0, 0, 0), (100, 0, 7)]
        quath[] orientations = [(1, 0, 0, 0), (0.9238795, 0, 0, 0.3826834)]
        uniform int[] falsework:component:instanceIds = [21, 22]
        def Xform "Protos" {{
            {moved("0, 0, 2")}
            {inner}
        }}
    }}"""
    scene = read_body(tmp_path, body)
    assert len(scene.draws.part) == 8
    assert sorted(scene.draws.instance.tolist()) == [21] * 4 + [22] * 4
    # USD's own numbers: every inner instance under every outer one.
    stage = Usd.Stage.Open(str(tmp_path / "stage.usda"))
    time = Usd.TimeCode.Default()
    outer, trees = (
        UsdGeom.PointInstancer(stage.GetPrimAtPath(path)).ComputeInstanceTransformsAtTime(time, time)
        for path in ("/Outer", "/Outer/Protos/Trees")
    )
    expected = sorted(tuple(np.round((t * o).Transform((0, 0, 0)), 4).tolist()) for o in outer for t in trees)
    found = sorted(tuple(np.round(transform[:3, 3], 4).tolist()) for transform in scene.draws.transform)
    np.testing.assert_allclose(found, expected, atol=2e-4)
    second = scene.draws.transform[:, 0, 3] > 50
    assert (scene.draws.instance == np.where(second, 22, 21)).all()


@pytest.mark.parametrize(
    ("line", "drawn"),
    [
        ('token visibility = "invisible"', False),
        ('token visibility = "inherited"', True),
        ('uniform token purpose = "render"', True),
        ('uniform token purpose = "proxy"', False),
        ('uniform token purpose = "guide"', False),
    ],
)
def test_visibility_and_purpose(line: str, drawn: bool, tmp_path: Path) -> None:
    """What a parent hides or sets aside is not drawn; a child may take back its purpose, not its visibility."""
    own = 'uniform token purpose = "default"'
    hidden = 'token visibility = "inherited"'
    body = f'def Xform "A" {{\n{line}\ndef Mesh "M" {{\n{SQUARE}}}\ndef Mesh "N" {{\n{SQUARE}{hidden}\n}}\n}}\n'
    body += f'def Mesh "Other" {{\n{SQUARE}}}\n'
    assert area(read_body(tmp_path, body)) == pytest.approx(12.0 if drawn else 4.0)
    taken_back = body.replace(hidden, own)
    purpose = "purpose" in line
    assert area(read_body(tmp_path, taken_back)) == pytest.approx(12.0 if drawn else (8.0 if purpose else 4.0))


def test_inactive_and_unloaded(tmp_path: Path) -> None:
    """An inactive prim is gone; a payload is loaded."""
    write_stage(tmp_path, f'def Mesh "M" {{\n{SQUARE}}}', 'defaultPrim = "M"', "payload.usda")
    body = f'def Mesh "Off" (active = false) {{\n{SQUARE}}}\ndef "On" (payload = @./payload.usda@) {{}}\n'
    assert area(read_body(tmp_path, body)) == pytest.approx(4.0)


def test_what_is_not_drawn_is_named_once_a_type(tmp_path: Path) -> None:
    """Curves and points are left out with one line for each type."""
    body = 'def BasisCurves "C1" {}\ndef BasisCurves "C2" {}\ndef Points "P" {}\n' + f'def Mesh "M" {{\n{SQUARE}}}'
    scene = read_body(tmp_path, body)
    said = ("/C1: BasisCurves without width is not drawn (nor 1 more)", "/P: Points without width is not drawn")
    assert scene.warnings[:2] == said


def test_transforms_that_are_not_finite(tmp_path: Path) -> None:
    """A prim that stands nowhere is dropped by name, and a flat one; one without any size, as hidden, silently."""
    body = f'def Mesh "M" {{\n{SQUARE}}}\ndef Mesh "Nan" {{\n{SQUARE}{moved("nan, 0, 0")}}}\n'
    body += f'def Mesh "Gone" {{\n{SQUARE}{moved(scale="0, 0, 0")}}}\n'
    body += f'def Plane "Flat" {{\n{moved(scale="5, 5, 0")}}}\n'
    scene = read_body(tmp_path, body)
    assert area(scene) == pytest.approx(4.0)
    assert any(line.startswith("/Nan: its transform is not finite") for line in scene.warnings)
    assert "/Flat: a scale of 0 along an axis: not drawn" in scene.warnings
    assert not any("/Gone" in line for line in scene.warnings)


def test_nothing_visible(tmp_path: Path) -> None:
    """A stage that shows nothing is bad input, in one line."""
    with pytest.raises(InputError, match=r"stage\.usda: the stage shows no geometry") as caught:
        read_body(tmp_path, f'def Mesh "M" {{\n{SQUARE}\n token visibility = "invisible"\n}}')
    assert "\n" not in str(caught.value)


def test_nothing_drawn_says_what_was_lost(tmp_path: Path) -> None:
    """The reason is the mesh that is not drawn, not the camera's fault before it; without such a line, all are said."""
    camera = 'def Camera "C" {\n token projection = "orthographic"\n}\n'
    with pytest.raises(InputError, match=r"no geometry\. /Bad: .*: not drawn$"):
        read_body(tmp_path, camera + 'def Mesh "Bad" {\n int[] faceVertexCounts = [3]\n}\n')
    with pytest.raises(InputError, match=r"no geometry\. .*gone\.usda.*; /C: only perspective"):
        read_body(tmp_path, camera + 'def "Lost" (references = @./gone.usda@) {}\n')
    with pytest.raises(InputError, match=r"no geometry\. Check visibility"):
        read_body(tmp_path, 'def Xform "Nothing" {}\n')


def test_what_moves_is_drawn_at_the_time_of_the_one_image(tmp_path: Path) -> None:
    """With a camera that stands still, parts stand as at the earliest time, by name; a rig alone is no motion."""
    keys = "double3 xformOp:translate.timeSamples = {\n 1: (0, 0, 0),\n 5: (9, 0, 0),\n}\n"
    keys += 'uniform token[] xformOpOrder = ["xformOp:translate"]\n'
    rig = f'def Xform "Rig" {{\n{keys}def Camera "C" {{}}\n}}\n'
    assert not any("move" in line for line in read_body(tmp_path, rig + f'def Mesh "M" {{\n{SQUARE}}}').warnings)
    scene = read_body(tmp_path, f'def Xform "X" {{\n{keys}def Mesh "M" {{\n{SQUARE}}}\ndef Cube "C" {{}}\n}}\n')
    assert "2 parts move: drawn at the time of the one image; --frame FIRST:LAST renders more" in scene.warnings
    np.testing.assert_allclose(bounds(scene), [[-1, -1, -1], [1, 1, 1]])


def test_cameras_and_lights_of_prototypes_do_not_count(tmp_path: Path) -> None:
    """A lamp scattered by an instancer neither shines nor films from the origin."""
    lamp = 'def DistantLight "Lamp" {}\ndef Camera "Eye" {}\n'
    text = INSTANCER.format(extra="", move="", scope="def Scope").replace(
        'def Xform "Tall" {', 'def Xform "Tall" {\n' + lamp
    )
    scene = read_body(tmp_path, text)
    assert scene.sun is None
    assert [camera.name for camera in scene.cameras] == ["framing"]
