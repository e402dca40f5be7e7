"""The store: a result is whole or absent, is made once, and is found again by what it depends on."""

import os
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from falsework.store.failures import ATTEMPTS, failure_of
from falsework.store.store import Store, Task
from groundwork.errors import ChildError, InputError, RejectedSceneError

TASK = Task("stage", 1, {"seed": 7}, {"parent": "abc"})

JSON = st.recursive(st.none() | st.booleans() | st.integers() | st.text(), lambda inner: st.lists(inner), max_leaves=5)


def _write(folder: Path) -> None:
    (folder / "a.txt").write_text("alpha")
    (folder / "sub").mkdir()
    (folder / "sub" / "b.bin").write_bytes(b"\x00\x01")


def test_second_request_makes_nothing(tmp_path: Path) -> None:
    """A result that is there is not made again, and its bytes verify."""
    store = Store(tmp_path)
    assert store.produce(TASK, _write)
    assert not store.produce(TASK, lambda folder: pytest.fail("made twice"))
    assert store.verify() == []
    assert not list((tmp_path / "work").iterdir())
    (manifest,) = tmp_path.rglob("artefact.json")
    assert {path.stat().st_mode & 0o777 for path in manifest.parent.rglob("*.*")} == {0o444}


@given(st.dictionaries(st.text(), JSON, min_size=1))
def test_key_depends_on_everything_and_on_no_order(settings: dict[str, object]) -> None:
    """Every part of a task changes its key; the order of the settings does not."""
    task = Task("stage", 1, settings, {"parent": "abc"})
    turned = Task("stage", 1, dict(reversed(settings.items())), {"parent": "abc"})
    assert task.key == turned.key
    others = [
        Task("cloud", 1, settings, {"parent": "abc"}),
        Task("stage", 2, settings, {"parent": "abc"}),
        Task("stage", 1, {**settings, "one more": 1}, {"parent": "abc"}),
        Task("stage", 1, settings, {"parent": "abd"}),
    ]
    assert len({task.key, *(other.key for other in others)}) == 5
    assert Task("stage", 1, settings, {"parent": "abc"}, {"workers": 4}).key == task.key  # the same bytes


def test_two_processes_may_evict_one_result(tmp_path: Path) -> None:
    """The second one finds it gone, and leaves the record of the first as it is."""
    store = Store(tmp_path)
    store.produce(TASK, _write)
    store.link("scenes/0000/stage", TASK)
    for _ in range(2):
        store.evict(TASK, "scenes/0000/stage")
        assert not store.has(TASK)
        assert set(store.evicted_files(TASK) or {}) == {"a.txt", "sub/b.bin"}
    assert not (tmp_path / "scenes/0000/stage").is_symlink()
    assert not list((tmp_path / "work").iterdir())


def test_failure_leaves_no_result(tmp_path: Path) -> None:
    """An exception in the middle leaves nothing under the final name, and the next try starts clean."""
    store = Store(tmp_path)

    def half(folder: Path) -> None:
        _write(folder)
        raise RuntimeError("in the middle")

    with pytest.raises(RuntimeError):
        store.produce(TASK, half)
    assert not store.has(TASK)
    seen: list[list[Path]] = []
    assert store.produce(TASK, lambda folder: (seen.append(list(folder.iterdir())), _write(folder))[1])
    assert seen == [[]]


def test_rejection_is_remembered(tmp_path: Path) -> None:
    """A rejected scene is a result: it is not computed again, and keeps its reason."""

    def reject(folder: Path) -> None:
        raise RejectedSceneError("no_texture", "nothing to match")

    store = Store(tmp_path)
    for make in (reject, lambda folder: pytest.fail("computed again")):
        with pytest.raises(RejectedSceneError, match="nothing to match") as caught:
            store.produce(TASK, make)
        assert caught.value.reason == "no_texture"
    assert store.verify() == []
    (record,) = (tmp_path / "failed").iterdir()
    record.write_text('{"format_version": 2')
    assert store.verify() == [f"failed/{record.name}: not a record of a failure"]


def test_verify_finds_every_kind_of_damage(tmp_path: Path) -> None:
    """A changed, a missing and an extra file are each named."""
    store = Store(tmp_path)
    store.produce(TASK, _write)
    folder = store.folder(TASK)
    (folder / "a.txt").chmod(0o644)
    (folder / "a.txt").write_text("alphb")
    (folder / "sub" / "b.bin").unlink()
    (folder / "c").write_text("new")
    found = sorted(line.rsplit("/", 1)[-1] for line in store.verify())
    assert found == ["a.txt: changed", "b.bin: missing", "c: not in the manifest"]


