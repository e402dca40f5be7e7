"""Another table of classes reaches the label images, and nothing else that is rendered."""

from pathlib import Path

import numpy as np
import pytest

from authoring.scene import author_scene
from authoring.settings import AuthoringSettings
from authoring.variants.add import set_choices
from groundwork.files import read_json
from groundwork.progress import SILENT
from render.capture import Truth, read_capture, read_truth
from render.frames import render_stage
from render.settings import RenderSettings
from tests.conftest import Count, RecordProof
from tests.render.prepared_here import prepared_here
from usd_schemas.taxonomies import BASE, taxonomy

SEED = 7
TINY: dict[str, object] = {
    "bridge": {
        "family": "beam",
        "service": "road",
        "alignment": {"kind": "straight", "skew": 0, "profile": "grade"},
        "beam": {"spans": [12.0, 12.0]},
    },
    "background": {"name": "none"},
    "look": {"texels": 256},
    "light": {"sky_height": 64},
    "site": {"half_width": 40, "run_out": 40, "scatter": {"tufts": 20, "stones": 10, "shrubs": 10, "reeds": 5}},
}


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory, proof_count: Count) -> Path:
    """Author one scene."""
    folder = tmp_path_factory.mktemp("scene")
    images, spacing = proof_count(8, 24), proof_count(20, 3)
    flight = {"kind": "global", "images": images, "spacing": spacing, "width": 160, "height": 120}
    author_scene(AuthoringSettings.model_validate({**TINY, "survey": [flight]}), SEED, folder, SILENT)
    return folder


def render(scene: Path, folder: Path) -> Truth:
    """Render the scene as it is into a new folder."""
    folder.mkdir()
    with prepared_here():
        render_stage(scene / "scene.usda", folder, RenderSettings(quality="fast", normals=True), SEED, SILENT)
    truth = read_truth(read_capture(folder))
    assert truth is not None
    return truth


@pytest.fixture(scope="module")
def base(scene: Path, tmp_path_factory: pytest.TempPathFactory) -> Truth:
    """Render it with the base table."""
    return render(scene, tmp_path_factory.mktemp("base") / "capture")


@pytest.mark.parametrize(
    "name",
    [
        pytest.param("kim2023", marks=pytest.mark.proof_only),
        pytest.param("semanticbridge", marks=pytest.mark.proof_only),
        "ifc43",  # that with the most classes
    ],
)
def test_label_images_are_those_of_the_table(
    scene: Path, base: Truth, tmp_path: Path, name: str, record_proof: RecordProof
) -> None:
    """Each pixel has the class of its instance's component, the sky class 0; every other file keeps its bytes."""
    assert set_choices(scene / "scene.usda", {"taxonomy": name}, lambda line: None) == {"taxonomy": name}
    try:
        truth = render(scene, tmp_path / "capture")
    finally:
        set_choices(scene / "scene.usda", {"taxonomy": BASE}, lambda line: None)
    table = taxonomy(name)
    ids = np.zeros(max(row.id for row in base.instances) + 1, np.uint8)
    for row in base.instances:
        ids[row.id] = table.row_of(row.component).id
    shown: set[int] = set()
    unequal = 0
    for image in range(len(base.names)):
        expected = ids[base.instance(image)]
        unequal += int((truth.semantic(image) != expected).sum())
        shown |= set(np.unique(expected).tolist())
    assert unequal == 0
    assert len(shown) >= min(4, len(table.rows) - 2)
    assert {0, *ids.tolist()} >= shown
    assert truth.classes == table.rows
    assert [row.class_name for row in truth.instances] == [table.row_of(row.component).name for row in base.instances]
    _, numbers, labels = truth.surface()
    np.testing.assert_array_equal(labels, ids[numbers])
    assert changed_files(base.folder.parent, tmp_path / "capture") <= {
        "truth/instances.json",
        "truth/surface.npz",
        "truth/render.json",  # the last: the hash of the scene
        *(f"truth/semantic/{name}.png" for name in base.names),
    }
    name = f"stage/labels: images carry the table {name}"
    record_proof(name, len(base.names), SEED, {"classes_shown": len(shown), "unequal_pixels": unequal})


def changed_files(first: Path, second: Path) -> set[str]:
    """Name the files of two folders that differ or are in one of them only."""
    contents = [
        {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
        for folder in (first, second)
    ]
    names = contents[0].keys() | contents[1].keys()
    assert {"images", "truth/depth", "truth/instance", "truth/normal"} <= {str(Path(name).parent) for name in names}
    return {name for name in names if contents[0].get(name) != contents[1].get(name)}


def test_tables_of_the_base_capture(base: Truth) -> None:
    """Without a layer the classes are the seventeen, and the file says so."""
    stored = read_json(base.folder / "instances.json")
    assert base.classes == taxonomy(BASE).rows
    assert [row["name"] for row in stored["classes"]] == [row.name for row in taxonomy(BASE).rows]
