"""What lets light through, glows, shines in a color of its own, ends at its edges, or comes from unusual files."""

import struct
from pathlib import Path

import cv2
import numpy as np
import OpenEXR
import pytest

from groundwork.errors import InputError
from render.gpu.context import Gl
from render.images.float_files import decode_float
from render.images.tga import decode_tga
from render.settings import RenderSettings
from tests.render.test_any_stage import DOME, FLOOR_SEEN, LAMP, SUN, TURN, Picture, mesh, moved, surface, take
from tests.usd_schemas.test_materials import network, texture

QUALITIES = ["fast", "standard", "fine"]
PLAIN = "(0.25, 0.5)", "(1, 1)", "rotation = 30", "rotation = 0", "(0.1, 0.2)", "(0, 0)"


def straight(nodes: str) -> str:
    """Let a texture lie from 0 to 1 as it is."""
    for former, new in zip(PLAIN[::2], PLAIN[1::2], strict=True):
        nodes = nodes.replace(former, new)
    return nodes


def coded(value: float) -> int:
    """Code a linear value as sRGB does."""
    return round(255 * (1.055 * value ** (1 / 2.4) - 0.055))


def shot(gl: Gl, ideal: RenderSettings, folder: Path, body: str, *more: str, quality: str = "fast") -> Picture:
    """Draw a square above the floor, under a plain white dome."""
    return take(gl, ideal, folder, body, DOME, *more, quality=quality)


@pytest.mark.parametrize("quality", QUALITIES)
@pytest.mark.parametrize("opacity", [0.0, 0.3, 0.7])
def test_what_light_shines_through(quality: str, opacity: float, gl: Gl, ideal: RenderSettings, tmp_path: Path) -> None:
    """The photograph mixes both in linear light; the truth is solid from 0.5 on, else what lies behind."""
    body = network(
        f"color3f inputs:diffuseColor = (0.8, 0, 0)\nfloat inputs:opacity = {opacity}\nfloat inputs:roughness = 1"
    )
    picture = shot(gl, ideal, tmp_path, body, quality=quality)
    solid = shot(gl, ideal, tmp_path, body.replace(f"opacity = {opacity}", "opacity = 1"), quality=quality)
    gone = shot(gl, ideal, tmp_path, "", quality=quality)
    light, height, number = picture.seen(0.3, 0.2, 0)
    front, behind = solid.seen(0.3, 0.2, 0)[0], gone.seen(0.3, 0.2, 0)[0]
    # In the light volume a pane that lets most light through takes no light from the floor, as the solid square does.
    tolerance = 0.004 if quality == "fast" else 0.02
    np.testing.assert_allclose(light, opacity * front + (1 - opacity) * behind, atol=tolerance)
    assert height == pytest.approx(0.0 if opacity >= 0.5 else -1.0, abs=1e-4)
    paths = {row.id: row.path for row in picture.scene.instances}
    assert paths[number] == ("/M" if opacity >= 0.5 else "/Floor")


def test_panes_before_panes(gl: Gl, ideal: RenderSettings, tmp_path: Path) -> None:
    """Two panes are blended from the far to the near one, whatever their order on the stage."""
    pane = network("color3f inputs:diffuseColor = (0.8, 0, 0)\nfloat inputs:opacity = 0.4\nfloat inputs:roughness = 1")
    other = (
        pane.replace("</Mat", "</Low")
        .replace('"Mat"', '"Low"')
        .replace('"M"', '"L"')
        .replace("(0.8, 0, 0)", "(0, 0, 0.8)")
    )
    other = other.replace("point3f[] points", moved("double3 xformOp:translate = (0, 0, -0.5)") + "point3f[] points")
    for bodies in ((pane, other), (other, pane)):
        light = take(gl, ideal, tmp_path, *bodies, DOME).seen(0, 0, 0)[0]
        floor, low = np.array(FLOOR_SEEN[0]), np.array([0, 0, 0.8])
        wanted = 0.4 * np.array([0.8, 0, 0]) + 0.6 * (0.4 * low + 0.6 * floor)
        np.testing.assert_allclose(light, wanted, atol=0.01)


