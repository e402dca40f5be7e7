"""`falsework compare` on toy bridges: from clouds to tables, stopped and gone on with, planned, and refused."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.learn.remote_training import described, experiment_here, fill, pieces_of, read_pack, train, write_pack
from falsework.store.store import Store
from learn.compare.preset import preset_names
from learn.metrics import mean_iou
from learn.trained import read_model
from recon.cloud import Cloud, write_cloud
from tests.falsework.test_sample_verbs import run as call
from tests.falsework.tiny_chain import contents
from tests.learn.toy_bridge import toy_cloud

TINY = """
title = "Toy"
models = ["forest", "pointnet2-ssg"]
seeds = 2
steps = 4
epochs = 2
batch = 2
points = 128
fewest = 100
test_draws = 1
forest_draws = 12
shares = [0.4, 0.2, 0.4]
draws = 100
[arms]
clean = ["clean"]
noisy = ["clean ~ scan"]
[tests]
scan = "scan"
[tile]
voxel = 0.3
stride = 10.0
[network.pointnet2-ssg]
counts = [64, 16, 8, 4]
[network.forest]
trees = 4
scales = [10]
points = 1000
"""


def write_bridges(folder: Path, count: int = 5, bridge: str = "b") -> list[Path]:
    """Write bridges, each as an exact cloud and as a scan with errors along z."""
    places = []
    for number in range(count):
        exact = toy_cloud(number, 2000, f"{bridge}{number}")
        rng = np.random.default_rng(number)
        scan = toy_cloud(100 + number, 1500, f"{bridge}{number}")
        off = 0.05 * rng.standard_normal(len(scan))
        columns = dict(scan.columns)
        columns["coord"] = columns["coord"] + off[:, None] * [0.0, 0.0, 1.0]
        columns["surface_distance"] = np.abs(off).astype(np.float32)
        statistics = {"stations": [(scan.columns["coord"].mean(axis=0) + np.array([0.0, -20.0, 0.0])).tolist()]}
        place = folder / f"{bridge}{number}"
        for name, cloud in (
            ("clean", exact),
            ("scan", Cloud(**{**vars(scan), "columns": columns, "statistics": statistics})),
        ):
            (place / name).mkdir(parents=True)
            write_cloud(place / name, cloud)
        places.append(place)
    return places


@pytest.fixture(scope="module")
def bridges(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Give five bridges and, beside them, the experiment."""
    folder = tmp_path_factory.mktemp("toys")
    (folder / "tiny.toml").write_text(TINY)
    return write_bridges(folder / "bridges")


def compare(
    capsys: pytest.CaptureFixture[str], bridges: list[Path], out: Path, *words: str | Path
) -> tuple[int, str, str]:
    """Run the verb on all bridges."""
    preset = bridges[0].parents[1] / "tiny.toml"
    return call(capsys, "compare", *bridges, "-o", out, "--preset", preset, *words)


