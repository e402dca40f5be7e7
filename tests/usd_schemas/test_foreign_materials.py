"""Simple OmniPBR and MaterialX standard_surface materials, as Omniverse and MaterialX exporters write them."""

from pathlib import Path

import pytest

from tests.usd_schemas.stages import SQUARE
from tests.usd_schemas.test_materials import UV, read_one
from usd_schemas.flat_scene import Texture


def bound(material: str) -> str:
    """Write a square that a material is bound to."""
    return f"""{material}
    def Mesh "M" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
        rel material:binding = </Mat>
        {SQUARE}{UV.format("st")}{UV.format("map7").replace("(1,1)", "(3,3)")}
    }}"""


def omni(inputs: str) -> str:
    """Write an OmniPBR material."""
    return bound(f"""def Material "Mat" {{
        token outputs:mdl:surface.connect = </Mat/S.outputs:out>
        def Shader "S" {{
            uniform token info:implementationSource = "sourceAsset"
            uniform asset info:mdl:sourceAsset = @OmniPBR.mdl@
            uniform token info:mdl:sourceAsset:subIdentifier = "OmniPBR"
            {inputs}
            token outputs:out
        }}
    }}""")


def standard(inputs: str, nodes: str = "") -> str:
    """Write a standard_surface material."""
    return bound(f"""def Material "Mat" {{
        token outputs:mtlx:surface.connect = </Mat/S.outputs:out>
        def Shader "S" {{
            uniform token info:id = "ND_standard_surface_surfaceshader"
            {inputs}
            token outputs:out
        }}
        {nodes}
    }}""")


def test_omnipbr_constants(tmp_path: Path) -> None:
    """Color times tint, roughness, metallic, emission only where it is on; no warning."""
    scene, material = read_one(
        tmp_path,
        omni("""
        color3f inputs:diffuse_color_constant = (0.8, 0.4, 0.2)
        color3f inputs:diffuse_tint = (0.5, 1, 1)
        float inputs:reflection_roughness_constant = 0.3
        float inputs:metallic_constant = 0.9
        color3f inputs:emissive_color = (1, 1, 1)
        float inputs:emissive_intensity = 50
        bool inputs:enable_emission = 0
    """),
    )
    assert material.base_color == pytest.approx((0.4, 0.4, 0.2))
    assert (material.roughness, material.metallic) == pytest.approx((0.3, 0.9))
    assert material.emissive == (0.0, 0.0, 0.0)
    assert scene.warnings == ()
    _, lit = read_one(tmp_path, omni("bool inputs:enable_emission = 1\nfloat inputs:emissive_intensity = 2\n"))
    assert lit.emissive == pytest.approx((2.0, 0.2, 0.2))
    assert lit.base_color == pytest.approx((0.2, 0.2, 0.2))


def test_omnipbr_textures(tmp_path: Path) -> None:
    """One texture an input, with the material's own placement; what is left out is named."""
    scene, material = read_one(
        tmp_path,
        omni("""
        asset inputs:diffuse_texture = @./a.png@
        asset inputs:normalmap_texture = @./b.png@
        asset inputs:reflectionroughness_texture = @./c.png@
        float inputs:reflection_roughness_texture_influence = 1
        float2 inputs:texture_scale = (2, 3)
        float inputs:texture_rotate = 45
        float2 inputs:texture_translate = (0.5, 0)
        asset inputs:metallic_texture = @./gone.png@
        float inputs:metallic_texture_influence = 1
    """),
    )
    assert material.base_texture == Texture(str(tmp_path / "a.png"), True, (2.0, 3.0), 45.0, (0.5, 0.0))
    assert material.normal_texture == Texture(str(tmp_path / "b.png"), False, (2.0, 3.0), 45.0, (0.5, 0.0))
    assert material.roughness_texture is not None
    assert material.metallic_texture is None
    assert len(scene.warnings) == 1
    assert "gone.png" in scene.warnings[0]


