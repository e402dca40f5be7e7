"""The verbs that make clouds of photographs, and that hand clouds and captures to other programs."""

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
    """Reconstruct a capture, or a folder of photographs, into a cloud, annotated where the capture carries its truth.

    Killed at any moment, the same command goes on where it stopped.

    Args:
        capture: Capture folder, or a folder of JPEG or PNG files.
        output: Folder to write.
        settings: Scenario whose `[recon]` section applies.
        gcp: Ground control points and scale bars, as a gcp_list.txt or as Metashape's tables; not with truth.
        mode: Which points. sparse: those of structure from motion; dense: one for nearly every pixel that enough
            photographs confirm, the way to train on; both: a cloud of each, from one model. Left out: as the scenario
            says, else dense.
        quality: How fine the depth maps of a dense cloud are. ultra: a depth for every pixel of the photographs; high
            for each 2 x 2 of them, medium 4 x 4, low 8 x 8. Left out: as the scenario says, else high.
        model: A cloud of the same photographs: its cameras are used again, and not looked for.
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
    """Write a cloud or a capture for another program.

    Of a capture: its true cameras (colmap, nerfstudio), or a film of the flight (video). Of a cloud: its points (laz,
    las, ply, hdf5, pointcept, s3dis), or the reconstructed cameras with them (colmap, nerfstudio).

    Args:
        source: Cloud or capture folder.
        output: Folder to write.
        to: Format.
        photographs: Capture of a cloud: its photographs are copied beside the cameras (colmap, nerfstudio).
        as_json: Print one JSON object instead of lines.
    """
    from falsework.commands.verbs import export_folder

    with ConsoleProgress() as progress:
        files = export_folder(source, to, output, progress, photographs)
    facts = {"format": to, "folder": str(output), "files": [str(file) for file in files]}
    return tell(facts, [f"export  {file}" for file in files], as_json)
