"""The gallery of families: sheets of the right size, and one real bridge."""

from collections.abc import Iterator, Sequence
from itertools import product
from pathlib import Path
from typing import get_args

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from authoring.backgrounds.registry import BACKGROUNDS
from authoring.families.registry import FAMILIES
from authoring.looks.roles import LOOKS
from falsework.cli import Family, Look, World, main
from falsework.gallery import combinations
from falsework.gallery.contact_sheet import contact_sheet
from falsework.gallery.looks import close_to_concrete
from tests.render.scenes import SceneBuilder, placed
from usd_schemas.pinhole import look_at

U8 = NDArray[np.uint8]


def test_a_sheet_has_a_row_for_each_bridge() -> None:
    """Three pictures side by side, bridges one below the other, colors kept."""
    colors = [(200, 30, 30), (30, 200, 30), (30, 30, 200)]
    pictures = tuple(np.full((60, 100, 3), color, np.uint8) for color in colors)
    data = contact_sheet([("one", pictures), ("two", pictures)], letters=0.3, quality=82)
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    assert image is not None
    assert image.shape == (120, 300, 3)
    for number, color in enumerate(colors):
        np.testing.assert_allclose(image[50, 50 + 100 * number, ::-1], color, atol=12)


def test_a_look_is_seen_from_half_a_meter() -> None:
    """The last camera of a row goes straight up to the surface before it and looks at it."""
    square = np.array([[[0, -5, -5], [0, 5, -5], [0, 5, 5]], [[0, -5, -5], [0, 5, 5], [0, -5, 5]]], np.float64)
    builder = SceneBuilder()
    builder.add_mesh(square, placed((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)), 1)
    pose = look_at(np.array([6.0, 1.0, 0.5]), np.array([0.0, 0.0, 0.0]))
    close = close_to_concrete(builder.build(pose[None]), pose)
    ahead = close[:3, 2]
    assert -close[0, 3] / ahead[0] == pytest.approx(0.5, abs=1e-5)
    assert np.linalg.norm(np.cross(close[:3, 3] - pose[:3, 3], ahead)) < 1e-5


def test_the_verb_offers_what_there_is() -> None:
    """Its words are those of the registries, so that a wrong one is told before these are loaded."""
    assert get_args(Family) == tuple(sorted(FAMILIES))
    assert {*get_args(World), "none"} == {*BACKGROUNDS}
    assert get_args(Look) == tuple(LOOKS)


def test_a_sheet_of_combinations_is_a_family_a_row_and_a_look_a_column(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One sheet for each world, in whichever order its pictures come; the first row names the looks, too."""
    levels = {"city": 0, "hillside": 100, "slab": 20, "arch": 60, "clean": 5, "aged": 15}

    def drawn(family: str, seed: int, worlds: Sequence[str], looks: Sequence[str]) -> Iterator[tuple[str, str, U8]]:
        assert seed == 4
        for look, world in product(looks, worlds):
            yield world, look, np.full((100, 400, 3), levels[family] + levels[world] + levels[look], np.uint8)

    monkeypatch.setattr(combinations, "photograph_combinations", drawn)
    words = ["--seed", "4", "--family", "slab", "arch", "--world", "city", "hillside", "--look", "clean", "aged"]
    with pytest.raises(SystemExit) as done:
        main(["gallery", "combinations", "-o", str(tmp_path / "out"), *words])
    assert done.value.code == 0
    for world in ("city", "hillside"):
        image = cv2.imread(str(tmp_path / f"out/{world}.jpg"))
        assert image is not None
        for row, family in enumerate(("slab", "arch")):
            for column, look in enumerate(("clean", "aged")):
                cell = image[100 * row : 100 * row + 100, 400 * column : 400 * column + 400]
                expected = levels[world] + levels[family] + levels[look]
                np.testing.assert_allclose(cell[40:90, 8:-8], expected, atol=3)
                assert (cell[:40].max() > 200) == (column == 0 or row == 0)
    assert "from the left: clean, aged" in (tmp_path / "out/index.md").read_text()


@pytest.mark.slow
@pytest.mark.proof_only
def test_looks_and_worlds_are_swapped_round_one_bridge(monkeypatch: pytest.MonkeyPatch) -> None:
    """The slab bridge stays in its place: pictures of two looks differ, but little in the world around it."""
    for name, size in {"_WIDTH": 120, "_HEIGHT": 60, "_FOCAL": 120.0}.items():
        monkeypatch.setattr(combinations, name, size)
    taken = list(combinations.photograph_combinations("slab", 7, ("lakeside",), ("clean", "aged")))
    assert [(world, look) for world, look, _ in taken] == [("lakeside", "clean"), ("lakeside", "aged")]
    clean, aged = (picture.astype(float).mean(axis=2) for _, _, picture in taken)
    assert min(clean.std(), aged.std()) > 15.0
    changed = np.abs(clean - aged) > 12.0
    assert 0.005 < changed.mean() < 0.3


@pytest.mark.slow
@pytest.mark.proof_only
def test_the_verb_writes_a_sheet_for_each_family(tmp_path: Path) -> None:
    """One real bridge: photographs with contrast, and its classes in colors on the one of the background."""
    with pytest.raises(SystemExit) as done:
        main(["gallery", "families", "-o", str(tmp_path / "out"), "--count", "1", "--family", "slab"])
    assert done.value.code == 0
    image = cv2.imread(str(tmp_path / "out/slab.jpg"))
    assert image is not None
    third = image.shape[1] // 3
    whole, classes, close = (image[:, k * third : (k + 1) * third].astype(float) for k in range(3))
    assert min(whole.std(), close.std()) > 15.0
    background = np.median(classes, axis=(0, 1))
    assert 0.03 < (np.abs(classes - background).max(axis=2) > 40.0).mean() < 0.5
    assert "slab.jpg" in (tmp_path / "out/index.md").read_text()
