"""Curves with a width are tubes, points with a width are balls; without one they are named."""

from pathlib import Path

import numpy as np
import pytest

from groundwork.errors import InputError
from tests.usd_schemas.stages import SQUARE, area, bounds, read_body, volume
from usd_schemas.flat_scene import FlatScene, world_triangles

TWELVE_SIDES = 12 / 2 * np.sin(2 * np.pi / 12)  # area of a regular one in the unit circle


def curves(content: str, kind: str = "linear", counts: str = "2", more: str = "") -> str:
    """Write curves."""
    return f"""def BasisCurves "C" {{
        uniform token type = "{kind}"
        int[] curveVertexCounts = [{counts}]
        point3f[] points = [{content}]
        {more}
    }}
    """


def colors_of(scene: FlatScene) -> set[tuple[float, ...]]:
    """List the colors of all vertices."""
    return set(map(tuple, np.round(scene.geometry.colors, 3).tolist()))


def test_a_straight_tube_holds_what_it_should(tmp_path: Path) -> None:
    """Volume and surface of a straight tube are those of a prism, wound outwards, and its ends are closed."""
    scene = read_body(tmp_path, curves("(0, 0, 0), (0, 3, 4)", more="float[] widths = [0.4]"))
    assert volume(scene) == pytest.approx(TWELVE_SIDES * 0.2**2 * 5.0, rel=1e-5)
    side = 2 * 12 * np.sin(np.pi / 12) * 0.2 * 5.0
    assert area(scene) == pytest.approx(side + 2 * TWELVE_SIDES * 0.2**2, rel=1e-5)
    assert not [line for line in scene.warnings if "/C" in line]


def test_a_cone_of_two_widths(tmp_path: Path) -> None:
    """Widths that change evenly make a frustum."""
    width = 'float[] widths = [0.4, 0.2] (interpolation = "%s")'
    for told in ("vertex", "varying"):
        scene = read_body(tmp_path, curves("(0, 0, 0), (2, 0, 0)", more=width % told))
        assert volume(scene) == pytest.approx(TWELVE_SIDES * 2 / 3 * (0.04 + 0.02 + 0.01), rel=1e-5)


CUBICS = [("bezier", "nonperiodic"), ("bspline", "nonperiodic"), ("bspline", "pinned"), ("catmullRom", "pinned")]


@pytest.mark.parametrize(("basis", "wrap"), CUBICS)
def test_cubic_curves_of_evenly_spaced_points_are_straight(basis: str, wrap: str, tmp_path: Path) -> None:
    """Every basis reproduces a straight line: its length is that of the segments which the wrap gives."""
    rows = "(0, 0, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0)"
    more = f'uniform token basis = "{basis}"\nuniform token wrap = "{wrap}"\nfloat[] widths = [0.2]'
    low, high = bounds(read_body(tmp_path, curves(rows, "cubic", "4", more)))
    first, last = (1.0, 2.0) if (basis, wrap) == ("bspline", "nonperiodic") else (0.0, 3.0)
    assert low[0] == pytest.approx(first, abs=1e-6)
    assert high[0] == pytest.approx(last, abs=1e-6)


def test_a_bezier_arc_follows_its_polynomial(tmp_path: Path) -> None:
    """The middle of every ring lies on the curve, found by de Casteljau's construction."""
    rows = np.array([[0, 0, 0], [0, 0, 2], [2, 1, 2], [2, 0, 0]], np.float64)
    text = ", ".join(str(tuple(row)) for row in rows.tolist())
    more = 'uniform token basis = "bezier"\nfloat[] widths = [0.02]'
    corners, _, _ = world_triangles(read_body(tmp_path, curves(text, "cubic", "4", more)))

    def at(u: float) -> np.ndarray:
        level = rows
        while len(level) > 1:
            level = (1 - u) * level[:-1] + u * level[1:]
        return level[0]

    way = np.array([at(u) for u in np.linspace(0, 1, 4001)])
    away = np.linalg.norm(corners.reshape(-1, 1, 3)[::7] - way[None, ::4], axis=2).min(axis=1)
    assert np.abs(away - 0.01).max() < 1e-3


def test_a_loop_has_no_ends(tmp_path: Path) -> None:
    """A periodic curve closes: no cap, and the volume of a ring."""
    more = 'uniform token wrap = "periodic"\nuniform token basis = "bspline"\nfloat[] widths = [0.1]'
    angle = 2 * np.pi * np.arange(24) / 24
    rows = ", ".join(f"({np.cos(a)}, {np.sin(a)}, 0)" for a in angle)
    scene = read_body(tmp_path, curves(rows, "cubic", "24", more))
    shrunk = (2 + np.cos(angle[1])) / 3  # radius of a uniform cubic B-spline through points of a circle
    assert volume(scene) == pytest.approx(2 * np.pi * shrunk * TWELVE_SIDES * 0.05**2, rel=1e-3)


