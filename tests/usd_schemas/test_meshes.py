"""Meshes of every kind: winding, normals, UV sets, colors, subsets, and arrays that contradict each other."""

from pathlib import Path

import numpy as np
import pytest

from groundwork.errors import InputError
from tests.usd_schemas.stages import SQUARE, area, area_vectors, bounds, read_body, volume
from usd_schemas.flat_scene import world_triangles

CUBE = """
    point3f[] points = [(0,0,0), (1,0,0), (1,1,0), (0,1,0), (0,0,1), (1,0,1), (1,1,1), (0,1,1)]
    int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]
    int[] faceVertexIndices = [0,3,2,1, 4,5,6,7, 0,1,5,4, 1,2,6,5, 2,3,7,6, 3,0,4,7]
"""
SCALED = """
    double3 xformOp:scale = ({})
    uniform token[] xformOpOrder = ["xformOp:scale"]
"""


def mesh(content: str, name: str = "M") -> str:
    """Wrap attributes in a mesh."""
    return f'def Mesh "{name}" {{\n{content}\n}}\n'


def test_concave_ngon(tmp_path: Path) -> None:
    """An L of six corners has the area of an L."""
    scene = read_body(
        tmp_path,
        mesh("""
        point3f[] points = [(0,0,0), (3,0,0), (3,1,0), (1,1,0), (1,4,0), (0,4,0)]
        int[] faceVertexCounts = [6]
        int[] faceVertexIndices = [0, 1, 2, 3, 4, 5]"""),
        subdivision=0,
    )
    assert area(scene) == pytest.approx(6.0)
    assert area_vectors(scene)[:, 2].min() > 0.0


@pytest.mark.parametrize("scale", ["1, 1, 1", "-1, 1, 1", "-2, -3, -1", "-1, -1, 2"])
@pytest.mark.parametrize("hand", ["rightHanded", "leftHanded"])
def test_winding_and_normals_survive_mirrors(scale: str, hand: str, tmp_path: Path) -> None:
    """Mirrored and left-handed cubes keep their outside outside: volume over 0, normals along it."""
    content = (
        CUBE
        if hand == "rightHanded"
        else CUBE.replace(
            "0,3,2,1, 4,5,6,7, 0,1,5,4, 1,2,6,5, 2,3,7,6, 3,0,4,7",
            "1,2,3,0, 7,6,5,4, 4,5,1,0, 5,6,2,1, 6,7,3,2, 7,4,0,3",
        )
    )
    text = content + f'uniform token orientation = "{hand}"\n uniform token subdivisionScheme = "none"' + SCALED
    scene = read_body(tmp_path, mesh(text.replace("({})", f"({scale})")))
    assert volume(scene) == pytest.approx(abs(np.prod([float(s) for s in scale.split(",")])))
    geometry, draws = scene.geometry, scene.draws
    first, count = geometry.part_first[draws.part[0]], geometry.part_count[draws.part[0]]
    normals = geometry.normals[geometry.triangles[first : first + count]][:, 0]
    placed = normals @ np.linalg.inv(draws.transform[0, :3, :3])
    assert np.einsum("ti,ti->t", placed, area_vectors(scene)).min() > 0.0


def test_mirrored_instances_share_vertices(tmp_path: Path) -> None:
    """One mesh, once plain and once mirrored: vertices and triangles once."""
    body = 'class "Proto" { ' + mesh(CUBE + 'uniform token subdivisionScheme = "none"') + "}\n"
    for name, scale in (("A", "1, 1, 1"), ("B", "-1, 1, 1"), ("C", "1, 1, 2")):
        body += f'def Xform "{name}" (instanceable = true\n references = </Proto>) {{\n{SCALED.format(scale)}\n}}\n'
    scene = read_body(tmp_path, body)
    assert len(scene.geometry.positions) == 24
    assert len(scene.geometry.part_first) == 1
    assert scene.draws.part.tolist() == [0, 0, 0]
    assert volume(scene) == pytest.approx(4.0)


