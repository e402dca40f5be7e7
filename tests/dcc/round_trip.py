"""Small scenes, and trips of it through Blender and back."""

import json
import shutil
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from pxr import Sdf

import authoring.exchange.blender
from authoring.edits.additions import Labeling
from authoring.edits.harvest import EDITS, Harvest, harvest_edits
from authoring.scene import author_scene
from authoring.settings import AuthoringSettings
from groundwork.progress import SILENT
from tests.dcc.blender import run_in_blender

SCRIPT = str(Path(authoring.exchange.blender.__file__).parent)
SMALL: dict[str, object] = {
    "look": {"texels": 256},
    "background": {"name": "none"},
    "bridge": {
        "family": "beam",
        "service": "road",
        "alignment": {"kind": "straight", "skew": 0, "profile": "grade"},
        "beam": {"spans": [14.0, 16.0]},
        "parapet": {"shape": "wall"},
        "roadway": {"lanes": 2},
    },
    "survey": [{"kind": "global", "images": 24, "width": 480, "height": 360}],
}

CHAIN: dict[str, object] = {  # small, and yet enough images with enough texture to reconstruct
    "background": {"name": "none"},
    "bridge": {
        "family": "beam",
        "service": "road",
        "alignment": {"kind": "straight", "skew": 0, "profile": "grade"},
        "beam": {"spans": [12.0]},
        "parapet": {"shape": "wall"},
    },
    "survey": [{"kind": "global", "images": 14, "width": 400, "height": 300}],
}

Y_UP_CENTIMETERS = {
    "convert_orientation": True,
    "export_global_forward_selection": "NEGATIVE_Z",
    "export_global_up_selection": "Y",
    "convert_scene_units": "CENTIMETERS",
}

Edit = tuple[object, ...]


def small_scene(folder: Path, settings: dict[str, object], seed: int) -> Path:
    """Author a scene.

    Args:
        folder: Where to; must not exist.
        settings: Sections of a scenario.
        seed: Seed.

    Returns:
        Its root layer.
    """
    folder.mkdir(parents=True)
    author_scene(AuthoringSettings.model_validate(settings), seed, folder, SILENT)
    return folder / "scene.usda"


def copy_scene(scene: Path, folder: Path) -> Path:
    """Copy a scene, free to be edited.

    Args:
        scene: Root layer.
        folder: Where to; must not exist.

    Returns:
        Root layer of the copy.
    """
    shutil.copytree(scene.parent, folder)
    return folder / scene.name


def trip(scene: Path, folder: Path, edits: Iterable[Edit], **options: object) -> tuple[Path, dict[str, Any]]:
    """Open a scene in Blender with the script that we ship, edit it, export it.

    Args:
        scene: Root layer.
        folder: Where the exported file goes.
        edits: Operations of `edit_scene.py`.
        options: Options of Blender's exporter; its defaults where none are given.

    Returns:
        The exported file, and what Blender knew of the scene before the edits.
    """
    folder.mkdir(parents=True, exist_ok=True)
    out, facts = folder / "edited.usdc", folder / "facts.json"
    request = {"script": SCRIPT, "scene": str(scene), "out": str(out), "facts": str(facts), "edits": list(edits)}
    run_in_blender("edit_scene.py", json.dumps({**request, "options": options}))
    return out, json.loads(facts.read_text(encoding="utf-8"))


def harvest(scene: Path, edited: Path, *labels: str, remove: bool = False) -> Harvest:
    """Bring edits home.

    Args:
        scene: Root layer.
        edited: What Blender exported.
        labels: Labels of new objects.
        remove: Switch deleted parts off.
    """
    return harvest_edits(edited, scene, Labeling.parse(labels), remove)


def opinions(scene: Path) -> dict[str, set[str]]:
    """List what the edits layer says.

    Args:
        scene: Root layer.

    Returns:
        Names of authored properties by path of the prim, variants included; prims without any are left out.
    """
    layer = Sdf.Layer.OpenAsAnonymous(str(scene.parent / EDITS))
    found: dict[str, set[str]] = {}

    def note(path: Sdf.Path) -> None:
        if path.IsPropertyPath():
            found.setdefault(str(path.GetPrimOrPrimVariantSelectionPath()), set()).add(path.name)

    layer.Traverse("/", note)
    return found
