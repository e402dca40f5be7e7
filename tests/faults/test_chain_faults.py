"""A whole run of tiny stages: killed, out of space, damaged, shared; the end is the tree of one left in peace."""

import errno
import json
import os
import random
import signal
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pytest

from authoring.looks import library
from authoring.looks.library import SheetName, bake_sheets
from falsework.execution import chain
from falsework.pipeline import run_scenario
from falsework.stages import STAGES
from falsework.store.store import Store
from groundwork import files
from groundwork.errors import InputError, OutOfSpaceError
from groundwork.files import MANIFEST
from groundwork.progress import SILENT
from tests.conftest import Count, RecordProof
from tests.falsework.forked import begin, end_of, fork, run
from tests.falsework.tiny_chain import SEED, contents, start, tiny_scenario, tiny_stages
from tests.faults.test_output_faults import Hook, Killed, calls_of, failing_at, killed_at, traced
from tests.patience import left

pytestmark = pytest.mark.faults
SCENES = 3
SAMPLE = '[[sample]]\nid = "laser"\nkind = "mesh"\n'
CHAIN = ("stage", "sample", "capture", "model", "cloud", "report")  # in the order in which a scene makes them
Tree = dict[str, str]


@pytest.fixture(scope="module")
def scenario(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give a scenario of some scenes with every stage."""
    path = tmp_path_factory.mktemp("scenario") / "s.toml"
    path.write_text(f'seed = {SEED}\nscenes = {SCENES}\n[[survey]]\nkind = "global"\n{SAMPLE}')
    return path


@pytest.fixture(scope="module")
def calm(scenario: Path, tmp_path_factory: pytest.TempPathFactory) -> Tree:
    """Give the tree of a run that nobody disturbed."""
    folder = tmp_path_factory.mktemp("calm")
    _finish(scenario, folder / "out", folder / "said")
    return contents(folder / "out")


def _finish(scenario: Path, out: Path, said: Path, *words: str) -> None:
    code = run("run", scenario, "-o", out, *words, said=said)
    assert code == 0, said.read_text()
    assert "Traceback" not in said.read_text()


def test_killed_at_random_moments(
    scenario: Path, calm: Tree, tmp_path: Path, proof_count: Count, record_proof: RecordProof
) -> None:
    """`kill -9` of the whole run, then the same command: outside `run/` the tree of one that nobody disturbed."""
    draw, said, wanted = random.Random(24), tmp_path / "said", proof_count(3, 50)
    clock = time.monotonic()
    _finish(scenario, tmp_path / "first", said)
    length = time.monotonic() - clock
    killed = whole = alike = 0
    while killed < wanted:
        out = tmp_path / str(killed + whole)
        pid = begin("run", scenario, "-o", out, said=said)
        time.sleep(draw.random() * length)
        os.kill(pid, signal.SIGKILL)
        if end_of(pid) == 0:
            whole += 1  # it was faster
            length *= 0.9
        else:
            killed += 1
        _finish(scenario, out, said)
        alike += contents(out) == calm
        assert alike == killed + whole
    record_proof("faults: run killed at random moments", killed, 24, {"kills": killed, "identical_trees": alike})


def test_a_worker_killed_in_each_stage(
    scenario: Path, calm: Tree, tmp_path: Path, proof_count: Count, record_proof: RecordProof
) -> None:
    """`kill -9` of a worker while it makes each kind of result, two workers at once: the tree of a single process."""
    rounds, deaths = proof_count(1, 5), 0
    stages = CHAIN[proof_count(2, 0) :: proof_count(3, 1)]  # one that goes on; one that begins anew, the last one
    faults = {f"{stage}:{number % SCENES}": "kill" for number, stage in enumerate(stages)}
    for number in range(rounds):
        out, once = tmp_path / f"out{number}", tmp_path / f"once{number}"
        once.mkdir()
        process = start(
            "run", scenario, "-o", out, "--workers", "2", TINY_FAULTS=json.dumps(faults), TINY_ONCE=str(once)
        )
        _, said = process.communicate(timeout=left())
        assert process.returncode == 0, said
        assert {path.name.partition("-")[0] for path in once.iterdir()} == set(stages)
        deaths += len(list(once.iterdir()))
        assert contents(out) == calm
    record_proof("faults: a worker killed in each stage", deaths, SEED, {"kills": deaths, "identical_trees": rounds})


def test_a_full_disk_in_each_stage(
    scenario: Path, calm: Tree, tmp_path: Path, proof_count: Count, record_proof: RecordProof
) -> None:
    """No file may grow any more (RLIMIT_FSIZE) from one stage on: exit code 4, one line; then it goes on."""
    rounds = proof_count(1, 3)
    for index in range(rounds):
        out, said = tmp_path / f"out{index}", tmp_path / "said"
        for stage in CHAIN:
            faults = json.dumps({f"{stage}:{index}": "full"})
            code = run("run", scenario, "-o", out, said=said, TINY_FAULTS=faults)
            assert code == 4, (stage, said.read_text())
            last = said.read_text().splitlines()[-1]
            assert last.startswith("falsework: ")
            assert last.endswith("no space left on the disk. Free some space, then run the same command again")
            assert "Traceback" not in said.read_text()
        _finish(scenario, out, said)
        assert contents(out) == calm
    record_proof("faults: disk full in each stage", rounds * len(CHAIN), SEED, {"exit_code_4": rounds * len(CHAIN)})


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> Callable[[Path], Tree]:
    """Give what runs one scene of tiny stages here, and tells its tree."""
    for name, stage in tiny_stages().items():
        monkeypatch.setitem(STAGES, name, stage)
    monkeypatch.setattr(chain, "render_platform", lambda device="auto": {"gl_renderer": "none"})
    monkeypatch.setattr(chain, "recon_platform", lambda: {"cpu": "none"})
    monkeypatch.setenv("TINY_FAULTS", "{}")

    def make(out: Path) -> Tree:
        run_scenario(tiny_scenario(2, keep=("stage", "cloud")), out, SILENT, [1])
        return contents(out)

    return make


@pytest.mark.parametrize("fault", ["killed", "ENOSPC", "EIO"])
def test_faults_at_every_call(
    fault: str,
    small: Callable[[Path], Tree],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    proof_count: Count,
    record_proof: RecordProof,
) -> None:
    """Each mkdir, open, write, fsync, rename, unlink fails or is the last one, also where results are let go."""
    monkeypatch.setattr(os, "fsync", lambda handle: None)  # which calls are made counts here, not the waiting
    whole = small(tmp_path / "calm")
    total = calls_of(lambda: small(tmp_path / "counted"))
    assert total > 100
    tried = sorted(random.Random(fault).sample(range(total), min(total, proof_count(15, 1000))))
    for call in tried:
        out = tmp_path / f"{fault}{call}"
        hook: Hook = killed_at(call) if fault == "killed" else failing_at(call, getattr(errno, fault))
        try:
            with traced(hook):
                small(out)
        except (Killed, OSError, OutOfSpaceError, InputError):  # the last one names a file that cannot be opened
            pass
        assert small(out) == whole, call
    record_proof(f"faults: {fault} at each system call of a run", len(tried), 0, {"calls": len(tried)})


def test_results_are_on_the_disk_before_they_have_their_name(
    small: Callable[[Path], Tree], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every file and folder of a result is synced before its rename, the folder that names it after it."""
    synced: set[str] = set()
    late: list[str] = []
    named: list[str] = []

    def watch(number: int, name: str, arguments: tuple[object, ...], is_after: bool) -> None:
        if name == "fsync" and is_after:
            synced.add(str(Path(f"/proc/self/fd/{arguments[0]}").readlink()))
        elif name == "rename" and "/store/" in str(arguments[1]):
            work, place = Path(str(arguments[0])), Path(str(arguments[1]))
            if is_after:
                named.append(str(place.parent))
            else:
                late.extend(str(path) for path in (work, *work.rglob("*")) if str(path) not in synced)
                synced.discard(str(place.parent))

    with traced(watch):
        small(tmp_path / "out")
    assert (late, len(named)) == ([], 4)
    assert set(named) <= synced
    monkeypatch.setattr(files, "sync", lambda path: None)
    synced.clear()
    with traced(watch):
        small(tmp_path / "careless")
    assert late  # without fsync this test would fail


def test_flipped_bits_are_all_found(
    scenario: Path, calm: Tree, tmp_path: Path, proof_count: Count, record_proof: RecordProof
) -> None:
    """Any bit of any stored file; a repair brings the former tree back."""
    out, said, draw, flips = tmp_path / "out", tmp_path / "said", random.Random(100), proof_count(50, 500)
    _finish(scenario, out, said)
    stored = sorted(path for path in out.glob("store/*/*/**/*") if path.is_file())
    kinds: Counter[str] = Counter()
    for _ in range(flips):
        path = draw.choice(stored)
        former = path.read_bytes()
        data = bytearray(former)
        bit = draw.randrange(8 * len(data))
        data[bit // 8] ^= 1 << bit % 8
        path.chmod(0o644)
        path.write_bytes(data)
        lines = Store(out).verify()
        assert [line for line in lines if path.name in line], (path, bit)
        kinds["manifest" if path.name == MANIFEST else path.parents[1].name] += 1
        path.write_bytes(former)
        path.chmod(0o444)
    for path in stored[::7]:
        path.chmod(0o644)
        path.write_bytes(b"another")
        path.chmod(0o444)  # a disk that loses bits keeps modes
    assert run("verify", out, said=said) == 1
    assert run("verify", out, "--repair", said=said) == 0, said.read_text()
    assert contents(out) == calm
    record_proof("faults: flipped bits of stored results", flips, 100, {"flips": flips, "found": sum(kinds.values())})


CHILD_FAULTS = {
    "aborts in a child": ("SIGABRT", "died of SIGABRT"),
    "hangs in a child": ("", "ran longer than"),
    "eats in a child": ("", "GB of memory"),
}


def test_children_that_abort_hang_or_eat_cost_their_scene_alone(
    scenario: Path, calm: Tree, tmp_path: Path, record_proof: RecordProof
) -> None:
    """The others go on, the record names signal or limit, exit code 3; tried again, the tree is the calm one."""
    out, said = tmp_path / "out", tmp_path / "said"
    faults = json.dumps({f"model:{index}": fault for index, fault in enumerate(CHILD_FAULTS)})
    (tmp_path / "three.toml").write_text(scenario.read_text().replace("scenes = 3", "scenes = 4"))
    assert run("run", tmp_path / "three.toml", "-o", out, said=said, TINY_FAULTS=faults) == 3
    records = [json.loads(path.read_text()) for path in (out / "failed").iterdir()]
    assert len(list((out / "store/cloud").iterdir())) == 1
    for signal_name, words in CHILD_FAULTS.values():
        (record,) = (one for one in records if words in one["message"])
        assert (record["kind"], record["signal"], record["attempts"]) == ("failed", signal_name, 1)
    assert "Traceback" not in said.read_text()
    _finish(tmp_path / "three.toml", out, said, "--retry-failed")
    assert calm.items() <= {**contents(out), "scenario.toml": calm["scenario.toml"]}.items()
    record_proof("faults: SIGABRT, time and memory in a child", len(records), SEED, {"quarantined": len(records)})


@pytest.mark.parametrize("count", [2, 4])
def test_processes_share_one_cold_cache(
    count: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, record_proof: RecordProof
) -> None:
    """All begin at once with nothing there: a sheet is drawn once between them, and nobody sees a part of it."""
    names = [SheetName("rubber", number, 64) for number in range(2)]
    draw = library.draw_sheet

    def drawn(name: SheetName, bank: library.Bank | None) -> tuple[dict[str, bytes], dict[str, object]]:
        (tmp_path / f"drawn-{name.number}-{os.getpid()}").touch()
        return draw(name, bank)

    monkeypatch.setattr(library, "draw_sheet", drawn)
    gate, done = os.pipe()

    def bake() -> None:
        os.close(done)
        os.read(gate, 1)  # until the last one closes it
        for place in bake_sheets(names, tmp_path / "cache").values():
            assert library._whole(place)

    pids = [fork(bake) for _ in range(count)]
    os.close(done)
    codes = [end_of(pid) for pid in pids]
    os.close(gate)
    assert codes == [0] * count
    drawings = len(list(tmp_path.glob("drawn-*")))
    assert drawings == len(names)
    assert not [path for path in (tmp_path / "cache").iterdir() if path.name.startswith(".")]
    ended = {"ended_well": codes.count(0), "sheets_drawn": drawings}
    record_proof(f"faults: {count} processes on one cold cache", count, 0, ended)
