"""A run ends by naming the classes that have few points in some 10 m of a bridge, or lost most of them to a limit."""

import json
from pathlib import Path
from typing import Any

import pytest

from falsework.cli import main
from falsework.execution import chain
from falsework.stages import STAGES, Stage
from groundwork.progress import Progress
from tests.falsework.tiny_chain import cloud, tiny_stages

FEW: dict[str, dict[str, Any]] = {
    "bearing": {"windows": 2, "few_in": 2},
    "deck": {"windows": 3, "few_in": 0},
    "abutment": {"windows": 2, "few_in": 1},
}
for name, row in FEW.items():  # of the bearing's points more than half are too far off, of the others' half
    row |= {"kept": 60, "dropped": {"deviation": 61 if name == "bearing" else 60, "duplicate": 3}}


def poor_cloud(settings: dict[str, Any], inputs: dict[str, Path], folder: Path, progress: Progress) -> None:
    """Make a tiny cloud that says of itself in how many windows its classes are few; a dense one has enough of all."""
    cloud(settings, inputs, folder, progress)
    mode = settings["recon"]["mode"]
    enough = {"few_in": 0, "dropped": {"deviation": 0, "duplicate": 0}}
    classes = FEW if mode == "sparse" else {name: {**row, **enough} for name, row in FEW.items()}
    (folder / "cloud.json").write_text(json.dumps({"source": f"sfm-{mode}", "statistics": {"classes": classes}}))


def test_scarce_classes_are_named_at_the_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Over all scenes, a line for each kind of cloud that has any; so again when nothing is left to make; in JSON."""
    for name, stage in tiny_stages().items():
        monkeypatch.setitem(STAGES, name, stage)
    monkeypatch.setitem(STAGES, "cloud", Stage(STAGES["cloud"].version, poor_cloud, STAGES["cloud"].resumes))
    monkeypatch.setattr(chain, "render_platform", lambda device="auto": {"gl_renderer": "none"})
    monkeypatch.setattr(chain, "recon_platform", lambda: {"cpu": "none"})
    (tmp_path / "tiny.toml").write_text('seed = 5\nscenes = 2\n[[survey]]\nkind = "global"\n[recon]\nmode = "both"\n')

    def said(*words: str) -> str:
        with pytest.raises(SystemExit) as caught:
            main(["run", str(tmp_path / "tiny.toml"), "-o", str(tmp_path / "out"), *words])
        printed = capsys.readouterr()
        assert not caught.value.code, printed.err
        return printed.out

    line = "sparse clouds: fewer than 50 points in a window of 10 m: bearing in 4 of 4, abutment in 2 of 4"
    lost = "sparse clouds: max_deviation took more than half of a class: bearing in 2 of 2. Raise [recon] max_deviation"
    for _ in range(2):
        lines = said().splitlines()
        assert [one for one in lines if one.startswith("few ")] == [f"few     {line}", f"few     {lost}"]
        assert [one.split()[0] for one in lines[lines.index(f"few     {line}") :]] == ["few", "few", "report", "report"]
    assert json.loads(said("--json"))["few"] == [line, lost]
