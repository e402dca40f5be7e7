"""A run of tiny stages: what it makes, what it makes again, and what it does with inputs that are not whole."""

import json
import os
import platform
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from falsework.execution import chain
from falsework.execution.memory import Resident, largest_child
from falsework.pipeline import Outcome, run_scenario
from falsework.stages import STAGES
from falsework.store.store import Store
from groundwork.errors import InputError, OutOfSpaceError
from groundwork.files import MANIFEST
from groundwork.progress import SILENT, Silent
from tests.conftest import RecordProof
from tests.falsework import forked, tiny_chain
from tests.falsework.tiny_chain import contents, start, tiny_scenario, tiny_stages
from tests.patience import left

Run = Callable[..., Outcome]


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Run:
    """Give `run(scenes=1, out=…, faults=None, **settings)` on tiny stages."""
    for name, stage in tiny_stages().items():
        monkeypatch.setitem(STAGES, name, stage)
    monkeypatch.setattr(chain, "render_platform", lambda device="auto": {"gl_renderer": "none"})
    monkeypatch.setattr(chain, "recon_platform", lambda: {"cpu": "none"})

    def run(
        scenes: int = 1, out: Path = tmp_path / "out", faults: dict[str, str] | None = None, **more: Any
    ) -> Outcome:
        monkeypatch.setenv("TINY_FAULTS", json.dumps(faults or {}))
        names = ("retry_failed", "workers", "shard", "cluster", "memory")
        how = {name: more.pop(name) for name in names if name in more}
        return run_scenario(tiny_scenario(scenes, **more), out, SILENT, **how)

    return run


def test_only_children_of_ours_are_stopped() -> None:
    """Not the run itself, not a worker, and nothing that somebody else's program started."""
    rows = (
        (1, "falsework", 9.0),
        (2, "", 8.0),
        (3, "http.server", 7.0),
        (4, "render.frames", 1.0),
        (5, "recon.x", 2.0),
    )
    alive = [Resident(pid, 1, module, memory) for pid, module, memory in rows]
    assert largest_child(alive) == alive[4]
    assert largest_child(alive[:3]) is None


def _only(out: Path, stage: str) -> Path:
    (folder,) = (out / "store" / stage).iterdir()
    return folder


def _overwrite(path: Path, data: bytes) -> None:
    path.chmod(0o644)
    path.write_bytes(data)


