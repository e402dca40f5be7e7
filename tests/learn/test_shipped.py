"""The model of the package: it is there, small, nobody else's, and labels a scan without a word about models."""

from __future__ import annotations

import json
from pathlib import Path

import laspy
import numpy as np
import pytest

from falsework.cli import main
from groundwork.canonical import file_digest
from learn.predict.model import named_model, shipped_folder
from learn.predict.trained_model import read_trained_model
from learn.trained import WEIGHTS
from learn.training.start import seen_by
from recon.formats.laz import write_laz
from tests.house.house import ROOT
from tests.learn.toy_bridge import toy_cloud
from usd_schemas.components import component_classes
from usd_schemas.taxonomies import TAXONOMIES, taxonomy

MOST = 8_000_000  # [byte] what an installation may grow by


def test_the_model_is_small_and_its_card_speaks_of_it() -> None:
    """A few megabytes; the card holds the hash of these very weights, the limits and the terms."""
    folder = shipped_folder()
    assert sum(path.stat().st_size for path in folder.iterdir()) < MOST
    card = (folder / "README.md").read_text()
    assert file_digest(folder / WEIGHTS) in card
    for words in ("What it cannot do", "Apache-2.0", "Table `kim2023`"):
        assert words in card, words
    model = read_trained_model(folder)
    assert model.channels == ("z",)
    kinds = tuple(component_classes())
    assert model.classes == tuple(
        kind for kind in kinds if kind in model.classes
    )  # kinds of later versions it does not know
    assert len(model.classes) >= 78


def test_the_test_bridges_of_the_card_were_not_trained_on() -> None:
    """Each bridge has one part: training, epoch, or test, or it taught the model that this one began with."""
    card = (shipped_folder() / "README.md").read_text()
    rows = [line.split("|") for line in card.splitlines() if line.startswith("| `")]
    parts = {row[1].strip(): row[2].strip() for row in rows}
    assert len(parts) == len(rows)
    assert {"training", "epoch", "test"} <= set(parts.values()) <= {"training", "epoch", "test", "the model before"}
    trained = read_trained_model(shipped_folder()).trained.facts.training
    assert trained is not None
    picked = {name.strip("`") for name, part in parts.items() if part == "epoch"}
    assert {name[:16] for name in trained["validation_bridges"]} == picked
    seen = {name[:16] for name in seen_by(shipped_folder())}
    assert seen == {name.strip("`") for name, part in parts.items() if part != "test"}


@pytest.mark.parametrize("table", ["", *TAXONOMIES])
def test_a_scan_is_labeled_without_a_model_named(
    table: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Every point gets a class of the table that is asked for, that of the components where none is."""
    coord = toy_cloud(3, 1_000).columns["coord"]
    coord[:, 0] = 4e5 + 0.2 * (coord[:, 0] - 4e5)  # eight meters of bridge, and as much ground: few tiles
    coord[:, 1] = 5e6 + 0.3 * (coord[:, 1] - 5e6)
    write_laz(tmp_path / "scan.laz", toy_cloud(3, 1_000, coord=coord))
    words = ["predict", str(tmp_path / "scan.laz"), "-o", str(tmp_path / "out.laz")]
    with pytest.raises(SystemExit) as left:
        main([*words, *(["--table", table] if table else [])])
    assert not left.value.code
    told = json.loads((tmp_path / "out.instances.json").read_text())
    assert told["table"] == (table or "falsework")
    found = np.unique(laspy.read(tmp_path / "out.laz")["predicted_class"])
    assert set(found) <= {row.id for row in taxonomy(table or "falsework").rows} - {255}
    assert str(shipped_folder() / "README.md") in capsys.readouterr().out


def test_the_model_is_package_data() -> None:
    """What is packed lies in a folder of the wheel, and no rule keeps it out of the repository."""
    assert shipped_folder() == ROOT / "learn" / "shipped"
    ignored = (ROOT / ".gitignore").read_text()
    assert "safetensors" not in ignored
    assert named_model("").points == named_model(str(shipped_folder())).points
