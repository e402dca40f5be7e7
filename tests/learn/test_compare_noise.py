"""Noise that is fitted on one draw of a known sensor and given to exact points shows what the sensor would have."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import KDTree

from groundwork.errors import InputError
from groundwork.progress import SILENT
from learn.compare import noise, pieces
from learn.compare.noise import CUBE, fit_noise, noise_from_json, sensor_places, with_noise
from learn.compare.pieces import CloudSource, CutSettings
from recon.cloud import COLUMNS, Cloud, without_observations, write_cloud
from usd_schemas.components import class_rows

STATION = np.array([0.0, 0.0, 3.0])


def floor_cloud(seed: int, count: int, *, measured: bool = False) -> Cloud:
    """Draw points of a floor of 40 m by 40 m; as measured from a tripod with known error, density and gaps.

    The error has a standard deviation of 0.2 % of the range, beyond 16 m every cube of the even columns is empty, and
    elsewhere a third of the points are there.
    """
    rng = np.random.default_rng(seed)
    coord = np.column_stack([rng.uniform(-20.0, 20.0, (count, 2)), np.full(count, 0.25)])
    distance = np.linalg.norm(coord - STATION, axis=1)
    off = np.zeros(count)
    if measured:
        cells = np.floor((coord[:, 0] + 20.0) / CUBE).astype(int)
        kept = (rng.random(count) < 1 / 3) & ~((distance > 16.0) & (cells % 2 == 0))
        coord, distance = coord[kept], distance[kept]
        off = 0.002 * distance * rng.standard_normal(len(coord))
        coord[:, 2] += off
    return cloud_of(coord, off, np.tile([0.0, 0.0, 1.0], (len(coord), 1)), measured=measured)


def ring_cloud(seed: int, count: int, *, measured: bool = False) -> Cloud:
    """Draw points of a floor about a tripod and of a round wall that faces it, all between 8 and 16 m away.

    As measured, the wall (less than 18 degrees off its normal) has an error of 10 mm and a third of its points, the
    floor (more than 70 degrees off) an error of 80 mm and a twelfth.
    """
    rng = np.random.default_rng(seed)
    angle, wall = rng.uniform(0.0, 2.0 * np.pi, count), rng.random(count) < 0.5
    away = np.where(wall, 10.0, np.sqrt(rng.uniform(8.0**2, 15.0**2, count)))
    height = np.where(wall, rng.uniform(1.5, 6.0, count), 0.25)
    ways = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(count)])
    coord = away[:, None] * ways + height[:, None] * [0.0, 0.0, 1.0]
    normal, off = np.where(wall[:, None], -ways, [0.0, 0.0, 1.0]), np.zeros(count)
    if measured:
        kept = rng.random(count) < np.where(wall, 1 / 3, 1 / 12)
        coord, normal, wall = coord[kept], normal[kept], wall[kept]
        off = np.where(wall, 0.01, 0.08) * rng.standard_normal(len(coord))
        coord = coord + off[:, None] * normal
    return cloud_of(coord, off, normal, measured=measured)


def cloud_of(coord: np.ndarray, off: np.ndarray, normal: np.ndarray, *, measured: bool) -> Cloud:
    """Make a cloud of positions, their distances to the surface, and its normals."""
    columns = {
        name: np.zeros((len(coord), row.width) if row.width > 1 else len(coord), row.dtype)
        for name, row in COLUMNS.items()
    }
    columns |= {"coord": coord, "surface_distance": np.abs(off).astype(np.float32) * np.ones(len(coord), np.float32)}
    columns["normal"][:] = normal
    facts = {"stations": [STATION.tolist()]} if measured else {}
    source = "lidar-terrestrial" if measured else "mesh"
    return Cloud(columns, without_observations(len(coord)), ("",), class_rows(), {}, (), facts, source, "b")


def written(folder: Path, cloud: Cloud) -> Path:
    """Write a cloud into a new folder."""
    folder.mkdir()
    write_cloud(folder, cloud)
    return folder


def far_cubes(points: np.ndarray) -> set[tuple[int, ...]]:
    """Name the cubes beyond 17 m that hold points."""
    cells = np.floor((points[np.linalg.norm(points[:, :2], axis=1) > 17.0, :2] + 20.0) / CUBE).astype(int)
    return set(map(tuple, cells.tolist()))


def test_what_was_fitted_comes_back(tmp_path: Path) -> None:
    """Error by range, density and gaps of new points are those of the sensor, within what so many points can tell."""
    exact = floor_cloud(1, 60_000)
    pair = written(tmp_path / "exact", exact), written(tmp_path / "like", floor_cloud(2, 60_000, measured=True))
    fitted = fit_noise([pair])
    again = noise_from_json(fitted.as_json())
    assert all((getattr(again, name) == values).all() for name, values in vars(fitted).items())
    other = floor_cloud(3, 60_000)
    rows, coord = with_noise(other, fitted, STATION[None], seed=5)
    truth = floor_cloud(4, 60_000, measured=True).columns["coord"]
    at = other.columns["coord"][rows]
    assert (coord[:, :2] == at[:, :2]).all()  # along the normal alone
    distance, reach = (np.linalg.norm(points[:, :2], axis=1) for points in (at, truth))
    for low, high in ((4.0, 7.4), (8.5, 15.5), (17.0, 28.0)):
        ours, theirs = (distance > low) & (distance < high), (reach > low) & (reach < high)
        spread, wanted = np.std(coord[ours, 2] - 0.25), np.std(truth[theirs, 2] - 0.25)
        assert spread == pytest.approx(wanted, rel=0.1)
        assert ours.sum() == pytest.approx(theirs.sum(), rel=0.1)
    far = [far_cubes(points) for points in (at, truth, other.columns["coord"])]
    assert len(far[1]) / len(far[2]) == pytest.approx(0.5, abs=0.05)  # half of the cubes are empty
    assert len(far[0]) / len(far[2]) == pytest.approx(0.5, abs=0.05)
    same = with_noise(other, fitted, STATION[None], seed=5)
    assert (same[0] == rows).all()
    assert (same[1] == coord).all()
    assert not np.array_equal(with_noise(other, fitted, STATION[None], seed=6)[0], rows)


def test_displaced_points_are_uncertain(tmp_path: Path) -> None:
    """By as much as they were displaced, so that a training leaves out the noisy ones, as those of the sensor."""
    exact, like = ring_cloud(1, 20_000), ring_cloud(2, 20_000, measured=True)
    pair = written(tmp_path / "exact", exact), written(tmp_path / "like", like)
    (tmp_path / "noise.json").write_text(json.dumps(fit_noise([pair]).as_json()))
    found = pieces._read(CloudSource("a", *pair, tmp_path / "noise.json"), CutSettings(table="falsework"), SILENT)
    nearest, _ = KDTree(exact.columns["coord"]).query(found.coord)
    assert (found.uncertainty >= nearest - 1e-6).all()
    assert 0.004 < np.median(found.uncertainty) < 0.02  # most are on the wall, which has an error of 10 mm
    assert (found.uncertainty > 0.1).any()


def told_apart(folder: Path) -> dict[str, tuple[float, float]]:
    """Fit and apply the noise of a ring; return the share and the spread [m] of the points of wall and floor."""
    folder.mkdir()
    exact, like = ring_cloud(1, 180_000), ring_cloud(2, 180_000, measured=True)
    fitted = fit_noise([(written(folder / "exact", exact), written(folder / "like", like))])
    other = ring_cloud(3, 180_000)
    rows, coord = with_noise(other, fitted, STATION[None], seed=5)
    normal = other.columns["normal"].astype(np.float64)
    off = np.einsum("ni,ni->n", coord - other.columns["coord"][rows], normal[rows])
    upright = np.abs(normal[:, 2]) < 0.5
    faces = {"wall": upright, "floor": ~upright}
    return {name: (float(face[rows].sum() / face.sum()), float(off[face[rows]].std())) for name, face in faces.items()}


def test_the_incidence_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two faces at the same distance, one seen from the front, keep the errors and densities that the sensor had."""
    found = told_apart(tmp_path / "a")
    for name, share, spread in (("wall", 1 / 3, 0.01), ("floor", 1 / 12, 0.08)):
        assert found[name] == pytest.approx((share, spread), rel=0.1)
    monkeypatch.setattr(noise, "COSINES", (0.0,))
    mixed = told_apart(tmp_path / "b")  # with a single bin of incidence, the wall has errors of the floor
    assert mixed["wall"][1] > 2 * found["wall"][1]
    assert mixed["floor"][0] > 2 * found["floor"][0]


