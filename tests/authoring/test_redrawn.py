"""Nothing is added to a scene whose bridge or site today's code would draw differently."""

from dataclasses import replace
from pathlib import Path

import pytest

from authoring.axis.alignment import Layout
from authoring.families.registry import DrawnBridge, build_bridge
from authoring.layers.assets import Pieces
from authoring.parts.piers import Ground
from authoring.shapes.component import Component
from authoring.site.site import Site, draw_site
from authoring.variants import add
from authoring.variants.add import set_choices
from groundwork.errors import InputError
from tests.authoring.small_scene import file_bytes


def moved(pieces: Pieces) -> Pieces:
    """Move one vertex of the first component by a millimeter, as another version might."""
    first, *others = pieces
    assert isinstance(first, Component)
    points = first.mesh.points.copy()
    points[0, 2] += 1e-3
    return replace(first, mesh=replace(first.mesh, points=points)), *others


@pytest.mark.parametrize(("axis", "value"), [("look", "random"), ("background", "lakeside")])
def test_a_scene_of_another_version_gets_no_look_and_no_world(
    own_scene: Path, monkeypatch: pytest.MonkeyPatch, axis: str, value: str
) -> None:
    """One line that says what to do, and not one byte is changed; what the scene has can still be chosen."""

    def another_bridge(layout: Layout, drawn: DrawnBridge, ground: Ground) -> Pieces:
        return moved(build_bridge(layout, drawn, ground))

    def another_site(*asked: object) -> Site:
        site = draw_site(*asked)  # type: ignore[arg-type]
        return replace(site, pieces=moved(site.pieces))

    monkeypatch.setattr(add, "build_bridge", another_bridge)
    monkeypatch.setattr(add, "draw_site", another_site)
    before = file_bytes(own_scene.parent)
    with pytest.raises(InputError, match=r"another version of Falsework authored it.*Author the scene again"):
        set_choices(own_scene, {"light": "2024-12-21T10:00", axis: value}, print)
    assert file_bytes(own_scene.parent) == before
    set_choices(own_scene, {"look": "clean"}, print)


def test_geometry_that_somebody_has_changed_is_not_compared(own_scene: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever edits the file by hand is not told of another version."""
    geometry = own_scene.parent / "bridge/geometry.usdc"
    geometry.chmod(0o644)
    geometry.write_bytes(geometry.read_bytes() + b"\0")
    monkeypatch.setattr(add, "build_bridge", lambda *asked: moved(build_bridge(*asked)))
    assert set_choices(own_scene, {"look": "random"}, print) == {"look": "random"}


def test_surfaces_with_the_name_of_our_look_are_refused_before_anything_is_written(
    own_scene: Path, tmp_path: Path
) -> None:
    """A folder called as a look of ours: one line, and the light that was asked for with it is not added either."""
    (tmp_path / "clean").mkdir()
    before = file_bytes(own_scene.parent)
    with pytest.raises(InputError, match="has the name of a look"):
        set_choices(own_scene, {"light": "2024-12-21T10:00", "look": str(tmp_path / "clean")}, print)
    assert file_bytes(own_scene.parent) == before
