"""The benchmark of accuracy counts what its page says."""

from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.recon.accuracy import accuracy_page, class_lines
from benchmarks.recon.accuracy_rows import ROWS, scenario_of_row
from benchmarks.recon.by_distance import distance_lines, nearest_camera
from benchmarks.recon.judged_cloud import CLEAR, Judged, instances_right, judge
from falsework.scenario import Scenario
from groundwork.files import read_json
from groundwork.settings import parse_settings
from recon.cloud import Cloud, read_cloud


def _cloud(plane_cloud: Path) -> Cloud:
    """90 points of a cloud with labels, instances and distances written by hand."""
    cloud = read_cloud(plane_cloud)
    columns = {name: values[:90].copy() for name, values in cloud.columns.items()}
    columns["segment"] = np.repeat(np.array([1, 1, 2], np.uint8), 30)
    columns["instance"] = np.repeat(np.array([5, 6, 7], np.uint32), 30)
    columns["surface_class"] = columns["segment"].copy()
    columns["surface_class"][:2] = 9  # two of 30 of the first instance are wrong: 93.3 %
    columns["surface_distance"] = np.zeros(90, np.float32)
    columns["surface_distance"][75:] = 0.2  # the third has 15 points left
    columns["coord"][:2] = [[0.0, 0.0, 0.0], [10.0, 0.0, 0.0]]
    columns["uncertainty"] = np.full(90, 0.01, np.float32)
    columns["uncertainty"][0] = 0.06  # one of them is not precise
    columns["confidence"] = np.ones(90, np.float32)
    columns["confidence"][1:21] = 0.75  # one of the two wrong points is in doubt
    counts = {
        "background": {"kept": 3, "windows": 2},
        "abutment": {"kept": 60, "windows": 1},
        "arch": {"kept": 1030, "windows": 2},
        "beam": {"kept": 0, "windows": 0},  # where the flight saw nothing
        "bearing": {"kept": 60, "windows": 1},
    }
    figures = {**cloud.statistics, "classes": counts}
    return Cloud(columns, {}, cloud.components, cloud.classes, {}, (), figures, cloud.source)


def _judged(plane_cloud: Path) -> Judged:
    """The first wrong point lies 20 mm above the nearest surface of its class, the second one 50 mm."""
    flat = np.array([[[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 2.0, 0.0]]])
    shifts = np.array([[0.0, 0.0, -0.02], [10.0, 0.0, -0.05], [0.0, 0.0, 0.0]])
    corners = np.concatenate([flat + shift for shift in shifts])
    return judge(_cloud(plane_cloud), np.full(90, 7.0), corners, np.array([1, 1, 9], np.uint8))


def test_points_and_instances_are_counted(plane_cloud: Path) -> None:
    """One of two instances with enough points is right; shares are of points near the surface."""
    judged = _judged(plane_cloud)
    assert (judged.near.sum(), judged.right.sum()) == (75, 73)
    assert (CLEAR, judged.clear[:3].tolist(), judged.clear.sum()) == (0.03, [False, True, False], 1)
    assert instances_right(judged) == (1, 2)
    rows = {line.split("|")[1].strip(): line for line in class_lines([judged, judged])}
    names = judged.classes
    assert rows[names[1]] == f"| {names[1]} | 120 | 100.0% | 96.7% | 97.5% | 98.3% | 118 | 1.7% | 2 of 4 |"
    assert rows[names[2]] == f"| {names[2]} | 60 | 50.0% | 100.0% | 100.0% | 100.0% | 30 | 0.0% |  |"


def test_the_page_says_what_was_not_made(plane_cloud: Path) -> None:
    """One line for the cloud that is there; every other row is named."""
    page = accuracy_page({ROWS[0]: {"sparse": _judged(plane_cloud)}}, {ROWS[1]: "too_few_cameras, 6 of 9 are invalid."})
    assert f"- {ROWS[1].name}: too_few_cameras, 6 of 9 are invalid." in page.splitlines()
    assert f"{ROWS[1].name}," not in page
    assert "| slab | road | local | sparse |" in page
    assert "| 90 | 83.3% | 97.3% | 1.3% | 1 of 2 | abutment: 60 |" in page
    assert all(row.name in page for row in ROWS[1:])
    assert "1 bridges with a close flight of a part, 0 with a flight of the whole, 0 with an inspection" in page
    assert ": 97.3 to 97.3 % (sparse) of the points near a surface have the right class, and at most 1.3 % are" in page


def test_rows_are_scenarios_of_their_own_seeds() -> None:
    """Eighteen rows of stored clouds come first; then inspections, dense alone, and whole rail bridges."""
    assert [row.name for row in ROWS[:13:12]] == ["local-slab-road", "global-slab-road"]
    families = [row.family for row in ROWS[12:18]]
    assert [row.name for row in ROWS[18:24]] == [f"inspection-{family}-road" for family in families]
    assert [row.name for row in ROWS[24:]] == [f"global-{family}-rail" for family in families]
    for number, row in enumerate(ROWS, 4001):
        scenario = parse_settings(Scenario, scenario_of_row(row, number, samples=True), row.name)
        assert len(scenario.sample) == (3 if number <= 4018 else 0)
        assert not scenario_of_row(row, number)["sample"]
        assert scenario.recon.modes == (("dense",) if row.survey == "inspection" else ("sparse", "dense"))


def test_distance_is_to_the_nearest_camera_that_saw_the_point(plane_cloud: Path) -> None:
    """A loop over points and their observations finds the same; cameras that did not see a point do not count."""
    cloud = read_cloud(plane_cloud)
    places = {row["name"]: np.array(row["camera_to_world"])[:3, 3] for row in _poses(plane_cloud)}
    names = [str(camera["name"]) for camera in cloud.cameras]
    start, image = cloud.observations["start"], cloud.observations["image"]
    for number, distance in enumerate(nearest_camera(plane_cloud, cloud)[:50]):
        seen = [places[names[row]] for row in image[start[number] : start[number + 1]]]
        expected = min(np.linalg.norm(cloud.columns["coord"][number] - place) for place in seen)
        assert np.isclose(distance, expected, rtol=1e-12, atol=0.0)


def _poses(folder: Path) -> list[dict[str, Any]]:
    return read_json(folder / "cameras_sfm.json")["poses"]


def test_lines_by_distance_count_points() -> None:
    """A bound belongs to the range above it; an empty range has no line."""
    distances, near = np.array([4.9, 5.0, 9.9, 80.0]), np.array([True, True, False, True])
    lines = distance_lines([(distances, near, np.array([False, True, False, True]))] * 2)
    assert lines == [
        "| 0 to 5 m | 2 | 100.0% | 0.0% |",
        "| 5 to 10 m | 4 | 50.0% | 100.0% |",
        "| more than 70 m | 2 | 100.0% | 100.0% |",
    ]