def test_flat_and_smooth_normals(tmp_path: Path) -> None:
    """Without normals a polygon mesh is flat, a subdivision cage smooth."""
    flat = read_body(tmp_path, mesh(CUBE + 'uniform token subdivisionScheme = "none"'))
    assert len(flat.geometry.positions) == 24
    assert sorted(map(tuple, np.unique(np.abs(flat.geometry.normals), axis=0).tolist())) == [
        (0.0, 0.0, 1.0),
        (0.0, 1.0, 0.0),
        (1.0, 0.0, 0.0),
    ]
    smooth = read_body(tmp_path, mesh(CUBE), subdivision=0)
    assert len(smooth.geometry.positions) == 8
    outward = (smooth.geometry.positions - 0.5) / np.sqrt(0.75)
    np.testing.assert_allclose(smooth.geometry.normals, outward, atol=1e-6)


NORMAL = (0.6, 0.0, 0.8)
TWO_FACES = """
    point3f[] points = [(0,0,0), (1,0,0), (1,1,0), (0,1,0), (2,0,0), (2,1,0)]
    int[] faceVertexCounts = [4, 4]
    int[] faceVertexIndices = [0, 1, 2, 3, 1, 4, 5, 2]
    uniform token subdivisionScheme = "none"
"""


@pytest.mark.parametrize(
    ("interpolation", "count"), [("vertex", 6), ("varying", 6), ("faceVarying", 8), ("uniform", 2)]
)
@pytest.mark.parametrize("name", ["normals", "primvars:normals"])
def test_authored_normals(name: str, interpolation: str, count: int, tmp_path: Path) -> None:
    """Authored normals count, whatever their interpolation, and are brought to length one."""
    values = ", ".join("(1.2, 0, 1.6)" for _ in range(count))
    text = f'normal3f[] {name} = [{values}] (interpolation = "{interpolation}")'
    scene = read_body(tmp_path, mesh(TWO_FACES + text))
    np.testing.assert_allclose(scene.geometry.normals, np.tile(NORMAL, (6, 1)), atol=1e-6)
    assert not any("normals" in line for line in scene.warnings)


def test_indexed_normals_split_only_where_they_differ(tmp_path: Path) -> None:
    """Two faces with one normal each: the shared edge has two vertices a point, the rest one."""
    text = """normal3f[] primvars:normals = [(0,0,1), (0,1,0)] (interpolation = "faceVarying")
        int[] primvars:normals:indices = [0, 0, 0, 0, 1, 1, 1, 1]"""
    scene = read_body(tmp_path, mesh(TWO_FACES + text))
    assert len(scene.geometry.positions) == 8
    corner = scene.geometry.normals[scene.geometry.triangles]
    np.testing.assert_allclose(corner[:2], np.tile([0, 0, 1], (2, 3, 1)))
    np.testing.assert_allclose(corner[2:], np.tile([0, 1, 0], (2, 3, 1)))


def test_equal_face_varying_values_are_welded(tmp_path: Path) -> None:
    """Face-varying values without indices cost no vertices where they agree."""
    uv = "(0,0), (1,0), (1,1), (0,1), (1,0), (2,0), (2,1), (1,1)"
    text = f'texCoord2f[] primvars:st = [{uv}] (interpolation = "faceVarying")\n'
    text += f'normal3f[] normals = [{", ".join(["(0,0,1)"] * 8)}] (interpolation = "faceVarying")'
    scene = read_body(tmp_path, mesh(TWO_FACES + text))
    assert len(scene.geometry.positions) == 6
    np.testing.assert_allclose(scene.geometry.st, scene.geometry.positions[:, :2])


def test_values_that_differ_in_one_component_are_kept_apart(tmp_path: Path) -> None:
    """Normals that differ only in z, without indices, are not welded."""
    up, tilted = ["(0, 0.6, 0.8)"] * 4, ["(0, 0.6, -0.8)"] * 4
    text = f'normal3f[] normals = [{", ".join(up + tilted)}] (interpolation = "faceVarying")'
    scene = read_body(tmp_path, mesh(TWO_FACES + text))
    corner = scene.geometry.normals[scene.geometry.triangles]
    np.testing.assert_allclose(corner[:2], np.tile([0, 0.6, 0.8], (2, 3, 1)), rtol=1e-6)
    np.testing.assert_allclose(corner[2:], np.tile([0, 0.6, -0.8], (2, 3, 1)), rtol=1e-6)


