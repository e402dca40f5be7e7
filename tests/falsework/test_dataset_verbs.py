"""`falsework dataset` from the command line."""

from __future__ import annotations

from pathlib import Path

import pytest

from falsework.cli import main
from learn.datasets.layout import read_facts
from tests.learn.toy_bridge import write_toy


def run(*words: object) -> int:
    """Call the command line and give its exit code."""
    with pytest.raises(SystemExit) as caught:
        main([str(word) for word in words])
    code = caught.value.code
    assert isinstance(code, int)
    return code


def test_data_sets_from_a_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The clouds of a run are found, settings reach their groups, a former set is replaced, mistakes are a line."""
    for i in range(3):
        write_toy(tmp_path / "run/scenes" / f"000{i}" / "cloud/local", i, 1500, f"b{i}")
    out, few = tmp_path / "set", ("--set", "points=256", "--set", "fewest=64", "--set", "tile.voxel=0.4")
    for _ in range(2):
        assert run("dataset", "local", tmp_path / "run", "-o", out, *few, "--set", "tile.scale=5.0") == 0
    facts = read_facts(out)
    assert (facts.settings.tile.scale, facts.settings.tile.size, facts.settings.points) == (5.0, 10.0, 256)
    assert len(facts.sources) == 3
    assert "Whole bridges are held out" in (out / "README.md").read_text()
    assert run("dataset", "global", tmp_path / "run", "-o", tmp_path / "g", *few, "--mode", "paper") == 0
    assert read_facts(tmp_path / "g").settings.noisy_class
    assert run("dataset", "export", out, "-o", tmp_path / "h5", "--to", "hdf5") == 0
    assert sorted(path.name for path in (tmp_path / "h5").glob("*.h5")) == ["test.h5", "train.h5", "val.h5"]
    capsys.readouterr()
    for words, said in (
        (("--set", "tile.sise=5"), "Did you mean 'size'?"),
        (("--table", "kim"), "unknown table"),
        (("--bridge", "a"), "one name is needed for each source"),
        (("--class-map", "nothing"), "no such class map"),
        (("--unit", "ft"), "--unit: is given, and no source is a scan"),
    ):
        assert run("dataset", "local", tmp_path / "run", "-o", tmp_path / "bad", *words) == 2
        error = capsys.readouterr().err
        assert said in error
        assert error.strip().count("\n") == 0
    assert not (tmp_path / "bad").exists()