@pytest.mark.faults
def test_kill_in_the_middle_then_resume(tmp_path: Path) -> None:
    """A process killed while it makes a result leaves no visible part, and its lock falls with it."""
    code = """
        import sys, time
        from pathlib import Path
        from falsework.store.store import Store, Task
        def make(folder):
            (folder / "a.txt").write_text("half")
            print("begun", flush=True)
            time.sleep(120)
        Store(Path(sys.argv[1])).produce(Task("stage", 1, {"seed": 7}, {"parent": "abc"}), make)
    """
    process = subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(code), str(tmp_path)], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "begun\n"
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    store = Store(tmp_path)
    assert not store.has(TASK)
    begin = time.monotonic()
    assert store.produce(TASK, _write)
    assert time.monotonic() - begin < 90  # it does not wait for the one that was killed
    assert store.verify() == []


def test_the_next_try_finds_what_a_killed_one_left(tmp_path: Path) -> None:
    """A task whose process was killed is tried again from what is there; after the last try nobody goes on with it."""
    store, found = Store(tmp_path), []

    def killed(folder: Path) -> None:
        found.append(sorted(path.name for path in folder.iterdir()))
        (folder / f"try_{len(found)}").touch()
        raise ChildError("died of SIGKILL", signal="SIGKILL")

    for _ in range(ATTEMPTS):
        with pytest.raises(ChildError):
            store.produce(TASK, killed, resume=True, quarantine=True)
        last = len(found) == ATTEMPTS
        store.sweep()
        assert (tmp_path / "work" / TASK.key).exists() != last
    assert found == [[f"try_{number + 1}" for number in range(tries)] for tries in range(ATTEMPTS)]


@pytest.mark.parametrize(
    ("root", "said", "kept"),
    [
        ("/d/out", "/d/out/work/a: broken", "OUT/work/a: broken"),
        ("/d/out", "in '/d/out', file:///d/out/b. See /d/out.", "in 'OUT', file://OUT/b. See OUT."),
        (
            "/d/out",
            "/d/outer/a, /d/out-2, /d/out.old and /mnt/d/out",
            "/d/outer/a, /d/out-2, /d/out.old and /mnt/d/out",
        ),
        ("out", "timeout: ran out of memory in out/work/a", "timeout: ran out of memory in OUT/work/a"),
        ("out", "in_out/a, lay-out/b, ../out/c", "in_out/a, lay-out/b, ../out/c"),
        ("a", "a bad value: a/work", "a bad value: OUT/work"),
    ],
)
def test_a_record_of_a_failure_names_no_place_of_the_run(root: str, said: str, kept: str) -> None:
    """The path of the run becomes OUT, so that it can be moved; words and other paths that contain it stay."""
    failure = failure_of(InputError(said), 1, Path(root))
    assert failure is not None
    assert failure.message == kept


def test_a_torn_record_of_a_failure_is_none(tmp_path: Path) -> None:
    """What its task left in the works is not swept, and it is tried again."""
    store = Store(tmp_path)
    (tmp_path / "work" / TASK.key).mkdir(parents=True)
    (tmp_path / "failed").mkdir()
    (tmp_path / "failed" / f"{TASK.key}.json").write_text('{"format_version": 2, "kind": "rej')
    store.sweep()
    assert (tmp_path / "work" / TASK.key).is_dir()
    assert store.produce(TASK, _write)


def test_links_are_relative_and_replaced(tmp_path: Path) -> None:
    """A readable name survives moving the whole output, and a second link replaces the first."""
    store = Store(tmp_path / "out")
    tasks = [Task("stage", 1, {"seed": seed}, {}) for seed in (1, 2)]
    for task in tasks:
        store.produce(task, _write)
        store.link("scenes/0000/stage", task)
    moved = store.root.rename(tmp_path / "moved")
    assert (moved / "scenes" / "0000" / "stage").resolve() == Store(moved).folder(tasks[1])
    assert not list((moved / "work").iterdir())


def test_a_name_is_removed_only_if_it_is_a_link(tmp_path: Path) -> None:
    """A result that is let go loses its readable name; a file of the user at such a place stays."""
    store = Store(tmp_path)
    store.produce(TASK, _write)
    store.link("scenes/0000/stage", TASK)
    (tmp_path / "scenes" / "0000" / "mine").write_text("mine")
    for name in ("scenes/0000/stage", "scenes/0000/mine", "scenes/0000/nothing"):
        store.unlink(name)
    assert [path.name for path in (tmp_path / "scenes" / "0000").iterdir()] == ["mine"]