def test_alpha_of_a_picture_is_blended(gl: Gl, ideal: RenderSettings, tmp_path: Path) -> None:
    """Without a threshold, alpha mixes the photograph texel by texel, and cuts the truth at a half."""
    leaf = np.full((64, 64, 4), coded(0.8), np.uint8)
    leaf[:, :32, 3], leaf[:, 32:, 3] = 77, 204
    cv2.imwrite(str(tmp_path / "leaf.png"), leaf)
    cut = "color3f inputs:diffuseColor.connect = </Mat/A.outputs:rgb>\n"
    cut += "float inputs:opacity.connect = </Mat/A.outputs:a>\n"
    picture = shot(gl, ideal, tmp_path, network(cut, straight(texture("A", "./leaf.png"))))
    for x, alpha in ((-0.5, 0.3), (0.5, 0.8)):
        light, height, _ = picture.seen(x, 0, 0)
        np.testing.assert_allclose(light, alpha * 0.8 + (1 - alpha) * 0.1, atol=0.012)
        assert height == pytest.approx(0.0 if alpha >= 0.5 else -1.0, abs=1e-4)


def test_opacity_of_another_picture(gl: Gl, ideal: RenderSettings, tmp_path: Path) -> None:
    """A gray picture cuts a plain color, and one with a picture of its own; `scale` and `bias` turn the mask round."""
    cv2.imwrite(str(tmp_path / "mask.png"), np.repeat([[0] * 32 + [255] * 32], 64, axis=0).astype(np.uint8))
    cv2.imwrite(str(tmp_path / "red.png"), np.full((32, 32, 3), (0, 0, coded(0.8)), np.uint8))
    cut = "float inputs:opacity.connect = </Mat/A.outputs:r>\nfloat inputs:opacityThreshold = 0.5\n"
    plain = network("color3f inputs:diffuseColor = (0.8, 0, 0)\n" + cut, straight(texture("A", "./mask.png")))
    both = network(
        "color3f inputs:diffuseColor.connect = </Mat/B.outputs:rgb>\n" + cut,
        straight(texture("A", "./mask.png") + texture("B", "./red.png")),
    )
    turned = "float4 inputs:scale = (-1, 1, 1, 1)\nfloat4 inputs:bias = (1, 0, 0, 0)\nasset inputs:file = @./mask.png@"
    for body, side in ((plain, 0.5), (both, 0.5), (both.replace("asset inputs:file = @./mask.png@", turned), -0.5)):
        picture = shot(gl, ideal, tmp_path, body)
        np.testing.assert_allclose(picture.seen(side, 0, 0)[0], (0.8, 0, 0), atol=0.02)
        np.testing.assert_allclose(picture.seen(-side, 0, -1)[0], FLOOR_SEEN[0], atol=0.02)
        assert picture.seen(-side, 0, -1)[1] == pytest.approx(-1.0, abs=1e-4)


@pytest.mark.parametrize("lit", [False, True])
def test_leaves_are_no_paler_than_their_color(lit: bool, gl: Gl, ideal: RenderSettings, tmp_path: Path) -> None:
    """A card with its crown's normal, seen along it, has no rim of sky; some sun from behind shines through."""
    leaf = np.full((32, 32, 4), (*map(coded, (0.03, 0.09, 0.06)), 255), np.uint8)
    leaf[:, :8, 3] = 0
    cv2.imwrite(str(tmp_path / "leaf.png"), leaf)
    node = straight(texture("A", "./leaf.png"))
    surface = "color3f inputs:diffuseColor.connect = </Mat/A.outputs:rgb>\nfloat inputs:roughness = 0.6\n"
    cut = "float inputs:opacity.connect = </Mat/A.outputs:a>\nfloat inputs:opacityThreshold = 0.5\n"
    bent = 'normal3f[] normals = [({0})] (interpolation = "constant")\npoint3f[] points'
    light = SUN.format(moved(TURN.format("(0, 0, 0)"))) if lit else ""
    lawn, card = (
        shot(gl, ideal, tmp_path, body.replace("point3f[] points", bent.format(way)), light, quality="standard")
        for body, way in (
            (network(surface, node), "0, 0, 1"),
            (network(surface + cut, node), "0, 0, -1" if lit else "1, 0, 0.02"),
        )
    )
    share = card.seen(0.3, 0.2, 0)[0] / lawn.seen(0.3, 0.2, 0)[0]
    assert share.max() < 0.9
    assert share[:2].min() > 0.3


