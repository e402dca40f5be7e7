"""What is added to a scene: nothing where today's code would draw it differently, or in the place of what is ours."""

from dataclasses import replace
from pathlib import Path

import pytest

from authoring.axis.alignment import Layout
from authoring.families.registry import DrawnBridge, build_bridge
from authoring.imported.asset import MARK
from authoring.layers.assets import Pieces
from authoring.parts.piers import Ground
from authoring.scenes.add_survey import add_survey
from authoring.shapes.component import Component
from authoring.site.site import Site, draw_site
from authoring.surveys.settings import GlobalSettings
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


@pytest.mark.parametrize(
    ("axis", "name"),
    [("background", "none"), ("background", "City"), ("light", "default.hdr"), ("look", "clean"), ("look", "Clean")],
)
def test_a_file_takes_no_name_of_ours(own_scene: Path, axis: str, name: str, tmp_path: Path) -> None:
    """A world, a sky or surfaces of this name would replace ours: nothing is written, not what is asked beside it."""
    own = tmp_path / "mine" / name
    (own if axis != "light" else own.parent).mkdir(parents=True)
    if axis == "background":
        head = f'(\n    customLayerData = {{\n        int "{MARK}" = 1\n    }}\n)\n'
        (own / f"{name}.usda").write_text(f"#usda 1.0\n{head}")
    before = file_bytes(own_scene.parent)
    other = {"look": "random"} if axis == "light" else {"light": "2024-12-21T10:00"}
    with pytest.raises(InputError, match=f"{own}: {axis}: has the name of a {axis} of Falsework .*Rename it"):
        set_choices(own_scene, {**other, axis: str(own)}, print)
    assert file_bytes(own_scene.parent) == before


def test_a_survey_that_differs_from_another_by_case_is_refused(own_scene: Path) -> None:
    """On some disks its files would replace those of the other one."""
    (flown,) = (path.stem for path in (own_scene.parent / "surveys").glob("*.usdc"))
    before = file_bytes(own_scene.parent)
    with pytest.raises(InputError, match=rf"survey\.id: differs from another survey only by case .*allowed: {flown}"):
        add_survey(own_scene, GlobalSettings(id=flown.upper()))
    assert file_bytes(own_scene.parent) == before
