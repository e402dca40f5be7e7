"""`falsework preview`: the whole bridge is in the picture with nothing in the way, and the file is guarded."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import tomli_w

from falsework.cli import main
from falsework.gallery.preview import signed_png
from falsework.gallery.viewpoint import VIEWS, best_view, subject_of
from groundwork.output.file import is_signed
from render.images.image_files import encode_png
from tests.authoring.small_scene import SMALL
from tests.render.scenes import SceneBuilder, placed
from usd_schemas.flat_scene import FlatScene, world_triangles
from usd_schemas.pinhole import Pinhole, project

CAMERA = Pinhole(320, 180, 284.0, 284.0, 160.0, 90.0)
BRIDGE, LAND, WALL = 1, 2, 3
SIGNED = b"made by falsework"


def _scene(wall_side: float) -> FlatScene:
    """A slab of 60 m on two walls, askew in plan, and a high wall along one side of it."""
    builder = SceneBuilder()
    turn = 0.4
    ahead, aside = np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)])
    builder.add_box(placed((0.0, 0.0, 8.0), (60.0, 10.0, 1.2), turn), BRIDGE, 9)
    for end in (-25.0, 25.0):
        builder.add_box(placed((end * ahead[0], end * ahead[1], 3.0), (2.0, 8.0, 10.0), turn), BRIDGE, 8)
    builder.add_box(placed((0.0, 0.0, -0.5), (900.0, 900.0, 1.0)), LAND, 0)
    place = wall_side * 25.0 * aside
    builder.add_box(placed((place[0], place[1], 20.0), (400.0, 1.0, 40.0), turn), WALL, 0)
    scene = builder.build(np.eye(4)[None], CAMERA)
    kinds = {BRIDGE: "deck_slab", LAND: "ground", WALL: "building"}
    rows = (replace(row, base_class=row.class_name, component=kinds[row.id]) for row in scene.instances)
    return replace(scene, instances=tuple({row.id: row for row in rows}.values()))


@pytest.mark.parametrize("view", sorted(VIEWS))
@pytest.mark.parametrize("wall", [1.0, -1.0])
def test_the_whole_bridge_is_seen_from_its_free_side(view: str, wall: float) -> None:
    """Every corner of the bridge lies in the frame, on the side without the wall, and the horizon is level."""
    scene = _scene(wall)
    pose = best_view(scene, CAMERA, view)
    corners, ids, _ = world_triangles(scene)
    points = corners[ids == BRIDGE].reshape(-1, 3)
    points = points[points[:, 2] > 0.0]
    pixels, depth = project(points, CAMERA, pose)
    assert (depth > 0.0).all()
    assert ((pixels > 0.0) & (pixels < [CAMERA.width, CAMERA.height])).all()
    assert pixels[:, 0].max() - pixels[:, 0].min() > 0.6 * CAMERA.width  # and no further away than that needs
    assert np.sign(subject_side(scene, pose)) == -wall
    assert abs(pose[2, 0]) < 1e-9
    if view == "ground":
        assert pose[2, 3] == pytest.approx(1.7, abs=1e-4)


def subject_side(scene: FlatScene, pose: np.ndarray) -> float:
    """Find how far to the left of the bridge the eye is [m]."""
    aside = np.array([-np.sin(0.4), np.cos(0.4)])
    assert abs(abs(float(subject_of(scene).square @ aside)) - 1.0) < 1e-3  # it finds the bridge's direction by itself
    return float(pose[:2, 3] @ aside)


def test_a_signed_picture_is_the_same_picture(tmp_path: Path) -> None:
    """A decoder reads the same pixels, and the file is known as ours."""
    pixels = np.random.default_rng(7).integers(0, 256, (40, 60, 3), np.uint8)
    plain, file = encode_png(pixels), tmp_path / "picture.png"
    assert SIGNED not in plain
    file.write_bytes(signed_png(plain))
    assert is_signed(file)
    image = cv2.imread(str(file))
    assert image is not None
    np.testing.assert_array_equal(image[..., ::-1], pixels)


def _preview(capsys: pytest.CaptureFixture[str], *words: str | Path) -> tuple[int, str]:
    with pytest.raises(SystemExit) as caught:
        main(["preview", *(str(word) for word in words)])
    return int(caught.value.code or 0), capsys.readouterr().err


def test_the_verb_writes_one_picture_and_refuses_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A real small scene takes the place of an earlier picture; bad words and foreign files change nothing."""
    scenario, picture = tmp_path / "small.toml", tmp_path / "new" / "picture.png"
    scenario.write_text(tomli_w.dumps({"seed": 7, **SMALL}))
    picture.parent.mkdir()
    picture.write_bytes(signed_png(encode_png(np.zeros((4, 4, 3), np.uint8))))  # of an earlier call
    words = (scenario, "-o", picture, "--width", "160", "--height", "96", "--quality", "fast")
    assert _preview(capsys, *words)[0] == 0
    first = picture.read_bytes()
    image = cv2.imread(str(picture))
    assert image is not None
    assert image.shape == (96, 160, 3)
    assert image.std() > 15.0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["new", "small.toml"]
    other = tmp_path / "holiday.png"
    other.write_bytes(encode_png(np.zeros((4, 4, 3), np.uint8)))
    for wrong, said in (
        ((scenario, "-o", other), "did not write"),
        ((scenario, "-o", tmp_path / "a.jpg"), "ends in .png"),
        ((scenario, "-o", picture, "--width", "9"), "--width"),
        ((scenario, "-o", picture, "--scene", "1"), "0 to 0"),
        ((tmp_path / "none.toml", "-o", picture), "none.toml"),
    ):
        code, err = _preview(capsys, *wrong)
        assert code == 2
        assert said in err
        assert err.count("\n") == 1
    assert picture.read_bytes() == first
