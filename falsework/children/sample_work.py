"""Child process of `falsework sample`: the stages that it opens are untrusted."""

from pathlib import Path
from typing import Any

from falsework.children.products import ADDRESS_LIMIT
from groundwork.child import answer_parent
from groundwork.errors import InputError
from groundwork.progress import Progress
from groundwork.settings import parse_settings


def sample(request: dict[str, Any], progress: Progress) -> int:
    """Sample a stage into a folder.

    Args:
        request: `{kind, settings, stage, allow_roots, folder}`: mesh, terrestrial, mobile or airborne, JSON of its
            settings, the USD file, further folders from which the stage may load files, and an empty folder.
        progress: Listener.

    Returns:
        Number of points.
    """
    from recon.sampling.sample_lidar import sample_lidar
    from recon.sampling.sample_mesh import sample_mesh
    from recon.sampling.sampler_settings import SCANNERS, MeshSettings
    from usd_schemas.guard.guard import check_stage, limit_memory
    from usd_schemas.reading.scene_cache import load_scene

    limit_memory(ADDRESS_LIMIT)
    stage, folder, settings = Path(request["stage"]), Path(request["folder"]), request["settings"]
    said: dict[str, None] = {}
    check_stage(stage, tuple(Path(root) for root in request["allow_roots"]), said.setdefault)
    scene = load_scene(stage)
    for line in {**said, **dict.fromkeys(scene.warnings)}:
        progress.note(line)
    try:
        if request["kind"] == "mesh":
            return len(sample_mesh(scene, folder, parse_settings(MeshSettings, settings, "--set"), progress))
        model = SCANNERS[request["kind"]]
        return len(sample_lidar(scene, folder, parse_settings(model, settings, "--set"), progress))
    except InputError as error:
        error.found_in(stage)
        raise


if __name__ == "__main__":
    answer_parent(sample)
