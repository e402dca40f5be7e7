"""What `verify` finds: every flipped bit, and everything missing, misplaced, dangling or foreign."""

import json
import pkgutil
import random
import shutil
from pathlib import Path
from typing import Any

import pytest

from falsework.store.artefact import task_key
from falsework.store.store import Store, Task
from groundwork.files import MANIFEST, write_json, write_manifest
from tests.conftest import Count

STAGE = Task("stage", 1, {"seed": 7, "name": "Brücke", "length": 12.5}, {})
CAPTURE = Task("capture", 2, {"seed": 7}, {"stage": STAGE.key})
CLOUD = Task("cloud", 3, {"recon": {"mode": "sparse"}}, {"capture": CAPTURE.key})
TASKS = (STAGE, CAPTURE, CLOUD)


def _fill(folder: Path) -> None:
    (folder / "sub").mkdir()
    (folder / "a.txt").write_text("alpha")
    (folder / "sub" / "b.bin").write_bytes(bytes(range(256)))


@pytest.fixture
def store(tmp_path: Path) -> Store:
    """Give a store with a small chain, linked from one scene."""
    store = Store(tmp_path / "out")
    for task in TASKS:
        store.produce(task, _fill)
        store.link(f"scenes/0000/{task.stage}", task)
    assert store.verify() == []
    return store


def _flip(path: Path, bit: int) -> bytes:
    """Flip a bit of a file; give its former bytes."""
    former = path.read_bytes()
    data = bytearray(former)
    data[bit // 8] ^= 1 << bit % 8
    path.chmod(0o644)
    path.write_bytes(bytes(data))
    return former


def test_every_flipped_bit_of_a_manifest_is_found(store: Store, proof_count: Count) -> None:
    """No bit of `artefact.json` can change unseen, white space and case of digits included."""
    path = store.folder(STAGE) / MANIFEST
    bits = range(8 * path.stat().st_size)
    for bit in random.Random(0).sample(bits, proof_count(250, len(bits))):
        former = _flip(path, bit)
        assert len(store.verify()) == 1, bit
        path.write_bytes(former)
    assert store.verify() == []


def test_every_flipped_bit_of_a_result_is_found(store: Store, proof_count: Count) -> None:
    """Any bit of any stored file."""
    files = sorted(path for path in store.root.glob("store/**/*") if path.is_file())
    draw = random.Random(1)
    for _ in range(proof_count(60, 1000)):
        path = draw.choice(files)
        former = _flip(path, draw.randrange(8 * path.stat().st_size))
        (line,) = store.verify()
        assert path.name in line
        path.write_bytes(former)


@pytest.mark.parametrize(
    ("task", "what"),  # nothing would refer to the cloud without its link
    [
        (task, what)
        for task in TASKS
        for what in ("folder", "manifest", "link too")
        if (task, what) != (CLOUD, "link too")
    ],
)
def test_missing_results_are_found(task: Task, what: str, store: Store) -> None:
    """A deleted result is missed by its link or by what was made from it; a deleted manifest by its folder."""
    folder = store.folder(task)
    if what == "manifest":
        (folder / MANIFEST).unlink()
    else:
        shutil.rmtree(folder)
    if what == "link too":
        (store.root / "scenes/0000" / task.stage).unlink()
    assert any(task.key in line and "missing" in line for line in store.verify())


def test_misplaced_and_foreign_things_are_found(store: Store) -> None:
    """A result under another key or stage, strangers' files, and links that lead elsewhere: each has its line."""
    out = store.root
    shutil.copytree(store.folder(STAGE), out / "store/stage" / ("0" * 64))
    shutil.copytree(store.folder(CAPTURE), out / "store/cloud" / CAPTURE.key)
    (out / "store/notes.txt").write_text("mine")
    (out / "store/stage/notes.txt").write_text("mine")
    (out / "scenes/0000/notes.txt").write_text("mine")
    (out / "scenes/0000/out").symlink_to("../../../elsewhere")
    (out / "scenes/0000/passwords").symlink_to("/etc/passwd")
    (store.folder(CLOUD) / "alias").symlink_to("a.txt")
    (store.folder(CLOUD) / "gone").symlink_to("nowhere")
    said = "\n".join(store.verify())
    for words in (
        f"store/stage/{'0' * 64}: misplaced: it belongs to store/stage/{STAGE.key}",
        f"store/cloud/{CAPTURE.key}: misplaced: it belongs to store/capture/{CAPTURE.key}",
        "store/notes.txt: foreign",
        "store/stage/notes.txt: foreign",
        "scenes/0000/notes.txt: foreign",
        "scenes/0000/out: leads out",
        "scenes/0000/passwords: leads out",
        "alias: not in the manifest",
        "gone: not in the manifest",
    ):
        assert words in said
    assert len(said.splitlines()) == 9


def test_file_replaced_by_a_link_is_found(store: Store) -> None:
    """A link to the very same bytes is not the file that was stored."""
    file = store.folder(STAGE) / "a.txt"
    shutil.copy(file, store.root / "run.txt")  # inside an atomic folder
    file.unlink()
    file.symlink_to(store.root / "run.txt")
    (line,) = store.verify()
    assert line.endswith("a.txt: not a regular file")


def test_stores_of_the_former_version_are_read(store: Store) -> None:
    """A manifest without a digest of itself is whole, and its flips are found, too."""
    folder = store.folder(STAGE)
    (folder / MANIFEST).unlink()
    write_manifest(folder, {"format_version": 1, "key": STAGE.key, **STAGE.record})
    assert store.verify() == []
    assert not store.produce(STAGE, lambda folder: pytest.fail("made again"))
    assert store.faults(STAGE) == []
    path = folder / MANIFEST
    for bit in random.Random(2).sample(range(8 * path.stat().st_size), 100):
        former = _flip(path, bit)
        assert store.verify() != [], bit
        path.write_bytes(former)


@pytest.mark.parametrize("field", ["stage", "version", "settings", "inputs"])
def test_every_field_of_the_key_is_held(field: str, store: Store) -> None:
    """A manifest that tells of another task, its digest made right again, is found by its key."""
    from groundwork.canonical import digest

    path = store.folder(STAGE) / MANIFEST
    manifest = json.loads(path.read_text())
    manifest[field] = {"stage": "capture", "version": 2, "settings": {}, "inputs": {"stage": "0"}}[field]
    del manifest["digest"]
    write_json(path, {**manifest, "digest": digest(manifest)})
    assert any("its key is not the hash of its contents" in line for line in store.verify())
    assert task_key(*(manifest[name] for name in ("stage", "version", "settings", "inputs"))) != STAGE.key


@pytest.mark.parametrize("at", ["read_manifest", "file_faults", "os.path.normpath"])
def test_a_run_may_remove_results_meanwhile(at: str, store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    """A capture evicted before its manifest, its files or its link are read is no fault."""
    before: Any = pkgutil.resolve_name(f"falsework.store.verification:{at}")
    waiting = [CAPTURE]

    def evict(*given: Any, **more: Any) -> Any:
        if waiting and CAPTURE.key in str(given[0]):
            store.evict(waiting.pop(), "scenes/0000/capture")
        return before(*given, **more)

    monkeypatch.setattr(f"falsework.store.verification.{at}", evict)
    assert store.verify() == []
    assert not waiting
