"""What the pages show runs: the tutorial and the front page's block from top to bottom, and every command is one."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
from collections.abc import Callable
from contextlib import nullcontext
from functools import wraps
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import tomli_w
import torch
import tyro
from pxr import Gf, Usd, UsdGeom

from falsework.cli import all_verbs, main
from falsework.commands.parsing import CONFIG
from falsework.scenario import Scenario
from groundwork.settings import parse_settings, read_toml
from learn.datasets.class_map import read_class_map
from learn.demo import clouds, demo
from learn.demo.clouds import thin_cloud
from tests.end_to_end.conftest import TINY, Chain
from tests.falsework.served_here import served_here
from tests.learn.toy_bridge import write_toy
from tests.recon.conftest import in_this_process
from tests.render.prepared_here import rendered_here

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
BLOCK = re.compile(r"^ *```(\w*)\n(.*?)^ *```$", re.M | re.S)
# Needs Blender (make test-dcc goes there and back), or a shell of its own.
NOT_HERE = {
    ". .venv/bin/activate",
    "falsework doctor",
    "blender --python authoring/exchange/blender/open_scene.py -- scene/scene.usda",
    "falsework scene import-edits edited.usdc scene/scene.usda",
}
FEW = {"survey": [{"kind": "global", "images": 8, "spacing": 40.0, "width": 160, "height": 120}]}
DENSE = {"recon": {"mode": "dense", "quality": "medium"}}
CHILD = "falsework scene diff"  # which the other verbs have elsewhere
HEREDOC = re.compile(r"cat > (\S+) <<'END'\n(.*?)^END\n", re.M | re.S)


def blocks(page: Path) -> list[tuple[str, str]]:
    """Give the language and the text of every fenced block of a page."""
    return BLOCK.findall(page.read_text(encoding="utf-8"))


def commands(text: str) -> list[str]:
    """Give the lines of a shell block without comments and what three spaces part; lines that go on are one."""
    joined = re.sub(r"\\\n\s*", "", text)
    lines = (re.split(r"\s+# |\s{3,}(?=\S)", line.strip())[0] for line in joined.splitlines())
    return [line.removeprefix(".venv/bin/").removeprefix("exec ") for line in lines if line and line[0] != "#"]


def falsework(line: str) -> None:
    """Run one command in this process, and demand that it is done."""
    with pytest.raises(SystemExit) as left:
        main(shlex.split(line)[1:])
    assert not left.value.code, line


def mentioned() -> list[tuple[str, str]]:
    """Give every command line of ours that any page shows, with the page; forms with gaps to fill in are left out."""
    found = []
    for page in PAGES:
        for language, text in blocks(page):
            lines = commands(text) if language in ("sh", "") else []
            ours = [line for line in lines if line.startswith("falsework ") and not re.search(r"[…|<\[]", line)]
            found += [(page.relative_to(ROOT).as_posix(), line) for line in ours]
    return found


def test_the_parser_takes_every_command_that_a_page_shows() -> None:
    """A verb or an option that was renamed leaves no page behind; more than a hundred lines are looked at."""
    verbs = all_verbs()
    wrong, lines = [], mentioned()
    assert len(lines) > 100
    for page, line in lines:
        words = shlex.split(line)[1:]
        name = next((name for name in (" ".join(words[:2]), words[0]) if name in verbs), "")
        if not name or not _takes(verbs[name], words[len(name.split()) :]):
            wrong.append(f"{page}: {line}")
    assert wrong == []


def _takes(verb: Callable[..., int], words: list[str]) -> bool:
    @wraps(verb)
    def taken(*_: object, **__: object) -> int:
        return 0

    try:
        return tyro.cli(taken, args=words, config=CONFIG) == 0
    except SystemExit as left:
        return not left.code and "--help" in words


def test_every_scenario_and_class_map_that_a_page_shows_is_one(tmp_path: Path) -> None:
    """Unknown keys and values out of range would be refused; experiments have tests of their own."""
    seen = 0
    for page in PAGES:
        for language, text in blocks(page):
            if language == "toml" and "[arms]" not in text:
                path = tmp_path / "shown.toml"
                path.write_text(text, encoding="utf-8")
                if "[[code]]" in text:
                    assert read_class_map(str(path)).codes, page
                else:
                    parse_settings(Scenario, read_toml(path), page.name)
                seen += 1
    assert seen >= 20


def test_the_tutorial_runs(chain: Chain, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every block in its order in an empty folder; a smaller scene and town, and photographs that are there."""
    flown = chain.out / "scenes/0000"
    monkeypatch.chdir(tmp_path)
    _stand_ins(tmp_path)
    small_demo(tmp_path, monkeypatch)
    names: dict[str, Any] = {}
    ran = []
    for language, text in blocks(ROOT / "docs/tutorial.md"):
        if language == "toml":
            shown = read_toml(_written("bridge.toml", text))
            parse_settings(Scenario, shown, "bridge.toml")
            assert shown["recon"] == DENSE["recon"]
            _written("bridge.toml", tomli_w.dumps({**TINY, **FEW, **DENSE}))
        elif language == "python":
            exec(compile(text, "docs/tutorial.md", "exec"), names)
        for line in commands(text) if language == "sh" else []:
            if line in NOT_HERE:
                continue
            line = line.replace("background=hillside", "background=town.usda")
            line = line.replace("captures/global", f"{flown}/capture/global --model {flown}/model/global")
            line = line.replace("-o captures", "-o captures --quality fast")  # a quarter of the time
            if line.startswith("falsework "):
                with rendered_here(), in_this_process(), nullcontext() if line.startswith(CHILD) else served_here():
                    falsework(line)
            else:
                subprocess.run(shlex.split(line), check=True)
            ran.append(line.split()[1] if line.startswith("falsework ") else line.split()[0])
    assert ran == ["author", "scene", "cp", "scene", "scene", "scene", "render", "reconstruct", "train", "predict"]
    assert (tmp_path / "captures/global/images/000000.jpg").is_file()
    assert len(names["cloud"]) > 1000
    assert names["cloud"].source == "sfm-dense"
    assert (tmp_path / "labeled.laz").is_file()