def test_where_the_sensor_stood(tmp_path: Path) -> None:
    """Stations as they are, a path every two meters, camera centers of a reconstruction; a mesh has no sensor."""
    cloud = floor_cloud(1, 100)
    mesh = written(tmp_path / "mesh", cloud)
    with pytest.raises(InputError, match="no sensor"):
        sensor_places(mesh)
    moved = Cloud(**{**vars(cloud), "statistics": {"path": [[0, 0, 1], [3, 0, 1], [3, 5, 1]]}})
    places = sensor_places(written(tmp_path / "mls", moved))
    np.testing.assert_allclose(places, [[0, 0, 1], [2, 0, 1], [3, 1, 1], [3, 3, 1], [3, 5, 1]])
    sfm = written(tmp_path / "sfm", Cloud(**{**vars(cloud), "statistics": {}}))
    pose = [[1, 0, 0, 4], [0, 1, 0, 5], [0, 0, 1, 6], [0, 0, 0, 1]]
    (sfm / "cameras_sfm.json").write_text(f'{{"poses": [{{"name": "a", "camera_to_world": {pose}}}]}}')
    assert sensor_places(sfm).tolist() == [[4.0, 5.0, 6.0]]
    with pytest.raises(InputError, match="no training bridge"):
        fit_noise([])


@pytest.mark.parametrize(
    "statistics", [{"stations": "here"}, {"stations": [[1.0, float("nan"), 0.0]]}, {"path": [[0, 0]]}, {"stations": []}]
)
def test_a_sensor_nowhere_is_one_line(statistics: dict[str, object], tmp_path: Path) -> None:
    """Words, gaps and half places in cloud.json are no places of a sensor."""
    moved = Cloud(**{**vars(floor_cloud(1, 50)), "statistics": {}})
    folder = written(tmp_path / "c", moved)
    stored = json.loads((folder / "cloud.json").read_text())
    (folder / "cloud.json").write_text(json.dumps({**stored, "statistics": statistics}))
    with pytest.raises(InputError, match="sensor"):
        sensor_places(folder)
