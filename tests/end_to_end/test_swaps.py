"""Swaps, through the renderer: another look, background or light changes what it should, and no bit of the rest."""

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from pxr import Usd

from authoring.exchange.bake_down import bake_down
from authoring.looks.material import MaterialRecipe, author_material
from authoring.variants.add import set_choices
from groundwork.files import MANIFEST
from groundwork.progress import SILENT
from render.capture import TRUTH
from render.frames import render_stage
from render.settings import RenderSettings, SensorSettings
from tests.authoring.small_scene import SEED, file_bytes, write_small_scene
from tests.conftest import Count, RecordProof
from tests.end_to_end.conftest import VARIANTS, Varied
from tests.render.prepared_here import prepared_here
from usd_schemas import tokens
from usd_schemas.reading.stage_reader import read_stage

IDEAL = RenderSettings(
    quality="fast", shadow_size=512, haze_distance=1e9, sensor=SensorSettings(noise=False, image_format="png")
)
VISIBLE = 10  # of 255

Images = dict[str, NDArray[Any]]


@pytest.fixture(scope="module", autouse=True)
def _prepared() -> Iterator[None]:
    """Render without a child for each flight."""
    with prepared_here():
        yield


@pytest.fixture(scope="module")
def scene(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory, proof_count: Count) -> Path:
    """Give a scene that offers two looks and two backgrounds: that of the shared run, or a larger flight for proof."""
    folder = tmp_path_factory.mktemp("swaps")
    if not proof_count(0, 1):
        varied: Varied = request.getfixturevalue("varied")
        stored, sealed = varied.out / "scenes/0000/stage", shutil.ignore_patterns(MANIFEST)
        shutil.copytree(stored, folder / "scene", ignore=sealed, copy_function=shutil.copyfile)
        return folder / "scene/scene.usda"
    flight = {"kind": "global", "images": 60, "spacing": 4, "width": 480, "height": 360}
    return write_small_scene(folder, variants=VARIANTS, survey=[flight])


