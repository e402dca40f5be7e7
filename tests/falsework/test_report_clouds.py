"""Pages of clouds whose photographs are not at hand, and how many views a page has."""

from dataclasses import replace
from pathlib import Path

import pytest

from falsework.report import cloud_view
from falsework.report.survey_page import write_survey_page
from recon.cloud import write_cloud
from tests.falsework.flight_rows import judged_flight
from tests.falsework.test_cloud_view import VIEWS, small_cloud
from tests.falsework.test_report_pages import elements_of
from tests.falsework.test_sample_verbs import run as call


def test_clouds_without_their_photographs_are_shown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """In a scene whose photographs were let go, and in a folder of clouds; no more in 3D than browsers draw."""
    (tmp_path / "scene" / "stage").mkdir(parents=True)
    monkeypatch.setattr(cloud_view, "MOST_VIEWS", 1)
    page, names = tmp_path / "page.html", ("local+dense", "local+sparse")
    for folder in (tmp_path / "scene" / "cloud", tmp_path / "clouds"):
        for name in names:
            (folder / name).mkdir(parents=True)
            cameras = tuple({"name": f"{k}", "status": "ok", "center_error": 0.1} for k in range(VIEWS))
            write_cloud(folder / name, replace(small_cloud(300), cameras=cameras))
    for source, way in (("scene", "scene/cloud"), ("clouds", "clouds")):
        assert call(capsys, "report", tmp_path / source, "-o", page)[0] == 0
        found = elements_of(page)
        text = " ".join(" ".join(found.text).split())
        assert [f"Cloud {name}" in text for name in names] == [True, True]
        assert text.count("Not shown in 3D") == 1
        assert {f"{way}/{name}/cloud.json" for name in names} <= {
            address.replace("%2B", "+") for address in found.addresses
        }
    flights = [judged_flight(word) for word in ("global", "local")]
    write_survey_page(page, flights, "scene.usda")
    assert " ".join(elements_of(page).text).count("Not shown in 3D") == 1
