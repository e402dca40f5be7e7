"""What a run does not keep goes when nothing needs it any more; what is damaged comes back with its former bytes."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from falsework import stages
from falsework.cli import main
from falsework.commands.repair import repair
from falsework.store.store import Store
from groundwork.errors import InputError
from groundwork.files import MANIFEST
from groundwork.locks import hold_lock
from groundwork.progress import SILENT
from tests.falsework import tiny_chain
from tests.falsework.test_run import Run, _flip, contents, run  # noqa: F401 (a fixture)

STAGES = ("stage", "capture", "model", "cloud", "report")
DAMAGES = ("flip", "gone", "manifest", "moved", "extra")
FILES = {
    "stage": "scene.usda",
    "capture": "000001.jpg",
    "model": "model.json",
    "cloud": "coord.npy",
    "report": "report.html",
}


def _count(out: Path) -> dict[str, int]:
    return {stage: len(list((out / "store").glob(f"{stage}/*"))) for stage in STAGES}


def test_what_is_not_kept_goes(run: Run, tmp_path: Path) -> None:  # noqa: F811
    """Captures and their links are gone, a second run makes nothing, and all is whole; rejected scenes as well."""
    keep = ("stage", "cloud")
    outcome = run(3, faults={"cloud:1": "reject"}, keep=keep)
    assert (outcome.made, list(outcome.rejected)) == (11, ["0001"])
    out = tmp_path / "out"
    assert _count(out) == {"stage": 3, "capture": 0, "model": 0, "cloud": 2, "report": 0}
    assert not list(out.glob("scenes/*/capture/*"))
    assert run(3, keep=keep).made == 0
    assert Store(out).verify() == []
    assert run(3).made == 6  # now all is wanted: captures and models of two clouds, and two reports
    assert Store(out).verify() == []


def test_let_go_for_good(run: Run, tmp_path: Path) -> None:  # noqa: F811
    """With the clouds alone, a scene leaves nothing else; a lost cloud is made again from its beginning."""
    run(2, keep=("cloud",))
    out = tmp_path / "out"
    whole = contents(out)
    assert _count(out) == {"stage": 0, "capture": 0, "model": 0, "cloud": 2, "report": 0}
    shutil.rmtree(out / "store/cloud")
    assert run(2, keep=("cloud",)).made == 8
    assert contents(out) == whole


@pytest.mark.parametrize(
    ("damage", "stage", "keep"),
    [(damage, stage, STAGES) for damage in DAMAGES for stage in STAGES[:4]]
    + [(damage, "cloud", ("stage", "cloud")) for damage in DAMAGES]
    + [("flip", "capture", ("stage", "cloud"))],
)
def test_repair_brings_the_former_bytes_back(
    damage: str,
    stage: str,
    keep: tuple[str, ...],
    run: Run,  # noqa: F811
    tmp_path: Path,
) -> None:
    """Damaged in any way, with any of its inputs let go: the tree is that of before; a stranger's file is kept."""
    out = tmp_path / "out"
    run(2, keep=keep)
    whole = contents(out)
    if stage not in keep:
        (record, _) = sorted((out / "evicted" / stage).iterdir())
        _flip(record, 400)
    else:
        folder = sorted((out / "store" / stage).iterdir())[1]
        match damage:
            case "flip":
                _flip(folder / FILES[stage], 5)
            case "gone":
                shutil.rmtree(folder)
            case "manifest":
                _flip(folder / MANIFEST, 999)
            case "moved":
                folder.rename(folder.with_name("0" * 64))
            case "extra":
                (folder / "notes.txt").write_text("mine")
    assert Store(out).verify() != []
    assert repair(out, SILENT) == []
    if damage == "extra" and stage in keep:
        (notes,) = (out / "foreign").glob("*/*/notes.txt")
        assert notes.read_text() == "mine"
        shutil.rmtree(out / "foreign")
    assert contents(out) == whole
    assert Store(out).verify() == []