def test_zero_normals_are_mended(tmp_path: Path) -> None:
    """A zero normal is replaced by the face's own."""
    text = f'normal3f[] normals = [{", ".join(["(0,0,0)"] * 8)}] (interpolation = "faceVarying")'
    scene = read_body(tmp_path, mesh(TWO_FACES + text))
    np.testing.assert_allclose(scene.geometry.normals, np.tile([0, 0, 1], (len(scene.geometry.normals), 1)))


@pytest.mark.parametrize("name", ["UVMap", "map1", "st"])
def test_uv_names_without_a_material(name: str, tmp_path: Path) -> None:
    """Any texture coordinates become the first set where there is no `st`."""
    text = f'texCoord2f[] primvars:{name} = [(0,0), (1,0), (1,1), (0,1)] (interpolation = "vertex")'
    scene = read_body(tmp_path, mesh(SQUARE + text))
    np.testing.assert_allclose(scene.geometry.st, (scene.geometry.positions[:, :2] + 1) / 2)
    assert not scene.geometry.st1.any()


def test_two_uv_sets(tmp_path: Path) -> None:
    """`st` and `st1` go to their own columns."""
    text = 'texCoord2f[] primvars:st = [(0,0), (5,0), (5,5), (0,5)] (interpolation = "vertex")\n'
    text += 'texCoord2f[] primvars:st1 = [(0,0), (1,0), (1,1), (0,1)] (interpolation = "vertex")\n'
    scene = read_body(tmp_path, mesh(SQUARE + text))
    np.testing.assert_allclose(scene.geometry.st, 5 * scene.geometry.st1)


@pytest.mark.parametrize(
    ("interpolation", "values"),
    [("constant", 1), ("uniform", 2), ("vertex", 6), ("faceVarying", 8)],
)
def test_display_color(interpolation: str, values: int, tmp_path: Path) -> None:
    """Vertex colors of every interpolation arrive, and the draw uses them."""
    colors = ", ".join("(0.1, 0.2, 0.3)" for _ in range(values))
    text = f'color3f[] primvars:displayColor = [{colors}] (interpolation = "{interpolation}")'
    scene = read_body(tmp_path, mesh(TWO_FACES + text))
    np.testing.assert_allclose(scene.geometry.colors, np.tile([0.1, 0.2, 0.3], (6, 1)), atol=1e-6)
    assert scene.materials[scene.draws.material[0]].use_display_color


def test_inherited_display_color(tmp_path: Path) -> None:
    """A constant color on a parent colors what is below."""
    color = 'color3f[] primvars:displayColor = [(1, 0, 0)] (interpolation = "constant")'
    scene = read_body(tmp_path, f'def Xform "X" {{\n{color}\n{mesh(SQUARE)}}}')
    np.testing.assert_allclose(scene.geometry.colors, np.tile([1.0, 0.0, 0.0], (4, 1)))


def test_face_subsets_split_the_mesh(tmp_path: Path) -> None:
    """Two material subsets and a rest: three parts with their own areas and materials."""
    body = 'def Scope "Looks" {\n'
    for name in ("Red", "Blue", "Rest"):
        body += f"""def Material "{name}" {{
            token outputs:surface.connect = </Looks/{name}/S.outputs:surface>
            def Shader "S" {{
                uniform token info:id = "UsdPreviewSurface"
                token outputs:surface
            }}
        }}\n"""
    body += "}\n"
    subsets = ""
    for name, faces in (("Red", "0"), ("Blue", "1, 2")):
        subsets += f"""def GeomSubset "{name}" (apiSchemas = ["MaterialBindingAPI"]) {{
            uniform token elementType = "face"
            uniform token familyName = "materialBind"
            int[] indices = [{faces}]
            rel material:binding = </Looks/{name}>
        }}\n"""
    head = 'def Mesh "M" (apiSchemas = ["MaterialBindingAPI"]) {\n rel material:binding = </Looks/Rest>\n'
    scene = read_body(tmp_path, body + head + CUBE + subsets + "}", subdivision=0)
    corners, _, rows = world_triangles(scene)
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    found = {}
    for row, material in enumerate(scene.draws.material.tolist()):
        found[scene.materials[material].name] = areas[rows == row].sum()
    assert found == pytest.approx({"/Looks/Red": 1.0, "/Looks/Blue": 2.0, "/Looks/Rest": 3.0})
    assert len(scene.geometry.positions) == 8
    assert not scene.warnings


