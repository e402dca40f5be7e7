"""A lens that bends lines by ten per cent costs no labels: photographs and truth bend alike, and the model finds it."""

import shutil
from pathlib import Path

import pytest
from pxr import Sdf, Usd, UsdGeom

from falsework.scenario import scene_seed
from falsework.stages import STAGES
from groundwork.progress import SILENT
from recon.cloud import Cloud, read_cloud
from recon.reconstruct import reconstruct
from tests.conftest import RecordProof
from tests.end_to_end.conftest import Chain

K1 = -0.1


def bend(scene: Path) -> None:
    """Give every camera of a scene a radial distortion, as a user would: in the layer of edits."""
    stage = Usd.Stage.Open(str(scene / "scene.usda"))
    stage.SetEditTarget(next(layer for layer in stage.GetLayerStack() if layer.identifier.endswith("edits/user.usda")))
    for prim in stage.Traverse():
        if prim.IsA(UsdGeom.Camera):
            prim.CreateAttribute("falsework:cal:k1", Sdf.ValueTypeNames.Double).Set(K1)
    stage.Save()


def label_error(cloud: Cloud) -> float:
    """Share of wrong classes among the points on the surface [1]."""
    return 1.0 - float(cloud.statistics["right_class_share"])


def clouds_of(capture: Path, chain: Chain, folder: Path) -> dict[str, Cloud]:
    """Reconstruct a capture sparsely, and densely."""
    folder.mkdir(parents=True)
    reconstruct(capture, folder, chain.scenario.recon.model_copy(update={"mode": "both"}), SILENT)
    return {mode: read_cloud(folder / "cloud" / mode) for mode in ("sparse", "dense")}


@pytest.mark.proof_only
def test_a_bent_lens_costs_no_labels(chain: Chain, tmp_path: Path, record_proof: RecordProof) -> None:
    """With k1 = -0.1 every camera is found, the coefficient comes back, and labels lose less than 0.2 points.

    Sparse points have their labels from the keypoints, wherever the lens put them; dense points are mapped back
    through the lens that structure from motion found.
    """
    scene, shots = tmp_path / "scene", tmp_path / "capture"
    shutil.copytree((chain.out / "scenes" / "0000" / "stage").resolve(), scene)
    for path in (scene, *scene.rglob("*")):
        path.chmod(0o755 if path.is_dir() else 0o644)
    bend(scene)
    shots.mkdir()
    seed = scene_seed(chain.scenario.seed, 0)
    request = {"seed": seed, "survey": "global", "render": chain.scenario.rendering()}
    STAGES["capture"].run(request, {"stage": scene}, shots, SILENT)
    level = clouds_of(chain.out / "scenes" / "0000" / "capture" / "global", chain, tmp_path / "straight")
    for mode, bent in clouds_of(shots, chain, tmp_path / "bent").items():
        straight = level[mode]
        figures = {
            "points_straight": float(len(straight)),
            "points_bent": float(len(bent)),
            "label_error_straight": label_error(straight),
            "label_error_bent": label_error(bent),
            "registered_share_bent": float(bent.statistics["registered_share"]),
            "median_centre_error_m_straight": float(straight.statistics["center_error_median"]),
            "median_centre_error_m_bent": float(bent.statistics["center_error_median"]),
            "k1_found": float(bent.statistics["camera_params"][3]),
        }
        record_proof(f"reconstruction: a lens of k1 = -0.1, {mode}", len(bent.cameras), chain.scenario.seed, figures)
        assert figures["registered_share_bent"] >= 0.95
        assert abs(figures["k1_found"] - K1) < 0.01
        assert figures["points_bent"] > 0.8 * figures["points_straight"]
        assert figures["label_error_bent"] - figures["label_error_straight"] < 0.002