@pytest.fixture(scope="module")
def base(scene: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Render the scene as it is."""
    return _shoot(scene, tmp_path_factory.mktemp("base"))


@pytest.fixture(scope="module")
def country(scene: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Choose the other background in a copy, and render it; give the copy and the capture."""
    folder = tmp_path_factory.mktemp("country")
    root = _copy(scene, folder, background="countryside")
    return root, _shoot(root, folder / "capture")


def test_look_changes_rgb_alone(scene: Path, base: Path, tmp_path: Path, record_proof: RecordProof) -> None:
    """The bridge as it was when it was new: all truth byte-equal, nearly all of the bridge's pixels changed."""
    after = _shoot(_copy(scene, tmp_path, look="clean"), tmp_path / "capture")
    assert _truth(base) == _truth(after)
    share = _changed(base, after)
    assert share > 0.8
    record_proof("stage/swap: a cleaner look changes rgb alone", len(_names(base)), SEED, {"changed_share": share})


def test_own_look_changes_rgb_alone(scene: Path, base: Path, tmp_path: Path, record_proof: RecordProof) -> None:
    """A look of the user's in other colors: all truth byte-equal, nearly all of the bridge's pixels changed."""
    stage = Usd.Stage.CreateInMemory()
    stage.SetDefaultPrim(stage.DefinePrim("/Mine", "Scope"))
    for role in tokens.ROLES:
        author_material(stage, f"/Mine/{role}", MaterialRecipe(role, color=(0.5, 0.16, 0.08)))
    stage.GetRootLayer().Export(str(tmp_path / "brick_red.usda"))  # not atomic: a test's own file
    after = _shoot(_copy(scene, tmp_path, look=str(tmp_path / "brick_red.usda")), tmp_path / "capture")
    assert _truth(base) == _truth(after)
    share = _changed(base, after)
    assert share > 0.8
    record_proof("stage/swap: the user's look changes rgb alone", len(_names(base)), SEED, {"changed_share": share})


def test_one_png_changes_rgb_alone(scene: Path, base: Path, tmp_path: Path, record_proof: RecordProof) -> None:
    """One texture file replaced by hand: all truth byte-equal, and most of the bridge's pixels another color."""
    root = _copy(scene, tmp_path)
    file = root.parent / "bridge/looks/weathered/textures/macro.png"
    picture = cv2.imread(str(file))
    assert picture is not None
    cv2.imwrite(str(file), (picture * np.array([0.4, 0.8, 1.0])).astype(np.uint8))
    after = _shoot(root, tmp_path / "capture")
    assert _truth(base) == _truth(after)
    share = _changed(base, after)
    assert share > 0.8
    record_proof("stage/swap: one png changes rgb alone", len(_names(base)), SEED, {"changed_share": share})


def test_light_changes_rgb_alone(scene: Path, base: Path, tmp_path: Path, record_proof: RecordProof) -> None:
    """Another light: all truth byte-equal; the photographs are others."""
    after = _shoot(_copy(scene, tmp_path, light="2024-12-21T10:00"), tmp_path / "capture")
    assert _truth(base) == _truth(after)
    assert all((base / name).read_bytes() != (after / name).read_bytes() for name in _names(base))
    share = _changed(base, after)
    record_proof("stage/swap: light changes rgb alone", len(_names(base)), SEED, {"changed_share": share})


def test_background_leaves_the_bridge(
    scene: Path, base: Path, country: tuple[Path, Path], record_proof: RecordProof
) -> None:
    """Another background: files of bridge, site and surveys, and depth and labels on the bridge, stay to the bit."""
    root, after = country
    kept = ("bridge/", "site/", "surveys/", "lights/", "lighting.usda", "render.usda", "edits/")
    before, later = (
        {name: data for name, data in file_bytes(one.parent).items() if name.startswith(kept)} for one in (scene, root)
    )
    assert before == later
    assert (base / TRUTH / "poses.json").read_bytes() == (after / TRUTH / "poses.json").read_bytes()
    assert (base / "cameras.json").read_bytes() == (after / "cameras.json").read_bytes()
    depth, ids, classes = (_images(base, kind) for kind in ("depth", "instance", "semantic"))
    depth_after, ids_after, classes_after = (_images(after, kind) for kind in ("depth", "instance", "semantic"))
    compared = unequal = 0
    for name, on_bridge in classes.items():
        both = (on_bridge > 0) & (classes_after[name] > 0)
        compared += int(both.sum())
        pairs = ((depth[name], depth_after[name]), (ids[name], ids_after[name]), (on_bridge, classes_after[name]))
        unequal += sum(int((one[both] != two[both]).sum()) for one, two in pairs)
    assert unequal == 0
    assert compared > 1000
    assert any((depth[name] != depth_after[name]).any() for name in depth)
    record_proof("stage/swap: background leaves the bridge", compared, SEED, {"unequal_pixels": unequal})


def test_baked_scene_renders_alike(
    country: tuple[Path, Path], tmp_path: Path, proof_count: Count, record_proof: RecordProof
) -> None:
    """Burnt into plain textures, bridge, site and background have the same depth and nearly the same colors."""
    scene, before = country
    (tmp_path / "baked").mkdir()
    lines: list[str] = []
    root = bake_down(scene, tmp_path / "baked", proof_count(128, 4096), lines.append)
    assert lines == []
    flat = read_stage(root)
    assert not [one.name for one in flat.materials if one.detail.file or one.detail.macro_file]
    after = _shoot(root, tmp_path / "capture")
    depth, depth_after = _images(before, "depth"), _images(after, "depth")
    unequal = sum(int((depth[name] != depth_after[name]).sum()) for name in depth)
    assert unequal == 0
    owners = {row.id: row.path.split("/")[2] for row in read_stage(scene).instances}
    medians = {}
    for part in ("Bridge", "Site", "Background"):
        ours = [number for number, owner in owners.items() if owner == part]
        shown = {name: np.isin(ids, ours) for name, ids in _images(before, "instance").items()}
        pairs = [(one[shown[name]].astype(float), two[shown[name]]) for name, one, two in _pairs(before, after)]
        one, two = (np.concatenate(side) for side in zip(*pairs, strict=True))
        assert len(one) > 1000
        medians[f"{part.lower()}_median_of_255"] = float(np.median(np.abs(one - two)))
        np.testing.assert_allclose(two.mean(axis=0), one.mean(axis=0), atol=5)
        np.testing.assert_allclose(two.std(axis=0), one.std(axis=0), rtol=0.15)
    assert max(medians.values()) <= 6
    record_proof("stage/bake: a baked scene renders alike", len(depth), SEED, {"unequal_depths": unequal, **medians})


def _copy(scene: Path, place: Path, **choices: str) -> Path:
    """Copy a scene and choose in it."""
    shutil.copytree(scene.parent, place / "scene")
    if choices:
        set_choices(place / "scene/scene.usda", choices, lambda line: None)
    return place / "scene/scene.usda"


def _shoot(scene: Path, folder: Path) -> Path:
    folder.mkdir(exist_ok=True)
    render_stage(scene, folder, IDEAL, SEED, SILENT)
    return folder


def _truth(capture: Path) -> dict[str, bytes]:
    """Everything but the photographs: labels, ids, depth, poses, and the cameras as the drone knows them."""
    files = {name: data for name, data in file_bytes(capture / TRUTH).items() if name != "render.json"}  # its exposure
    assert {name.partition("/")[0] for name in files} >= {"depth", "semantic", "instance", "poses.json"}
    return {**files, "cameras.json": (capture / "cameras.json").read_bytes()}


def _names(capture: Path) -> list[str]:
    return sorted(path.relative_to(capture).as_posix() for path in (capture / "images").iterdir())


def _images(capture: Path, kind: str) -> Images:
    folder = capture / TRUTH / kind
    return {path.stem: np.asarray(cv2.imread(str(path), cv2.IMREAD_UNCHANGED)) for path in sorted(folder.iterdir())}


def _pairs(one: Path, two: Path) -> list[tuple[str, NDArray[Any], NDArray[Any]]]:
    return [
        (Path(name).stem, np.asarray(cv2.imread(str(one / name))), np.asarray(cv2.imread(str(two / name))))
        for name in _names(one)
    ]


def _changed(one: Path, two: Path) -> float:
    """Share of the bridge's pixels that differ visibly in at least one channel."""
    classes = _images(one, "semantic")
    visible = [
        (np.abs(before.astype(int) - after).max(axis=-1) > VISIBLE)[classes[name] > 0]
        for name, before, after in _pairs(one, two)
    ]
    return float(np.mean(np.concatenate(visible)))