def test_glass_throws_no_shadow(gl: Gl, ideal: RenderSettings, tmp_path: Path) -> None:
    """The floor below a pane of opacity 0.3 is lit by the sun as without it; below one of 0.7 it is not."""
    sun = SUN.format(moved(TURN.format("(30, 0, 0)")))
    lit = []
    for opacity in (0.3, 0.7):
        body = network(f"float inputs:opacity = {opacity}").replace(
            "point3f[] points", moved("double3 xformOp:translate = (0, 0, 1)") + "point3f[] points"
        )
        picture = take(gl, ideal, tmp_path, body, sun)
        lit.append(float(picture.seen(0, 1.6, -1)[0].mean()))
    assert lit[1] < 0.1 * lit[0]


@pytest.mark.parametrize(
    ("wrap", "left"), [("repeat", (0, 0, 0.8)), ("mirror", (0.8, 0, 0)), ("clamp", (0.8, 0, 0)), ("black", (0, 0, 0))]
)
def test_textures_go_on_beyond_their_edges(
    wrap: str, left: tuple[float, float, float], gl: Gl, ideal: RenderSettings, tmp_path: Path
) -> None:
    """A picture red left of blue, moved by a half to the right: what lies left of it depends on the mode."""
    sides = np.zeros((64, 64, 3), np.uint8)
    sides[:, :32, 2], sides[:, 32:, 0] = coded(0.8), coded(0.8)
    cv2.imwrite(str(tmp_path / "sides.png"), sides)
    nodes = straight(texture("A", "./sides.png", f'token inputs:wrapS = "{wrap}"\ntoken inputs:wrapT = "{wrap}"'))
    nodes = nodes.replace("translation = (0, 0)", "translation = (-0.5, 0)")
    picture = shot(gl, ideal, tmp_path, network("color3f inputs:diffuseColor.connect = </Mat/A.outputs:rgb>", nodes))
    np.testing.assert_allclose(picture.seen(-0.3, 0, 0)[0], left, atol=0.02)
    np.testing.assert_allclose(picture.seen(0.5, 0, 0)[0], (0.8, 0, 0), atol=0.02)
    after = shot(gl, ideal, tmp_path, mesh(""))  # samplers let go of what comes later
    np.testing.assert_allclose(after.seen(0, 0, 0)[0], (0.8, 0, 0), atol=0.02)


def test_a_picture_glows(gl: Gl, ideal: RenderSettings, tmp_path: Path) -> None:
    """An emissive texture adds its color times `scale` plus `bias`, also beyond 1."""
    cv2.imwrite(str(tmp_path / "glow.png"), np.full((32, 32, 3), (0, coded(0.5), 0), np.uint8))
    body = "color3f inputs:diffuseColor = (0.2, 0.2, 0.2)\ncolor3f inputs:emissiveColor.connect = </Mat/A.outputs:rgb>"
    strong = "float4 inputs:scale = (9, 10, 1, 1)\nfloat4 inputs:bias = (0, 1, 0.1, 0)"
    for more, seen in (("", (0.2, 0.7, 0.2)), (strong, (0.2, 6.2, 0.3))):
        picture = shot(gl, ideal, tmp_path, network(body, straight(texture("A", "./glow.png", more))))
        np.testing.assert_allclose(picture.seen(0, 0, 0)[0], seen, rtol=0.02, atol=0.02)


