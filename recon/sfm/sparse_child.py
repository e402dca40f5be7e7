"""The stages of structure from motion that run in a child process: `python -m recon.sfm.sparse_child`.

COLMAP may abort the whole process (a full disk, a broken file), so each stage is one request to a separate process.
"""

from pathlib import Path
from typing import Any

import pycolmap

from groundwork.child import answer_parent
from groundwork.progress import Progress
from recon.photos.photos import open_photographs
from recon.settings import SparseSettings
from recon.sfm.colmap_log import silence
from recon.sfm.extraction import extract
from recon.sfm.mapping import map_images, transform
from recon.sfm.matching import SHARE, match, match_share


def serve(request: dict[str, Any], progress: Progress) -> object:
    """Run one stage.

    Args:
        request: `stage`, `folder` to fill, `seed`; `before`: folder of the stage before; `pairs` for a batch of the
            matching, `similarity` for `transform`, `capture` and `settings` for all others.
        progress: Listener.

    Returns:
        JSON figures of the stage.
    """
    silence()
    pycolmap.set_random_seed(request["seed"])
    folder, before = Path(request["folder"]), Path(request["before"])
    if request["stage"] == "transform":
        return transform(before, folder, request["similarity"])
    if request["stage"] == SHARE:
        return match_share(map(tuple, request["pairs"]), before, folder, request["seed"])
    settings = SparseSettings.model_validate(request["settings"])
    capture = open_photographs(Path(request["capture"]))
    if request["stage"] == "extract":
        return extract(capture, folder, settings, progress)
    run = match if request["stage"] == "match" else map_images
    return run(capture, before, folder, settings, request["seed"], progress)


if __name__ == "__main__":
    answer_parent(serve)
