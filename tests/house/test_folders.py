"""Inside a room, too, imports point one way: from folder to folder, and no module lies loose that is not meant to."""

from __future__ import annotations

import re

import pytest

from docs.architecture import ROOMS as ARCHITECTURE
from docs.architecture import folders_of
from tests.house.house import ROOT
from tests.house.test_imports import imported_names

# The order of each room, lowest first: folders, and the modules beside them, which end in `.py`. Each imports only from
# those before it. Beside the folders stand the conductor, the settings, and what several folders share.
FLOORS: dict[str, tuple[str, ...]] = {
    "groundwork": (
        "errors.py",
        "length_units.py",
        "progress.py",
        "user_cache.py",
        "foreign_file.py",
        "png_chunks.py",
        "locks.py",
        "slug.py",
        "settings.py",
        "marks.py",
        "canonical.py",
        "memory.py",
        "child.py",
        "files.py",
        "output",
    ),
    "usd_schemas": (
        "tokens.py",
        "components.py",
        "taxonomies.py",
        "pinhole.py",
        "distortion.py",
        "registration.py",
        "apis.py",
        "flat_lights.py",
        "flat_scene.py",
        "texels.py",
        "raycast.py",
        "triangulate.py",
        "reading",
        "guard",
    ),
    "authoring": (
        "streams.py",
        "foreign",
        "shapes",
        "axis",
        "solids",
        "site",
        "parts",
        "families",
        "looks",
        "light",
        "backgrounds",
        "surveys",
        "layers",
        "imported",
        "settings.py",
        "scenes",
        "variants",
        "edits",
        "exchange",
        "scene.py",
    ),
    "render": (
        "settings.py",
        "images",
        "capture.py",
        "gpu",
        "light",
        "detail",
        "views",
        "sensor",
        "writing",
        "frames.py",
        "workers.py",
    ),
    "recon": (
        "settings.py",
        "columns.py",
        "cloud.py",
        "steps.py",
        "shortage.py",
        "photos",
        "sfm",
        "dense",
        "placing",
        "points",
        "truth",
        "formats",
        "sampling",
        "reconstruct.py",
    ),
    "learn": (
        "device.py",
        "sample.py",
        "neighborhoods",
        "datasets",
        "models",
        "losses.py",
        "metrics.py",
        "instance_defaults.py",
        "instances.py",
        "trained.py",
        "seen_bridges.py",
        "scoring",
        "evaluate.py",
        "training",
        "compare",
        "demo",
        "predict",
    ),
    "falsework": (
        "platform.py",
        "stops.py",
        "scenario.py",
        "report",
        "stages.py",
        "children",
        "view",
        "store",
        "execution",
        "pipeline.py",
        "gallery",
        "doctor.py",
        "commands",
        "arguments.py",
        "api_reading.py",
        "api.py",
        "cli.py",
        "__main__.py",
    ),
}


def wrong_arrows(room: str, place: str, source: str) -> list[str]:
    """Name the imports of a module that lead upwards within its room.

    Args:
        room: Name of the room.
        place: The folder that the module lies in, or the name of its file.
        source: Its text.
    """
    floors = [name.removesuffix(".py") for name in FLOORS[room]]
    here = place.removesuffix(".py")
    if place not in FLOORS[room]:
        return [f"1: {place} has no floor in {room}"]
    found = []
    for line, name in imported_names(source):
        first, *rest = name.split(".")
        if first != room or not rest or rest[0] == here:
            continue
        if rest[0] not in floors:
            found.append(f"{line}: {name} has no floor in {room}")
        elif floors.index(rest[0]) > floors.index(here):
            found.append(f"{line}: {here} may not import {name}")
    return found


@pytest.mark.parametrize("room", FLOORS)
def test_every_floor_is_there(room: str) -> None:
    """The table names nothing that the room does not have."""
    assert [name for name in FLOORS[room] if not (ROOT / room / name).exists()] == []


@pytest.mark.parametrize("room", FLOORS)
def test_the_page_of_the_house_knows_every_folder(room: str) -> None:
    """docs/architecture.md lists the folders of each room in this order, and no others."""
    floors = [name for name in FLOORS[room] if not name.endswith(".py")]
    assert list(ARCHITECTURE[room][1]) == floors
    assert sorted(floors) == folders_of(room)


def test_the_guidelines_show_the_same_order() -> None:
    """The tree of CODING_GUIDELINES.md names the folders and modules of each room in this order, and no others."""
    text = (ROOT / "CODING_GUIDELINES.md").read_text(encoding="utf-8")
    rooms = re.findall(r"^ {3}(\w+) +(.*(?:\n {4,}.*)*)", text.split("   ```")[1], re.M)
    tree = {room: re.sub(r"\(conductor\)|·", " ", names).split() for room, names in rooms}
    floors = {room: [name.removesuffix(".py") for name in names] for room, names in FLOORS.items()}
    floors["falsework"].remove("__main__")
    assert tree == floors


@pytest.mark.parametrize(
    ("room", "place", "source"),
    [
        ("authoring", "site", "from authoring.parts.piers import Pier"),
        ("authoring", "shapes", "def f():\n    from authoring.axis import alignment"),
        ("authoring", "surveys", "import authoring.settings"),
        ("recon", "sfm", "from recon import reconstruct"),
        ("learn", "scoring", "from learn.training.train import train"),
        ("learn", "training", "from learn.compare import trial"),
        ("recon", "misc", ""),
        ("recon", "loose.py", ""),
        ("render", "gpu", "from render.nowhere import x"),
    ],
)
def test_an_arrow_upwards_is_found(room: str, place: str, source: str) -> None:
    """Each import of a higher folder, and each name without a floor, is one finding."""
    assert len(wrong_arrows(room, place, source)) == 1


@pytest.mark.parametrize(
    ("room", "place", "source"),
    [
        ("authoring", "site", "from authoring.axis.alignment import Alignment\nfrom authoring.site import grid"),
        ("authoring", "scene.py", "from authoring.settings import AuthoringSettings"),
        ("learn", "predict", "from learn.scoring.votes import vote\nimport learn.trained\nfrom learn import sample"),
        ("recon", "reconstruct.py", "import recon.sfm.sparse\nfrom render.capture import read_capture"),
    ],
)
def test_an_arrow_downwards_passes(room: str, place: str, source: str) -> None:
    """Imports of lower folders, of the same folder, and of other rooms are no findings."""
    assert wrong_arrows(room, place, source) == []