def test_the_front_pages_block_runs(chain: Chain, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The block that writes a scenario, from top to bottom in an empty folder, over a run of the tiny scenario."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(chain.out, tmp_path / "out", symlinks=True)
    (text,) = (text for language, text in blocks(ROOT / "README.md") if language == "sh" and "<<'END'" in text)
    ((name, shown),) = HEREDOC.findall(text)
    parse_settings(Scenario, read_toml(_written(name, shown)), name)
    _written(name, chain.scenario.as_toml())
    for line in commands(HEREDOC.sub("", text)):
        with served_here():
            falsework(line)
    assert (tmp_path / "for_others/cloud.laz").is_file()
    assert (tmp_path / "points/cloud.json").is_file()


def _written(name: str, text: str) -> Path:
    path = Path(name)
    path.write_text(text, encoding="utf-8")
    return path


def _stand_ins(folder: Path) -> None:
    """What the reader brings: a picture of concrete, and a town of one house beside the strip."""
    (folder / "surfaces/concrete/mine").mkdir(parents=True)
    noise = np.random.default_rng(0).integers(90, 170, (256, 256, 3)).astype(np.uint8)
    cv2.imwrite(str(folder / "surfaces/concrete/mine/albedo.jpg"), noise)
    stage = Usd.Stage.CreateNew(str(folder / "town.usda"))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/Town").GetPrim())
    house = UsdGeom.Cube.Define(stage, "/Town/House")
    house.CreateSizeAttr(20.0)
    UsdGeom.XformCommonAPI(house).SetTranslate(Gf.Vec3d(0.0, 150.0, 10.0))
    stage.Save()


def small_demo(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let `train --demo` learn from five toy bridges with a small network."""
    torch.set_num_threads(1)
    toys = [
        thin_cloud(write_toy(folder / f"toys/{name}", number, 5000, f"b{number}"), name)
        for number, name in enumerate(("a", "b", "beam26", "c", "slab34"))
    ]
    small = {"network": {"counts": [64, 16], "unit": 2.0, "dropout": 0.0}, "batch": 2, "epochs": 1}
    monkeypatch.setattr(demo, "demo_clouds", lambda: toys)
    monkeypatch.setattr(clouds, "demo_clouds", lambda: toys)  # for `dataset demo`
    monkeypatch.setattr(demo, "MODEL", {**demo.MODEL, **small})
