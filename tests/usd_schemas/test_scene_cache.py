"""The cache of flat scenes: nothing is composed twice, nothing stale or damaged is taken over."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from pathlib import Path
from types import GenericAlias
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from pxr import Sdf, UsdUtils

import usd_schemas.reading.scene_cache as scene_cache
from groundwork.errors import InputError, MissingError
from groundwork.user_cache import cache_folder
from tests.usd_schemas.stages import SQUARE, write_stage
from usd_schemas.flat_scene import FlatScene
from usd_schemas.reading.choices import StageChoices
from usd_schemas.reading.layer_contents import layer_contents
from usd_schemas.reading.scene_cache import load_scene
from usd_schemas.reading.scene_file import is_array
from usd_schemas.reading.stage_reader import read_stage

CAMERA = """def Camera "{}" {{
    double3 xformOp:translate.timeSamples = {{ 1: (0, 0, 5), 2: (1, 0, 5) }}
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}
"""
MATERIAL = """def Material "Mat" {
    token outputs:surface.connect = </Mat/S.outputs:surface>
    asset falsework:detail:macroTexture = @./skins/macro.png@
    def Shader "S" {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </Mat/T.outputs:rgb>
        float inputs:metallic.connect = </Mat/T.outputs:b>
        token outputs:surface
    }
    def Shader "T" {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @./skins/a.png@
        float3 outputs:rgb
        float outputs:b
    }
}
"""
LIGHTS = """def DistantLight "Sun" {}
def SphereLight "Lamp" {}
def DomeLight "Sky" {
    asset inputs:texture:file = @./skins/sky.hdr@
}
"""
MESH = f"""def Mesh "M" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
    rel material:binding = </Mat>
    int userProperties:semantic:instance_id = 5
    {SQUARE}
}}
"""


@pytest.fixture
def stage(tmp_path: Path) -> Path:
    """Write a stage of three layers with pictures, and one that it names but never shows."""
    home = tmp_path / "home"
    (home / "skins").mkdir(parents=True)
    for name in ("a.png", "macro.png", "sky.hdr"):
        (home / "skins" / name).write_bytes(name.encode())
    write_stage(home, CAMERA.format("One") + CAMERA.format("Two"), name="cameras.usda")
    write_stage(home, MATERIAL + MESH, name="mesh.usda")
    write_stage(home, f'def Mesh "Other" {{{SQUARE}}}', 'defaultPrim = "Other"', "other.usda")
    choice = """def Xform "Choice" (
        variants = { string what = "none" }
        prepend variantSets = "what"
    ) {
        variantSet "what" = {
            "none" {}
            "other" (prepend references = @./other.usda@) {}
        }
    }
    """
    header = 'upAxis = "Z"\n metersPerUnit = 1\n subLayers = [@./cameras.usda@, @./mesh.usda@]'
    return write_stage(home, LIGHTS + choice, header)


@pytest.fixture
def composed(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """List the stages that are composed from now on."""
    paths: list[Path] = []
    compose = scene_cache.compose_stage

    def counted(path: Path, choices: StageChoices) -> Any:
        paths.append(path)
        return compose(path, choices)

    monkeypatch.setattr(scene_cache, "compose_stage", counted)
    return paths


def assert_same(one: Any, other: Any) -> None:
    """Compare every field of two scenes, types, shapes and bits included."""
    if is_dataclass(one):
        assert type(one) is type(other)
        for field in fields(one):
            assert_same(getattr(one, field.name), getattr(other, field.name))
    elif isinstance(one, np.ndarray):
        assert one.dtype == other.dtype
        np.testing.assert_array_equal(one, other)
    elif isinstance(one, tuple):
        assert len(one) == len(other)
        for pair in zip(one, other, strict=True):
            assert_same(*pair)
    else:
        assert one == other
        assert type(one) is type(other)


def test_a_kept_scene_is_the_scene_that_was_read(stage: Path, tmp_path: Path, composed: list[Path]) -> None:
    """The second time nothing is composed; every array, record, path and warning is as the reader gives it."""
    for survey in (None, "Two", "One"):
        expected = read_stage(stage, survey=survey)
        assert_same(load_scene(stage, survey=survey, folder=tmp_path / "cache"), expected)
    assert len(composed) == 1
    assert expected.sphere_lights
    assert expected.sun
    assert expected.dome
    assert expected.materials[2].metallic_texture
    with pytest.raises(InputError, match="no such survey"):
        load_scene(stage, survey="Three", folder=tmp_path / "cache")


def test_the_same_bytes_elsewhere_are_the_same_scene(stage: Path, tmp_path: Path, composed: list[Path]) -> None:
    """A copy in another folder, read by another process, composes nothing; its pictures are its own."""
    load_scene(stage, folder=tmp_path / "cache")
    shutil.copytree(stage.parent, tmp_path / "there")
    scene = load_scene(tmp_path / "there/stage.usda", folder=tmp_path / "cache")
    assert len(composed) == 1
    assert scene.materials[2].base_texture
    assert scene.materials[2].base_texture.file == str(tmp_path.resolve() / "there/skins/a.png")
    assert_same(scene, read_stage(tmp_path / "there/stage.usda"))
    script = (
        "import sys, usd_schemas.reading.scene_cache as c\nfrom pathlib import Path\nc.compose_stage = None\n"
        "print(c.load_scene(Path(sys.argv[1])).origin)"
    )
    environment = {**os.environ, "FALSEWORK_CACHE": str(tmp_path)}
    (tmp_path / "cache").rename(tmp_path / "scenes")
    run = [sys.executable, "-c", script, str(stage)]
    done = subprocess.run(run, capture_output=True, text=True, env=environment, check=True)
    assert done.stdout.strip() == scene.origin


CHANGES: dict[str, Callable[[Path], object]] = {
    "root layer": lambda home: write_stage(home, LIGHTS, "subLayers = [@./cameras.usda@, @./mesh.usda@]"),
    "sublayer": lambda home: write_stage(home, MATERIAL + MESH.replace("-1, -1, 0", "-3, -1, 0"), name="mesh.usda"),
    "layer of an unselected variant": lambda home: (home / "other.usda").unlink(),
    "missing texture": lambda home: (home / "skins/a.png").unlink(),
    "texture": lambda home: (home / "skins/a.png").write_bytes(b"new"),
}


@pytest.mark.parametrize("change", CHANGES)
def test_what_changed_is_never_taken_over(change: str, stage: Path, tmp_path: Path, composed: list[Path]) -> None:
    """Another layer or a lost file is read anew, another picture gives another origin; what returns is found again."""
    former = load_scene(stage, folder=tmp_path / "cache")
    kept = {file: file.read_bytes() for file in stage.parent.rglob("*") if file.is_file()}
    CHANGES[change](stage.parent)
    scene = load_scene(stage, folder=tmp_path / "cache")
    assert_same(scene, read_stage(stage))
    assert len(composed) == (1 if change == "texture" else 2)
    assert (scene.origin == former.origin) == change.startswith("layer of an unselected")
    for file, data in kept.items():
        file.write_bytes(data)
    assert_same(load_scene(stage, folder=tmp_path / "cache"), former)
    assert len(composed) == (1 if change == "texture" else 2)


@pytest.mark.parametrize("damage", ["cut", "emptied", "one bit", "another form", "another scene"])
def test_a_damaged_file_is_made_anew(damage: str, stage: Path, tmp_path: Path, composed: list[Path]) -> None:
    """Truncated, empty, one bit over, whole but of another form, or of another scene: read again, and kept again."""
    folder = tmp_path / "cache"
    expected = load_scene(stage, folder=folder)
    (place,) = folder.glob("*.scene")
    whole = place.read_bytes()
    flipped = bytearray(whole)
    flipped[len(whole) // 2] ^= 4
    other = scene_cache.pack_scene(FlatScene(*[()] * 11), ())  # type: ignore[arg-type]
    strange = whole[:32] + scene_cache.pack_scene(expected, ())[32:]  # sound in itself, but not what the hash is of
    place.write_bytes(
        {
            "cut": whole[:-7],
            "emptied": b"",
            "one bit": bytes(flipped),
            "another form": other,
            "another scene": strange,
        }[damage]
    )
    assert_same(load_scene(stage, folder=folder), expected)
    assert len(composed) == 2
    assert place.read_bytes() == whole


def test_who_comes_second_waits(stage: Path, tmp_path: Path) -> None:
    """Four processes that begin at once compose the stage once between them."""
    script = (
        "import sys, usd_schemas.reading.scene_cache as c\nfrom pathlib import Path\nkept = c.compose_stage\n"
        "c.compose_stage = lambda path, choices: print('composed') or kept(path, choices)\n"
        "print(c.load_scene(Path(sys.argv[1])).origin)"
    )
    environment = {**os.environ, "FALSEWORK_CACHE": str(tmp_path)}
    runs = [
        subprocess.Popen([sys.executable, "-c", script, str(stage)], stdout=subprocess.PIPE, text=True, env=environment)
        for _ in range(3)
    ]
    said = [line for run in runs for line in run.communicate()[0].split()]
    assert said.count("composed") == 1
    assert len(set(said)) == 2
    assert len(said) == 4


def test_the_cache_is_bounded(
    stage: Path, tmp_path: Path, composed: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What was not used for longest goes when it grows too large."""
    folder = tmp_path / "cache"
    stages = [shutil.copytree(stage.parent, tmp_path / str(number)) / "stage.usda" for number in range(3)]
    for number, path in enumerate(stages):
        path.write_text(path.read_text() + f'def Xform "Number{number}" {{}}\n')
    load_scene(stages[0], folder=folder)
    (first,) = folder.glob("*.scene")
    monkeypatch.setattr(scene_cache, "MOST_BYTES", int(2.5 * first.stat().st_size))
    load_scene(stages[1], folder=folder)
    (second,) = set(folder.glob("*.scene")) - {first}
    os.utime(first, (1, 1))
    os.utime(second, (2, 2))
    load_scene(stages[0], folder=folder)  # used again
    load_scene(stages[2], folder=folder)
    left = set(folder.glob("*.scene"))
    assert len(composed) == 3
    assert len(left) == 2
    assert first in left
    assert {file.stem for file in folder.glob("*.lock")} == {file.stem for file in left}


