"""Trips through the real Blender: instances, a sun, cameras, lamps, and a run that goes on from an edited stage."""

from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdLux

from authoring.edits.harvest import Harvest
from authoring.scenes.validate import validate_scene
from falsework.pipeline import run_scenario
from falsework.scenario import load_scenario, scene_seed
from groundwork.progress import SILENT
from recon.cloud import read_cloud
from tests.conftest import RecordProof
from tests.dcc.round_trip import CHAIN, SMALL, Y_UP_CENTIMETERS, Edit, copy_scene, harvest, opinions, small_scene, trip
from usd_schemas.reading.stage_reader import read_stage

pytestmark = pytest.mark.dcc


@pytest.mark.parametrize(
    "options",
    [pytest.param(Y_UP_CENTIMETERS, marks=pytest.mark.proof_only), {"use_instancing": True}],
    ids=["made_real", "as_instances"],
)
def test_native_instances_are_edited_one_by_one(
    options: dict[str, object], tmp_path: Path, record_proof: RecordProof
) -> None:
    """Poles are empties in Blender: one is moved, one deleted, one copied; the others, and all trees, stay."""
    world = {"name": "countryside", "countryside": {"reach": 400, "buildings": 1, "trees": 12, "hedge_bushes": 5}}
    original = small_scene(tmp_path / "original", {**SMALL, "background": world}, 7)
    scene, pole = copy_scene(original, tmp_path / "scene"), "Countryside_Poles_"
    edits: list[Edit] = [
        ("move", f"{pole}003", [2.0, 0.0, 0.5]),
        ("delete", f"{pole}005"),
        ("duplicate", f"{pole}007", [0.0, 3.0, 0.0]),
    ]
    out, _ = trip(original, tmp_path / "out", edits, **options)
    found = harvest(scene, out, remove=True)
    assert found == Harvest(moved=[f"{pole}003"], removed=[f"{pole}005"], added=found.added)
    assert len(found.added) == 2  # wood and metal; the stand-in does not come
    assert {name[: len(pole) + 7]: kind for name, kind in found.added.items()} == {f"{pole}007_001": "pole"}
    assert validate_scene(scene) == []
    before, after = (Usd.Stage.Open(str(one)) for one in (original, scene))
    poles = before.GetPrimAtPath("/World/Background/BackgroundGeom/BackgroundPlants/Countryside_Poles").GetChildren()
    far = 0.0
    for prim in poles:
        if prim.GetName() == f"{pole}005":
            continue
        home = after.GetPrimAtPath(prim.GetPath())
        places = [np.array(UsdGeom.XformCache().GetLocalToWorldTransform(one)) for one in (prim, home)]
        expected = [2.0, 0.0, 0.5] if prim.GetName() == f"{pole}003" else [0.0, 0.0, 0.0]
        far = max(far, float(np.abs(places[1] - places[0] - np.vstack([np.zeros((3, 4)), [*expected, 0.0]])).max()))
    assert far < 1e-4
    way = "as instances" if "use_instancing" in options else "made real"
    record_proof(f"blender: native instances edited one by one, {way}", len(poles), 7, {"apart_m": far})


def test_run_goes_on_from_the_edited_stage(tmp_path: Path, record_proof: RecordProof) -> None:
    """`falsework run` with `[stage] path` gives a labeled cloud of the bridge as it was edited."""
    scene = small_scene(tmp_path / "scene", CHAIN, scene_seed(3, 0))
    out, _ = trip(
        scene,
        tmp_path / "out",
        [
            ("move", "Parapet_000_L", [0.0, 0.0, 1.5]),
            ("add_cube", "Crate", [6.0, 0.0, 7.4], 1.6),
            ("assign_material", "Crate", "Role_AbutmentConcrete", []),
        ],
    )
    assert harvest(scene, out, "wing_wall").moved == ["Parapet_000_L"]
    scenario = tmp_path / "scenario.toml"
    text = 'seed = 3\n[stage]\npath = "scene/scene.usda"\n[render]\nquality = "fast"\n[recon]\nmode = "sparse"\n'
    scenario.write_text(text, encoding="utf-8")
    outcome = run_scenario(load_scenario(scenario), tmp_path / "run", SILENT)
    assert not outcome.failed
    assert not outcome.rejected
    cloud, stage = read_cloud(outcome.clouds[0]), read_stage(scene)
    numbers = {row.path.rsplit("/", 1)[-1]: row.id for row in stage.instances}
    where, what = cloud.columns["coord"], cloud.columns["instance"]
    crate = what == numbers["Crate"]
    assert crate.sum() >= 10
    assert set(cloud.columns["segment"][crate].tolist()) == {1}  # a wing wall is part of an abutment
    reach = np.abs(where[crate] - [6.0, 0.0, 7.4]).max(axis=1)
    assert np.median(reach) == pytest.approx(0.8, abs=0.05)
    figures = {"points_of_the_new_box": int(crate.sum()), "median_half_side_m": float(np.median(reach))}
    record_proof("stage/dcc: a labelled cloud of the edited bridge", len(what), 3, figures)


