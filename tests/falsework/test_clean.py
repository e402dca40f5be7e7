"""What `clean` removes from a run's folder, what it leaves alone, and the bytes that it says are freed."""

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from falsework.cli import main
from falsework.commands.clean import Cleaning, clean
from falsework.execution import chain
from falsework.pipeline import Outcome, run_scenario
from falsework.stages import STAGES
from falsework.store.store import Store
from groundwork.errors import InputError
from groundwork.locks import hold_lock
from groundwork.marks import TEMPORARY
from groundwork.progress import SILENT
from tests.falsework.tiny_chain import contents, tiny_scenario, tiny_stages

Run = Callable[..., Outcome]
KEY = "ab" * 32


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Run:
    """Give `run(scenes=1, faults=None, gpu="none", **settings)` on tiny stages."""
    for name, stage in tiny_stages().items():
        monkeypatch.setitem(STAGES, name, stage)
    monkeypatch.setattr(chain, "recon_platform", lambda: {"cpu": "none"})

    def run(scenes: int = 1, faults: dict[str, str] | None = None, gpu: str = "none", **more: Any) -> Outcome:
        monkeypatch.setattr(chain, "render_platform", lambda device="auto": {"gl_renderer": gpu})
        monkeypatch.setenv("TINY_FAULTS", json.dumps(faults or {}))
        return run_scenario(tiny_scenario(scenes, **more), tmp_path / "out", SILENT)

    return run


def _used(out: Path) -> int:
    """Add up the files of a folder, each once however many links it has [bytes]."""
    files = [path.lstat() for path in out.rglob("*") if path.is_file() and not path.is_symlink()]
    return sum({(seen.st_dev, seen.st_ino): seen.st_size for seen in files}.values())


def _clean_twice(out: Path, **how: bool) -> Cleaning:
    """Say what would go, check that nothing went, let it go, and check the bytes and that nothing more is to go."""
    before, used = contents(out), _used(out)
    said = clean(out, SILENT, dry_run=True, **how)
    assert contents(out) == before
    done = clean(out, SILENT, **how)
    assert (done, done.freed) == (said, used - _used(out))
    assert clean(out, SILENT, **how).removed == []
    return done


def _leave(out: Path, key: str = KEY) -> None:
    """Leave what a killed process leaves: a half-made result, its lock, a damaged one, a link, temporary files."""
    (out / "work" / key / "inner").mkdir(parents=True)
    (out / "work" / key / "inner/000000.jpg").write_bytes(bytes(5000))
    (out / "work" / f"{key}.aside").mkdir()
    (out / "work" / f"{key}.aside/scene.usda").write_bytes(bytes(700))
    (out / "work" / f"{key}.lock").touch()
    (out / "work" / "link.0123456789abcdef").symlink_to("../store")
    (out / "failed").mkdir(exist_ok=True)
    for folder in (out, out / "failed"):
        (folder / f"{TEMPORARY}0123456789abcdef").write_bytes(bytes(30))


def test_leftovers_of_killed_runs_go(run: Run, tmp_path: Path) -> None:
    """All of them, and nothing else: the tree is that of the run before."""
    out = tmp_path / "out"
    run(2)
    (out / "failed").mkdir()
    whole = contents(out)
    _leave(out)
    assert _clean_twice(out).freed == 5000 + 700 + 2 * 30
    assert contents(out) == whole
    assert Store(out).verify() == []


def test_nothing_of_a_running_process_goes(run: Run, tmp_path: Path) -> None:
    """A half-made result whose lock is held stays, the one beside it goes; temporary files stay; no `--unused`."""
    out = tmp_path / "out"
    run()
    _leave(out)
    _leave_other = out / "work" / ("cd" * 32)
    _leave_other.mkdir()
    with hold_lock(out / "work" / f"{KEY}.lock"):
        with pytest.raises(InputError, match="a run is in progress"):
            clean(out, SILENT, unused=True)
        assert (out / "work" / KEY / "inner/000000.jpg").is_file()
        said = clean(out, SILENT, dry_run=True)
        done = clean(out, SILENT)
        assert said == done
        assert [one.key for one in done.removed] == ["cd" * 32, "link"]
        assert (out / "work" / KEY / "inner/000000.jpg").is_file()
        assert (out / "work" / f"{KEY}.lock").is_file()
        assert (out / f"{TEMPORARY}0123456789abcdef").is_file()
    assert len(clean(out, SILENT).removed) == 3


