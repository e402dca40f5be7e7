"""`--json`: one object on standard output and nothing beside it, with numbers where a person reads a sentence."""

import inspect
import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from falsework.cli import all_verbs, main
from falsework.commands.answers import answer
from groundwork.progress import Progress
from recon.cloud import write_cloud
from tests.authoring.mesh_files import gltf
from tests.falsework.served_here import served_here
from tests.falsework.test_render_verb import DARK
from tests.falsework.test_sample_verbs import BODY
from tests.learn.toy_bridge import write_toy
from tests.recon.test_scan import small_cloud
from tests.render.prepared_here import rendered_here
from tests.usd_schemas.stages import write_stage

# One shows a page until it is stopped, the other prints a script.
NO_RESULT = {"view", "completion"}


def told(capsys: pytest.CaptureFixture[str], *words: str | Path) -> dict[str, Any]:
    """Run a verb with --json; give its object, which must be all that it printed."""
    with pytest.raises(SystemExit) as caught:
        main([*(str(word) for word in words), "--json"])
    printed = capsys.readouterr()
    assert not caught.value.code, printed.err
    found = json.loads(printed.out)  # and not a word before or after it
    assert printed.out.count("\n") == 1
    assert found.pop("version") == 1
    return found


def test_every_verb_with_a_result_has_the_option() -> None:
    """A new verb either answers scripts or is named above."""
    without = {name for name, verb in all_verbs().items() if "as_json" not in inspect.signature(verb).parameters}
    assert without == NO_RESULT


def test_what_is_not_finite_is_null(capsys: pytest.CaptureFixture[str]) -> None:
    """A flight that sees nothing has no sampling distance; `Infinity` and `NaN` are not JSON."""
    answer({"sampling": (np.inf, 0.5), "rows": [{"share": float("nan")}]})
    assert json.loads(capsys.readouterr().out, parse_constant=pytest.fail) == {
        "version": 1,
        "sampling": [None, 0.5],
        "rows": [{"share": None}],
    }


def test_render(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Each capture with its survey, images and their size."""
    stage, out = write_stage(tmp_path, DARK), tmp_path / "out"
    with served_here(), rendered_here():
        found = told(capsys, "render", stage, "-o", out, "--quality", "fast", "--width", "48", "--height", "36")
    size = {"width": 48, "height": 36}
    assert found == {
        "captures": [
            {"folder": str(out / name), "survey": name, "images": count, **size}
            for name, count in (("Empty", 1), ("Above", 2))
        ]
    }


def test_reconstruct(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """Points, and images by what became of them; of both modes a cloud each."""
    rows = tuple({"name": f"{row}", "status": status} for row, status in enumerate(("ok", "ok", "unregistered")))
    cloud = replace(small_cloud(), cameras=rows)

    def written(capture: Path, folder: Path, settings: Any, progress: Progress, *more: object) -> None:
        for mode in settings.modes:
            place = folder if len(settings.modes) == 1 else folder / "cloud" / mode
            place.mkdir(parents=True, exist_ok=True)
            write_cloud(place, cloud)

    monkeypatch.setattr("recon.reconstruct.reconstruct", written)
    (tmp_path / "photographs").mkdir()
    out = tmp_path / "out"
    facts = {"source": "mesh", "points": len(cloud), "images": {"ok": 2, "unregistered": 1}}
    words = ("reconstruct", tmp_path / "photographs", "-o", out, "--mode")
    assert told(capsys, *words, "sparse") == {"clouds": [{"folder": str(out), **facts}]}
    assert told(capsys, *words, "both") == {
        "clouds": [{"folder": str(out / "cloud" / mode), **facts} for mode in ("sparse", "dense")]
    }


def test_sample_and_export(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A cloud with its points; files that a program can open."""
    stage, cloud, files = write_stage(tmp_path, BODY), tmp_path / "cloud", tmp_path / "laz"
    with served_here():
        found = told(capsys, "sample", "mesh", stage, "-o", cloud, "--points", "500")
    assert found == {"clouds": [{"folder": str(cloud), "source": "mesh", "points": 500, "images": {}}]}
    found = told(capsys, "export", cloud, "--to", "laz", "-o", files)
    assert found == {"format": "laz", "folder": str(files), "files": [str(files / "cloud.laz")]}
    assert Path(found["files"][0]).is_file()


def test_background(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Counts, bytes and meters are numbers; what people wrote is text under a name of its own."""
    out = tmp_path / "tile"
    with served_here():
        imported = told(capsys, "background", "import", gltf(tmp_path), "-o", out)
        assert imported.pop("world") == str(out / "tile.usda")
        found = told(capsys, "background", "info", out)
    assert found == imported
    assert found.pop("attribution")["author"] == "City of Nowhere"
    length, width = found.pop("extent")
    assert isinstance(length, float)
    assert isinstance(width, float)
    assert all(type(value) is int for value in found.values())
    assert (found["buildings"], found["images"]) == (1, 1)
    (skin,) = (out / "textures").glob("skin_*.png")
    assert found["image_bytes"] == skin.stat().st_size


def test_scene_and_flight(authored: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A planned flight with images and length; a layer and a package with what is in them."""
    scene = Path(shutil.copytree(authored.parent, tmp_path / "scene")) / authored.name
    with served_here():
        found = told(capsys, "survey", "plan", scene, "--kind", "grid", "--set", "sampling=0.02")
    assert found["survey"] == "grid"
    assert found["images"] > 1
    assert found["length"] > 0.0
    copy = tmp_path / "mine"
    assert told(capsys, "scene", "checkout", scene, "-o", copy) == {"scene": str(copy / "scene.usda")}
    assert Path(told(capsys, "scene", "schemas")["folder"]).is_dir()
    layer, package = tmp_path / "flat.usdc", tmp_path / "bridge.usdz"
    with served_here():
        assert told(capsys, "scene", "flatten", scene, "-o", layer) == {"layer": str(layer), "missing_textures": []}
        found = told(capsys, "scene", "package", scene, "-o", package)
    assert found.pop("entries") > 1
    assert found == {"package": str(package), "bytes": package.stat().st_size}


def test_learning(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A data set with pieces and points of each split; a model with what it saw; a scan with points of each class."""
    for row in range(3):
        write_toy(tmp_path / "run/scenes" / f"000{row}" / "cloud/local", row, 2000, f"b{row}")
    data, model = tmp_path / "set", tmp_path / "model"
    few = ("--set", "points=256", "--set", "fewest=64", "--set", "tile.voxel=0.4")
    found = told(capsys, "dataset", "local", tmp_path / "run", "-o", data, *few)
    assert set(found["splits"]) == {"train", "val", "test"}
    assert all(split["bridges"] == 1 and split["points"] > 64 for split in found["splits"].values())
    classes = found["classes"]
    small = ("--set", "network.trees=4", "--set", "network.depth=6", "--set", "network.points=1000")
    found = told(capsys, "train", data, "-o", model, "--model", "forest", *small)
    assert (found["model"], found["network"], found["classes"]) == (str(model), "forest", classes)
    scan = tmp_path / "scan.npy"
    np.save(scan, np.random.default_rng(1).uniform(-5.0, 5.0, (300, 3)))
    found = told(capsys, "predict", scan, "-o", tmp_path / "labelled.laz", "--model", model, "--unit", "m")
    assert found["points"] == 300
    assert sum(found["counts"].values()) + found["unlabelled"] == 300