def test_a_sun_turned_in_blender_comes_home(original: Path, tmp_path: Path) -> None:
    """Into the light that was selected, with the strength that it had; the shadows of the scene follow."""
    scene = copy_scene(original, tmp_path / "scene")
    before = read_stage(scene).sun
    found = harvest(scene, trip(original, tmp_path / "out", [("turn", "Sun", [0.9, 0.0, 1.2])])[0])
    assert found.moved == ["Sun"]
    assert opinions(scene).keys() == {"/World/Environment{light=default}Sun"}
    after = read_stage(scene).sun
    assert before is not None
    assert after is not None
    pole = [np.sin(0.9) * np.sin(1.2), -np.sin(0.9) * np.cos(1.2), np.cos(0.9)]
    np.testing.assert_allclose(after.direction, pole, atol=1e-5)
    np.testing.assert_allclose(after.radiance, before.radiance, rtol=1e-5)
    assert validate_scene(scene) == []


@pytest.mark.parametrize("options", [pytest.param({}, marks=pytest.mark.proof_only), Y_UP_CENTIMETERS])
def test_cameras_and_lamps_made_in_blender_come_home(
    options: dict[str, object], original: Path, tmp_path: Path, record_proof: RecordProof
) -> None:
    """A flight of one pose a frame through the lens that was set, and a spot where it hangs; the survey is no edit."""
    scene = copy_scene(original, tmp_path / "scene")
    images = len(read_stage(original).cameras[0].poses)
    out, _ = trip(
        original,
        tmp_path / "out",
        [
            ("fly", "Drone", 35.0, [2.0, -30.0, 6.0], images),
            ("add_lamp", "Spot", "SPOT", [4.0, 1.0, 9.0]),
        ],
        export_animation=True,
        **options,
    )
    found = harvest(scene, out)
    assert asdict(found) == {**asdict(Harvest()), "cameras": {"Drone": images}, "lights": {"Spot": "SphereLight"}}
    assert validate_scene(scene) == []
    (track,) = [camera for camera in read_stage(scene).cameras if camera.name == "Drone"]
    expected = [[2.0 + step, -30.0, 6.0] for step in range(images)]
    np.testing.assert_allclose(track.poses[:, :3, 3], expected, atol=1e-4)
    np.testing.assert_allclose(track.poses[:, :3, 2], [[0.0, 1.0, 0.0]] * images, atol=1e-5)
    lens = (track.lens.focal_length, track.lens.horizontal_aperture, track.near)
    assert lens == pytest.approx((0.35, 0.36, 0.5), rel=1e-5)
    stage = Usd.Stage.Open(str(scene))
    spot = stage.GetPrimAtPath("/World/Environment/Spot")
    place = np.array(UsdGeom.XformCache().GetLocalToWorldTransform(spot))[3, :3]
    np.testing.assert_allclose(place, [4.0, 1.0, 9.0], atol=1e-4)
    assert spot.HasAPI(UsdLux.ShapingAPI)
    off = float(np.abs(track.poses[:, :3, 3] - expected).max())
    name = f"stage/dcc: a camera animated in Blender, {'centimetres and y up' if options else 'metres and z up'}"
    record_proof(name, images, 7, {"largest_offset_m": off})
