"""Stages in motion: what moves stands at each image as it does at that time, and nothing else is read twice."""

import json
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pxr import Sdf

import falsework
from groundwork.errors import InputError
from tests.usd_schemas.stages import SQUARE, read_body, write_stage
from usd_schemas.flat_scene import FlatScene, world_triangles
from usd_schemas.reading.choices import MOST_FRAMES, StageChoices, checked_choices, frames_of, variants_of
from usd_schemas.reading.scene_cache import load_scene
from usd_schemas.reading.stage_reader import read_stage

KEYS = """double3 xformOp:translate.timeSamples = {1: (0, 0, 0), 5: (8, 0, 0)}
    uniform token[] xformOpOrder = ["xformOp:translate"]
"""
EYE = """def Camera "Eye" {
    double3 xformOp:translate.timeSamples = {1: (0, 0, 9), 2: (0, 0, 9.5), 3: (0, 0, 10)}
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
STILL = f'def Mesh "Still" {{\n{SQUARE}}}\n'
SLIDING = f'def Mesh "Sliding" {{\n{SQUARE}{KEYS}}}\n'
BENT = SQUARE.replace(
    "point3f[] points =", "point3f[] points.timeSamples = { 1: [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], 3:"
).replace("(-1, 1, 0)]", "(-1, 1, 4)] }")
BENDING = f'def Mesh "Bending" {{\n{BENT}}}\n'
BLINKING = f"""def Xform "Blinking" {{
    token visibility.timeSamples = {{ 1: "inherited", 2: "invisible", 3: "inherited" }}
    def Mesh "Lamp" {{
{SQUARE}}}
}}
"""
SWARM = f"""def PointInstancer "Swarm" {{
    rel prototypes = </Swarm/Proto>
    int[] protoIndices = [0, 0]
    point3f[] positions.timeSamples = {{ 1: [(0, 0, 1), (0, 0, 2)], 3: [(0, 2, 1), (0, 2, 2)] }}
    def Mesh "Proto" {{
{SQUARE}}}
}}
"""
SKIN = f"""def SkelRoot "Body" {{
    def Skeleton "Bones" (prepend apiSchemas = ["SkelBindingAPI"]) {{
        uniform token[] joints = ["hip"]
        uniform matrix4d[] bindTransforms = [((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))]
        uniform matrix4d[] restTransforms = [((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))]
        rel skel:animationSource = </Body/Walk>
    }}
    def SkelAnimation "Walk" {{
        uniform token[] joints = ["hip"]
        quatf[] rotations = [(1, 0, 0, 0)]
        half3[] scales = [(1, 1, 1)]
        float3[] translations.timeSamples = {{ 1: [(0, 0, 0)], 3: [(0, 6, 0)] }}
    }}
    def Mesh "Skin" (prepend apiSchemas = ["SkelBindingAPI"]) {{
{SQUARE}        rel skel:skeleton = </Body/Bones>
        int[] primvars:skel:jointIndices = [0, 0, 0, 0] (
 interpolation = "vertex"
 elementSize = 1
)
        float[] primvars:skel:jointWeights = [1, 1, 1, 1] (
 interpolation = "vertex"
 elementSize = 1
)
        matrix4d primvars:skel:geomBindTransform = ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))
    }}
}}
"""


def corners_of(scene: FlatScene, path: str, moment: int) -> np.ndarray:
    """Find the world corners of what a prim drew at a moment, shape (T, 3, 3)."""
    scene = scene.at_moment(moment)
    triangles, ids, _ = world_triangles(scene)
    number = next(row.id for row in scene.instances if row.path == path)
    return triangles[ids == number]


def test_each_image_shows_what_moves_at_its_own_time(tmp_path: Path) -> None:
    """A sliding mesh, a bending one, a blinking one and a swarm stand at every image as USD puts them at that time."""
    scene = read_body(tmp_path, EYE + STILL + SLIDING + BENDING + BLINKING + SWARM)
    assert scene.cameras[0].moments == (0, 1, 2)
    assert len(scene.moments) == 3
    for number, time in enumerate((1.0, 2.0, 3.0)):
        assert corners_of(scene, "/Sliding", number)[..., 0].min() == pytest.approx(2.0 * (time - 1.0) - 1.0)
        assert corners_of(scene, "/Bending", number)[..., 2].max() == pytest.approx(2.0 * (time - 1.0))
        assert len(corners_of(scene, "/Blinking/Lamp", number)) == (0 if time == 2.0 else 2)
        assert corners_of(scene, "/Swarm", number)[..., 1].min() == pytest.approx(time - 2.0)
        assert corners_of(scene, "/Still", number)[..., 0].min() == -1.0
    moving = {row.path for row in scene.instances if row.moves}
    assert moving == {"/Sliding", "/Bending", "/Blinking/Lamp", "/Swarm"}


def test_velocities_carry_the_instances_on(tmp_path: Path) -> None:
    """One sample of positions and velocities: a still shows the positions, each image where USD says they have come."""
    drift = SWARM.partition("point3f[]")[0] + "point3f[] positions.timeSamples = { 1: [(0, 0, 1), (0, 0, 2)] }\n"
    drift += "vector3f[] velocities.timeSamples = { 1: [(24, 0, 0), (0, 48, 0)] }\n"
    drift += f'def Mesh "Proto" {{\n{SQUARE}}}\n}}\n'
    still = read_body(tmp_path, drift)
    np.testing.assert_allclose(still.draws.transform[:, :3, 3], [(0, 0, 1), (0, 0, 2)])
    scene = read_body(tmp_path, drift + EYE)
    assert len(scene.moments) == 3
    for number in range(3):
        found = scene.at_moment(number).draws.transform[:, :3, 3]
        np.testing.assert_allclose(found, [(number, 0, 1), (0, 2 * number, 2)], atol=1e-12)


def test_a_skeleton_bends_its_mesh_at_each_time(tmp_path: Path) -> None:
    """A skinned mesh stands at every image where its joint carries it, and one without a camera in motion too."""
    scene = read_body(tmp_path, EYE + SKIN)
    for number, time in enumerate((1.0, 2.0, 3.0)):
        assert corners_of(scene, "/Body/Skin", number)[..., 1].min() == pytest.approx(3.0 * (time - 1.0) - 1.0)
    posed = read_body(
        tmp_path,
        SKIN.replace("translations.timeSamples = { 1: [(0, 0, 0)], 3: [(0, 6, 0)] }", "translations = [(0, 4, 0)]"),
    )
    assert corners_of(posed, "/Body/Skin", 0)[..., 1].min() == pytest.approx(3.0)
    assert posed.moments == ()


def test_a_skeleton_in_an_instance_bends_its_mesh(tmp_path: Path) -> None:
    """Two instances of a character are both bent; the files stay as they are."""
    classes = f'class Xform "Man" {{\n{SKIN.replace("</Body", "</Man/Body")}}}\n'
    shared = "(\n instanceable = true\n inherits = </Man>\n)"
    two = "".join(f'def "Man_{n}" {shared} {{}}\n' for n in range(2))
    path = write_stage(tmp_path, EYE + classes + two)
    before = path.read_bytes()
    scene = read_stage(path)
    for number in range(2):
        assert corners_of(scene, f"/Man_{number}/Body/Skin", 2)[..., 1].min() == pytest.approx(5.0)
    assert path.read_bytes() == before


def test_samples_that_say_the_same_are_no_motion(tmp_path: Path) -> None:
    """What is sampled twice at one place is drawn, and its id is not marked."""
    scene = read_body(tmp_path, EYE + f'def Mesh "M" {{\n{SQUARE}{KEYS.replace("(8, 0, 0)", "(0, 0, 0)")}}}\n')
    assert [row.moves for row in scene.instances] == [False]


def test_frames_are_chosen(tmp_path: Path) -> None:
    """A camera that stands still takes one image, and as many as are asked for; the cache keeps them apart."""
    still = 'def Camera "Eye" {}\n'
    path = write_stage(tmp_path, still + SLIDING)
    assert len(load_scene(path, folder=tmp_path / "cache").cameras[0].poses) == 1
    scene = load_scene(path, folder=tmp_path / "cache", choices=StageChoices(frames=frames_of(["2", "3:5:2"])))
    again = load_scene(path, folder=tmp_path / "cache", choices=StageChoices(frames=frames_of(["2", "3:5:2"])))
    for one in (scene, again):
        assert [corners_of(one, "/Sliding", n)[..., 0].min() for n in one.cameras[0].moments] == [1.0, 3.0, 7.0]
    bare = read_stage(write_stage(tmp_path, SLIDING, name="bare.usda"), choices=StageChoices(frames=(1.0, 5.0)))
    assert len(bare.cameras[0].poses) == 2
    assert bare.cameras[0].moments == (0, 1)


@pytest.mark.parametrize("word", ["a", "1:0", "1:5:0", "1:5:-1", "nan", "inf", "1:2:3:4", "", "0:1e9"])
def test_what_are_no_frames_is_refused(word: str) -> None:
    """Neither words, nor ranges that never end or go backwards, are frames."""
    with pytest.raises(InputError, match="--frame"):
        frames_of([word])


def test_purposes_variants_cameras_and_sizes_are_chosen(tmp_path: Path) -> None:
    """Another purpose, another variant, one camera of two, and one side of the image: each is as asked for."""
    body = f"""def Camera "A" {{}}
