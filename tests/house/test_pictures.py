"""Pictures of the documentation: each has a command that makes it, and one command makes those that are named."""

import importlib.util
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from docs import pictures
from docs.pictures import IMAGES, NEEDS, OUT, RECIPES, chosen, main, make
from falsework.cli import all_verbs


def test_every_picture_has_its_command() -> None:
    """What lies in docs/images is listed once, and what is listed lies there."""
    listed = [picture for recipe in RECIPES for picture in recipe.pictures]
    assert sorted(listed) == sorted(p.relative_to(IMAGES).as_posix() for p in IMAGES.rglob("*") if p.is_file())


def test_every_command_is_there() -> None:
    """Each module can be found, each verb is one, and a word in capitals is explained."""
    for recipe in RECIPES:
        assert importlib.util.find_spec(recipe.words[0]) is not None, recipe.words
        assert recipe.words[0] != "falsework" or recipe.words[1] in all_verbs()
        capitals = {word for word in recipe.words[1:] if word.isupper()}
        assert capitals <= {OUT, *NEEDS}


def test_a_sheet_is_taken_over_from_its_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The command gets a folder for OUT and the path that was given; the picture ends below docs/images."""
    images = tmp_path / "docs/images"
    images.mkdir(parents=True)
    monkeypatch.setattr(pictures, "IMAGES", images)
    (tmp_path / "draw.py").write_text(
        "import pathlib, sys\nout = pathlib.Path(sys.argv[2])\nout.mkdir()\n"
        "(out / 'slab.jpg').write_text(sys.argv[1])\n"
    )
    recipe = replace(RECIPES[1], pictures=("gallery/slab.jpg",), words=("draw", "RUN", OUT))
    with pytest.raises(SystemExit, match=r"give --with RUN=…: folder of falsework demo"):
        make(recipe, {})
    make(recipe, {"RUN": "demo-out"})
    assert (images / "gallery/slab.jpg").read_text() == "demo-out"
    with pytest.raises(SystemExit, match="ended with 1"):
        make(replace(recipe, words=("nowhere",)), {})


def test_names_and_folders(capsys: pytest.CaptureFixture[str]) -> None:
    """A folder stands for all that is in it; a wrong name gets the nearest; --list makes nothing."""
    assert [recipe.words[0] for recipe in chosen(["blender", "docs/images/chain.png"])] == [
        "docs.picture",
        "tests.dcc.pictures",
    ]
    with pytest.raises(SystemExit, match=r"no such picture: gallery/slap.jpg. Did you mean 'gallery/slab.jpg'\?"):
        chosen(["gallery/slap.jpg"])
    assert main(["--list", "gallery/arch.jpg"]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "gallery/arch.jpg",
        "    python -m falsework gallery families --family arch --count 3 --seed 11 -o OUT",
    ]


def test_the_sheet_of_surfaces(tmp_path: Path) -> None:
    """Thirteen surfaces are two rows of twelve cells; concrete is gray and paint blue."""
    import cv2

    from docs import surfaces_picture

    names = (*(["board_concrete"] * 12), "paint_blue_clean")
    surfaces_picture.main(tmp_path / "sheet.jpg", names)
    image = cv2.imread(str(tmp_path / "sheet.jpg"))
    assert image is not None
    assert image.shape == (300, 1800, 3)
    blue, green, red = image[200:280, 30:120].reshape(-1, 3).mean(axis=0)
    assert blue > red + 40
    blue, green, red = image[60:140, 30:120].reshape(-1, 3).mean(axis=0)
    assert max(blue, green, red) - min(blue, green, red) < 40


def test_a_prediction_stands_beside_the_truth() -> None:
    """Three panels of one cloud: the colors of the true classes, of the predicted ones, and red where they differ."""
    from benchmarks.shipped.scan_scores import Labeled
    from docs.prediction_picture import RIGHT, WRONG, legend, panels
    from docs.sampling_picture import GAP, PANEL
    from learn.datasets.class_tables import class_table

    table = class_table("falsework")
    deck, girder = table.index("deck"), table.index("girder")
    x, y = (part.ravel() for part in np.meshgrid(np.linspace(0.0, 20.0, 200), np.linspace(0.0, 8.0, 80)))
    truth = np.full(len(x), deck, np.int64)
    said = np.where(x < 10.0, deck, girder).astype(np.int64)
    found = Labeled(
        np.stack([x, y, np.zeros(len(x))], axis=1), {"falsework": truth}, {"falsework": said}, np.arange(len(x))
    )
    image = panels(found, "falsework", "mesh")
    width = PANEL[0] + GAP
    drawn = [
        {tuple(color) for color in image[40:, k * width : k * width + PANEL[0]].reshape(-1, 3).tolist()}
        for k in range(3)
    ]
    white = (255, 255, 255)
    assert drawn == [
        {white, table.colors[deck]},
        {white, table.colors[deck], table.colors[girder]},
        {white, RIGHT, WRONG},
    ]
    named = legend(table, np.concatenate([truth, said]), image.shape[1])
    swatches = {tuple(color) for color in named[10:14].reshape(-1, 3).tolist()}
    assert {table.colors[deck], table.colors[girder]} <= swatches
    assert table.colors[table.index("arch")] not in swatches


def test_a_flight_is_drawn_from_first_to_last() -> None:
    """A camera beside a bridge is a blue dot at its place, the last one a red dot; the caption fills the top alone."""
    from docs.flights_picture import PANEL, flight_panel
    from usd_schemas.flat_scene import CameraTrack
    from usd_schemas.pinhole import UsdLens, look_at

    eyes = np.array([[-10.0, -8.0, 4.0], [0.0, -8.0, 4.0], [10.0, -8.0, 4.0]])
    poses = np.stack([look_at(eye, eye + np.array([0.0, 8.0, -4.0])) for eye in eyes])
    track = CameraTrack("row", "/Row", UsdLens(0.24, 0.36, 0.24), poses, ("0", "1", "2"))
    low, high = np.array([-10.0, -8.0, 0.0]), np.array([10.0, 4.0, 4.0])
    image = flight_panel(track, np.zeros((1, 3)), np.full((1, 3), 200, np.uint8), low, high).astype(int)
    assert image.shape == (PANEL[1], PANEL[0], 3)
    blue = np.argwhere(image[40:, :, 2] > image[40:, :, 0] + 60)
    red = np.argwhere(image[40:, :, 0] > image[40:, :, 2] + 60)
    assert len(blue) > 10
    assert len(red) > 10
    assert blue[:, 1].min() < red[:, 1].min()  # seen from the left: the first camera is the nearer one
