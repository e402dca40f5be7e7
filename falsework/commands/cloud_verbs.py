"""The verbs that reconstruct clouds from photographs, and that export clouds and captures."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from falsework.commands.answers import AsJson, cloud_facts, tell
from falsework.commands.console import ConsoleProgress
from falsework.commands.given_files import need_scenario

if TYPE_CHECKING:
    from recon.settings import ReconSettings

Output = Annotated[Path, tyro.conf.arg(aliases=["-o"])]
File = tyro.conf.Positional[Path]


def reconstruct(
    capture: File,
    output: Output,
    *,
    settings: Path | None = None,
    gcp: Path | None = None,
    mode: Literal["sparse", "dense", "both"] | None = None,
    quality: Literal["low", "medium", "high", "ultra"] | None = None,
    model: Path | None = None,
    as_json: AsJson = False,
) -> int:
    """Reconstruct a cloud from a capture or a folder of photographs; with labels if the capture has its truth.

    An interrupted command can be repeated and continues where it stopped.

    Args:
        capture: Capture folder, or a folder of JPEG or PNG files.
        output: Folder to write.
        settings: Scenario whose `[recon]` section applies.
        gcp: File of ground control points and scale bars, as a gcp_list.txt or as Metashape's tables; not with truth.
        mode: Kind of cloud. sparse: the points of structure from motion; dense: a point for nearly every pixel that
            enough photographs confirm, recommended for training; both: one cloud of each kind from one model. Default:
            as in the scenario, else dense.
        quality: Resolution of the depth maps of a dense cloud. ultra: one depth for every pixel of the photographs;
            high: for each 2 x 2 pixels; medium: 4 x 4; low: 8 x 8. Default: as in the scenario, else medium.
        model: A cloud of the same photographs whose cameras are reused.
        as_json: Print one JSON object instead of lines.
    """
    from falsework.commands.verbs import reconstruct_folder
    from recon.settings import ReconSettings

    given = ReconSettings() if settings is None else _recon_of(settings)
    said = {name: value for name, value in (("mode", mode), ("quality", quality)) if value is not None}
    with ConsoleProgress() as progress:
        clouds = reconstruct_folder(capture, output, given.model_copy(update=said), progress, gcp, model)
    facts = {"clouds": [cloud_facts(cloud) for cloud in clouds]} if as_json else {}
    return tell(facts, [f"cloud   {cloud}" for cloud in clouds], as_json)


def _recon_of(scenario: Path) -> "ReconSettings":
    need_scenario(scenario)
    from falsework.scenario import load_scenario

    return load_scenario(scenario).recon


def export(
    source: File,
    output: Output,
    *,
    to: Literal["laz", "las", "ply", "hdf5", "pointcept", "s3dis", "colmap", "nerfstudio", "video"],
    photographs: Path | None = None,
    as_json: AsJson = False,
) -> int:
    """Export a cloud or a capture for another program.

    From a capture: its true cameras (colmap, nerfstudio), or a video of the flight (video). From a cloud: its points
    (laz, las, ply, hdf5, pointcept, s3dis), or points and reconstructed cameras (colmap, nerfstudio).

    Args:
        source: Cloud or capture folder.
        output: Folder to write.
        to: Format.
        photographs: Capture of the cloud, to copy its photographs beside the cameras (colmap, nerfstudio).
        as_json: Print one JSON object instead of lines.
    """
    from falsework.commands.verbs import export_folder

    with ConsoleProgress() as progress:
        files = export_folder(source, to, output, progress, photographs)
    facts = {"format": to, "folder": str(output), "files": [str(file) for file in files]}
    return tell(facts, [f"export  {file}" for file in files], as_json)
