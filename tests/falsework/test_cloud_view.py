"""Points and cameras in space: what the page is given, and what a browser makes of it."""

import base64
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from falsework.report.cloud_view import (
    SHOWN_POINTS,
    Shown,
    cloud_view,
    instance_color,
    uncertainty_levels,
    uncertainty_scale,
)
from falsework.report.flight import Flight, Sheet
from falsework.report.page import script_json, write_page
from falsework.report.pictures import data_uri
from recon.cloud import SFM_SPARSE, Cloud
from tests.conftest import RecordProof
from tests.falsework.browser import needs_browser, open_page
from tests.learn.toy_bridge import toy_cloud

WORK = Path(__file__).with_name("cloud_view.js").read_text(encoding="utf-8")
VIEWS = 3  # of each point of the small cloud


def small_cloud(count: int = 600) -> Cloud:
    """Make a cloud with every uncertainty, some of them unknown, a few components, and three images of each point."""
    rng = np.random.default_rng(5)
    uncertainty = np.geomspace(1e-4, 20.0, count).astype(np.float32)
    uncertainty[::50] = np.nan
    cloud = toy_cloud(
        2,
        count,
        uncertainty=uncertainty,
        color=rng.integers(0, 256, (count, 3)).astype(np.uint8),
        instance=rng.integers(0, 40, count).astype(np.uint32),
    )
    seen = {
        "start": np.arange(count + 1, dtype=np.int64) * VIEWS,
        "image": np.tile(np.arange(VIEWS, dtype=np.uint32), count),
        "uv": rng.integers(1, 400, (count * VIEWS, 2)) + 0.5,  # spelt with one decimal, none of them is in doubt
        "label": np.zeros(count * VIEWS, np.uint8),
        "instance": np.zeros(count * VIEWS, np.uint32),
        "depth_error": np.zeros(count * VIEWS, np.float32),
    }
    cameras = tuple({"name": f"image {k}", "status": "ok"} for k in range(VIEWS))
    return replace(cloud, observations=seen, cameras=cameras, source=SFM_SPARSE)


def small_flight(cloud: Cloud) -> Flight:
    """Look down on the cloud from three places, the last of which is lost, with a picture of one color from each."""
    poses = np.tile(np.diag([1.0, -1.0, -1.0, 1.0]), (VIEWS, 1, 1))
    poses[:, :3, 3] = cloud.columns["coord"].mean(axis=0) + np.array([[-30, 0, 25], [0, 0, 25], [30, 0, 25]])
    sheet = np.zeros((30, 120, 3), np.uint8)
    sheet[:, :40], sheet[:, 40:80], sheet[:, 80:] = (250, 0, 0), (0, 250, 0), (0, 0, 250)
    names = tuple(f"image {k}" for k in range(VIEWS))
    picture = Sheet(data_uri(sheet, 120, smooth=False), 3, 1, (0, 1, 2))
    return Flight(names, (0, 1, 2), poses, ("ok", "ok", "lost"), (0.5, 0.4), ("./a.jpg",) * VIEWS, picture)


def unpacked(text: str, kind: str) -> np.ndarray:
    """Read an array of the page."""
    return np.frombuffer(base64.b64decode(text), kind)


def test_every_uncertainty_has_a_level() -> None:
    """Each tenfold is a quarter of the scale, whose colors go from blue to red; the unknown has a level apart."""
    given = np.array([0.0, 0.001, 0.01, 0.1, 1.0, 10.0, np.inf, np.nan], np.float32)
    assert uncertainty_levels(given).tolist() == pytest.approx([0, 0, 63.5, 127, 190.5, 254, 254, 255], abs=0.5)
    scale = uncertainty_scale().astype(int)
    assert len(scale) == 255
    assert len({tuple(color) for color in scale.tolist()}) > 200
    assert scale[0, 2] > scale[0, 0]
    assert scale[254, 0] > scale[254, 2]


def test_components_are_told_apart() -> None:
    """A hundred of them have a hundred colors; what belongs to none is gray."""
    assert len({instance_color(number) for number in range(1, 101)}) == 100
    red, green, blue = instance_color(0)
    assert max(red, green, blue) - min(red, green, blue) < 20


def test_the_page_is_given_the_points() -> None:
    """Every third point of many, to a hundredth of the span over 655; class, color and number as in the cloud."""
    rng, count = np.random.default_rng(1), 2 * SHOWN_POINTS + 1
    cloud = toy_cloud(
        1,
        count,
        coord=rng.uniform(-50, 50, (count, 3)),
        segment=rng.integers(1, 4, count).astype(np.uint8),
        instance=rng.integers(0, 9, count).astype(np.uint32),
    )
    columns = cloud.columns
    view = cloud_view(cloud)
    data = json.loads(view["data"])
    assert (data["every"], data["count"]) == (3, len(columns["coord"][::3]))
    place = np.array(data["low"]) + np.array(data["step"]) * unpacked(data["place"], "<u2").reshape(-1, 3)
    apart = place + np.array(data["origin"]) - columns["coord"][::3]
    assert np.abs(apart).max() <= 100 / 65535
    np.testing.assert_array_equal(unpacked(data["color"], "u1").reshape(-1, 3), columns["color"][::3])
    np.testing.assert_array_equal(unpacked(data["segment"], "u1"), columns["segment"][::3])
    number = unpacked(data["instance"], "<u2")
    assert np.array([row["id"] for row in data["instances"]])[number].tolist() == columns["instance"][::3].tolist()
    assert np.array([row["color"] for row in data["instances"]])[number].tolist() == [
        list(instance_color(int(one))) for one in columns["instance"][::3]
    ]
    assert {row["id"]: row["points"] for row in view["classes"]} == dict(
        zip(*map(np.ndarray.tolist, np.unique(columns["segment"], return_counts=True)), strict=True)
    )


