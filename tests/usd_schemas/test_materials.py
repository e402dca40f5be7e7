"""Materials: UsdPreviewSurface networks as they are written by us and by DCCs, and what falls back."""

from pathlib import Path

import numpy as np
import pytest

from tests.usd_schemas.stages import SQUARE, Z_UP, read_body
from usd_schemas.flat_scene import FlatScene, Material

UV = 'texCoord2f[] primvars:{} = [(0,0), (1,0), (1,1), (0,1)] (interpolation = "vertex")\n'


def network(surface: str, nodes: str = "", outside: str = "") -> str:
    """Write a material with a preview surface, and a square that it is bound to.

    Args:
        surface: Inputs of the surface.
        nodes: Further shaders of the material.
        outside: Further attributes of the material.
    """
    return f"""def Material "Mat" {{
        token outputs:surface.connect = </Mat/S.outputs:surface>
        {outside}
        def Shader "S" {{
            uniform token info:id = "UsdPreviewSurface"
            {surface}
            token outputs:surface
        }}
        {nodes}
    }}
    def Mesh "M" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
        rel material:binding = </Mat>
        {SQUARE}{UV.format("st")}{UV.format("map7").replace("(1,1)", "(3,3)")}
    }}"""


def texture(name: str, file: str, more: str = "", varname: str = "st") -> str:
    """Write a texture node, its placement and its reader."""
    return f"""def Shader "{name}" {{
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @{file}@
            float2 inputs:st.connect = </Mat/{name}Place.outputs:result>
            {more}
            float3 outputs:rgb
            float outputs:r
            float outputs:g
            float outputs:b
            float outputs:a
        }}
        def Shader "{name}Place" {{
            uniform token info:id = "UsdTransform2d"
            float2 inputs:in.connect = </Mat/{name}Uv.outputs:result>
            float2 inputs:scale = (0.25, 0.5)
            float inputs:rotation = 30
            float2 inputs:translation = (0.1, 0.2)
            float2 outputs:result
        }}
        def Shader "{name}Uv" {{
            uniform token info:id = "UsdPrimvarReader_float2"
            string inputs:varname = "{varname}"
            float2 outputs:result
        }}\n"""


def read_one(folder: Path, body: str) -> tuple[FlatScene, Material]:
    """Read a stage and the material of its first draw; texture files exist as empty files."""
    for name in ("a.png", "b.png", "c.png"):
        (folder / name).write_bytes(b"")
    scene = read_body(folder, body)
    return scene, scene.materials[scene.draws.material[0]]


def test_constants(tmp_path: Path) -> None:
    """Plain values arrive as written."""
    scene, material = read_one(
        tmp_path,
        network("""
        color3f inputs:diffuseColor = (0.25, 0.5, 0.75)
        float inputs:roughness = 0.25
        float inputs:metallic = 1
        color3f inputs:emissiveColor = (0, 1, 0)"""),
    )
    assert material == Material("/Mat", (0.25, 0.5, 0.75), roughness=0.25, metallic=1.0, emissive=(0.0, 1.0, 0.0))
    assert not scene.warnings


def test_textures_and_their_placement(tmp_path: Path) -> None:
    """Three textures: color as sRGB, data as raw, the atlas as second set, files absolute."""
    scene, material = read_one(
        tmp_path,
        network(
            "color3f inputs:diffuseColor.connect = </Mat/A.outputs:rgb>\n"
            "float inputs:roughness.connect = </Mat/B.outputs:r>\n"
            "normal3f inputs:normal.connect = </Mat/C.outputs:rgb>",
            texture("A", "./a.png", 'token inputs:sourceColorSpace = "sRGB"')
            + texture("B", "./b.png", varname="st1")
            + texture("C", "./c.png", 'token inputs:sourceColorSpace = "raw"'),
        ),
    )
    base, rough, normal = material.base_texture, material.roughness_texture, material.normal_texture
    assert base
    assert rough
    assert normal
    assert base.file == str(tmp_path.resolve() / "a.png")
    assert (base.srgb, rough.srgb, normal.srgb) == (True, False, False)
    assert (base.uv_set, rough.uv_set, normal.uv_set) == (0, 1, 0)
    assert (base.scale, base.translation) == ((0.25, 0.5), pytest.approx((0.1, 0.2)))
    assert base.rotation == pytest.approx(30.0)
    assert not scene.warnings


