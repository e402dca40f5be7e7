"""The scene that renderers are compared on: a girder bridge of eight spans by a lake, in the look of the gallery."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from authoring.axis.alignment import Layout
from authoring.families.bridge_settings import draw_layout
from authoring.scene import author_scene
from authoring.settings import AuthoringSettings
from authoring.streams import stream
from groundwork.progress import SILENT
from groundwork.settings import parse_settings
from usd_schemas.pinhole import Pinhole, look_at

F64 = NDArray[np.float64]

SEED = 7
SURVEY, IMAGES = "many", 80
CAMERA = Pinhole(1280, 960, 1280 * 24 / 36, 1280 * 24 / 36, 640.0, 480.0)
VIEWS = ("close", "global", "under deck")
SHIFT = 0.6  # [m] between the two pictures of a view
RECIPE: dict[str, object] = {
    "bridge": {
        "family": "girder",
        "service": "road",
        "alignment": {"kind": "straight", "skew": 0},
        "girder": {"spans": [30.0] * 8},
    },
    "site": {"crossing": "river", "fine_spacing": 0.85, "scatter": {"tufts": 1800, "shrubs": 260}},
    "background": {"name": "lakeside", "lakeside": {"villas": 100, "town_houses": 40, "trees": 20500, "boats": 40}},
    "look": {"name": "weathered"},
    "survey": [{"kind": "global", "id": SURVEY, "images": IMAGES, "spacing": 50.0, "width": 1280, "height": 960}],
}


def author_bench(folder: Path) -> Layout:
    """Author the scene.

    Args:
        folder: Existing empty folder.

    Returns:
        The bridge's layout.
    """
    settings = parse_settings(AuthoringSettings, RECIPE, "benchmark")
    author_scene(settings, SEED, folder, SILENT)
    return draw_layout(settings.bridge, stream(SEED, "bridge"))[0]


def view_pairs(layout: Layout) -> F64:
    """Place two cameras for each of `VIEWS`, `SHIFT` apart.

    Args:
        layout: The bridge.

    Returns:
        camera_to_world, shape (3, 2, 4, 4), float64.
    """
    pier, width, depth = layout.supports[3], layout.width, layout.depth

    def at(along: float, left: float, above: float) -> F64:
        return layout.alignment.point(np.array([along]), np.array([left]), np.array([above]))[0]

    places = (
        (at(pier - 9.0, -0.5 * width - 9.0, 0.0), at(pier + 1.0, 0.0, -depth - 4.0)),
        (at(pier - 36.0, -0.5 * width - 30.0, 9.0), at(pier, 0.0, -depth - 4.0)),
        (at(pier - 9.0, -0.3 * width, -depth - 3.0), at(pier, 0.1 * width, -depth - 3.0)),
    )
    return np.array(
        [
            [
                look_at(eye + step * _sideways(eye, target), target + step * _sideways(eye, target))
                for step in (0.0, SHIFT)
            ]
            for eye, target in places
        ]
    )


def _sideways(eye: F64, target: F64) -> F64:
    across = np.cross(target - eye, [0.0, 0.0, 1.0])
    return across / np.linalg.norm(across)