def test_lock_taken_after_the_look_is_respected(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Somebody begins between finding and removing: it stays, and is not counted."""
    from falsework.store import leftovers

    out = tmp_path / "out"
    run()
    _leave(out)
    monkeypatch.setattr(leftovers, "is_held", lambda lock, **more: False)
    with hold_lock(out / "work" / f"{KEY}.lock"):
        done = clean(out, SILENT)
    assert (out / "work" / KEY / "inner/000000.jpg").is_file()
    assert (done.freed, len(done.left)) == (60, 1)


def test_strangers_files_stay(run: Run, tmp_path: Path) -> None:
    """Whatever we did not write, in every folder of the run, under names near ours, through links as well."""
    out = tmp_path / "out"
    run(2)
    mine = [
        out / name
        for name in (
            "notes.txt",
            f"{TEMPORARY}mine",
            "work/notes.txt",
            "work/abc/x",
            f"work/{KEY}x/y",
            f"work/{KEY}.{'0' * 16}/x",
            "failed/list.json",
            "failed/a.txt",
            "store/notes.txt",
            "store/mine/x",
            f"store/cloud/{KEY}/coord.npy",
            "store/texture/mine.png",
            "scenes/0001/notes.txt",
            "evicted/cloud/a.json",
            "run/notes.txt",
        )
    ]
    strangers_result = next((out / "store/cloud").iterdir()) / "mine.txt"
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "thesis.txt").write_text("mine")
    (out / "work" / ("ef" * 32)).symlink_to(elsewhere)
    (out / "store/cloud" / ("ef" * 32)).symlink_to(elsewhere)
    for path in (*mine, strangers_result):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("mine")
    run_scenario(tiny_scenario(1, seed=99), out, SILENT)  # nothing of the former scenes is needed any more
    done = _clean_twice(out, unused=True)
    assert all(path.read_text() == "mine" for path in (*mine, strangers_result, elsewhere / "thesis.txt"))
    assert len(done.removed) == 9  # of ten results, the cloud with a stranger's file stays
    assert done.left == [f"{strangers_result.relative_to(out)}: not in the manifest"]


def test_unused_results_go_and_the_others_stay(run: Run, tmp_path: Path) -> None:
    """After a change of settings and of the number of scenes, the tree is that of a run from nothing."""
    out = tmp_path / "out"
    settings = {"recon": {"max_reprojection_error": 2.5}}
    run(2, {"cloud:1": "reject"}, **settings)
    whole = contents(out)
    shutil.rmtree(out)
    run(4, {"cloud:1": "reject", "capture:3": "input"}, keep=("stage", "capture", "model", "report"))
    run(2, {"cloud:1": "reject"}, **settings)
    assert clean(out, SILENT).removed == []
    _clean_twice(out, unused=True)
    after = contents(out)
    assert {name: what for name, what in after.items() if what != "folder"} == {
        name: what for name, what in whole.items() if what != "folder"
    }
    assert Store(out).verify() == []
    assert run(2, **settings).made == 0


def test_results_of_other_machines_stay(run: Run, tmp_path: Path) -> None:
    """Captures, clouds and reports of the same scenario from another graphics card are used; the rest is as before."""
    out = tmp_path / "out"
    assert run(2, gpu="another").made == 10
    assert run(2, keep=("stage", "cloud", "report")).made == 8
    before = contents(out)
    assert _clean_twice(out, unused=True).removed == []
    assert contents(out) == before
    run_scenario(tiny_scenario(1), out, SILENT)
    removed = [one.about for one in _clean_twice(out, unused=True).removed]
    assert len(removed) == 1 + 4 + 4 + 0  # of the second scene: its stage, and three of each machine


def test_results_of_other_packages_go(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """After an upgrade of a package nothing uses what the former version made, on the same machine or another one."""
    run(1, recon={"max_reprojection_error": 2.5})
    monkeypatch.setattr(chain, "recon_platform", lambda: {"cpu": "none", "pycolmap": "9"})
    removed = [one.about for one in _clean_twice(tmp_path / "out", unused=True).removed]
    uses = "that no scene uses"
    assert sorted(removed) == [f"cloud {uses}", f"model {uses}", f"report {uses}"]


def test_results_of_earlier_versions_go(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """After an upgrade of one stage its results and those made from them go, and the first are said to be old."""
    run(1)
    monkeypatch.setitem(STAGES, "cloud", replace(STAGES["cloud"], version=99))
    removed = [one.about for one in _clean_twice(tmp_path / "out", unused=True).removed]
    assert sorted(removed) == ["cloud of an earlier version", "report that no scene uses"]


def test_texture_goes_with_the_last_scene(run: Run, tmp_path: Path) -> None:
    """A file of several links counts when all of them go: the run's own and those of the scenes."""
    out = tmp_path / "out"
    run(2)
    run_scenario(tiny_scenario(1), out, SILENT)
    assert _clean_twice(out, unused=True).freed < 100_000
    assert len(list((out / "store/texture").iterdir())) == 1
    run_scenario(tiny_scenario(1, seed=99), out, SILENT)
    shutil.rmtree(next(path for path in (out / "store/stage").iterdir() if _is_of_seed_99(path)))
    assert _clean_twice(out, unused=True).freed > 102_400
    assert not list((out / "store/texture").iterdir())


def _is_of_seed_99(folder: Path) -> bool:
    return folder.samefile(folder.parents[2] / "scenes/0000/stage")


def test_verb(run: Run, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Lines, JSON, and exit code 2 for a folder that is not of a run."""

    def ask(*words: str | Path) -> tuple[int, str]:
        with pytest.raises(SystemExit) as end:
            main(["clean", *map(str, words)])
        said = capsys.readouterr()
        return int(end.value.code or 0), said.out + said.err

    run()
    _leave(tmp_path / "out")
    assert ask(tmp_path / "out", "--dry-run")[1].endswith("4 items would be removed, 0.0 MB would be freed\n")
    code, said = ask(tmp_path / "out", "--json")
    answer = json.loads(said)
    assert (code, answer["freed_bytes"], len(answer["removed"]), answer["version"]) == (0, 5760, 4, 1)
    assert ask(tmp_path / "out") == (0, "0 items removed, 0.0 MB freed\n")
    assert ask(tmp_path)[0] == 2