@pytest.mark.parametrize(("named", "corner"), [("st", (1.0, 1.0)), ("map7", (3.0, 3.0)), ("nowhere", (1.0, 1.0))])
def test_the_reader_names_the_uv_set(named: str, corner: tuple[float, float], tmp_path: Path) -> None:
    """The primvar that the material reads becomes the first set; else `st`."""
    body = network("color3f inputs:diffuseColor.connect = </Mat/A.outputs:rgb>", texture("A", "./a.png", varname=named))
    scene, material = read_one(tmp_path, body)
    assert material.base_texture is not None
    assert material.base_texture.uv_set == 0
    np.testing.assert_allclose(scene.geometry.st.max(axis=0), corner)


def test_two_foreign_uv_sets(tmp_path: Path) -> None:
    """Two textures on two sets of any name get one column each."""
    scene, material = read_one(
        tmp_path,
        network(
            "color3f inputs:diffuseColor.connect = </Mat/A.outputs:rgb>\n"
            "float inputs:roughness.connect = </Mat/B.outputs:r>",
            texture("A", "./a.png", varname="map7") + texture("B", "./b.png", varname="st"),
        ),
    )
    assert material.base_texture
    assert material.roughness_texture
    assert (material.base_texture.uv_set, material.roughness_texture.uv_set) == (0, 1)
    np.testing.assert_allclose(scene.geometry.st.max(axis=0), (3.0, 3.0))
    np.testing.assert_allclose(scene.geometry.st1.max(axis=0), (1.0, 1.0))


def test_materials_of_one_mesh_share_its_two_sets(tmp_path: Path) -> None:
    """Each part is drawn with the texture coordinates that its own material names; of a third set a line is said."""
    body, subsets = "", ""
    for face, name in enumerate("ABC"):
        one = network("color3f inputs:diffuseColor.connect = </Mat/A.outputs:rgb>", texture("A", "./a.png", "", name))
        body += one.partition("def Mesh")[0].replace('"Mat"', f'"Mat{name}"').replace("</Mat/", f"</Mat{name}/")
        subsets += f"""def GeomSubset "{name}" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
            uniform token familyName = "materialBind"
            int[] indices = [{face}]
            rel material:binding = </Mat{name}>
        }}\n"""
    strips = SQUARE.replace("[4]", "[3, 3, 3]").replace("[0, 1, 2, 3]", "[0, 1, 2, 0, 2, 3, 0, 1, 3]")
    uvs = "".join(UV.format(name).replace("(1,1)", f"({width},1)") for width, name in ((2, "A"), (3, "B"), (4, "C")))
    (tmp_path / "a.png").write_bytes(b"")
    scene = read_body(tmp_path, body + f'def Mesh "M" {{\n{strips}{uvs}{subsets}}}')
    drawn = [scene.materials[row] for row in scene.draws.material]
    sets = {one.name: one.base_texture.uv_set for one in drawn if one.base_texture}
    assert (sets["/MatA"], sets["/MatB"]) == (0, 1)
    assert (scene.geometry.st[:, 0].max(), scene.geometry.st1[:, 0].max()) == (2.0, 3.0)
    assert scene.warnings == ("/M: texture coordinates C are left out: a mesh has two sets of them",)


def test_interface_inputs_are_followed(tmp_path: Path) -> None:
    """Values and primvar names on the material itself reach the shaders, as Blender and usdex write them."""
    nodes = texture("A", "./a.png").replace(
        'string inputs:varname = "st"', "string inputs:varname.connect = </Mat.inputs:uv>"
    )
    body = network(
        "color3f inputs:diffuseColor.connect = </Mat/A.outputs:rgb>\n"
        "float inputs:roughness.connect = </Mat.inputs:rough>",
        nodes,
        'string inputs:uv = "map7"\nfloat inputs:rough = 0.125',
    )
    scene, material = read_one(tmp_path, body)
    assert material.roughness == 0.125
    np.testing.assert_allclose(scene.geometry.st.max(axis=0), (3.0, 3.0))


