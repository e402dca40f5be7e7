"""A stage that Blender exported becomes a capture with one command, and its truth is what rays say."""

from pathlib import Path

import numpy as np
import pytest

from falsework.cli import main
from render.capture import load_image, read_capture, read_truth
from tests.dcc.blender import export_scene
from usd_schemas.raycast import RayScene

OPTIONS = {
    "plain": {},
    "centimetres, Y up": {
        "convert_scene_units": "CENTIMETERS",
        "convert_orientation": True,
        "export_global_forward_selection": "NEGATIVE_Z",
        "export_global_up_selection": "Y",
    },
    "instances": {"use_instancing": True},
}


@pytest.mark.dcc
@pytest.mark.parametrize("name", OPTIONS)
def test_blender_export_renders(name: str, tmp_path: Path) -> None:
    """No product, no labels: every camera at the default size, everything background, depth as rays measure it."""
    file, _ = export_scene(tmp_path, "scene", **OPTIONS[name])
    with pytest.raises(SystemExit) as caught:
        main(["render", str(file), "-o", str(tmp_path / "out"), "--quality", "fast"])
    assert caught.value.code == 0
    (folder,) = [path for path in (tmp_path / "out").iterdir() if path.is_dir()]
    capture = read_capture(folder)
    truth = read_truth(capture)
    assert truth is not None
    assert load_image(capture, 0).std() > 5
    assert set(np.unique(truth.semantic(0))) == {0}
    corners, ids, _ = truth.surface()
    camera, pose = truth.camera, truth.poses[0]
    column, line = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
    rays = np.stack([(column - camera.cx) / camera.fx, (line - camera.cy) / camera.fy, np.ones_like(line)], axis=-1)
    directions = rays.reshape(-1, 3) @ pose[:3, :3].T
    cast, _, hit = RayScene(corners, ids).cast(np.broadcast_to(pose[:3, 3], directions.shape), directions)
    depth = truth.depth(0).ravel()
    same = hit == truth.instance(0).ravel()
    assert same.mean() > 0.995
    seen = same & np.isfinite(cast)
    assert seen.mean() > 0.02
    assert np.mean(np.abs(depth[seen] - cast[seen]) < 1e-3 + 1e-4 * cast[seen]) > 0.999