def test_files_of_the_user_outlive_the_results_that_they_lie_in(run: Run, tmp_path: Path) -> None:  # noqa: F811
    """Through the link of a scene they land in the store: a result that is made again or let go leaves them behind."""
    run(1)
    out = tmp_path / "out"
    link = out / "scenes/0000/capture/global"
    for text in ("first", "second"):
        (link / "notes.txt").write_text(text)
        assert repair(out, SILENT) == []
    (link / "notes.txt").write_text("third")
    shutil.rmtree(out / "store/cloud")
    assert run(1).made == 2  # the cloud, and its capture, which is not as it was written
    (link / "notes.txt").write_text("fourth")
    run(1, keep=("stage", "cloud"))
    assert not link.exists()
    run(1)
    manifest = link.resolve() / MANIFEST
    for text, damage in (("fifth", lambda: manifest.write_text("{")), ("sixth", manifest.unlink)):
        (link / "notes.txt").write_text(text)
        manifest.chmod(0o644)
        damage()
        shutil.rmtree(out / "store/cloud")
        run(1)
        assert Store(out).verify() == []
    assert {path.read_text() for path in (out / "foreign").rglob("notes.txt*")} == {
        "first",
        "second",
        "third",
        "fourth",
        "fifth",
        "sixth",
    }