def test_without_a_place_to_keep_it_the_stage_is_read(
    stage: Path, tmp_path: Path, composed: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A file where the cache should be: no error. The folder follows the environment."""
    (tmp_path / "cache").write_text("")
    assert_same(load_scene(stage, folder=tmp_path / "cache"), read_stage(stage))
    assert len(composed) == 1
    monkeypatch.setenv("FALSEWORK_CACHE", "/somewhere")
    assert cache_folder("scenes") == Path("/somewhere/scenes")
    monkeypatch.delenv("FALSEWORK_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", "/x")
    assert cache_folder("scenes") == Path("/x/falsework/scenes")


def test_pictures_of_a_package(
    stage: Path, tmp_path: Path, composed: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A usdz is drawn with its own pictures, kept like any other stage; a copy that somebody changed is mended."""
    monkeypatch.setenv("FALSEWORK_CACHE", str(tmp_path / "cache"))
    package = tmp_path / "packed" / "stage.usdz"
    package.parent.mkdir()
    monkeypatch.chdir(package.parent)
    assert UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(str(stage)), str(package))
    scene = load_scene(package)
    assert_same(scene, read_stage(package))
    assert_same(load_scene(package), scene)
    assert len(composed) == 1
    assert not any("texture" in line for line in scene.warnings)
    material, dome = scene.materials[2], scene.dome
    assert material.base_texture
    assert dome
    files = [Path(file) for file in (material.base_texture.file, material.detail.macro_file, dome.file)]
    assert [file.read_bytes() for file in files] == [b"a.png", b"macro.png", b"sky.hdr"]
    assert [file.suffix for file in files] == [".png", ".png", ".hdr"]
    files[0].write_bytes(b"painted over")
    assert read_stage(package).origin == scene.origin
    assert files[0].read_bytes() == b"a.png"
    files[0].unlink()
    assert_same(load_scene(package), scene)