def test_the_specular_workflow_shines_as_it_says(gl: Gl, ideal: RenderSettings, tmp_path: Path) -> None:
    """A specular color of 0.04 is the dielectric that metallic 0 is; a metal is a black body with a shine."""
    sun = SUN.format(moved(TURN.format("(0, 10, 0)")))
    rough = "float inputs:roughness = 0.5\n"
    pairs = [
        (
            "color3f inputs:diffuseColor = (0.6, 0.3, 0.1)\n",
            "color3f inputs:diffuseColor = (0.6, 0.3, 0.1)\n"
            "int inputs:useSpecularWorkflow = 1\ncolor3f inputs:specularColor = (0.04, 0.04, 0.04)\n",
        ),
        (
            "color3f inputs:diffuseColor = (0.9, 0.6, 0.2)\nfloat inputs:metallic = 1\n",
            "color3f inputs:diffuseColor = (0, 0, 0)\nint inputs:useSpecularWorkflow = 1\n"
            "color3f inputs:specularColor = (0.9, 0.6, 0.2)\n",
        ),
    ]
    for one, other in pairs:
        first, second = (
            take(gl, ideal, tmp_path, network(rough + text), sun, quality="standard").seen(0, 0, 0)[0]
            for text in (one, other)
        )
        np.testing.assert_allclose(first, second, rtol=0.02, atol=0.003)
        assert first.max() > 0.02


def test_ior_shines_as_the_specular_color_that_it_means(gl: Gl, ideal: RenderSettings, tmp_path: Path) -> None:
    """A gem of 2.4 mirrors 17 % straight on; at 1 a surface is as in `fast`, where no shine is drawn."""
    sun = SUN.format(moved(TURN.format("(0, 10, 0)")))
    plain = "float inputs:roughness = 0.5\ncolor3f inputs:diffuseColor = (0.6, 0.3, 0.1)\n"
    share = (1.4 / 3.4) ** 2
    told = f"int inputs:useSpecularWorkflow = 1\ncolor3f inputs:specularColor = ({share}, {share}, {share})\n"
    drawn = {
        name: take(gl, ideal, tmp_path, network(plain + text), sun, quality=quality).seen(0, 0, 0)[0]
        for name, text, quality in (
            ("gem", "float inputs:ior = 2.4\n", "standard"),
            ("told", told, "standard"),
            ("matt", "float inputs:ior = 1\n", "standard"),
            ("fast", "", "fast"),
        )
    }
    np.testing.assert_allclose(drawn["gem"], drawn["told"], rtol=1e-3)
    np.testing.assert_allclose(drawn["matt"], drawn["fast"], rtol=5e-3)
    assert (drawn["gem"] > 1.1 * drawn["matt"]).all()


def test_metals_are_lit_by_lamps_in_fast(gl: Gl, ideal: RenderSettings, tmp_path: Path) -> None:
    """A metal below a lamp is as bright as a matt surface of its color where no shine is drawn."""
    lamp = LAMP.format(moved("double3 xformOp:translate = (0, 0, 2)"))
    body = "color3f inputs:diffuseColor = (0.9, 0.6, 0.2)\nfloat inputs:metallic = {}"
    metal, matt = (take(gl, ideal, tmp_path, network(body.format(m)), lamp).seen(0, 0, 0)[0] for m in (1, 0))
    np.testing.assert_allclose(metal, matt, rtol=1e-3)
    assert matt[0] > 0.01


def tga(kind: int, bits: int, body: bytes, width: int, height: int, flags: int, table: bytes = b"") -> bytes:
    """Write a TGA file."""
    count = len(table) // 3
    return (
        struct.pack(
            "<BBBHHBHHHHBB", 0, bool(table), kind, 0, count, 24 if table else 0, 0, 0, width, height, bits, flags
        )
        + table
        + body
    )


