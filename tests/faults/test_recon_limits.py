"""A reconstruction that runs out of disk, time or memory says so in one line, with the mend, and can go on."""

import contextlib
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

import recon.sfm.sparse
from groundwork.child import run_child
from groundwork.errors import ChildError, OutOfSpaceError, RejectedSceneError
from groundwork.progress import SILENT
from recon.photos.photos import open_photographs
from recon.settings import ReconSettings, SparseSettings
from recon.sfm.sparse import run_sparse
from render.capture import read_capture
from tests.conftest import Count, RecordProof
from tests.faults.conftest import MAX_FEATURES, Start, contents
from tests.patience import left

# A disk of its own for one command, and for the same once more when it has grown; what is there then is copied.
# It ends with the namespace: its folder, its size, where to copy to, the command.
FULL_DISK = (
    "unshare",
    "-rm",
    "bash",
    "-c",
    """
    mount -t tmpfs -o size="$1" none "$0" || exit 9
    copy="$2"; shift 2
    "$@"; echo "first: $?" >&2
    mount -o remount,size=1g "$0"
    "$@" && cp -r "$0/out" "$copy"
""",
)


def one_line(process: subprocess.Popen[str], said: str, code: int) -> str:
    """Check that a run has failed with a code and without a traceback, and return its last line."""
    assert process.returncode == code, said
    assert "Traceback" not in said
    return said.strip().splitlines()[-1]


@pytest.mark.faults
@pytest.mark.skipif(shutil.which("unshare") is None, reason="there is no unshare to mount a small disk with")
def test_full_disk(
    start_reconstruct: Start, calm: Path, tmp_path: Path, proof_count: Count, record_proof: RecordProof
) -> None:
    """On disks that fill up in one step or another: exit code 4, one line that says what to do, and it goes on."""
    filled = 0
    for full, size in enumerate(("2m", "1m", "1500k", "2300k", "2600k", "2900k")[: proof_count(1, 6)]):
        disk, copy = tmp_path / size, tmp_path / f"copy{size}"
        disk.mkdir()
        process = start_reconstruct(disk / "out", before=(*FULL_DISK, str(disk), size, str(copy)))
        _, said = process.communicate(timeout=left())
        assert process.returncode == 0, said
        assert contents(copy) == contents(calm)
        if "first: 0" in said and full:
            break  # large enough; how large that is depends on the platform
        before, _, _ = said.partition("first: 4")
        line = before.strip().splitlines()[-1]
        assert line.startswith("falsework: ")
        assert "Free some space, then run the same command again" in line
        assert "Traceback" not in said
        filled += 1
    record_proof("faults: disk full in the steps of a reconstruction", filled, 0, {"exit_code_4": filled})


@pytest.mark.faults
def test_a_file_that_may_not_grow(start_reconstruct: Start, tmp_path: Path) -> None:
    """COLMAP aborts when its database cannot grow; that, too, is out of space and not a crash."""
    process = start_reconstruct(tmp_path / "out", before=("bash", "-c", 'ulimit -f 200; exec "$0" "$@"'))
    _, said = process.communicate(timeout=left())
    line = one_line(process, said, 4)
    assert line.endswith("no space left on the disk. Free some space, then run the same command again")


@pytest.mark.faults
def test_too_little_space_is_seen_before(few_planes: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A disk that cannot hold the databases is refused before the first keypoint is sought."""
    usage = shutil.disk_usage(tmp_path)
    monkeypatch.setattr(shutil, "disk_usage", lambda path: usage._replace(free=1_000_000))
    settings = ReconSettings(sparse=SparseSettings(max_features=MAX_FEATURES))
    with pytest.raises(OutOfSpaceError, match=r"0\.0 GB are free, structure from motion of these images may need 0\.0"):
        run_sparse(read_capture(few_planes), tmp_path, settings, SILENT)


@pytest.mark.faults
@pytest.mark.parametrize(("limit", "words"), [("time", "seconds_per_image"), ("memory", "memory_limit")])
def test_limits_name_their_setting(
    limit: str, words: str, few_planes: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A step that takes too long or too much is stopped, and the line names the setting that allows more.

    The settings are sound; only the guard is told of a limit that no interpreter keeps to, however fast the box.
    """
    none = {"time_limit": 0.0} if limit == "time" else {"memory_limit": 1e-6}
    monkeypatch.setattr(recon.sfm.sparse, "run_child", lambda *given, **named: run_child(*given, **{**named, **none}))
    sparse = SparseSettings(max_features=MAX_FEATURES)
    with pytest.raises(ChildError, match=rf"stopped because it .*\[recon\.sparse\] {words}"):
        run_sparse(read_capture(few_planes), tmp_path, ReconSettings(sparse=sparse), SILENT)


@pytest.mark.faults
@pytest.mark.parametrize(("size", "megapixels"), [((640, 480), 0.3072), ((3200, 2400), 7.68), ((6400, 4800), 7.68)])
def test_more_and_larger_images_may_take_more(
    size: tuple[int, int], megapixels: float, few_planes: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Hundreds of images take gigabytes that twelve need not be allowed; so do keypoints of large ones, per thread."""
    allowed: list[float] = []

    def stop(*_: object, memory_limit: float, **__: object) -> None:
        allowed.append(memory_limit)
        raise ChildError("stopped")

    monkeypatch.setattr(recon.sfm.sparse, "run_child", stop)
    capture = replace(read_capture(few_planes), size=size)
    sparse = SparseSettings(memory_limit=2.0, memory_per_image=0.5, memory_per_megapixel=0.4, threads=3)
    with pytest.raises(ChildError, match="stopped"):
        run_sparse(capture, tmp_path, ReconSettings(sparse=sparse), SILENT)
    assert allowed == [pytest.approx(2.0 + 0.5 * len(capture.images) + 0.4 * 3 * megapixels)]


@pytest.mark.faults
@pytest.mark.proof_only
def test_the_keypoints_of_large_photographs_fit(tmp_path: Path) -> None:
    """Pictures as large as COLMAP looks at, full of detail, two at a time: within the limit that stands by default."""
    noise = np.random.default_rng(5).integers(0, 255, (600, 800, 3), np.uint8)
    picture = cv2.resize(noise, (3200, 2400), interpolation=cv2.INTER_CUBIC)
    for number in range(3):
        cv2.imwrite(str(tmp_path / f"{number}.jpg"), np.roll(picture, 40 * number, axis=1))
    work = tmp_path / "work"
    work.mkdir()
    with contextlib.suppress(RejectedSceneError):  # a picture that slides is no scene
        run_sparse(open_photographs(tmp_path), work, ReconSettings(), SILENT)
    assert any(work.glob("features-*"))