def test_packed_channels_with_scale_and_bias(tmp_path: Path) -> None:
    """Roughness from green and metallic from blue of one picture, each with its own scale and bias; a tinted color."""
    scene, material = read_one(
        tmp_path,
        network(
            "color3f inputs:diffuseColor.connect = </Mat/A.outputs:rgb>\n"
            "float inputs:roughness.connect = </Mat/B.outputs:g>\n"
            "float inputs:metallic.connect = </Mat/B.outputs:b>",
            texture("A", "./a.png", "float4 inputs:scale = (0.5, 1, 0.25, 1)")
            + texture(
                "B", "./b.png", "float4 inputs:scale = (9, 0.5, 0.75, 1)\nfloat4 inputs:bias = (9, 0.25, 0.125, 0)"
            ),
        ),
    )
    rough, metal = material.roughness_texture, material.metallic_texture
    assert material.base_texture
    assert material.base_texture.gain == (0.5, 1.0, 0.25)
    assert rough
    assert metal
    assert (rough.channel, rough.gain, rough.bias) == (1, (0.5,) * 3, (0.25,) * 3)
    assert (metal.channel, metal.gain, metal.bias) == (2, (0.75,) * 3, (0.125,) * 3)
    assert rough.file == metal.file == str(tmp_path.resolve() / "b.png")
    assert not scene.warnings


def test_what_a_flat_material_cannot_hold_is_named(tmp_path: Path) -> None:
    """Inputs that change the look and are not read: one line each, and the rest is drawn."""
    scene, material = read_one(
        tmp_path,
        network(
            "color3f inputs:diffuseColor.connect = </Mat/A.outputs:rgb>\n"
            "color3f inputs:emissiveColor.connect = </Mat/A.outputs:rgb>\n"
            "int inputs:useSpecularWorkflow = 1\nfloat inputs:clearcoat = 0.5\nfloat inputs:displacement = 0.1\n"
            "normal3f inputs:normal.connect = </Mat/C.outputs:rgb>",
            texture("A", "./a.png", 'token inputs:wrapS = "mirror"\ntoken inputs:wrapT = "repeat"')
            + texture("C", "./c.png", "float4 inputs:scale = (2, -2, 2, 1)\nfloat4 inputs:bias = (-1, 1, -1, 0)"),
        ),
    )
    assert material.base_texture
    assert material.normal_texture
    assert (material.normal_texture.gain, material.normal_texture.bias) == ((1.0, -1.0, 1.0), (0.0, 1.0, 0.0))
    assert material.base_texture.wrap == ("mirror", "repeat")
    assert material.emissive_texture is not None
    assert material.specular == (0.0, 0.0, 0.0)
    assert sorted(scene.warnings) == [
        "/Mat: clearcoat is left out",
        "/Mat: displacement is left out",
    ]


@pytest.mark.parametrize(
    ("told", "expected"),
    [
        ("float inputs:ior = 1", 0.0),
        ("float inputs:ior = 1.5", None),
        ("float inputs:ior = 2", 1 / 9),
        ("float inputs:ior = 0", 1.0),
        ("float inputs:ior = -3", 1.0),
        ("float inputs:ior = 2\nfloat inputs:metallic = 1", None),
        ("float inputs:ior = inf", None),
        ("float inputs:ior = nan", None),
    ],
)
def test_ior_tells_the_shine(told: str, expected: float | None, tmp_path: Path) -> None:
    """((1 - ior) / (1 + ior))^2 is mirrored straight on, nothing at 1; of a metal its color does."""
    scene, material = read_one(tmp_path, network(f"color3f inputs:diffuseColor = (0.2, 0.2, 0.2)\n{told}", ""))
    assert material.specular == (pytest.approx((expected,) * 3) if expected is not None else None)
    assert material.is_matt == (expected == 0.0)
    assert any("ior" in line for line in scene.warnings) == told.endswith(("inf", "nan"))