def test_tga_is_read(tmp_path: Path, gl: Gl, ideal: RenderSettings) -> None:
    """Plain and packed, gray, mapped, 15, 24 and 32 bits, from any corner: the same picture, and it is drawn."""
    rng = np.random.default_rng(3)
    image = rng.integers(0, 2, (6, 5, 1), np.uint8) * rng.integers(1, 255, (1, 1, 4), np.uint8)
    file = tmp_path / "a.tga"
    for bits, flags in ((24, 0x20), (24, 0), (32, 0x30), (32, 0x08)):
        rows = image[..., : bits // 8]
        stored = rows[..., [2, 1, 0, 3][: bits // 8] if bits == 32 else [2, 1, 0]]
        stored = stored[:, ::-1] if flags & 0x10 else stored
        stored = stored if flags & 0x20 else stored[::-1]
        flat = stored.reshape(30, -1)
        packed = b"".join(bytes([0x80]) + row.tobytes() for row in flat[:10]) + bytes([19]) + flat[10:].tobytes()
        for kind, body in ((2, flat.tobytes()), (10, packed)):
            file.write_bytes(tga(kind, bits, body, 5, 6, flags))
            np.testing.assert_array_equal(decode_tga(file), rows)
    gray = image[..., 0]
    file.write_bytes(tga(3, 8, gray.tobytes(), 5, 6, 0x20))
    np.testing.assert_array_equal(decode_tga(file), gray)
    file.write_bytes(tga(1, 8, (gray > 0).astype(np.uint8).tobytes(), 5, 6, 0x20, bytes([3, 2, 1, 30, 20, 10])))
    np.testing.assert_array_equal(decode_tga(file), np.where(gray[..., None] > 0, [10, 20, 30], [1, 2, 3]))
    file.write_bytes(tga(2, 16, struct.pack("<30H", *[31 << 10 | 15 << 5] * 30), 5, 6, 0x20))
    np.testing.assert_array_equal(decode_tga(file)[0, 0], [255, round(15 * 255 / 31), 0])
    red = np.full((16, 16, 3), (0, 0, coded(0.8)), np.uint8)
    file.write_bytes(tga(2, 24, red.tobytes(), 16, 16, 0x20))
    picture = shot(
        gl,
        ideal,
        tmp_path,
        network("color3f inputs:diffuseColor.connect = </Mat/A.outputs:rgb>", texture("A", "./a.tga")),
    )
    np.testing.assert_allclose(picture.seen(0, 0, 0)[0], (0.8, 0, 0), atol=0.02)


BROKEN = [
    b"",
    b"\0" * 30,
    tga(2, 24, b"\1" * 20, 9, 9, 0),
    tga(10, 24, b"\x05", 9, 9, 0),
    tga(1, 8, b"\7" * 81, 9, 9, 0, b"\1\2\3"),
    tga(2, 24, b"", 65535, 65535, 0),
]


@pytest.mark.parametrize("data", BROKEN)
def test_a_broken_tga_is_named(data: bytes, tmp_path: Path) -> None:
    """Cut off, without pixels, of unknown kinds, with colors that its table lacks, or huge: one line."""
    file = tmp_path / "broken.tga"
    file.write_bytes(data)
    with pytest.raises(InputError, match=r"broken\.tga"):
        decode_tga(file)


def test_infinite_light_is_not_dimmer_than_finite_light(tmp_path: Path) -> None:
    """In OpenEXR +inf becomes 65504 or, in 32 bits, the largest finite value beyond it; NaN and -inf become 0."""
    for kind, brightest in ((np.float16, 65504.0), (np.float32, 1e6)):
        values = np.full((2, 4, 3), 0.5, kind)
        values[0, 0], values[0, 1], values[0, 2], values[0, 3] = np.inf, -np.inf, np.nan, min(brightest, 6e4)
        values[1, 0, 2] = brightest
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        OpenEXR.File(header, {"RGB": values}).write(str(tmp_path / "a.exr"))
        read = decode_float(tmp_path / "a.exr")
        assert (read[0, 0].tolist(), read.max()) == ([brightest] * 3, brightest)
        assert (read[0, 1:3] == 0.0).all()
        np.testing.assert_array_equal(read[1], values[1].astype(np.float32))


def test_floating_point_pictures_color_surfaces(gl: Gl, ideal: RenderSettings, tmp_path: Path) -> None:
    """An HDR picture is linear light, cut at 1."""
    cv2.imwrite(str(tmp_path / "a.hdr"), np.full((16, 16, 3), (0.1, 0.3, 4.0), np.float32))
    assert decode_float(tmp_path / "a.hdr").max() == pytest.approx(4.0, rel=0.02)
    body = network(
        "color3f inputs:diffuseColor.connect = </Mat/A.outputs:rgb>",
        texture("A", "./a.hdr", 'token inputs:sourceColorSpace = "raw"'),
    )
    picture = shot(gl, ideal, tmp_path, surface(body))
    np.testing.assert_allclose(picture.seen(0, 0, 0)[0], (0.95, 0.3, 0.1), atol=0.03)