def Camera "B" {{}}
def Mesh "Guide" {{
    uniform token purpose = "guide"
{SQUARE}}}
def Xform "House" (
    variants = {{
        string roof = "flat"
    }}
    prepend variantSets = "roof"
) {{
    variantSet "roof" = {{
        "flat" {{
            def Mesh "Flat" {{
{SQUARE}}}
        }}
        "steep" {{
            def Mesh "Steep" {{
{SQUARE}}}
        }}
    }}
}}
"""
    path = write_stage(tmp_path, body)

    def paths(choices: StageChoices) -> set[str]:
        return {row.path for row in read_stage(path, choices=choices).instances}

    assert paths(StageChoices()) == {"/House/Flat"}
    assert paths(StageChoices(purposes=("default", "guide"))) == {"/House/Flat", "/Guide"}
    assert paths(StageChoices(variants=variants_of(["/House:roof=steep"]))) == {"/House/Steep"}
    scene = read_stage(path, choices=StageChoices(camera="B", width=320))
    assert [(product.name, product.width) for product in scene.products] == [("B", 320)]
    shape = scene.products[0].height / 320
    tall = read_stage(path, choices=StageChoices(camera="/B", height=500)).products[0]
    assert tall.height == 500
    assert tall.height / tall.width == pytest.approx(shape, rel=0.01)
    for choices, field in (
        (StageChoices(camera="C"), "--camera"),
        (StageChoices(variants=(("/House", "roof", "thatched"),)), "flat, steep"),
        (StageChoices(variants=(("/House", "wall", "brick"),)), "roof"),
        (StageChoices(variants=(("/Barn", "roof", "flat"),)), "--variant"),
    ):
        with pytest.raises(InputError, match=field):
            read_stage(path, choices=choices)


GIVEN: Any = {
    "camera": Sdf.Path("/W/cam"),
    "frames": np.arange(1, 3),
    "purposes": {"render", "default"},
    "variants": [[Sdf.Path("/W"), "roof", "flat"]],
    "width": np.int64(640),
    "height": np.uint16(0),
    "subdivision": np.int32(2),
}


def test_choices_of_a_script_get_their_types() -> None:
    """Numbers of numpy, prim paths, and any iterable; a set is sorted, for an order that is always the same."""
    wanted = StageChoices("/W/cam", (1.0, 2.0), ("default", "render"), (("/W", "roof", "flat"),), 640, 0, 2)
    assert checked_choices(StageChoices(**GIVEN)) == wanted
    found = checked_choices(StageChoices(**GIVEN)).as_json()
    assert json.loads(json.dumps(found)) == json.loads(json.dumps(wanted.as_json()))
    wide: Any = {"frames": {10, 9.0, Fraction(1, 2)}, "purposes": (one for one in ("guide", "proxy"))}
    chosen = checked_choices(StageChoices(**wide))
    assert (chosen.frames, chosen.purposes) == ((0.5, 9.0, 10.0), ("guide", "proxy"))
    many: Any = {"frames": range(MOST_FRAMES)}
    assert len(checked_choices(StageChoices(**many)).frames) == MOST_FRAMES
    assert checked_choices(StageChoices()) == StageChoices()


def test_a_stage_is_read_with_them(tmp_path: Path) -> None:
    """As with plain ones, by the function of the API."""
    body = f"{EYE}{SLIDING}"
    path = write_stage(tmp_path, body)
    given: Any = {"frames": np.arange(1, 3), "width": np.int64(64), "purposes": {"render", "default"}}
    found = falsework.read_stage(path, choices=StageChoices(**given))
    assert found.products[0].width == 64
    assert len(found.cameras[found.products[0].camera].poses) == 2
