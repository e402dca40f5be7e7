"""A scene of real parts, small enough to be authored in a few seconds, for every test that only reads or copies it."""

from pathlib import Path

from authoring.scene import author_scene
from authoring.settings import AuthoringSettings
from groundwork.progress import SILENT

SEED = 7
SMALL: dict[str, object] = {
    "bridge": {
        "service": "road",
        "alignment": {"kind": "straight", "skew": 0, "profile": "grade"},
        "beam": {"spans": [12.0]},
    },
    "look": {"texels": 256},
    "light": {"sky_height": 64},
    "site": {
        "crossing": "river",
        "half_width": 40,
        "run_out": 40,
        "scatter": {"tufts": 20, "stones": 10, "shrubs": 5, "reeds": 5},
    },
    "background": {"name": "none", "countryside": {"reach": 400, "buildings": 1, "trees": 8, "hedge_bushes": 5}},
    "survey": [{"kind": "global", "images": 8, "spacing": 30.0, "width": 160, "height": 120}],
}


def write_small_scene(folder: Path, **sections: object) -> Path:
    """Author the scene into an empty folder, with some sections replaced; give its root layer."""
    author_scene(AuthoringSettings.model_validate({**SMALL, **sections}), SEED, folder, SILENT)
    return folder / "scene.usda"


def file_bytes(folder: Path) -> dict[str, bytes]:
    """Read every file below a folder."""
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