def test_missing_texture_is_gray(tmp_path: Path) -> None:
    """A texture that is not there costs one warning, which names no folder of this machine."""
    body = network("color3f inputs:diffuseColor.connect = </Mat/A.outputs:rgb>", texture("A", "./gone.png"))
    scene, material = read_one(tmp_path, body)
    assert material.base_texture is None
    assert material.base_color == (0.5, 0.5, 0.5)
    assert scene.warnings == ("/Mat: no texture ./gone.png for diffuseColor: drawn plain gray",)


def test_unknown_surface_falls_back(tmp_path: Path) -> None:
    """A material that is no preview surface: one warning, then displayColor where there is one, else gray."""
    body = network("").replace("UsdPreviewSurface", "ND_surface_of_nobody")
    scene, material = read_one(tmp_path, body)
    assert material == scene.materials[0]
    assert len(scene.warnings) == 1
    assert "ND_surface_of_nobody" in scene.warnings[0]
    colored = body.replace(
        SQUARE, SQUARE + 'color3f[] primvars:displayColor = [(1, 0, 0)] (interpolation = "constant")\n'
    )
    _, material = read_one(tmp_path, colored)
    assert material.use_display_color


def test_only_an_mdl_surface(tmp_path: Path) -> None:
    """A material for another renderer is named in the warning."""
    body = network("").replace("token outputs:surface.connect", "token outputs:mdl:surface.connect")
    scene, material = read_one(tmp_path, body.replace("UsdPreviewSurface", "OmniGlass"))
    assert material == scene.materials[0]
    assert "OmniGlass" in scene.warnings[0]


def test_display_color_reader(tmp_path: Path) -> None:
    """A diffuse color that reads displayColor uses the vertex colors."""
    reader = """def Shader "A" {
        uniform token info:id = "UsdPrimvarReader_float3"
        string inputs:varname = "displayColor"
        float3 outputs:result
    }"""
    body = network("color3f inputs:diffuseColor.connect = </Mat/A.outputs:result>", reader)
    color = 'color3f[] primvars:displayColor = [(1, 0, 0)] (interpolation = "constant")\n'
    _, material = read_one(tmp_path, body.replace(SQUARE, SQUARE + color))
    assert material.use_display_color


def test_cut_outs_and_glass(tmp_path: Path) -> None:
    """Alpha of the color texture with a threshold is a cut-out; a see-through constant is blended."""
    diffuse = "color3f inputs:diffuseColor.connect = </Mat/A.outputs:rgb>\n"
    alpha = "float inputs:opacity.connect = </Mat/A.outputs:a>\nfloat inputs:opacityThreshold = 0.375\n"
    scene, material = read_one(tmp_path, network(diffuse + alpha, texture("A", "./a.png")))
    assert material.opacity_threshold == 0.375
    assert not scene.warnings
    scene, material = read_one(tmp_path, network("float inputs:opacity = 0.3"))
    assert material.opacity_threshold == 0.0
    assert (material.opacity, material.blends, material.is_mostly_transparent) == (pytest.approx(0.3), True, True)
    _, material = read_one(tmp_path, network("float inputs:opacity = 0.6"))
    assert (material.blends, material.is_mostly_transparent) == (True, False)
    _, material = read_one(tmp_path, network(diffuse + alpha.splitlines()[0], texture("A", "./a.png")))
    assert (material.blends, material.opacity_threshold) == (True, 0.5)
    plain = "color3f inputs:diffuseColor = (0.2, 0.4, 0.6)\n"
    _, material = read_one(
        tmp_path, network(plain + alpha.replace("outputs:a>", "outputs:g>"), texture("A", "./a.png"))
    )
    assert material.base_texture is not None
    assert (material.base_texture.alpha, material.base_texture.alpha_channel) == (material.base_texture.file, 1)
    assert material.base_texture.bias == pytest.approx((0.2, 0.4, 0.6))
    turned = 'float4 inputs:scale = (1, 1, 1, -1)\nfloat4 inputs:bias = (0, 0, 0, 1)\ntoken inputs:wrapS = "clamp"'
    nodes = texture("A", "./a.png") + texture("B", "./a.png", turned, "map7")
    scene, material = read_one(tmp_path, network(diffuse + alpha.replace("</Mat/A", "</Mat/B"), nodes))
    assert material.base_texture is not None
    assert (material.base_texture.alpha_gain, material.base_texture.alpha_bias) == (-1.0, 1.0)
    assert scene.warnings == tuple(
        f"/Mat: opacity and diffuseColor have different {what}: those of diffuseColor are used for both"
        for what in ("wrap modes", "texture coordinates")
    )