def test_holes_of_a_cage(tmp_path: Path) -> None:
    """A subdivision surface leaves its holes open; polygons have none."""
    holes = "int[] holeIndices = [0, 1]\n"
    assert area(read_body(tmp_path, mesh(CUBE + holes), subdivision=0)) == pytest.approx(4.0)
    whole, open_ = (len(read_body(tmp_path, mesh(CUBE + more)).geometry.triangles) for more in ("", holes))
    assert (whole, open_) == (48, 32)
    assert area(read_body(tmp_path, mesh(CUBE + holes + 'uniform token subdivisionScheme = "none"'))) == pytest.approx(
        6
    )


BROKEN = {
    "finite": "point3f[] points = [(nan, 0, 0), (1, 0, 0), (0, 1, 0)]\nint[] faceVertexCounts = [3]\n"
    "int[] faceVertexIndices = [0, 1, 2]",
    "do not exist": "point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]\nint[] faceVertexCounts = [3]\n"
    "int[] faceVertexIndices = [0, 1, 7]",
    "fit together": "point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]\nint[] faceVertexCounts = [4]\n"
    "int[] faceVertexIndices = [0, 1, 2]",
}


@pytest.mark.parametrize("reason", BROKEN)
def test_broken_mesh_is_dropped_with_its_path(reason: str, tmp_path: Path) -> None:
    """One bad mesh costs one warning, not the stage."""
    scene = read_body(tmp_path, mesh(BROKEN[reason], "Bad") + mesh(SQUARE, "Good"))
    assert [line for line in scene.warnings if line.startswith("/Bad:") and reason in line]
    assert area(scene) == pytest.approx(4.0)
    with pytest.raises(InputError, match="no geometry"):
        read_body(tmp_path, mesh(BROKEN[reason], "Bad"))


def test_wrong_sizes_are_ignored_with_a_warning(tmp_path: Path) -> None:
    """Too few texture coordinates or normals are left out by name."""
    text = 'texCoord2f[] primvars:st = [(1, 1)] (interpolation = "vertex")\n normal3f[] normals = [(1, 0, 0)]'
    scene = read_body(tmp_path, mesh(SQUARE + text))
    assert not scene.geometry.st.any()
    np.testing.assert_allclose(scene.geometry.normals, np.tile([0, 0, 1], (4, 1)))
    assert sum("too few values" in line for line in scene.warnings) == 2


def test_time_samples_are_read_at_the_first(tmp_path: Path) -> None:
    """A mesh that only has time samples is read at the earliest."""
    text = """point3f[] points.timeSamples = {
            3: [(0,0,0), (1,0,0), (0,1,0)],
            9: [(0,0,5), (1,0,5), (0,1,5)],
        }
        int[] faceVertexCounts = [3]
        int[] faceVertexIndices = [0, 1, 2]"""
    np.testing.assert_allclose(bounds(read_body(tmp_path, mesh(text))), [[0, 0, 0], [1, 1, 0]])


@pytest.mark.parametrize("axis", ["Y", "Z"])
def test_units_and_up_axis(axis: str, tmp_path: Path) -> None:
    """Centimeters with y up become meters with z up."""
    box = mesh(CUBE + 'uniform token subdivisionScheme = "none"' + SCALED.format("100, 200, 300"))
    scene = read_body(tmp_path, box, f'upAxis = "{axis}"\n metersPerUnit = 0.01')
    expected = [[0, 0, 0], [1, 2, 3]] if axis == "Z" else [[0, -3, 0], [1, 0, 2]]
    np.testing.assert_allclose(bounds(scene), expected, atol=1e-9)
    assert volume(scene) == pytest.approx(6.0)


def test_double_sided(tmp_path: Path) -> None:
    """The flag reaches the part."""
    scene = read_body(tmp_path, mesh(SQUARE, "A") + mesh(SQUARE + "uniform bool doubleSided = 1", "B"))
    assert scene.geometry.part_double_sided.tolist() == [0, 1]
