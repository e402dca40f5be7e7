"""The databases of features and matches hold the same rows, whatever the number of threads and of interruptions."""

import hashlib
import sqlite3
import threading
from contextlib import closing, nullcontext, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pycolmap
import pytest

from groundwork.child import run_child
from groundwork.errors import ChildError, RejectedSceneError
from groundwork.progress import SILENT
from recon.photos.photos import open_photographs
from recon.settings import ReconSettings, SparseSettings
from recon.sfm import matching, sparse
from recon.sfm.database import DATABASE, empty_journal, paired
from recon.sfm.extraction import extract
from recon.sfm.matching import choose_pairing, match
from render.capture import CalibrationPrior, Capture, CaptureImage
from tests.conftest import RecordProof
from tests.recon.conftest import count_no_rows, in_this_process, serve_here

TABLES = ("cameras", "images", "keypoints", "descriptors", "pose_priors", "matches", "two_view_geometries")


def crops(folder: Path, count: int, contrast: float = 40.0) -> Capture:
    """Photograph a flat picture of noise from places side by side, with GPS, in images small enough for a test."""
    noise = cv2.GaussianBlur(np.random.default_rng(2).normal(size=(160, 400)).astype(np.float32), (0, 0), 1.5)
    picture = np.clip(128 + contrast * noise / noise.std(), 0, 255).astype(np.uint8)
    folder.mkdir()
    for row in range(count):
        cv2.imwrite(str(folder / f"{row}.png"), cv2.merge([picture[:, 25 * row : 25 * row + 220]] * 3))
    capture = open_photographs(folder)
    images = tuple(image.model_copy(update={"gps": (float(row), 0.0, 0.0)}) for row, image in enumerate(capture.images))
    return replace(capture, images=images)


def rows_of(database: Path) -> dict[str, str]:
    """Hash every row of every table, in the order of its key."""
    found = {}
    with closing(sqlite3.connect(database)) as connection:
        for table in TABLES:
            lines = sorted(repr(row) for row in connection.execute(f"SELECT * FROM {table}"))
            found[table] = hashlib.sha256("\n".join(lines).encode()).hexdigest() + f" {len(lines)}"
    return found


def made(capture: Capture, folder: Path, threads: int, interrupted: bool = False) -> dict[str, str]:
    """Extract and match with some threads; interrupted: from databases that have lost half of their rows."""
    settings = SparseSettings(max_features=500, threads=threads)
    features, matches = folder / "features", folder / "matches"
    for part in (features, matches):
        part.mkdir(parents=True)
    extract(capture, features, settings, SILENT)
    if interrupted:
        with closing(sqlite3.connect(features / DATABASE)) as connection:
            for table in ("keypoints", "descriptors", "pose_priors"):
                key = "image_id" if table != "pose_priors" else "corr_data_id"
                connection.execute(f"DELETE FROM {table} WHERE {key} > 2")
            connection.commit()
        extract(capture, features, settings, SILENT)
    empty_journal(features / DATABASE)
    with in_this_process() if interrupted or threads == 1 else nullcontext():
        first = settings.model_copy(update={"threads": 1}) if interrupted else settings
        match(capture, features, matches, first, 0, SILENT)
    if interrupted:
        with closing(sqlite3.connect(matches / DATABASE)) as connection:
            middle = connection.execute("SELECT AVG(pair_id) FROM two_view_geometries").fetchone()
            for table in ("matches", "two_view_geometries"):
                connection.execute(f"DELETE FROM {table} WHERE pair_id > ?", middle)
            connection.commit()
        (matches / "share0").mkdir()
        (matches / "share0" / DATABASE).write_bytes(b"what a killed share left")
        match(capture, features, matches, settings, 0, SILENT)
    return rows_of(matches / DATABASE)