def test_detail(tmp_path: Path) -> None:
    """FalseworkDetailAPI arrives with absolute files."""
    outside = """asset falsework:detail:texture = @./a.png@
        uniform float[] falsework:detail:periods = [0.5, 0.125]
        uniform float[] falsework:detail:amplitudes = [0.25, 0.5]
        asset falsework:detail:macroTexture = @./b.png@"""
    _, material = read_one(tmp_path, network("", "", outside))
    assert material.detail.file == str(tmp_path.resolve() / "a.png")
    assert material.detail.macro_file == str(tmp_path.resolve() / "b.png")
    assert (material.detail.periods, material.detail.amplitudes) == ((0.5, 0.125), (0.25, 0.5))
    more = outside.replace("0.125]", "0.125, 0.1, 0.05]").replace("0.5]", "0.5, 0.5, 0.5]")
    scene, material = read_one(tmp_path, network("", "", more))
    assert material.detail.periods == pytest.approx((0.5, 0.125, 0.1))
    assert scene.warnings == ("/Mat: detail beyond 3 octaves is left out",)
    scene, material = read_one(tmp_path, network("", "", outside.replace("[0.25, 0.5]", "[0.25]")))
    assert material.detail.file == ""
    assert scene.warnings == ("/Mat: detail:periods and detail:amplitudes differ in length: fine detail is left out",)


def test_collection_binding(tmp_path: Path) -> None:
    """A material bound to a collection on a parent reaches its members only."""
    material = network("color3f inputs:diffuseColor = (0, 0, 1)").split("def Mesh")[0]
    group = f"""def Xform "G" (prepend apiSchemas = ["MaterialBindingAPI", "CollectionAPI:blue"]) {{
        uniform token collection:blue:expansionRule = "expandPrims"
        rel collection:blue:includes = </G/In>
        rel material:binding:collection:blue = [</G.collection:blue>, </Mat>]
        def Mesh "In" {{ {SQUARE} }}
        def Mesh "Out" {{ {SQUARE} }}
    }}"""
    scene = read_body(tmp_path, material + group)
    names = [scene.materials[row].name for row in scene.draws.material]
    assert names == ["/Mat", "fallback"]


def test_instances_share_their_materials(tmp_path: Path) -> None:
    """A material inside of an instanced asset is one material, however often the asset is there."""
    inside = network("float inputs:clearcoat = 1").replace("</", "</Asset/")
    body = f'class "Asset" {{\n{inside}\n}}\n'
    body += "".join(f'def Xform "I{row}" (instanceable = true\n references = </Asset>) {{}}\n' for row in range(3))
    scene = read_body(tmp_path, body)
    assert [scene.materials[row].name for row in scene.draws.material] == ["/I0/Mat"] * 3
    assert len(scene.materials) == 3  # with the fallback and displayColor
    assert scene.warnings == ("/I0/Mat: clearcoat is left out",)


def test_textures_of_a_referenced_layer(tmp_path: Path) -> None:
    """A relative texture path counts from the layer that holds it."""
    inner = tmp_path / "asset"
    inner.mkdir()
    (inner / "a.png").write_bytes(b"")
    body = network("color3f inputs:diffuseColor.connect = </World/Mat/A.outputs:rgb>", texture("A", "./a.png"))
    wrapped = 'def Xform "World" {\n' + body.replace("</Mat", "</World/Mat").replace("</World/World", "</World") + "\n}"
    (inner / "asset.usda").write_text(f'#usda 1.0\n(\n {Z_UP}\n defaultPrim = "World"\n)\n{wrapped}\n')
    scene = read_body(tmp_path, 'def "Here" (references = @./asset/asset.usda@) {}')
    assert scene.materials[2].base_texture is not None
    assert scene.materials[2].base_texture.file == str(inner.resolve() / "a.png")