def test_omnipbr_weights_and_packed_channels(tmp_path: Path) -> None:
    """An influence mixes constant and texture, a tint multiplies the texture, ORM has its own channels."""
    scene, material = read_one(
        tmp_path,
        omni("""
        asset inputs:diffuse_texture = @./a.png@
        color3f inputs:diffuse_tint = (0.5, 1, 0.25)
        bool inputs:enable_ORM_texture = 1
        asset inputs:ORM_texture = @./b.png@
        float inputs:reflection_roughness_constant = 0.5
        float inputs:reflection_roughness_texture_influence = 0.25
        float inputs:metallic_texture_influence = 1
    """),
    )
    rough = Texture(str(tmp_path / "b.png"), False, channel=1, gain=(0.25, 0.25, 0.25), bias=(0.375, 0.375, 0.375))
    assert material.base_texture == Texture(str(tmp_path / "a.png"), True, gain=(0.5, 1.0, 0.25))
    assert material.roughness_texture == rough
    assert material.metallic_texture == Texture(str(tmp_path / "b.png"), False, channel=2)
    assert scene.warnings == ()


@pytest.mark.parametrize(
    ("files", "gain", "warned"),
    [
        ({"emissive_color_texture": "a"}, (2.0, 2.0, 2.0), ""),
        ({"emissive_mask_texture": "a"}, (1.0, 0.5, 2.0), ""),
        ({"emissive_color_texture": "a", "emissive_mask_texture": "b"}, (2.0, 2.0, 2.0), "emissive_mask_texture"),
        ({"emissive_color_texture": "gone"}, (0.0, 0.0, 0.0), "gone.png"),
    ],
)
def test_omnipbr_emission_of_a_texture(
    files: dict[str, str], gain: tuple[float, float, float], warned: str, tmp_path: Path
) -> None:
    """The picture stands for the color, or masks it, times the intensity; without emission it is not read."""
    inputs = "color3f inputs:emissive_color = (0.5, 0.25, 1)\nfloat inputs:emissive_intensity = 2\n"
    inputs += "".join(f"asset inputs:{name} = @./{file}.png@\n" for name, file in files.items())
    scene, material = read_one(tmp_path, omni(inputs + "bool inputs:enable_emission = 1"))
    assert material.emissive == (1.0, 0.5, 2.0)
    assert material.emissive_texture == (Texture(str(tmp_path / "a.png"), True, gain=gain) if any(gain) else None)
    assert len(scene.warnings) == bool(warned)
    assert all(warned in line for line in scene.warnings)
    scene, dark = read_one(tmp_path, omni(inputs))
    assert (dark.emissive, dark.emissive_texture, scene.warnings) == ((0.0, 0.0, 0.0), None, ())


def test_omnipbr_fed_by_a_node_is_named(tmp_path: Path) -> None:
    """An input that another MDL node computes falls back to its default, with one line."""
    scene, material = read_one(tmp_path, omni("color3f inputs:diffuse_color_constant.connect = </Mat/S.outputs:out>"))
    assert material.base_color == pytest.approx((0.2, 0.2, 0.2))
    assert len(scene.warnings) == 1
    assert "diffuse_color_constant of OmniPBR comes from" in scene.warnings[0]


def test_standard_surface_constants(tmp_path: Path) -> None:
    """Its weights multiply its colors; glass is drawn blended, with a warning."""
    scene, material = read_one(
        tmp_path,
        standard("""
        float inputs:base = 0.5
        color3f inputs:base_color = (0.8, 0.4, 0.2)
        float inputs:specular_roughness = 0.35
        float inputs:metalness = 1
        float inputs:emission = 3
        color3f inputs:emission_color = (0.5, 0, 0)
        float inputs:transmission = 0.9
    """),
    )
    assert material.base_color == pytest.approx((0.4, 0.2, 0.1))
    assert (material.roughness, material.metallic) == pytest.approx((0.35, 1.0))
    assert material.emissive == pytest.approx((1.5, 0.0, 0.0))
    assert (material.opacity, material.blends) == (pytest.approx(0.19), True)
    assert scene.warnings == ("/Mat: its transmission is drawn as opacity 0.19",)