def test_a_stray_point_does_not_coarsen_the_others() -> None:
    """One point 4,000 km away: it is drawn at the side of the box, and all others stay where they are."""
    cloud = small_cloud()
    coord = cloud.columns["coord"].copy()
    coord[7] += 4e6
    data = json.loads(cloud_view(replace(cloud, columns={**cloud.columns, "coord": coord}))["data"])
    drawn = unpacked(data["place"], "<u2").reshape(-1, 3) * data["step"] + data["low"]
    away = np.delete(drawn - drawn[0] - (coord - coord[0]), 7, axis=0)
    assert np.abs(away).max() < 0.01


@pytest.mark.parametrize(("shown", "views"), [(600, 2), (200, 9), (150, 0)])
def test_the_page_is_given_the_images_of_each_point(shown: int, views: int) -> None:
    """For every point that is shown: the first of its images, its pixels to a 65,535th, and how many there are."""
    cloud = small_cloud()
    seen = json.loads(cloud_view(cloud, None, Shown(shown, views))["data"])["seen"]
    if not views:
        assert seen is None
        return
    every, most = 600 // shown, min(views, VIEWS)
    assert unpacked(seen["views"], "u1").tolist() == [most] * shown
    assert unpacked(seen["of"], "<u2").tolist() == [VIEWS] * shown
    rows = (np.arange(0, 600, every)[:, None] * VIEWS + np.arange(most)).ravel()
    assert unpacked(seen["image"], "<u2").tolist() == cloud.observations["image"][rows].tolist()
    found = unpacked(seen["uv"], "<u2").reshape(-1, 2) * seen["step"]
    np.testing.assert_allclose(found, cloud.observations["uv"][rows], atol=seen["step"])
    assert seen["step"] < 0.01
    assert seen["names"] == ["image 0", "image 1", "image 2"]


def test_names_cannot_end_the_script() -> None:
    """What a file calls a class stays data."""
    text = script_json({"name": "</script><script>alert(1)//&"})
    assert "<" not in text
    assert json.loads(text) == {"name": "</script><script>alert(1)//&"}


@needs_browser
def test_a_browser_paints_and_filters(tmp_path: Path, record_proof: RecordProof) -> None:
    """Each button gives each point its color, on the canvas too; slider and switches leave the points they should."""
    cloud = small_cloud()
    page = tmp_path / "page.html"
    write_page(page, "view.html.j2", title="Page", lead="", view=cloud_view(cloud, small_flight(cloud)))
    answer = open_page(page, WORK)
    told, columns = answer.told, cloud.columns
    assert [line for line in answer.console if "GPU stall" not in line] == []
    levels = uncertainty_levels(columns["uncertainty"])
    colors = {row.id: list(row.color) for row in cloud.classes}
    known = levels < 255
    wanted: dict[str, Any] = {
        "photo": columns["color"].tolist(),
        "class": [colors[number] for number in columns["segment"].tolist()],
        "instance": [list(instance_color(number)) for number in columns["instance"].tolist()],
        "uncertainty": np.vstack([uncertainty_scale(), [[154, 160, 166]]])[levels].tolist(),
    }
    for paint, color in wanted.items():
        assert told[paint] == color, paint
        seen = told["drawn"][paint]  # [number of the point, color of the canvas where it is in front]
        assert len(seen) > 100
        assert [pixel for _, pixel in seen] == [color[number] for number, _ in seen], paint
    assert len({tuple(color) for color, sure in zip(told["uncertainty"], known, strict=True) if sure}) > 20
    assert len({tuple(pixel) for _, pixel in told["drawn"]["uncertainty"]}) > 20
    for paint in ("photo", "instance"):  # a table has seventeen classes at most
        assert len({tuple(pixel) for _, pixel in told["drawn"][paint]}) > 20, paint
    distinct = {paint: len({tuple(pixel) for _, pixel in told["drawn"][paint]}) for paint in wanted}
    slid = dict(zip(("any", "254", "200", "100", "0"), told["slid"], strict=True))
    figures = {f"colors_{paint}": count for paint, count in distinct.items()}
    figures |= {f"points_at_level_{level}": points for level, points in slid.items()}
    record_proof("report: buttons and slider of a cloud in a browser", len(levels), 0, figures)
    assert told["pickedAlone"]
    assert told["scale"]
    assert told["slid"] == [len(levels), *(int((levels <= limit).sum()) for limit in (254, 200, 100, 0))]
    assert told["none"] == 0
    assert told["classes"] == [[row, int((columns["segment"] == row).sum())] for row in np.unique(columns["segment"])]
    assert told["all"] == len(levels)
    number = told["picked"]
    names = {row.id: row.name for row in cloud.classes}
    assert names[int(columns["segment"][number])] in told["words"]
    assert "seen by 3 images" in told["words"]
    for k in range(VIEWS):
        x, y = cloud.observations["uv"][VIEWS * number + k]
        assert f"image {k} at ({x:.1f}, {y:.1f})" in told["words"]
    assert told["rays"] == 2 * VIEWS
    assert told["pictures"] == [[250, 0, 0], [0, 250, 0], [0, 0, 250]]
    assert told["image"] == "image 1"