@pytest.fixture(scope="module")
def whole(bridges: list[Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give the output of an experiment that nothing disturbed, with a page beside it."""
    out = tmp_path_factory.mktemp("whole")
    from falsework.cli import main

    with pytest.raises(SystemExit) as caught:
        main(
            [
                str(word)
                for word in (
                    "compare",
                    *bridges,
                    "-o",
                    out / "cmp",
                    "--preset",
                    bridges[0].parents[1] / "tiny.toml",
                    "--page",
                    out / "page.md",
                )
            ]
        )
    assert not caught.value.code
    return out


def test_tables_follow_from_the_matrices(whole: Path) -> None:
    """The differences are those of the stored confusion matrices; the page and its copy say the same; all is whole."""
    record = json.loads((whole / "cmp/comparison.json").read_text())
    assert len(record["scores"]) == 4
    assert len(record["differences"]) == 2
    for row in record["differences"]:
        assert (row["first"], row["second"], row["seeds"], row["bridges"]) == ("clean", "noisy", 2, 2)
        low, high = row["interval"]
        assert low <= row["difference"] <= high
        assert low < high or row["model"] != "forest"  # a network of four steps calls everything alike in both arms
        pair = [one for one in record["scores"] if one["model"] == row["model"]]
        assert row["difference"] == pytest.approx(pair[0]["mean_iou"] - pair[1]["mean_iou"])
    for row in record["scores"]:
        total = np.array(row["confusion"])
        assert total.sum() == sum(sum(sum(values) for values in matrix) for matrix in _matrices(whole, row))
        assert row["mean_iou"] == pytest.approx(np.mean([float(mean_iou(matrix)) for matrix in _matrices(whole, row)]))
    assert {row["part"]: (row["bridges"], row["valid"] >= row["common"] > 0) for row in record["losses"]} == {
        "bridges/clean": (2, True),
        "bridges/clean ~ scan": (2, True),
    }
    text = (whole / "cmp/comparison.md").read_text()
    assert (whole / "page.md").read_text().startswith(text)
    assert "Weak figures: 2 test bridges, 2 seeds" in text
    assert Store(whole / "cmp").verify() == []


def _matrices(whole: Path, row: dict[str, Any]) -> list[np.ndarray]:
    """Confusion matrix of each seed, from the stored records of the tests."""
    found = []
    for path in sorted((whole / "cmp/store/training").glob("*/artefact.json")):
        training = json.loads(path.read_text())
        if training["settings"]["train"]["model"] != row["model"]:
            continue
        for test in sorted((whole / "cmp/store/scores").glob("*/artefact.json")):
            told = json.loads(test.read_text())
            scores = json.loads((test.parent / "scores.json").read_text())
            if told["inputs"]["training"] == training["key"] and _adds_up(row, scores, found):
                found.append(_whole(scores))
    return found


def _whole(scores: dict[str, Any]) -> np.ndarray:
    return np.sum([np.array(matrix) for matrix in scores["bridges"].values()], axis=0)


def _adds_up(row: dict[str, Any], scores: dict[str, Any], found: list[np.ndarray]) -> bool:
    """Whether a record is one of the two that make up a row's matrix."""
    rest = np.array(row["confusion"]) - sum(found) - _whole(scores)
    return bool((rest >= 0).all())


def test_no_bridge_is_trained_on_and_tested(whole: Path) -> None:
    """Training, validation and test share no bridge, in any artifact of the experiment."""
    tested = set()
    for path in (whole / "cmp/store/scores").glob("*/scores.json"):
        tested |= set(json.loads(path.read_text())["bridges"])
    names = {f"pieces/bridges/{bridge}" for bridge in tested}
    assert len(tested) == 2
    for path in (whole / "cmp/store/training").glob("*/artefact.json"):
        assert not names & json.loads(path.read_text())["inputs"].keys()
    for path in (whole / "cmp/store/noise").glob("*/artefact.json"):
        assert not {name.split("/")[1] for name in json.loads(path.read_text())["inputs"]} & tested


def test_stopped_and_gone_on_with(
    bridges: list[Path],
    whole: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Stopped between two epochs of a training and run again: the bytes of the run that nothing stopped."""
    from learn.training import train

    real, stopped = train.train_network, []

    def stop_once(*values: Any, **named: Any) -> None:
        if len(stopped) < 1:
            stopped.append(1)
            real(*values, **named, stop_after=1)
            raise KeyboardInterrupt
        real(*values, **named)

    monkeypatch.setattr(train, "train_network", stop_once)
    assert compare(capsys, bridges, tmp_path / "cmp")[0] == 130
    assert not (tmp_path / "cmp/comparison.json").exists()
    assert list((tmp_path / "cmp/work").glob("*/last.ckpt"))
    assert compare(capsys, bridges, tmp_path / "cmp")[0] == 0
    assert contents(tmp_path / "cmp") == contents(whole / "cmp")
    code, said, _ = compare(capsys, bridges, tmp_path / "cmp", "--json")
    assert code == 0
    assert (json.loads(said)["made"], len(list((tmp_path / "cmp/store/training").iterdir()))) == (0, 8)


def test_a_plan_tells_what_is_missing_and_writes_nothing(
    bridges: list[Path], whole: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Before anything is there, when all is, and with one seed more."""
    code, said, _ = compare(capsys, bridges, tmp_path / "cmp", "--plan")
    assert code == 0
    assert "tests are counted after the bridges are cut" in said
    assert not (tmp_path / "cmp").exists()
    before = contents(whole / "cmp")
    for words, wanted in (
        ((), {}),
        (
            ("--set", "seeds=3"),
            {"training forest": 2, "training pointnet2-ssg": 2, "scores forest": 2, "scores pointnet2-ssg": 2},
        ),
    ):
        code, said, _ = compare(capsys, bridges, whole / "cmp", "--plan", "--json", *words)
        found = json.loads(said)
        assert {kind: row["make"] for kind, row in found["kinds"].items() if row["make"]} == wanted
        assert (found["hours"] > 0, found["bytes"] > 0) == (bool(wanted), bool(wanted))
    assert contents(whole / "cmp") == before


def test_the_models_are_those_of_train(whole: Path) -> None:
    """Each training is a model that predict and evaluate read, and says how a scan is to be cut."""
    folders = sorted((whole / "cmp/store/training").iterdir())
    for folder in folders:
        facts = read_model(folder).facts
        assert facts.data["settings"]["tile"]["voxel"] == 0.3
        assert facts.data["table"] == "kim2023"
        assert facts.channels == ("x", "y", "z")


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (("--set", 'tests={"x": "korea/tls"}'), "no folder is given for a set of bridges"),
        (("--set", 'tests={"x": "absent"}'), "allowed: clean, scan"),
        (("--set", 'models=["forst"]'), "allowed: pointnet2-ssg"),
        (("--set", 'network={"forest": {"tree": 3}}'), "trees"),
        (("--set", 'table="kim"'), "kim2023"),
        (("--set", 'held=["zz"]'), "can be held out"),
        (("--set", "fewest=100000"), "no window"),
        (("--set", "seeds=0"), "greater than or equal to 1"),
        (("--set", 'channels=["x", "y", "uncertainty"]'), "not a channel"),
    ],
)
def test_what_cannot_be_is_one_line(
    words: tuple[str, ...], reason: str, bridges: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Exit code 2 and one line that names the reason."""
    code, _, error = compare(capsys, bridges, tmp_path / "cmp", *words)
    last = [line for line in error.splitlines() if line.startswith("falsework: ")]
    assert (code, len(last)) == (2, 1)
    assert reason in last[0]


def test_a_folder_of_bridges_is_as_good_as_each(
    bridges: list[Path], whole: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The folder that holds all bridges gives the same results; one given twice, or no cloud at all, is refused."""
    preset = bridges[0].parents[1] / "tiny.toml"
    words = ["-o", whole / "cmp", "--preset", preset, "--plan", "--json"]
    code, said, _ = call(capsys, "compare", bridges[0].parent, *words)
    assert code == 0
    assert not any(row["make"] for row in json.loads(said)["kinds"].values())
    (tmp_path / "empty").mkdir()
    wrong = [
        ([*bridges, bridges[0]], "given twice"),
        ([tmp_path / "empty"], "contains no clouds"),
        ([], "Name the folder of a run"),
        ([bridges[1], f"korea={bridges[0]}"], "has no such set"),
    ]
    for sources, reason in wrong:
        code, _, error = call(capsys, "compare", *sources, "-o", tmp_path / "out", "--preset", preset)
        assert code != 0
        assert reason in error


def test_one_name_for_a_folder_of_bridges(
    bridges: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One --bridge cannot name them all: the line says to give each folder and its name."""
    words = ("--preset", bridges[0].parents[1] / "tiny.toml", "--bridge", "mine")
    code, _, error = call(capsys, "compare", bridges[0].parent, "-o", tmp_path / "cmp", *words)
    assert code == 2
    assert "has several bridges" in error
    assert "Name the folder of each bridge, with one --bridge for each" in error


def test_clouds_of_two_bridges_in_one_folder(
    bridges: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """They would be compared as one: refused."""
    mixed = tmp_path / "mixed"
    mixed.mkdir()
    (mixed / "clean").symlink_to(bridges[0] / "clean")
    (mixed / "scan").symlink_to(bridges[1] / "scan")
    code, _, error = compare(capsys, [*bridges[2:], mixed], tmp_path / "cmp")
    assert code == 2
    assert "clouds of several bridges" in error


def test_trained_elsewhere_is_as_trained_here(bridges: list[Path], whole: Path, tmp_path: Path) -> None:
    """Packed windows, trainings and tests in another place, their results put into the store: the same bytes."""
    preset = str(bridges[0].parents[1] / "tiny.toml")
    experiment, trials = experiment_here(bridges, tmp_path / "out", preset, [])
    networks = [one for one in trials if one.model != "forest"]
    folders = {f"{number:03d}": path for number, path in enumerate(sorted(pieces_of(networks)))}
    names = {path: name for name, path in folders.items()}
    write_pack(tmp_path / "pack", [described(one, names) for one in networks], folders)
    jobs = read_pack(tmp_path / "pack", tmp_path / "pieces")
    for job in jobs:
        train(job, tmp_path / "pieces", tmp_path / "results")
    assert fill(networks, experiment, tmp_path / "results") == len(networks) * 2
    made = Store(tmp_path / "out")
    for one in networks:
        for job in (one.training, *one.tests.values()):
            here = {path.name: path.read_bytes() for path in Store(whole / "cmp").folder(job.task).iterdir()}
            assert here == {path.name: path.read_bytes() for path in made.folder(job.task).iterdir()}


def test_the_help_names_every_preset(capsys: pytest.CaptureFixture[str]) -> None:
    """A preset that the help does not name is one that nobody finds."""
    _, said, _ = call(capsys, "compare", "--help")
    words = "".join(said.replace("│", " ").split())
    assert [name for name in preset_names() if name not in words] == []