def test_standard_surface_textures(tmp_path: Path) -> None:
    """An image by its primvar, a tiled one, a normal map through its node; color spaces as stated."""
    inputs = """
        color3f inputs:base_color.connect = </Mat/A.outputs:out>
        float inputs:specular_roughness.connect = </Mat/B.outputs:out>
        vector3f inputs:normal.connect = </Mat/N.outputs:out>
    """
    nodes = """
        def Shader "A" {
            uniform token info:id = "ND_image_color3"
            asset inputs:file = @./a.png@ (colorSpace = "srgb_texture")
            float2 inputs:texcoord.connect = </Mat/Uv.outputs:out>
            color3f outputs:out
        }
        def Shader "B" {
            uniform token info:id = "ND_tiledimage_float"
            asset inputs:file = @./b.png@
            float2 inputs:uvtiling = (4, 2)
            float outputs:out
        }
        def Shader "N" {
            uniform token info:id = "ND_normalmap"
            vector3f inputs:in.connect = </Mat/C.outputs:out>
            vector3f outputs:out
        }
        def Shader "C" {
            uniform token info:id = "ND_image_vector3"
            asset inputs:file = @./c.png@
            vector3f outputs:out
        }
        def Shader "Uv" {
            uniform token info:id = "ND_geompropvalue_vector2"
            string inputs:geomprop = "map7"
            float2 outputs:out
        }
    """
    scene, material = read_one(tmp_path, standard(inputs, nodes))
    assert material.base_texture == Texture(str(tmp_path / "a.png"), True)
    assert material.roughness_texture == Texture(str(tmp_path / "b.png"), False, (4.0, 2.0))
    assert material.normal_texture == Texture(str(tmp_path / "c.png"), False)
    assert scene.geometry.st.max() == 3.0
    assert scene.warnings == ()
    raw = nodes.replace("srgb_texture", "lin_rec709")
    _, material = read_one(tmp_path, standard(inputs, raw))
    assert material.base_texture is not None
    assert not material.base_texture.srgb


@pytest.mark.parametrize(
    ("node", "output"),
    [
        ('"ND_extract_color3"\nint inputs:index = 2', "out"),
        ('"ND_separate3_color3"', "outb"),
    ],
)
def test_standard_surface_metalness_of_a_channel(node: str, output: str, tmp_path: Path) -> None:
    """Metalness from the blue of a packed picture, by either node; `base` multiplies the texture of base_color."""
    inputs = f"""
        float inputs:base = 0.5
        color3f inputs:base_color.connect = </Mat/A.outputs:out>
        float inputs:metalness.connect = </Mat/Pick.outputs:{output}>
    """
    nodes = f"""
        def Shader "A" {{
            uniform token info:id = "ND_image_color3"
            asset inputs:file = @./a.png@
            color3f outputs:out
        }}
        def Shader "Pick" {{
            uniform token info:id = {node}
            color3f inputs:in.connect = </Mat/B.outputs:out>
            float outputs:{output}
        }}
        def Shader "B" {{
            uniform token info:id = "ND_image_color3"
            asset inputs:file = @./b.png@
            color3f outputs:out
        }}
    """
    scene, material = read_one(tmp_path, standard(inputs, nodes))
    assert material.metallic_texture == Texture(str(tmp_path / "b.png"), False, channel=2)
    assert material.base_texture == Texture(str(tmp_path / "a.png"), True, gain=(0.5, 0.5, 0.5))
    assert scene.warnings == ()


def test_a_network_that_is_more_than_one_texture_is_named(tmp_path: Path) -> None:
    """A product of two images is no flat material: the constant stays, and one line says so."""
    nodes = 'def Shader "A" {\nuniform token info:id = "ND_multiply_color3"\ncolor3f outputs:out\n}'
    scene, material = read_one(tmp_path, standard("color3f inputs:base_color.connect = </Mat/A.outputs:out>", nodes))
    assert material.base_texture is None
    assert scene.warnings == ("/Mat: base_color comes from ND_multiply_color3, which is not read",)


def test_a_texture_cuts_a_standard_surface_of_one_color(tmp_path: Path) -> None:
    """Its silhouette is that of the opacity, as of a preview surface; the weight multiplies its color."""
    inputs = """
        float inputs:base = 0.5
        color3f inputs:base_color = (0.25, 0.5, 0.25)
        color3f inputs:opacity.connect = </Mat/A.outputs:out>
    """
    nodes = """
        def Shader "A" {
            uniform token info:id = "ND_image_color3"
            asset inputs:file = @./a.png@
            color3f outputs:out
        }
    """
    scene, material = read_one(tmp_path, standard(inputs, nodes))
    file = str(tmp_path / "a.png")
    gain, bias = (0.0, 0.0, 0.0), (0.125, 0.25, 0.125)
    assert material.base_texture == Texture(file, False, gain=gain, bias=bias, alpha=file, alpha_channel=0)
    assert (material.opacity_threshold, material.blends, scene.warnings) == (0.5, True, ())
