"""What is wrong with the words of a command line is one line with exit code 2, and `--help` lists the verbs."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from falsework.cli import VERBS, all_verbs, main
from tests.falsework.test_commands_named import options

LINES = {
    "": r"no verb; allowed: doctor, demo, .*\. See falsework --help",
    "--foo": r"no such option \(found '--foo'\); .*See falsework --help",
    "scene": r"scene: no verb; allowed: info, validate, .*\. See falsework scene --help",
    "run": r"run: missing: SCENARIO, -o/--output\. See falsework run --help",
    "scene info": r"scene info: missing: SCENE\. See falsework scene info --help",
    "run a b -o out": r"run: too many arguments \(found 'b'\)\. See falsework run --help",
    "author --sceen 1 a.toml -o out": r"author: no such option \(found '--sceen'\)\. Did you mean --scene\? See .*",
    "run a -o out --sceens 1:2": r"run: no such option \(found '--sceens'\)\. Did you mean --scenes\? See .*",
    "run a -o": r"run: -o/--output: its value is missing\. See falsework run --help",
    "verify -o out": r"verify: OUTPUT: its value is missing\. See falsework verify --help",
    "run a -o out --workers x": r"run: --workers: not a whole number \(found 'x'\)\. See falsework run --help",
    "sample mesh s -o p --points 1.5": r"sample mesh: --points: not a whole number \(found '1\.5'\)\. See .*",
    "sample mesh s -o p --density x": r"sample mesh: --density: not a number \(found 'x'\)\. See .*",
    "demo -o o --seed -1": r"--seed: seed out of range \(found -1\); allowed: 0 or more",
    "render s -o o --seed -1": r"--seed: seed out of range .*",
    "survey plan s --seed -1": r"--seed: seed out of range .*",
    "export d -o o --to lazz": r"export: --to: not one of the choices \(found 'lazz'\); allowed: laz, .*'laz'\?",
    "export . -o o --to laz --photographs .": r"--photographs: not with --to laz; allowed: only with colmap or .*",
    "export . -o o --to colmap --photographs .": r"--photographs: only for clouds: .*",
    "reconstruct d -o o --mode spare": r"reconstruct: --mode: .*; allowed: both, dense, sparse\. .*'sparse'\?",
    "gallery families -o o --family slap": r"gallery: --family: .*; allowed: arch, .*\. Did you mean 'slab'\?",
    "gallery looks -o o --world city": r"--world: not with looks \(found 'city'\); allowed: only with worlds or .*",
    "gallery families -o o --look clean": r"--look: not with families .*; allowed: only with combinations",
    "scene set s look=a --re-origin 1 2": r"scene set: --re-origin: needs 3 values \(found 2\)\. See .*",
}


@pytest.mark.parametrize("words", LINES)
def test_wrong_words_are_one_line(
    words: str, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Which verb, which argument, what was found, and what to do; no frame, no traceback, and nothing else."""
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as left:
        main(words.split())
    assert left.value.code == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert re.fullmatch(rf"falsework: {LINES[words]}\n", printed.err), printed.err


@pytest.mark.parametrize(
    "words",
    [
        *("scene info {}", "verify {}", "clean {}", "plan {}", "run {} -o out", "view {}", "predict {} -o out.laz"),
        *("render {} -o out", "reconstruct {} -o out", "export {} --to ply -o out", "report {} -o out.html"),
        *("run {scenario} -o {}", "plan {scenario} -o {}", "train {scenario} -o {}"),
    ],
)
@pytest.mark.parametrize("name", ["a" * 256, "x/" * 2100], ids=["name", "path"])
def test_a_name_that_is_too_long_is_one_line(
    words: str, name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of what is read and of what is written: no traceback, and nothing is made."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "s.toml").write_text("seed = 1\n")
    with pytest.raises(SystemExit) as left:
        main(words.format(name, scenario="s.toml").split())
    printed = capsys.readouterr()
    assert left.value.code == 2
    assert re.fullmatch(r"falsework: .*\n", printed.err), printed.err
    assert [path.name for path in tmp_path.iterdir()] == ["s.toml"]


def test_the_help_lists_every_verb_once(capsys: pytest.CaptureFixture[str]) -> None:
    """Those of groups under their group; each with one sentence."""
    with pytest.raises(SystemExit) as left:
        main(["--help"])
    assert not left.value.code
    listed = re.findall(r"^[│ ] +[•*] ([a-z-]+)", capsys.readouterr().out, re.M)
    assert listed == list(VERBS)
    assert sorted(listed) == sorted({name.split()[0] for name in all_verbs()})


def test_the_help_is_silent_of_defaults_that_say_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    """No None, no False, no empty word; and no line ends where a line of the source does."""
    for name in all_verbs():
        with pytest.raises(SystemExit):
            main([*name.split(), "--help"])
        assert not re.findall(r"\(default:\s*(?:None|False|''|\))", capsys.readouterr().out), name
    with pytest.raises(SystemExit):
        main(["render", "--help"])
    text = re.sub(r" *│\n│ +", " ", capsys.readouterr().out)
    assert "a number of stops relative to gain 1, or `auto`" in text
    assert "(default: standard)" in text


def test_no_flag_has_a_twin_that_negates_it() -> None:
    """`--no-…` stands alone, where the flag is on to begin with."""
    negated = {name: [word for word in options(name) if word.startswith("--no-")] for name in all_verbs()}
    assert {name: words for name, words in negated.items() if words} == {
        "render": ["--no-noise"],
        "survey score": ["--no-propose"],
    }
