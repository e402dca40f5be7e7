"""The whole scene: the same bytes wherever it is authored, sound in every variant, each layer with its own stream."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdShade

from authoring.layers.geometry import BRIDGE
from authoring.scene import author_scene
from authoring.scenes.manifest import changed_files
from authoring.scenes.validate import validate_scene
from authoring.settings import AuthoringSettings
from groundwork.errors import InputError
from groundwork.files import read_json
from groundwork.progress import SILENT
from groundwork.settings import parse_settings
from tests.conftest import Count, RecordProof
from usd_schemas import tokens
from usd_schemas.pinhole import USD_FROM_CAMERA
from usd_schemas.reading.stage_reader import read_stage

SEED = 7
SMALL: dict[str, object] = {
    "look": {"texels": 256},
    "light": {"sky_height": 64},
    "site": {"half_width": 40, "run_out": 40, "scatter": {"tufts": 100, "stones": 40, "shrubs": 20, "reeds": 20}},
    "background": {"countryside": {"reach": 400, "buildings": 2, "trees": 20, "hedge_bushes": 10}},
}
PLAIN: dict[str, object] = {
    "bridge": {"family": "beam", "service": "road", "beam": {"spans": [12.0, 14.0]}},
    "site": {
        **{"half_width": 40, "run_out": 40, "fine_spacing": 2.0, "coarse_spacing": 8.0},
        "scatter": {"tufts": 100, "stones": 40, "shrubs": 20, "reeds": 20},
    },
    "survey": [{"kind": "global", "images": 8, "spacing": 30.0}],
}
EARLY = ("site", "bridge/geometry.usdc", "bridge/semantics.usda", "bridge/bridge.usda", "surveys", "render.usda")

AUTHOR = """
import json, sys
from pathlib import Path
from authoring.scene import author_scene
from authoring.settings import AuthoringSettings
from groundwork.progress import SILENT
author_scene(AuthoringSettings.model_validate(json.loads(sys.argv[2])), int(sys.argv[3]), Path(sys.argv[1]), SILENT)
"""


@pytest.fixture(scope="module")
def small(proof_count: Count) -> dict[str, object]:
    """Settings of a scene with small textures: of a drawn bridge with --proof, else of a short one and few cameras."""
    return SMALL if proof_count(0, 1) else {**SMALL, **PLAIN}


@pytest.fixture(scope="module")
def scene(small: dict[str, object], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Author one scene with small textures."""
    return _author(tmp_path_factory.mktemp("scene"), small)


