"""`falsework sample` and `falsework export` of clouds: from a stage that somebody else wrote to files for others."""

from pathlib import Path

import numpy as np
import pytest

from falsework.cli import main
from recon.cloud import read_cloud
from recon.formats.scan import read_scan
from tests.usd_schemas.stages import write_stage

BODY = """
def Cube "Deck" (prepend apiSchemas = ["SemanticsLabelsAPI:class"]) {
    double size = 1
    token[] semantics:labels:class = ["deck"]
    double3 xformOp:translate = (0, 0, 3)
    float3 xformOp:scale = (12, 4, 1)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
}
def Mesh "Ground" (prepend apiSchemas = ["SemanticsLabelsAPI:class"]) {
    token[] semantics:labels:class = ["background"]
    point3f[] points = [(-40, -40, 0), (40, -40, 0), (40, 40, 0), (-40, 40, 0)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    uniform token subdivisionScheme = "none"
}
def Camera "Eye" {
    double3 xformOp:translate = (0, 0, 30)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give a stage that knows nothing of us but the labels of USD."""
    return write_stage(tmp_path_factory.mktemp("foreign"), BODY)


def run(capsys: pytest.CaptureFixture[str], *words: str | Path) -> tuple[int, str, str]:
    """Run the command line; give exit code and what it printed."""
    with pytest.raises(SystemExit) as caught:
        main([str(word) for word in words])
    printed = capsys.readouterr()
    return int(caught.value.code or 0), printed.out, printed.err


def test_a_mesh_cloud_and_its_exports(stage: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Sampled, written, read back, exported and read again; what there is no camera for is said."""
    words = ("sample", "mesh", stage, "-o", tmp_path / "c", "--points", "900", "--scope", "bridge", "--visible")
    assert run(capsys, *words)[:2] == (0, f"cloud   {tmp_path / 'c'}\n")
    columns = read_cloud(tmp_path / "c").columns
    assert len(columns["coord"]) == 900
    assert (columns["segment"] == 9).all()
    assert columns["coord"][:, 2].min() > 3.49  # the camera is above
    code, said, _ = run(capsys, "export", tmp_path / "c", "--to", "laz", "-o", tmp_path / "laz")
    assert (code, said) == (0, f"export  {tmp_path / 'laz' / 'cloud.laz'}\n")
    scan = read_scan(tmp_path / "laz" / "cloud.laz")
    np.testing.assert_allclose(scan.coord, columns["coord"], rtol=0, atol=0.51e-4)
    code, _, error = run(capsys, "export", tmp_path / "c", "--to", "colmap", "-o", tmp_path / "colmap")
    assert code == 2
    assert "has no cameras" in error
    code, _, error = run(capsys, "export", tmp_path / "laz", "--to", "ply", "-o", tmp_path / "ply")
    assert code == 2
    assert "cloud.json" in error


def test_a_scan(stage: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A tripod where the words say."""
    code, _, _ = run(
        capsys,
        "sample",
        "lidar",
        stage,
        "-o",
        tmp_path / "c",
        "--set",
        "positions=[[0, -9, 1.5]]",
        "--set",
        "angular_step=2",
        "--set",
        "max_range=30",
    )
    assert code == 0
    cloud = read_cloud(tmp_path / "c")
    assert cloud.source == "lidar-terrestrial"
    assert set(cloud.columns["segment"].tolist()) == {0, 9}
    assert cloud.columns["range"].max() <= 30.1


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (("mesh", "STAGE", "--set", "min_view=3"), "Did you mean 'min_views'"),
        (("mesh", "STAGE", "--set", "noise"), "key=value"),
        (("mesh", "STAGE", "--density", "-1"), "falsework: --density: "),
        (("mesh", "STAGE", "--set", "survey=global"), "falsework sample mesh --visible"),
        (("lidar", "absent.usda"), "no such file"),
        (("mesh", "CLIMBING"), "leads out of the allowed folders"),
    ],
)
def test_bad_input_is_one_line(
    stage: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...], reason: str
) -> None:
    """Exit code 2, one line that names file and reason, and nothing written."""
    places = {"STAGE": stage}
    if "CLIMBING" in words:
        write_stage(tmp_path, BODY, name="outside.usda")
        (tmp_path / "scene").mkdir()
        body = 'def "A" (references = @../outside.usda@</Deck>) {}'.replace(" {}", " {\n}")
        places["CLIMBING"] = write_stage(tmp_path / "scene", body)
    code, said, error = run(capsys, "sample", *(places.get(word, word) for word in words), "-o", tmp_path / "c")
    assert (code, said) == (2, "")
    last = [line for line in error.splitlines() if line.startswith("falsework: ")]
    assert len(last) == 1
    assert reason in last[0]
    assert not (tmp_path / "c").exists()
