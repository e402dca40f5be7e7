"""What `reconstruct` and `report` say of photographs without truth: placed by control points, by GPS, by neither."""

import html
import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from falsework.cli import main
from recon.photos.photos import open_photographs
from tests.recon.conftest import CAMERA
from usd_schemas.pinhole import project

CORNERS = np.array([[-2.0, 5, 0.5], [2, 5, 0.5], [2, 5, 3], [-2, 5, 3], [0, 1.5, 0], [1, 2.5, 0]])
AWAY = np.array([1000.0, 2000.0, 0.0])  # [m] the corners as the surveyor's system has them


@pytest.fixture
def bare(plane_capture: Path, tmp_path: Path) -> Path:
    """Give the photographs of the planes without their truth, with the GPS of each."""
    return Path(shutil.copytree(plane_capture, tmp_path / "bare", ignore=shutil.ignore_patterns("truth")))


def marks(capture: Path) -> list[tuple[int, str, NDArray[np.float64]]]:
    """Find the corners in the photographs: number of the corner, name of the image, pixel [px], shape (2,)."""
    told = json.loads((capture / "truth/poses.json").read_text())["poses"]
    found = []
    for number, corner in enumerate(CORNERS):
        for row in told:
            uv, depth = project(corner[None], CAMERA, np.array(row["camera_to_world"]))
            if depth[0] > 0 and (uv[0] > 0).all() and (uv[0] < [CAMERA.width, CAMERA.height]).all():
                found.append((number, row["name"], uv[0]))
    return found


def as_list(capture: Path) -> str:
    """Write the corners as OpenDroneMap does."""
    rows = [(CORNERS[number] + AWAY, uv, image, f"C{number}") for number, image, uv in marks(capture)]
    lines = [" ".join(map(str, [*place, *uv, f"{image}.jpg", name])) for place, uv, image, name in rows]
    return "\n".join(["LOCAL", *lines])


def as_tables(capture: Path) -> str:
    """Write the corners as Metashape does, with a bar that is said 2 cm too long."""
    places = [f"C{k},{','.join(map(str, corner + AWAY))},0.01" for k, corner in enumerate(CORNERS)]
    rows = [f"{image},C{number},{uv[0]},{uv[1]}" for number, image, uv in marks(capture)]
    heads = ("#Label,X/Easting,Y/Northing,Z/Altitude,Accuracy_(m)", "#Camera,Label,x_px,y_px", "#Label,Distance_(m)")
    return "\n".join([heads[0], *places, heads[1], *rows, heads[2], "C0_C1,4.02"])


def said(capsys: pytest.CaptureFixture[str], *words: str | Path) -> str:
    """Run the command; give all that it printed."""
    with pytest.raises(SystemExit) as caught:
        main([str(word) for word in words])
    printed = capsys.readouterr()
    assert not caught.value.code, printed.err
    return printed.out + printed.err


def text_of(page: Path) -> str:
    """Read a page without its elements and scripts."""
    body = re.sub(r"(?s)<script.*?</script>|<style.*?</style>", "", page.read_text(encoding="utf-8"))
    return " ".join(html.unescape(re.sub(r"<[^>]+>", " ", body)).split())


@pytest.mark.usefixtures("no_children")
@pytest.mark.parametrize("form", [as_list, as_tables])
def test_residuals_of_control_stand_in_verdict_and_page(
    form: object, bare: Path, plane_capture: Path, plane_cloud: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Both forms of a file of control points: every point and the bar, in the last line, in cloud.json, in the page."""
    file, cloud, page = tmp_path / "control.txt", tmp_path / "cloud", tmp_path / "page.html"
    file.write_text(as_list(plane_capture) if form is as_list else as_tables(plane_capture))
    out = said(capsys, "reconstruct", bare, "-o", cloud, "--model", plane_cloud, "--mode", "sparse", "--gcp", file)
    assert re.search(r"aligned to 6 control points \(0\.00\d m rms\), scale ±0\.\d+ %, tilt ±0\.\d+°", out), out
    stored = json.loads((cloud / "cloud.json").read_text())["alignment"]
    assert [row["name"] for row in stored["control_points"]] == [f"C{k}" for k in range(6)]
    said(capsys, "report", cloud, "-o", page)
    text = text_of(page)
    for row in stored["control_points"]:
        assert f"control point {row['name']} off by {row['distance']:.3f} m" in text
    assert text.count("scale bar C0 to C1 off by -0.0") == (form is as_tables)
    for name in ("scale", "tilt", "heading", "place"):
        assert f"error of {name}, 95 % below" in text
    assert "error of the camera positions" not in text


@pytest.mark.usefixtures("no_children")
def test_a_frame_made_of_gps_says_how_far_it_is_off(
    bare: Path, plane_cloud: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The four limits stand in the last line, in cloud.json and in the page; distances from fixes are called that."""
    file = bare / "cameras.json"
    told = json.loads(file.read_text())
    told["images"][3]["gps"][0] += 400.0  # one fix strays, and costs no camera
    file.write_text(json.dumps(told))
    cloud, page = tmp_path / "cloud", tmp_path / "page.html"
    out = said(capsys, "reconstruct", bare, "-o", cloud, "--model", plane_cloud, "--mode", "sparse")
    assert "10 of 10 photographs ok" in out
    assert re.search(
        r"aligned to GPS \(9 of 10 fixes\), scale ±[\d.]+ %, tilt ±[\d.]+°, heading ±[\d.]+°, place ±", out
    )
    stored = json.loads((cloud / "cloud.json").read_text())
    assert stored["alignment"]["unit"] == "m"
    limits = stored["alignment"]["expected_error"]
    assert [row["fix"] for row in stored["cameras"]].count("strays") == 1
    said(capsys, "report", cloud, "-o", page)
    text = text_of(page)
    assert f"error of scale, 95 % below {limits['scale_percent']:.2g} %" in text
    assert f"error of place, 95 % below {limits['place_m']:.2g} m" in text
    assert "GPS fixes that agree 9 of 10" in text
    assert "median distance of a camera from its GPS fix" in text
    assert "from its GPS fix mm" in text
    assert "error of the camera positions" not in text


@pytest.mark.usefixtures("no_children")
def test_without_a_frame_lengths_have_no_unit(
    bare: Path, plane_cloud: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Fixes in one place fix no frame: the unit is unknown in all three, and no axis of the page is in meters."""
    file = bare / "cameras.json"
    told = json.loads(file.read_text())
    for row in told["images"]:
        row["gps"] = [1.0, 2.0, 3.0]
    file.write_text(json.dumps(told))
    cloud, page = tmp_path / "both", tmp_path / "page.html"
    words = ("--model", plane_cloud, "--mode", "both", "--quality", "low")
    out = said(capsys, "reconstruct", bare, "-o", cloud, *words)
    assert "in its own units, upright, without labels" in out
    assert "GPS does not fix the frame" in out
    for kind in ("sparse", "dense"):
        assert json.loads((cloud / "cloud" / kind / "cloud.json").read_text())["alignment"]["unit"] == "unknown"
    assert open_photographs(bare).images[0].gps is not None
    said(capsys, "report", cloud, "-o", page)
    text, whole = text_of(page), page.read_text(encoding="utf-8")
    assert text.count("unit of length unknown") == 2
    assert "GPS does not determine the frame fewer than three positions that differ" in text
    assert '"title":{"text":"x [units of the model]"' in whole
    assert '"title":{"text":"x [m]"' not in whole
    assert '"unit":"units of the model"' in whole
