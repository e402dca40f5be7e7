"""What NVIDIA's validator for USD, `usd-validation-nvidia[usd]` on PyPI, says of a scene, in every variant.

It brings requirements that USD's own validators lack. It is run as a program of another virtual environment:
`FALSEWORK_USD_VALIDATE=/there/bin/nvidia_usd_validate`, or where `PATH` has it; without it these tests are skipped.
"""

import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.authoring.small_scene import SEED
from tests.conftest import RecordProof
from usd_schemas import tokens

PROGRAM = os.environ.get("FALSEWORK_USD_VALIDATE", "") or shutil.which("nvidia_usd_validate") or ""
# UsdRender's prims stand beside the world, so that a reference to the world does not bring its render settings; and
# two covers of the ground may meet in a point, where the validator wants a hole or a doubled vertex, and warns of both.
# Leaves are two sheets back to back with the normals of the crown: the products of normals and faces, whose sum the
# validator wants to be positive, add up to 0, and rounding gives the sign.
ACCEPTED = (
    ("DefaultPrimChecker", tokens.RENDER),
    ("ManifoldChecker", f"{tokens.SITE}/SiteGeom/SiteGround"),
    ("ManifoldChecker", f"{tokens.BACKGROUND}/BackgroundGeom/BackgroundGround"),
    ("NormalsWindingsChecker", f"{tokens.SITE}/SiteGeom/SitePlants"),
)

pytestmark = pytest.mark.skipif(not PROGRAM, reason="no nvidia_usd_validate (usd-validation-nvidia) is installed")


def _findings(scene: Path, report: Path) -> list[tuple[str, str, str]]:
    """Run it: rule, prim and message of each finding that is not accepted."""
    command = [PROGRAM, str(scene), "--variants", "--json-output", str(report)]
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "PXR"))}
    subprocess.run(command, check=False, capture_output=True, env=environment, timeout=300)
    found = [
        (rule["rule"]["name"], (issue.get("at") or {}).get("path", ""), issue["message"])
        for rule in json.loads(report.read_text())["rules"]
        for issue in rule.get("issues", ())
    ]
    return [row for row in found if not any(row[0] == rule and row[1].startswith(at) for rule, at in ACCEPTED)]


def test_nothing_to_complain_of(stored_scene: Path, tmp_path: Path, record_proof: RecordProof) -> None:
    """A scene as it is authored, every look and background of it, has no finding but the accepted ones."""
    found = _findings(stored_scene, tmp_path / "report.json")
    assert found == []
    record_proof("stage/nvidia: findings beside the accepted", 1, SEED, {"findings": len(found)})


def test_a_lost_texture_is_found(own_scene: Path, tmp_path: Path) -> None:
    """The check can fail: one file fewer, and it is named."""
    (own_scene.parent / "bridge/looks/clean/textures/macro.png").unlink()
    assert any("macro.png" in message for _, _, message in _findings(own_scene, tmp_path / "report.json"))