def test_what_only_a_composition_can_tell_is_not_kept(tmp_path: Path) -> None:
    """A path that other layers' variables decide, a layer that cannot be read, a file that is not there."""
    body = f'def Mesh "M" {{{SQUARE}}}\ndef "R" (references = @`"${{NAME}}.usda"`@) {{}}\n'
    path = write_stage(tmp_path, body, 'expressionVariables = { string NAME = "a" }')
    write_stage(tmp_path, 'def Sphere "S" {}', 'defaultPrim = "S"', "a.usda")
    assert layer_contents(path) is None
    assert_same(load_scene(path, folder=tmp_path / "cache"), read_stage(path))
    assert not (tmp_path / "cache").exists()
    (tmp_path / "broken.usda").write_text("#usda 1.0\ndef Xform {")
    for wrong in (tmp_path / "broken.usda", tmp_path):
        with pytest.raises(InputError):
            load_scene(wrong, folder=tmp_path / "cache")
    with pytest.raises(MissingError):
        load_scene(tmp_path / "gone.usda", folder=tmp_path / "cache")


def test_arrays_are_known_behind_a_type_alias() -> None:
    """NumPy 2.5 on Python 3.12 and later: `NDArray[float32]` is no `ndarray[...]` but an alias that stands for one."""

    class Alias:
        __value__ = np.ndarray[Any, np.dtype[np.float32]]

    assert is_array(GenericAlias(Alias, (np.float32,)))
    assert is_array(NDArray[np.float32])
    assert not is_array(tuple[int, ...])
    assert not is_array(int)