def test_threads_shares_and_interruptions_change_no_row(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One process for all pairs, two with three pairs each, and two that were cut off: the same rows in every table."""
    capture = crops(tmp_path / "photographs", 4)
    pycolmap.logging.minloglevel = 3
    one = made(capture, tmp_path / "one", 1)
    assert one["keypoints"].endswith(" 4")
    assert one["two_view_geometries"].endswith(" 6")
    monkeypatch.setattr(matching, "_SHARE", 3)
    monkeypatch.setattr(matching, "_LEAST_SHARE", 1)
    assert made(capture, tmp_path / "two", 2) == one
    assert made(capture, tmp_path / "cut", 2, interrupted=True) == one


def test_a_share_that_dies_costs_no_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One of six shares dies while another is at work: that one comes home, and most of the others are not begun."""
    capture = crops(tmp_path / "photographs", 4)
    settings = SparseSettings(max_features=500, threads=2)
    for part in ("features", "matches"):
        (tmp_path / part).mkdir()
    extract(capture, tmp_path / "features", settings, SILENT)
    empty_journal(tmp_path / "features" / DATABASE)
    begun, alone, home, dead = threading.Event(), threading.Lock(), list[Any](), list[Any]()
    dead_is_known = False

    def run_or_die(module: str, request: dict[str, Any], **options: Any) -> Any:
        if request["folder"].endswith("share0") and not dead:
            dead.extend(request["pairs"])
            assert begun.wait(60)
            raise ChildError("out of luck")
        home.extend(request["pairs"])
        begun.set()
        if not dead_is_known:
            return run_child(module, request, **options)
        with alone:
            return serve_here(module, request, **options)

    monkeypatch.setattr(matching, "_SHARE", 1)
    monkeypatch.setattr(matching, "_LEAST_SHARE", 1)
    monkeypatch.setattr(matching, "run_child", run_or_die)
    with pytest.raises(ChildError, match="out of luck"):
        match(capture, tmp_path / "features", tmp_path / "matches", settings, 0, SILENT)
    assert 1 <= len(home) <= 3  # the pool may have begun another or two before it heard of the failure
    first, dead_is_known = list(home), True
    count_no_rows(monkeypatch)  # from here on pairs are matched in this process
    assert match(capture, tmp_path / "features", tmp_path / "matches", settings, 0, SILENT)["pairs"] == 6
    assert set(dead) <= set(home)
    assert len(home) == len(set(home)) == 6  # and nothing twice
    assert home[: len(first)] == first
    assert [path.name for path in (tmp_path / "matches").iterdir()] == [DATABASE]


@pytest.mark.usefixtures("no_children")
def test_what_a_killed_share_had_matched_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, record_proof: RecordProof
) -> None:
    """Four of six pairs were through in a share that was killed: two are left to do, and every row is as ever."""
    capture = crops(tmp_path / "photographs", 4)
    settings = SparseSettings(max_features=500, threads=1)
    wanted = made(capture, tmp_path / "calm", 1)
    features, matches = tmp_path / "calm" / "features", tmp_path / "matches"
    (matches / "share0").mkdir(parents=True)
    with pycolmap.Database.open(features / DATABASE) as opened:
        numbers = sorted(image.image_id for image in opened.read_all_images())
    pairs = [(one, other) for one in numbers for other in numbers if one < other]
    matching.match_share(pairs[:4], features, matches / "share0", 0)
    asked = list[Any]()

    def run_and_tell(module: str, request: dict[str, Any], **options: Any) -> Any:
        asked.extend(request["pairs"])
        return serve_here(module, request, **options)

    monkeypatch.setattr(matching, "run_child", run_and_tell)
    match(capture, features, matches, settings, 0, SILENT)
    assert sorted(tuple(sorted(pair)) for pair in asked) == pairs[4:]
    found = rows_of(matches / DATABASE)
    assert found == wanted
    figures = {"matched_again": len(asked), "tables_alike": sum(found[table] == wanted[table] for table in TABLES)}
    record_proof("recon: pairs of a killed share of matching are kept", len(pairs), 2, figures)


