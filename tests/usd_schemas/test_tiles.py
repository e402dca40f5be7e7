"""Textures in tiles (UDIM): each unit square of the texture coordinates shows its own picture."""

from pathlib import Path

import numpy as np
import pytest

from groundwork.errors import InputError
from render.images.image_files import encode_png
from tests.usd_schemas.stages import read_body, write_stage
from usd_schemas.flat_scene import FlatScene
from usd_schemas.guard.guard import check_stage
from usd_schemas.reading.layer_contents import layer_contents

STRIP = """
    point3f[] points = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0), (0, 1, 0), (1, 1, 0), (2, 1, 0), (3, 1, 0)]
    int[] faceVertexCounts = [4, 4, 4]
    int[] faceVertexIndices = [0, 1, 5, 4, 1, 2, 6, 5, 2, 3, 7, 6]
    uniform token subdivisionScheme = "none"
    texCoord2f[] primvars:st = [(0, 0), (1, 0), (2, 0), (3, 0), (0, 1), (1, 1), (2, 1), (3, 1)] (
        interpolation = "vertex")
"""


def tiled(file: str = "./tex/wall.<UDIM>.png") -> str:
    """Write a strip over three tiles, and a material that reads tiles."""
    return f"""def Material "Mat" {{
    token outputs:surface.connect = </Mat/S.outputs:surface>
    def Shader "S" {{
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </Mat/T.outputs:rgb>
        float inputs:roughness.connect = </Mat/R.outputs:r>
        token outputs:surface
    }}
    def Shader "T" {{
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @{file}@
        float3 outputs:rgb
    }}
    def Shader "R" {{
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @./tex/plain.png@
        float outputs:r
    }}
}}
def Mesh "M" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
    rel material:binding = </Mat>
{STRIP}
}}
"""


def write_tiles(folder: Path, *names: str) -> None:
    """Write pictures, each of other bytes."""
    (folder / "tex").mkdir(exist_ok=True)
    for shade, name in enumerate(names):
        (folder / "tex" / name).write_bytes(encode_png(np.full((4, 4, 3), 40 * shade, np.uint8)))


def shown(scene: FlatScene) -> dict[int, tuple[str, tuple[float, float]]]:
    """Tell which picture lies on the first, second and third square, and how it is moved."""
    found = {}
    for part, row in zip(scene.draws.part.tolist(), scene.draws.material.tolist(), strict=True):
        first, count = scene.geometry.part_first[part], scene.geometry.part_count[part]
        corners = scene.geometry.positions[scene.geometry.triangles[first : first + count]]
        texture = scene.materials[row].base_texture
        for place in set(np.floor(corners.mean(axis=1)[:, 0]).astype(int).tolist()):
            found[place] = (Path(texture.file).name, texture.translation) if texture else ("", (0.0, 0.0))
    return found


def test_each_square_shows_its_tile(tmp_path: Path) -> None:
    """Tiles lie on their squares, moved to their own 0 to 1; a square without a tile is plain; plain maps stay."""
    write_tiles(tmp_path, "wall.1001.png", "wall.1002.png", "wall.2000.png", "wall.100.png", "plain.png")
    scene = read_body(tmp_path, tiled())
    assert shown(scene) == {0: ("wall.1001.png", (0, 0)), 1: ("wall.1002.png", (-1, 0)), 2: ("", (0, 0))}
    roughness = [scene.materials[row].roughness_texture for row in scene.draws.material]
    assert {Path(one.file).name for one in roughness if one} == {"plain.png"}
    assert len(set(scene.draws.instance.tolist())) == 1
    assert not [line for line in scene.warnings if "texture" in line]


def test_rows_of_tiles(tmp_path: Path) -> None:
    """The tile above the first is 1011, and square brackets and stars in a name are letters."""
    write_tiles(tmp_path, "w[1]*.1011.png", "plain.png")
    body = tiled("./tex/w[1]*.<UDIM>.png").replace(
        "primvars:st = [(0, 0), (1, 0), (2, 0), (3, 0), (0, 1), (1, 1), (2, 1), (3, 1)]",
        "primvars:st = [(0, 1), (1, 1), (2, 1), (3, 1), (0, 2), (1, 2), (2, 2), (3, 2)]",
    )
    assert shown(read_body(tmp_path, body))[0] == ("w[1]*.1011.png", (0, -1))


def test_without_a_tile_a_line_says_so(tmp_path: Path) -> None:
    """No tile at all: named by the reader and by the guard."""
    write_tiles(tmp_path, "plain.png")
    scene = read_body(tmp_path, tiled())
    assert any("no texture ./tex/wall.<UDIM>.png" in line for line in scene.warnings)
    said: list[str] = []
    check_stage(tmp_path / "stage.usda", (), said.append)
    assert any("there is no tile of ./tex/wall.<UDIM>.png" in line for line in said)


def test_tiles_are_part_of_the_key(tmp_path: Path) -> None:
    """A tile that comes later is a stage of another key."""
    write_tiles(tmp_path, "wall.1001.png", "plain.png")
    stage = write_stage(tmp_path, tiled())
    before = layer_contents(stage)
    write_tiles(tmp_path, "wall.1002.png")
    assert before is not None
    assert layer_contents(stage) != before


def test_tiles_that_lead_elsewhere_are_refused(tmp_path: Path) -> None:
    """A tile that is a link out of the stage's folder is refused as any other file is."""
    home, other = tmp_path / "home", tmp_path / "other"
    home.mkdir()
    other.mkdir()
    write_tiles(home, "plain.png")
    write_tiles(other, "secret.png")
    (home / "tex" / "wall.1001.png").symlink_to(other / "tex" / "secret.png")
    with pytest.raises(InputError, match="leads out of the allowed folders"):
        check_stage(write_stage(home, tiled()), (), lambda line: None)