def _flip(path: Path, bit: int) -> None:
    data = bytearray(path.read_bytes())
    data[bit // 8] ^= 1 << bit % 8
    _overwrite(path, bytes(data))


def test_same_bytes_anywhere_and_nothing_left_behind(run: Run, tmp_path: Path) -> None:
    """Two runs in two places give the same tree; the second call makes nothing; no work and no lock is left."""
    assert (run(3).made, run(3).made, run(3).reused) == (15, 0, 15)
    assert run(3, tmp_path / "other").made == 15
    assert contents(tmp_path / "out") == contents(tmp_path / "other")
    assert not list((tmp_path / "out/work").iterdir())
    assert Store(tmp_path / "out").verify() == []


def test_result_without_manifest_is_made_again_once(run: Run, tmp_path: Path) -> None:
    """It stands where the new one belongs: it is replaced, and the next run finds all there."""
    run()
    whole = contents(tmp_path / "out")
    for stage in sorted(set(STAGES) - {"sample"}):
        folder = _only(tmp_path / "out", stage)
        (folder / MANIFEST).unlink()
        assert (run().made, run().made) == (1, 0)
        assert contents(tmp_path / "out") == whole


@pytest.mark.parametrize(
    "torn", [b"[]", b"", b"{", b"null", b'{"kind": "failed"}', b"[" * 100_000, b"9" * 6000, b"pipe"]
)
def test_torn_record_of_a_failure_is_tried_again(torn: bytes, run: Run, tmp_path: Path) -> None:
    """Whatever stands there instead of a record, a pipe too: the scene is made."""
    run(2, faults={"cloud:1": "reject"})
    (record,) = (tmp_path / "out/failed").iterdir()
    if torn == b"pipe":
        record.unlink()
        os.mkfifo(record)
    else:
        record.write_bytes(torn)
    assert Store(tmp_path / "out").verify() != []
    outcome = run(2)
    assert (outcome.rejected, outcome.failed, len(outcome.clouds)) == ({}, {}, 2)
    assert not list((tmp_path / "out/failed").iterdir())


@pytest.mark.parametrize(
    ("stage", "file", "needed_by"),
    [
        ("stage", "scene.usda", "capture"),
        ("capture", "000002.jpg", "model"),
        ("capture", "000002.jpg", "cloud"),
        ("model", "model.json", "cloud"),
        ("cloud", "coord.npy", "report"),
    ],
)
@pytest.mark.parametrize("damage", ["flip", "short", "missing", "extra", "manifest"])
def test_damaged_input_is_made_again_before_use(
    stage: str, file: str, needed_by: str, damage: str, run: Run, tmp_path: Path
) -> None:
    """A flipped, short, missing or extra file of an input: what is made from it has the bytes of a sound run."""
    out = tmp_path / "out"
    run()
    whole = contents(out)
    path = _only(out, stage) / file
    match damage:
        case "flip":
            _flip(path, 77)
        case "short":
            _overwrite(path, path.read_bytes()[:-1])
        case "missing":
            path.unlink()
        case "extra":
            (path.parent / "extra").write_text("no")
        case "manifest":
            _flip(path.parent / MANIFEST, 4001)
    shutil.rmtree(out / "store" / needed_by)
    assert run().made == 2
    if damage == "extra":
        assert [path.read_text() for path in (out / "foreign").glob("*/*/extra")] == ["no"]
        shutil.rmtree(out / "foreign")
    assert contents(out) == whole
    assert Store(out).verify() == []


def test_sound_inputs_are_hashed_once(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two consumers of one input read it once in a process."""
    run()
    shutil.rmtree(tmp_path / "out/store/cloud")
    shutil.rmtree(tmp_path / "out/store/report")
    from falsework.store import artefact

    read: list[Path] = []
    digest = artefact.file_digest
    monkeypatch.setattr(artefact, "file_digest", lambda path: (read.append(path), digest(path))[1])
    assert run().made == 2
    assert len(read) == len(set(read)) > 5


@pytest.mark.parametrize(
    "address", ["", "localhost", "tcp://h", "tcp://:1", "tcp://h:99999", "ws://h:1", "tcp://h:1/x"]
)
def test_no_address_of_a_scheduler(address: str, run: Run, tmp_path: Path) -> None:
    """It is refused by its form before the output folder is claimed."""
    with pytest.raises(InputError, match=r"--cluster.*tcp://HOST:PORT"):
        run(2, cluster=address)
    assert not (tmp_path / "out").exists()


def test_what_nobody_asks_for_counts_nowhere(run: Run, tmp_path: Path) -> None:
    """With stages and captures alone, no model or cloud is made, counted, named, or asked why there is none."""
    keep = ("stage", "capture")
    for made, reused in ((4, 0), (0, 4)):
        outcome = run(2, faults={"cloud:1": "reject"}, keep=keep)
        assert (outcome.made, outcome.reused, outcome.clouds, outcome.rejected) == (made, reused, [], {})
    rejected = run(2, faults={"cloud:1": "reject"})
    assert list(rejected.rejected) == ["0001"]
    assert [path.is_dir() for path in rejected.clouds] == [True]
    again = run(2, keep=keep)  # the clouds go; the rejection is of something that nobody wants now
    assert (again.made, again.reused, again.clouds, again.rejected) == (0, 4, [], {})
    assert not list((tmp_path / "out/store/cloud").iterdir())


@pytest.mark.parametrize("fault", ["input", "reject"])
def test_a_run_in_which_every_scene_fails_says_why(fault: str, run: Run, tmp_path: Path) -> None:
    """It ends as others do, with its counts and its page, and so does a share of a run that has no scene."""
    for _ in range(2):
        outcome = run(2, faults={"stage:0": fault, "stage:1": fault})
        assert sorted(outcome.failed if fault == "input" else outcome.rejected) == ["0000", "0001"]
    assert "0001" in (tmp_path / "out/run/report.html").read_text()
    assert run_scenario(tiny_scenario(2), tmp_path / "idle", SILENT, []).made == 0
    assert (tmp_path / "idle/run/report.html").is_file()


def test_a_pipe_among_the_records_is_not_waited_for(run: Run, tmp_path: Path) -> None:
    """In place of a log of times it is left out, in place of the scenario it is replaced."""
    run()
    for path in (tmp_path / "out/scenario.toml", *(tmp_path / "out/run").glob("*.jsonl")):
        path.unlink()
        os.mkfifo(path)
    assert run().reused == 5
    assert (tmp_path / "out/scenario.toml").is_file()


@pytest.mark.parametrize("fault", ["input", "child", "abort", "internal"])
def test_error_quarantines_one_scene(fault: str, run: Run, tmp_path: Path) -> None:
    """The others go on; the record tells cause, signal, last lines and attempts; it is tried again when asked for."""
    outcome = run(3, faults={"cloud:1": fault})
    assert list(outcome.failed) == ["0001"]
    assert len(outcome.clouds) == 2
    (path,) = (tmp_path / "out/failed").iterdir()
    record = json.loads(path.read_text())
    assert (record["kind"], record["stage"], record["attempts"]) == ("failed", "cloud", 1)
    assert record["signal"] == ("SIGABRT" if fault == "abort" else "")
    assert (record["last_lines"] != []) == (fault != "input")
    assert str(tmp_path) not in path.read_text()
    again = run(3)  # it would succeed now, and is left alone
    assert "--retry-failed" in again.failed["0001"]
    assert again.made == 0
    run(3, faults={"cloud:1": fault}, retry_failed=True)
    assert json.loads(path.read_text())["attempts"] == 2
    assert run(3, retry_failed=True).failed == {}
    assert not list((tmp_path / "out/failed").iterdir())
    run(3, tmp_path / "calm")
    assert contents(tmp_path / "out").keys() - {"failed"} == contents(tmp_path / "calm").keys()


def test_a_stop_that_a_library_turned_into_an_error_stops(run: Run, tmp_path: Path) -> None:
    """Ctrl-C while Open3D is imported is an `ImportError`: the scene is not blamed for it, and the run ends."""
    with pytest.raises(KeyboardInterrupt):
        run(3, faults={"capture:0": "stopped in an import"})
    assert not list((tmp_path / "out").glob("failed/*"))
    assert run(3).failed == {}


def test_killed_from_outside_is_tried_three_times(run: Run) -> None:
    """Whom somebody stopped or a disk failed leaves no record; a child that was killed is tried in two more runs."""
    for _ in range(4):
        assert "--retry-failed" not in run(2, faults={"cloud:1": "outside"}).failed["0001"]
    for _ in range(2):
        said = run(2, faults={"cloud:1": "device in a child"}).failed["0001"]
        assert "cannot be opened: Input/output error" in said
        assert "--retry-failed" not in said
    for _ in range(3):
        assert "--retry-failed" not in run(2, faults={"cloud:1": "short"}).failed["0001"]
    assert "--retry-failed" in run(2).failed["0001"]


def test_rejection_stands(run: Run) -> None:
    """What was rejected is a result, also for whom asks to try failures again."""
    for retry in (False, True):
        outcome = run(2, faults={"cloud:1": "reject"} if not retry else {}, retry_failed=retry)
        assert outcome.rejected == {"0001": "no_texture: nothing to match"}
        assert not outcome.failed


def test_the_only_scene_says_what_is_wrong_and_a_full_disk_stops(run: Run, tmp_path: Path) -> None:
    """Bad input of a scenario of one scene is raised and not remembered; a full disk ends any run."""
    with pytest.raises(InputError, match=r"bridge\.spans"):
        run(faults={"stage:0": "input"})
    with pytest.raises(OutOfSpaceError):
        run(2, faults={"cloud:0": "space"})
    log = tmp_path / f"out/run/{platform.node()}-{os.getpid()}.jsonl"
    log.unlink()
    log.symlink_to("/dev/full")  # full only at the line of the log
    with pytest.raises(OutOfSpaceError):
        run(2)
    log.unlink()
    assert not (tmp_path / "out/failed").exists()
    assert run(2).failed == {}


def test_remade_input_of_other_bytes_is_said(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where a damaged input does not come back as it was, a line says so."""
    run()
    out = tmp_path / "out"
    _flip(_only(out, "stage") / "scene.usda", 9)
    shutil.rmtree(out / "store/capture")
    monkeypatch.setattr(tiny_chain, "TEXTURE", b"another")
    said: list[str] = []

    class Listener(Silent):
        def note(self, message: str) -> None:
            said.append(message)

    run_scenario(tiny_scenario(), out, Listener())
    assert any("scene.usda: changed: the result is made again" in line for line in said)
    assert any("its bytes differ from the former ones" in line for line in said)


def test_scenes_of_a_run_share_their_textures(run: Run, tmp_path: Path) -> None:
    """One file under `store/texture` for all; one that was painted on is found, and put right by the next scene."""
    out = tmp_path / "out"
    run(2)
    textures = sorted(out.glob("store/stage/*/textures/steel.png"))
    (shared,) = (out / "store/texture").iterdir()
    assert len({path.stat().st_ino for path in (*textures, shared)}) == 1
    assert {path.name for path in tmp_path.rglob("*") if path.is_file() and path.stat().st_nlink > 1} == {
        "steel.png",
        shared.name,
    }
    _flip(shared, 5)
    assert [line.split(": ")[-1] for line in Store(out).verify()] == ["changed"] * 3
    shutil.rmtree(textures[0].parents[1])
    shutil.rmtree(out / "store/capture")
    assert run(2).made == 4  # the missing stage; the other one, for it is damaged and needed; both captures
    assert Store(out).verify() == []


@pytest.mark.faults
@pytest.mark.parametrize("count", [pytest.param(2, marks=pytest.mark.proof_only), 4])
def test_several_processes_share_one_output(count: int, tmp_path: Path, record_proof: RecordProof) -> None:
    """All end well, together make everything once, and leave the tree of one that was alone."""
    scenario = tmp_path / "s.toml"
    scenario.write_text(f'seed = {tiny_chain.SEED}\nscenes = 3\n[[survey]]\nkind = "global"\n')
    words = ("run", scenario, "-o", tmp_path / "out", "--json")
    processes = [start(*words, TINY_WAIT="0.01") for _ in range(count)]
    answers = [process.communicate(timeout=left()) for process in processes]
    assert [process.returncode for process in processes] == [0] * count, answers
    results = sum(json.loads(said)["made"] for said, _ in answers)
    assert results == 15
    assert forked.run("run", scenario, "-o", tmp_path / "alone", said=tmp_path / "said") == 0
    assert "Traceback" not in (tmp_path / "said").read_text()
    assert contents(tmp_path / "out") == contents(tmp_path / "alone")
    made = sum(json.loads(said)["made"] > 0 for said, _ in answers)
    assert len(list((tmp_path / "out/run").glob("*.jsonl"))) >= made  # one of each that had something to do
    figures = {
        "results_made": results,
        "processes_that_made_some": made,
        "files_alike": len(contents(tmp_path / "out")),
    }
    record_proof(f"faults: {count} processes on one output", count, tiny_chain.SEED, figures)