def test_colors_of_curves(tmp_path: Path) -> None:
    """One color a curve, curves of different lengths in any order; one a point; one for all."""
    rows = "(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 2, 0), (1, 2, 0), (0, 4, 0), (1, 4, 0), (2, 4, 0)"
    color = 'float[] widths = [0.1]\ncolor3f[] primvars:displayColor = [%s] (interpolation = "%s")'
    three = "(1, 0, 0), (0, 1, 0), (0, 0, 1)"
    scene = read_body(tmp_path, curves(rows, counts="3, 2, 3", more=color % (three, "uniform")))
    corners, vertices = scene.geometry.positions, scene.geometry.colors
    for place, axis in ((0.0, 0), (2.0, 1), (4.0, 2)):
        assert (vertices[np.abs(corners[:, 1] - place) < 0.5] == np.eye(3)[axis]).all()
    eight = ", ".join(["(1, 0, 0)"] * 3 + ["(0, 1, 0)"] * 2 + ["(0, 0, 1)"] * 3)
    for told in ("vertex", "varying"):
        scene = read_body(tmp_path, curves(rows, counts="3, 2, 3", more=color % (eight, told)))
        assert colors_of(scene) == {(1, 0, 0), (0, 1, 0), (0, 0, 1)}
        assert (scene.geometry.colors[np.abs(scene.geometry.positions[:, 1] - 2) < 0.5] == [0, 1, 0]).all()


def test_points_are_balls(tmp_path: Path) -> None:
    """Each point is a ball of its own width and color."""
    body = """def Points "P" {
        point3f[] points = [(0, 0, 0), (5, 0, 0)]
        float[] widths = [2, 1]
        color3f[] primvars:displayColor = [(1, 0, 0), (0, 0, 1)] (interpolation = "vertex")
    }"""
    scene = read_body(tmp_path, body)
    assert volume(scene) == pytest.approx(4 / 3 * np.pi * (1 + 1 / 8), rel=0.05)
    assert np.allclose(bounds(scene), [[-1, -1, -1], [5.5, 1, 1]])
    assert (scene.geometry.colors[scene.geometry.positions[:, 0] > 3] == [0, 0, 1]).all()


def test_strands_move(tmp_path: Path) -> None:
    """Points of a curve with time samples are those of the image's time."""
    text = curves("(0, 0, 0), (1, 0, 0)", more="float[] widths = [0.1]").replace(
        "point3f[] points = [(0, 0, 0), (1, 0, 0)]",
        "point3f[] points.timeSamples = {\n1: [(0, 0, 0), (1, 0, 0)],\n2: [(0, 0, 0), (3, 0, 0)],\n}",
    )
    scene = read_body(tmp_path, text)
    assert any("move" in line for line in scene.warnings)
    assert bounds(scene)[1, 0] == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("body", "said"),
    [
        (curves("(0, 0, 0), (1, 0, 0)"), "/C: BasisCurves without width is not drawn"),
        ('def Points "C" {\npoint3f[] points = [(0, 0, 0)]\n}', "/C: Points without width is not drawn"),
        (curves("(0, 0, 0), (1, 0, 0)", counts="3", more="float[] widths = [1]"), "do not fit together: not drawn"),
        (curves("(0, 0, 0), (nan, 0, 0)", more="float[] widths = [1]"), "not finite, or have a wrong type: not drawn"),
        (curves("(0, 0, 0), (1, 0, 0)", more="string widths = 'x'"), "/C: "),
        (curves("(0, 0, 0)", counts="1", more="float[] widths = [1]"), "no curve has enough points: not drawn"),
        ('def NurbsPatch "C" {\n}', "/C: NurbsPatch is not drawn"),
    ],
)
def test_what_cannot_be_drawn_is_named(body: str, said: str, tmp_path: Path) -> None:
    """Curves and points that are not drawn cost themselves alone, with one line."""
    scene = read_body(tmp_path, f'def Mesh "Good" {{\n{SQUARE}\n}}\n{body}')
    assert area(scene) == pytest.approx(4.0)
    assert any(said in line for line in scene.warnings)
    with pytest.raises(InputError, match="shows no geometry"):
        read_body(tmp_path, body)


def test_short_curves_beside_long_ones(tmp_path: Path) -> None:
    """A curve of too few points is left out by name, and the others keep their own widths."""
    rows = "(0, 0, 0), (0, 5, 0), (1, 5, 0)"
    widths = 'float[] widths = [9, 0.2] (interpolation = "uniform")'
    scene = read_body(tmp_path, curves(rows, counts="1, 2", more=widths))
    assert volume(scene) == pytest.approx(TWELVE_SIDES * 0.1**2, rel=1e-4)
    assert any("1 of 2 curves have too few points" in line for line in scene.warnings)