def test_what_cannot_be_read_just_now_is_not_thrown_away(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Somebody holds a sound database of matches: its pairs are not taken for none."""
    monkeypatch.setattr(sqlite3, "connect", partial(sqlite3.connect, timeout=0.1))  # SQLite waits for five seconds
    with closing(sqlite3.connect(tmp_path / DATABASE)) as holder:
        holder.execute("CREATE TABLE two_view_geometries (pair_id INTEGER)")
        holder.execute("INSERT INTO two_view_geometries VALUES (7)")
        holder.commit()
        assert paired(tmp_path / DATABASE) == {7}
        holder.execute("BEGIN EXCLUSIVE")
        with pytest.raises(sqlite3.OperationalError, match="locked"):
            paired(tmp_path / DATABASE)


@pytest.mark.usefixtures("no_children")
@pytest.mark.parametrize("left", [b"", bytes(40_000), b"what a power cut left"])
def test_a_broken_database_is_made_anew(tmp_path: Path, left: bytes) -> None:
    """A database that is empty, zeroed or no database at all is not gone on with."""
    capture = crops(tmp_path / "photographs", 3)
    settings = SparseSettings(max_features=500)
    for part in ("features", "matches"):
        (tmp_path / part).mkdir()
    extract(capture, tmp_path / "features", settings, SILENT)
    empty_journal(tmp_path / "features" / DATABASE)
    (tmp_path / "matches" / DATABASE).write_bytes(left)
    (tmp_path / "matches" / f"{DATABASE}-wal").write_bytes(b"of another")
    assert match(capture, tmp_path / "features", tmp_path / "matches", settings, 0, SILENT)["pairs"] == 3


def test_who_looks_on_loses_no_row(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Somebody reads the database while the child that filled it ends; the next step's copy still has every row."""
    ended = threading.Event()
    held: list[str] = []

    def run_and_tell(module: str, request: dict[str, Any], **options: Any) -> Any:
        ended.clear()
        if request["stage"] == "map":
            raise RejectedSceneError("no_model", "the databases are there")
        try:
            return run_child(module, request, **options)
        finally:
            ended.set()

    def read_to_the_end(database: Path, table: str) -> int:
        with suppress(sqlite3.Error), closing(sqlite3.connect(f"{database.as_uri()}?mode=ro", uri=True)) as reader:
            reader.execute("BEGIN")
            count = reader.execute(f"SELECT COUNT(*) FROM {table}").fetchone()[0]
            if count and not ended.is_set():
                held.append(table)
                assert ended.wait(120)  # a child that waits for this reader would wait for ever
            return count
        return 0

    monkeypatch.setattr(sparse, "run_child", run_and_tell)
    monkeypatch.setattr(sparse, "count_rows", read_to_the_end)
    monkeypatch.setattr(sparse, "_LOOK", 0.05)
    settings = ReconSettings(sparse=SparseSettings(max_features=500))
    with suppress(RejectedSceneError):
        sparse.run_sparse(crops(tmp_path / "photographs", 4), tmp_path, settings, SILENT)
    features, matches = (next(tmp_path.glob(f"{step}-*")) / DATABASE for step in ("features", "matches"))
    assert "keypoints" in held
    assert [path.name for path in features.parent.glob(f"{DATABASE}*")] == [DATABASE]
    copied, whole = rows_of(matches), rows_of(features)
    assert whole["keypoints"].endswith(" 4")
    assert all(copied[table] == whole[table] for table in TABLES[:5])


@pytest.mark.usefixtures("no_children")
def test_sequential_pairs_come_back(tmp_path: Path) -> None:
    """Without GPS, an image meets its followers one by one, and others 2, 4, 8 further on."""
    capture = crops(tmp_path / "photographs", 7, contrast=0.0)
    settings = SparseSettings(max_features=256, pairing="sequential", overlap=3)
    for part in ("features", "matches"):
        (tmp_path / part).mkdir()
    extract(capture, tmp_path / "features", settings, SILENT)
    found = match(capture, tmp_path / "features", tmp_path / "matches", settings, 0, SILENT)
    assert found["pairing"] == "sequential"
    assert found["pairs"] == 6 + 5 + 4 + 3  # gaps of 1, 2, 3, and 4
    assert found["verified"] == 0
    assert found["overlapping"] == [False] * 7


def rows_paired(folder: Path) -> list[tuple[int, ...]]:
    """List the pairs of a database whose files are named by their rows."""
    with closing(sqlite3.connect(folder / DATABASE)) as connection:
        file = dict(connection.execute("SELECT image_id, name FROM images"))
        numbers = [number for (number,) in connection.execute("SELECT pair_id FROM two_view_geometries")]
    return [tuple(int(file[image][:2]) for image in pycolmap.pair_id_to_image_pair(number)) for number in numbers]


@pytest.mark.usefixtures("no_children")
def test_spatial_pairs_of_a_long_flight_leap(tmp_path: Path) -> None:
    """With GPS, an image meets its nearest ones, and on a long flight some 32, 64 … further on; each pair once.

    Two stations out of each other's sight are joined by the way between them.
    """
    (tmp_path / "photographs").mkdir()
    for row in range(70):
        cv2.imwrite(str(tmp_path / f"photographs/{row:02d}.png"), np.full((24, 32, 3), 128, np.uint8))
    capture = open_photographs(tmp_path / "photographs")
    images = tuple(image.model_copy(update={"gps": (float(row), 0.0, 0.0)}) for row, image in enumerate(capture.images))
    capture = replace(capture, images=images)
    settings = SparseSettings(max_features=256, neighbours=2, leaps_from=70)
    (tmp_path / "features").mkdir()
    extract(capture, tmp_path / "features", settings, SILENT)
    nearest = {frozenset((row, row + 1)) for row in range(69)} | {frozenset((0, 2)), frozenset((67, 69))}
    leaps = {frozenset((row, row + leap)) for leap in (32, 64) for row in range(0, 70 - leap, 4)}
    for name, long, wanted in (
        ("long", settings, nearest | leaps),
        ("short", settings.model_copy(update={"leaps_from": 71}), nearest),
    ):
        (tmp_path / name).mkdir()
        found = match(capture, tmp_path / "features", tmp_path / name, long, 0, SILENT)
        pairs = rows_paired(tmp_path / name)
        assert found["pairs"] == len(pairs) == len(wanted)
        assert {frozenset(pair) for pair in pairs} == wanted
    stations = [(1e4 * (row >= 35) + row % 35, 0.0, 0.0) for row in range(70)]
    apart = replace(
        capture,
        images=tuple(image.model_copy(update={"gps": place}) for image, place in zip(images, stations, strict=True)),
    )
    for name in ("apart", "joined"):
        (tmp_path / name).mkdir()
    extract(apart, tmp_path / "apart", settings, SILENT)
    short = settings.model_copy(update={"leaps_from": 71})
    joined = match(apart, tmp_path / "apart", tmp_path / "joined", short, 0, SILENT)
    found_pairs = {frozenset(pair) for pair in rows_paired(tmp_path / "joined")}
    assert joined["pairs"] == len(found_pairs)
    assert {frozenset((row, row + 1)) for row in range(69)} < found_pairs  # 34 and 35, 10 km apart, among them
    blind = replace(capture, images=tuple(image.model_copy(update={"gps": None}) for image in images))
    for name in ("blind", "none"):
        (tmp_path / name).mkdir()
    extract(blind, tmp_path / "blind", settings, SILENT)
    asked = settings.model_copy(update={"pairing": "spatial"})
    assert match(blind, tmp_path / "blind", tmp_path / "none", asked, 0, SILENT)["pairs"] == 0


def test_pairing_without_all_positions_is_not_spatial() -> None:
    """One photograph without GPS is enough to pair by order."""
    images = tuple(
        CaptureImage(name=str(row), file=f"{row}.jpg", gps=(0.0, 0.0, 0.0) if row else None) for row in range(50)
    )
    prior = CalibrationPrior(focal_px=4.0, cx=2.0, cy=1.5)
    capture = Capture(Path(), "s", (4, 3), prior, (1.0, 1.0, 1.0), {}, images)
    assert choose_pairing(capture, SparseSettings()) == "sequential"