CHANGES: dict[str, dict[str, str]] = {
    "hash seed": {"PYTHONHASHSEED": "4711"},
    "CPU features": {"NPY_DISABLE_CPU_FEATURES": "", "NUMBA_CPU_NAME": "generic"},  # which numpy may lack, see below
    "worker count": {"PXR_WORK_THREAD_LIMIT": "1", "NUMBA_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},
}


def test_another_process_writes_the_same_bytes(
    scene: Path, small: dict[str, object], tmp_path: Path, record_proof: RecordProof
) -> None:
    """Another folder, process, hash seed, worker count and set of vector instructions change no byte of any file."""
    changes = {name: text for one in CHANGES.values() for name, text in one.items()}
    files = _files(_author_elsewhere(tmp_path, small, changes))
    unequal = len(set(files.items()) ^ set(_files(scene).items()))
    assert unequal == 0
    name = "stage/determinism: bytes across folder, process, hash seed, worker count and CPU features"
    record_proof(name, len(files), SEED, {"unequal_files": unequal})


@pytest.mark.proof_only
@pytest.mark.parametrize("change", [*CHANGES, "folder and process"])
def test_each_of_them_alone_writes_the_same_bytes(
    scene: Path, small: dict[str, object], tmp_path: Path, change: str, record_proof: RecordProof
) -> None:
    """Each of them by itself, so that no two of them make up for one another."""
    files = _files(_author_elsewhere(tmp_path / "an other/folder", small, CHANGES.get(change, {})))
    unequal = len(set(files.items()) ^ set(_files(scene).items()))
    assert unequal == 0
    record_proof(f"stage/determinism: bytes across {change}", len(files), SEED, {"unequal_files": unequal})


def test_scene_is_sound(scene: Path) -> None:
    """No findings in any variant, the renderer reads it without a warning, and the manifest agrees with the files."""
    assert validate_scene(scene / "scene.usda") == []
    assert read_stage(scene / "scene.usda").warnings == ()
    assert changed_files(scene) == []


def test_layers_lie_where_the_design_says(scene: Path) -> None:
    """The folder, the composed hierarchy and the choices are those of the design."""
    for name in (
        "edits/user.usda",
        "render.usda",
        "surveys/surveys.usda",
        "surveys/global.usdc",
        "lighting.usda",
        "site/site.usda",
        "bridge/bridge.usda",
        "bridge/payload.usda",
        "bridge/geometry.usdc",
        "bridge/semantics.usda",
        "bridge/looks/weathered/look.usda",
        "bridge/looks/clean/look.usda",
        "background/countryside/countryside.usda",
        "manifest.json",
    ):
        assert (scene / name).is_file(), name
    stage = Usd.Stage.Open(str(scene / "scene.usda"))
    children = [prim.GetName() for prim in stage.GetPrimAtPath(tokens.WORLD).GetChildren()]
    assert sorted(children) == ["Background", "Bridge", "Environment", "Site", "Surveys"]
    assert [prim.GetName() for prim in stage.GetPrimAtPath(tokens.BRIDGE).GetChildren()] == [
        "BridgeGeom",
        "BridgeLooks",
    ]
    assert stage.GetPrimAtPath(tokens.BRIDGE).GetVariantSet("look").GetVariantNames() == ["clean", "weathered"]
    background = stage.GetPrimAtPath(tokens.BACKGROUND).GetVariantSet("background")
    assert background.GetVariantNames() == ["countryside", "none"]
    assert background.GetVariantSelection() == "countryside"
    assert stage.GetMetadata("renderSettingsPrimPath") == tokens.RENDER_SETTINGS


def test_no_layer_knows_where_it_was_made(scene: Path, small: dict[str, object]) -> None:
    """No file holds the folder's path; the manifest holds the recipe."""
    needle = str(scene).encode()
    assert [path for path in scene.rglob("*") if path.is_file() and needle in path.read_bytes()] == []
    manifest = read_json(scene / "manifest.json")
    assert manifest["seed"] == SEED
    told = parse_settings(AuthoringSettings, manifest["settings"], "manifest")
    assert told == AuthoringSettings.model_validate(small)


def test_every_role_is_filled_in_both_looks(scene: Path) -> None:
    """Each material that geometry binds has a surface, whichever look is selected, and another one in each."""
    stage = Usd.Stage.Open(str(scene / "scene.usda"))
    looks = stage.GetPrimAtPath(tokens.BRIDGE).GetVariantSet("look")
    files: dict[str, set[str]] = {}
    for look in looks.GetVariantNames():
        looks.SetVariantSelection(look)
        roles = stage.GetPrimAtPath(f"{tokens.WORLD}{BRIDGE.looks}").GetChildren()
        assert roles
        for role in roles:
            surface, _, _ = UsdShade.Material(role).ComputeSurfaceSource("")
            assert surface, (look, role)
            for texture in Usd.PrimRange(role):
                file = texture.GetAttribute("inputs:file")
                if file:
                    files.setdefault(look, set()).add(file.Get().resolvedPath)
    assert files["clean"]
    assert not files["clean"] & files["weathered"]


@pytest.mark.parametrize(
    ("change", "stays"),
    [
        (
            {"look": {"texels": 256, "name": "clean"}},
            (*EARLY[:3], *EARLY[4:], "background", "lighting.usda", "textures"),
        ),
        ({"background": {"name": "none"}}, (*EARLY, "bridge/looks", "lighting.usda", "textures")),
        (
            {
                "light": {"sky_height": 64, "date": "2024-12-21T10:00"},
                "survey": [{"kind": "global", "images": 20, "spacing": 12.0}],
                "background": {"name": "none"},
            },
            ("site", "bridge"),
        ),
    ],
)
def test_sections_draw_alone(
    scene: Path, small: dict[str, object], tmp_path: Path, change: dict[str, object], stays: tuple[str, ...]
) -> None:
    """Another look, background, light or survey leaves the files of all other layers byte-equal."""
    before, after = _files(scene), _files(_author(tmp_path, {**small, **change}))
    assert before != after
    kept = {name for name in before if any(name == stem or name.startswith(f"{stem}/") for stem in stays)}
    assert kept
    assert {name: before[name] for name in kept} == {name: after.get(name) for name in kept}


def test_cameras_compose_to_what_the_renderer_reads(scene: Path) -> None:
    """Through every arc of the scene, a camera's matrix is a rigid pose, one for each code of the stage's range."""
    stage = Usd.Stage.Open(str(scene / "scene.usda"))
    camera = UsdGeom.Camera(stage.GetPrimAtPath(f"{tokens.SURVEYS}/global/global_Camera"))
    (operation,) = camera.GetOrderedXformOps()
    codes = operation.GetTimeSamples()
    assert codes == [float(code) for code in range(int(stage.GetEndTimeCode()) + 1)]
    for code in codes:
        pose = camera.ComputeLocalToWorldTransform(code)
        turn = pose.ExtractRotationMatrix()
        assert abs(turn.GetDeterminant() - 1) < 1e-8
        down = USD_FROM_CAMERA[1, 1] * turn.GetRow(1)[2]
        assert down < 0  # the image's down is the world's down


def test_unknown_names_are_bad_input(tmp_path: Path) -> None:
    """A look or background that nobody knows is named with those that are known, before any work."""
    with pytest.raises(InputError, match="weathered"):
        parse_settings(AuthoringSettings, {"look": {"name": "shiny"}}, "scenario.toml")
    with pytest.raises(InputError, match="countryside"):
        _author(tmp_path, {"background": {"name": "shiny"}})
    assert not list(tmp_path.iterdir())


def test_two_surveys_need_two_ids() -> None:
    """The same id twice is bad input, said in one line."""
    with pytest.raises(InputError, match="same id"):
        parse_settings(AuthoringSettings, {"survey": [{"kind": "global"}, {"kind": "global"}]}, "scenario.toml")


def _author(folder: Path, settings: dict[str, object]) -> Path:
    author_scene(AuthoringSettings.model_validate(settings), SEED, folder, SILENT)
    return folder


def _author_elsewhere(folder: Path, scenario: dict[str, object], change: dict[str, str]) -> Path:
    """Author in a process of its own, with some of its environment changed."""
    folder.mkdir(parents=True, exist_ok=True)
    known = {name: text for name, text in os.environ.items() if name != "PYTHONHASHSEED"}
    environment = {**known, **change}
    if "NPY_DISABLE_CPU_FEATURES" in change:
        environment["NPY_DISABLE_CPU_FEATURES"] = _slow_numpy()
    settings = AuthoringSettings.model_validate(scenario).model_dump_json()
    command = [sys.executable, "-c", AUTHOR, str(folder), settings, str(SEED)]
    subprocess.run(command, env=environment, check=True, cwd=Path(__file__).parents[2])
    return folder


def _files(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def _slow_numpy() -> str:
    """Name the vector instructions that numpy may do without on this machine."""
    features = np.show_config(mode="dicts")["SIMD Extensions"]
    return " ".join(features.get("found", []))
