"""One picture of a scene: the whole bridge in its surroundings, as a photographer would show it."""

import struct
import tempfile
import zlib
from dataclasses import replace
from pathlib import Path
from typing import Any

from falsework.children.products import ADDRESS_LIMIT, read_safely
from groundwork.child import answer_parent
from groundwork.output.file import SIGNATURE
from groundwork.progress import Progress

TIME_LIMIT = 1800.0  # [s]
MEMORY_LIMIT = 16.0  # [GB]
FOCAL = 32.0 / 36.0  # focal length over the picture's width: a moderate wide angle with little distortion of verticals
_NEAR = 0.1  # [m]
_SEED = 7  # seed of the sensor, whose noise is off
_HEADER_END = 33  # [byte] of a PNG: its signature and its first chunk


def photograph_stage(stage: Path, request: dict[str, Any], progress: Progress) -> bytes:
    """Render the picture of a stage in a child process: a graphics driver may crash, and the stage is untrusted.

    Args:
        stage: USD file.
        request: `{view, width, height, render}`, and `allow_roots`: further folders from which the stage may load
            files.
        progress: Listener.

    Returns:
        PNG that carries our signature.

    Raises:
        InputError: No bridge in the stage, or a stage that cannot be opened safely.
    """
    with tempfile.TemporaryDirectory() as scratch:
        picture = Path(scratch) / "picture.png"
        asked = {"allow_roots": [], **request, "stage": str(stage.absolute()), "picture": str(picture)}
        read_safely("falsework.gallery.preview", asked, stage, progress, TIME_LIMIT, MEMORY_LIMIT)
        return picture.read_bytes()


def signed_png(data: bytes) -> bytes:
    """Add our signature to a PNG, so that a later command recognizes it as ours and may replace it.

    Args:
        data: A PNG.
    """
    body = b"tEXtSoftware\0" + SIGNATURE.encode("latin-1")
    chunk = struct.pack(">I", len(body) - 4) + body + struct.pack(">I", zlib.crc32(body))
    return data[:_HEADER_END] + chunk + data[_HEADER_END:]


def _answer(request: dict[str, Any], progress: Progress) -> None:
    from falsework.gallery.camera import seen_from
    from falsework.gallery.viewpoint import best_view
    from render.frames import render_scene
    from render.settings import RenderSettings
    from usd_schemas.guard.guard import check_stage, limit_memory
    from usd_schemas.pinhole import Pinhole
    from usd_schemas.reading.scene_cache import load_scene

    limit_memory(ADDRESS_LIMIT)
    stage, picture = Path(request["stage"]), Path(request["picture"])
    check_stage(stage, tuple(Path(root) for root in request["allow_roots"]), progress.note)
    progress.stage("view", 2)
    scene = load_scene(stage)
    progress.advance(1)
    width, height = request["width"], request["height"]
    camera = Pinhole(width, height, FOCAL * width, FOCAL * width, 0.5 * width, 0.5 * height)
    seen = seen_from(scene, best_view(scene, camera, request["view"])[None], camera)
    track = replace(seen.cameras[0], near=_NEAR, distortion=type(seen.cameras[0].distortion)(), readout_time=0.0)
    with tempfile.TemporaryDirectory() as scratch:
        settings = RenderSettings.model_validate(request["render"])
        render_scene(replace(seen, cameras=(track,), moments=()), Path(scratch), settings, _SEED, progress)
        (data,) = (path.read_bytes() for path in sorted((Path(scratch) / "images").glob("*.png")))
    picture.write_bytes(signed_png(data))  # inside an atomic folder: a temporary folder of the parent


if __name__ == "__main__":
    answer_parent(_answer)
