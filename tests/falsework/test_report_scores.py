"""Pages of trainings and data sets: figures stand under the names that are theirs, and weak ones are said."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from falsework.report import dataset_page, training_page
from falsework.report.comparison_page import write_comparison_page
from falsework.report.dataset_page import class_rows_of
from falsework.report.training_page import write_training_page
from groundwork.files import write_json
from learn.scoring.record import tally_cloud, whole_record
from learn.scoring.votes import ScoredCloud
from tests.falsework.test_report_pages import comparison, elements_of, write_model


def test_confusion_stands_under_its_names(tmp_path: Path) -> None:
    """Classes that do not come by the alphabet, read from a file that sorts its keys: each row is that of its class."""
    names, absent = ("water", "arch", "deck"), "bearing"
    truth, found = np.array([0] * 6 + [1] * 2 + [2] * 4), np.array([0] * 3 + [2] * 3 + [1] * 2 + [2] * 4)
    likely = np.eye(4, dtype=np.float32)[found]
    cloud = ScoredCloud(
        bridge="b1",
        coord=np.zeros((12, 3)),
        truth=truth,
        probabilities=likely,
        votes=np.ones(12, np.int64),
        uncertainty=np.zeros(12, np.float32),
        instance=truth + 1,
    )
    record = whole_record({"b1": tally_cloud(cloud, 4, (), 0.5, 1)}, (*names, absent), 0.5)
    write_json(tmp_path / "scores.json", record)
    model = write_model(tmp_path / "model", "m")
    facts = json.loads((model / "model.json").read_text())
    facts["training"]["validation_bridges"] = ["b1"]
    facts["data"] = {"earlier": ["b0", "b1"]}
    (model / "model.json").write_text(json.dumps(facts))
    write_training_page(tmp_path / "page.html", {"m": model}, {"scores": tmp_path / "scores.json"})
    page = (tmp_path / "page.html").read_text()
    matrix = page[page.index('<table class="matrix">') :].partition("</table>")[0]
    heads = re.findall(r"<span>(\w+)</span>", matrix)
    rows = {
        name: re.findall(r"<td[^>]*>(\d*)</td>", cells)
        for name, cells in re.findall(r"<tr><th>(\w+)</th>(.*)</tr>", matrix)
    }
    assert heads == list(names)
    assert rows == {"water": ["50", "", "50"], "arch": ["", "100", ""], "deck": ["", "", "100"]}
    text = " ".join(" ".join(elements_of(tmp_path / "page.html").text).split())
    for words in (
        "Neither there nor predicted: bearing.",
        "water deck 3 50.0%",
        "50.0% accuracy if every point were water",
        "mean IoU of the 3 classes that occur",
        "Model m chose its epoch by b1: its scores there are too good.",
        "Model m began with a model that had seen b1: its scores there are too good.",
    ):
        assert words in text, words


def test_scores_side_by_side_show_what_any_of_them_has() -> None:
    """A class that no table of scores has is left out; the others have a row each, with a gap where one lacks it."""
    one = {"name": "a", "iou": {"water": 0.5, "arch": None, "deck": None, "mean": 0.5}}
    other = {"name": "b", "iou": {"water": 0.25, "arch": None, "deck": 1.0, "mean": 0.625}}
    found = training_page._side_by_side([one, other])
    assert found["rows"] == [["water", "50.0%", "25.0%"], ["deck", "–", "100.0%"], ["mean", "50.0%", "62.5%"]]
    bars = found["figure"].to_dict()["data"]
    assert [list(bar["y"]) for bar in bars] == [["water", "deck"]] * 2
    assert [list(bar["x"]) for bar in bars] == [[50.0, None], [25.0, 100.0]]


def test_a_data_set_says_what_training_lacks() -> None:
    """A class that is held out alone is named; sizes with a long tail have a logarithmic axis with whole numbers."""
    rows = class_rows_of(("ground", "rail", "arch_rib"))
    counts = {"train": np.array([5, 0, 0] + [0] * 253), "test": np.array([5, 2, 0] + [0] * 253)}
    assert dataset_page._missing_in_training(rows, counts, ["train", "test"]) == "rail"
    assert dataset_page._missing_in_training(rows, counts, ["test"]) == ""
    shares = dataset_page._share_figure(rows, counts, ["train", "test"]).to_dict()
    assert [list(bar["y"]) for bar in shares["data"]] == [["ground", "rail"]] * 2
    assert shares["layout"]["yaxis"]["dtick"] == 1  # no name is left out
    assert dataset_page._log_axis(90.0, 1200.0)["ticktext"] == ["100", "200", "500", "1,000"]
    many = class_rows_of(tuple(f"kind{k}" for k in range(40)))
    assert len({row.color for row in many}) == 40


@pytest.mark.parametrize("several", [False, True], ids=["one model", "two models"])
def test_columns_of_equal_words_are_left_out(several: bool, tmp_path: Path) -> None:
    """One model, one group of windows: no column for either; of two, each row says which. Rows fit their heads."""
    record = comparison("deck one")
    if several:
        record["groups"].append(["x", "y"])
        for key in ("scores", "differences"):
            record[key] += [{**row, "model": "forest", "group": ["x", "y"]} for row in record[key]]
        record["losses"] += [{**row, "group": ["x", "y"]} for row in record["losses"]]
    write_json(tmp_path / "comparison.json", record)
    write_comparison_page(tmp_path / "page.html", tmp_path)
    page = (tmp_path / "page.html").read_text()
    tables = re.findall(r"<table>(.*?)</table>", page, re.S)
    heads = [re.findall(r"<th[^>]*>(.*?)</th>", table) for table in tables]
    for table, head in zip(tables, heads, strict=True):
        rows = [row for row in table.split("<tr>") if "<td" in row]
        assert rows
        assert {row.count("<td") for row in rows} == {len(head)}
    assert len(heads) == 5
    assert [("model" in head) or ("group" in head) for head in heads] == [several] * 5
    assert page.count('<table class="matrix">') == len(record["scores"])
    assert "trained on b" in page
    assert ("forest, trained on b (x · y), tested on deck one" in page) is several
