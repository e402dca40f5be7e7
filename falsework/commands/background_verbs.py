"""The verbs of `falsework background`: real surroundings for scenes."""

from pathlib import Path
from typing import Annotated, Any

import tyro

from falsework.commands.answers import AsJson, tell
from falsework.commands.console import ConsoleProgress
from falsework.commands.given_files import USD_SUFFIXES
from groundwork.child import run_child
from groundwork.errors import InputError

WORKER = "falsework.children.background_work"
TIME_LIMIT = 1800.0  # [s]
MEMORY_LIMIT = 12.0  # [GB]
_SUFFIXES = (".json", ".jsonl", ".glb", ".gltf", ".obj", ".ply", ".zip", *USD_SUFFIXES)

File = tyro.conf.Positional[Path]
Output = Annotated[Path, tyro.conf.arg(aliases=["-o"])]


def import_background(
    file: File,
    output: Output,
    *,
    up: str = "",
    scale: float = 1.0,
    attribution: str = "",
    license: str = "",
    as_json: AsJson = False,
) -> int:
    """Import a city model as a background for scenes: in meters, z up, with its own origin and labels.

    A CityJSON file states what is a building. In a mesh, the lowest surface is the ground, and everything that rises
    above it is a building. Colors and textures are kept.

    Args:
        file: CityJSON 1.0 to 2.0 or CityJSONSeq (.json, .jsonl); .glb, .gltf, .obj, .ply, or a .zip with one of them
            and its textures; or any USD stage (.usd, .usda, .usdc, .usdz).
        output: Folder to write; its name is the name of the world.
        up: Axis that points up in .obj, .ply, .gltf and .glb, y or z; default: y for glTF and z for the others.
        scale: Meters per unit of a mesh, e.g. 0.01 for centimeters.
        attribution: Author of the data, if the file does not state it.
        license: License of the data, if the file does not state it.
        as_json: Print one JSON object instead of lines.
    """
    if file.is_file() and file.suffix.lower() not in _SUFFIXES:
        raise InputError("no city model", where=file, value=file.suffix, allowed=", ".join(_SUFFIXES))
    from groundwork.output.folder import fresh_output

    said = {name: text for name, text in (("attribution", attribution), ("license", license)) if text}
    request = {"file": str(file.absolute()), "name": output.absolute().name, "said": said}
    request |= {"up": up, "scale": scale}
    with ConsoleProgress() as progress:
        found: dict[str, Any] = {}

        def fill(folder: Path) -> None:
            found.update(
                run_child(
                    WORKER,
                    {**request, "folder": str(folder.absolute())},
                    time_limit=TIME_LIMIT,
                    memory_limit=MEMORY_LIMIT,
                    progress=progress,
                )
            )

        fresh_output(output, "world", fill, inputs=[file])
    layer = str(output / f"{output.absolute().name}.usda")
    return tell({**found, "world": layer}, [*_lines(found), f"world       {layer}"], as_json)


def info(world: File, *, as_json: AsJson = False) -> int:
    """Show the contents and the license of an imported world.

    Args:
        world: Its root layer or folder.
        as_json: Print one JSON object instead of lines.
    """
    request = {"world": str(world.absolute())}
    found: dict[str, Any] = run_child(WORKER, request, time_limit=TIME_LIMIT, memory_limit=MEMORY_LIMIT)
    return tell(found, _lines(found), as_json)


def _lines(found: dict[str, Any]) -> list[str]:
    length, width = found["extent"]
    said = {
        "buildings": found["buildings"],
        "triangles": found["triangles"],
        "ground": f"{found['ground_triangles']} triangles",
        "textured": found["textured_triangles"],
        "images": f"{found['images']}, {found['image_bytes'] / 1e6:.1f} MB",
        "extent": f"{length:.0f} x {width:.0f} m",
        **found["attribution"],
    }
    return [f"{name:<11} {text}" for name, text in said.items()]


BACKGROUND_VERBS = {"import": import_background, "info": info}