def test_repair_says_when_the_bytes_differ(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:  # noqa: F811
    """A result that does not come back as it was is named."""
    run(2)
    out = tmp_path / "out"
    folder = sorted((out / "store/stage").iterdir())[0]
    _flip(folder / "scene.usda", 5)
    monkeypatch.setattr(tiny_chain, "TEXTURE", b"another")
    lines = repair(out, SILENT)
    assert any(folder.name in line and "differ from the former ones" in line for line in lines)


@pytest.mark.parametrize("stage", ["cloud", "report"])
def test_damage_that_the_scenario_no_longer_leads_to_is_left(stage: str, run: Run, tmp_path: Path) -> None:  # noqa: F811
    """A result of a former scenario cannot be made again: it stays, and stays reported."""
    run(1)
    out = tmp_path / "out"
    (folder,) = (out / "store" / stage).iterdir()
    run(1, recon={"min_views": 4})
    _flip(folder / FILES[stage], 3)
    lines = repair(out, SILENT)
    assert lines == [f"store/{stage}/{folder.name}/{FILES[stage]}: changed"]
    assert json.loads((folder / MANIFEST).read_text())["key"] == folder.name


def test_repair_remakes_only_what_is_damaged(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:  # noqa: F811
    """The scenes of a flipped bit and of a link elsewhere, not one that is not made yet; after an upgrade nothing."""
    out = tmp_path / "out"
    run(3, keep=("cloud",))
    links = [out / f"scenes/{index:04d}/cloud/global" for index in range(3)]
    shutil.rmtree(links[2].resolve())
    links[2].unlink()
    whole = contents(out)
    damaged = links[0].resolve() / "coord.npy"
    former = damaged.read_bytes()
    _flip(damaged, 3)
    links[1].unlink()
    links[1].symlink_to(tmp_path)
    assert repair(out, SILENT) == []
    (out / "foreign/scenes/0001/cloud/global").unlink()
    shutil.rmtree(out / "foreign")
    assert contents(out) == whole
    assert damaged.read_bytes() == former
    _flip(damaged, 3)
    whole = contents(out)
    monkeypatch.setitem(stages.STAGES, "cloud", replace(stages.STAGES["cloud"], version=99))
    assert repair(out, SILENT) == [f"{damaged.relative_to(out)}: changed"]
    assert contents(out) == whole


def test_no_repair_beside_a_run(run: Run, tmp_path: Path) -> None:  # noqa: F811
    """What a run is making looks damaged: nothing is repaired until it ends."""
    run(1)
    out = tmp_path / "out"
    (out / "failed").mkdir()
    (out / "failed/todo.txt").write_text("mine")
    whole = contents(out)
    with hold_lock(out / "work" / f"{'ab' * 32}.lock"), pytest.raises(InputError, match="a run is in progress"):
        repair(out, SILENT)
    (out / "work" / f"{'ab' * 32}.lock").unlink()
    assert contents(out) == whole


def test_repair_brings_records_of_failures_back(run: Run, tmp_path: Path) -> None:  # noqa: F811
    """The task of a damaged record is done again, and fails again; a folder with a strange number is none of ours."""
    out = tmp_path / "out"
    run(2, faults={"cloud:1": "reject"})
    (record,) = (out / "failed").iterdir()
    former = json.loads(record.read_text())
    record.write_text("damaged")
    (out / "scenes/²").mkdir()
    assert repair(out, SILENT) == []
    assert json.loads(record.read_text())["inputs"] == former["inputs"]


def test_report_without_a_rejected_variant_is_remade(run: Run, tmp_path: Path) -> None:  # noqa: F811
    """Its key differs from that of a scene whose clouds all exist."""
    out = tmp_path / "out"
    run(1, faults={"cloud:0": "reject"}, variants={"look": ["clean", "weathered"]})
    (folder,) = (out / "store/report").iterdir()
    _flip(folder / FILES["report"], 3)
    assert repair(out, SILENT) == []
    assert (out / "scenes/0000/report.html").is_file()


def test_verify_answers_a_script(run: Run, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:  # noqa: F811
    """`--json` holds the lines that people read, and the exit code says the same."""
    run(1)
    out = tmp_path / "out"
    for flipped in (False, True):
        if flipped:
            _flip(sorted((out / "store/stage").iterdir())[0] / "scene.usda", 5)
        with pytest.raises(SystemExit) as left:
            main(["verify", str(out), "--json"])
        found = json.loads(capsys.readouterr().out)
        assert found == {"version": 1, "whole": not flipped, "wrong": Store(out).verify(), "unfinished": []}
        assert left.value.code == int(flipped) == int(bool(found["wrong"]))


def test_repair_moves_files_of_the_user(run: Run, tmp_path: Path) -> None:  # noqa: F811
    """Notes, links and copies of results among ours: each is in `OUT/foreign`, and a link leads where it led before."""
    run(1)
    out, photos = tmp_path / "out", tmp_path / "photos"
    photos.mkdir()
    (photos / "mine.txt").write_text("mine")
    (photos / "link").symlink_to("mine.txt")
    (cloud,) = (out / "store/cloud").iterdir()
    whole = contents(out)
    for name in ("failed/notes/mine.txt", "failed/todo.txt", "evicted/cloud/mine.json"):
        (out / name).parent.mkdir(parents=True, exist_ok=True)
        (out / name).write_text("mine")
    for name in ("backup", "0" * 64):
        shutil.copytree(cloud, cloud.with_name(name))
        (cloud.with_name(name) / "mine.txt").write_text("mine")
    (out / "failed" / f"{'0' * 64}.json").write_text("damaged")
    (out / "scenes/0000/my_link").symlink_to("../../../photos/mine.txt")
    for name in ("scenes/my_link", "evicted/my_link"):
        (out / name).symlink_to(photos)
    (out / "foreign").write_text("a file of the user in the way")
    with pytest.raises(InputError, match=r"a file is where a folder .*foreign"):
        repair(out, SILENT)
    (out / "foreign").unlink()
    assert repair(out, SILENT) == ["scenes/my_link: foreign", "evicted/my_link: foreign"]
    assert {path.relative_to(out / "foreign").as_posix() for path in (out / "foreign").rglob("m*")} == {
        "failed/notes/mine.txt",
        "evicted/cloud/mine.json",
        "scenes/0000/my_link",
        "store/cloud/backup/mine.txt",
        f"cloud/{'0' * 64}/mine.txt",
    }
    assert (out / "foreign/failed/todo.txt").read_text() == "mine"
    assert (out / "foreign/scenes/0000/my_link").read_text() == "mine"
    assert sorted(path.name for path in photos.iterdir()) == ["link", "mine.txt"]
    for name in ("foreign", "evicted", "failed"):
        shutil.rmtree(out / name)
    (out / "scenes/my_link").unlink()
    assert contents(out) == whole
