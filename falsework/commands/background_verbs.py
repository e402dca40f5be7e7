"""The verbs of `falsework background`: real surroundings for scenes."""

import sys
from pathlib import Path
from typing import Annotated

import tyro

from falsework.commands.console import ConsoleProgress
from groundwork.child import run_child

WORKER = "falsework.children.background_work"
TIME_LIMIT = 1800.0  # [s]
MEMORY_LIMIT = 12.0  # [GB]

File = tyro.conf.Positional[Path]
Output = Annotated[Path, tyro.conf.arg(aliases=["-o"])]


def import_background(
    file: File, output: Output, *, up: str = "", scale: float = 1.0, attribution: str = "", license: str = ""
) -> int:
    """Turn a city from elsewhere into a world that scenes are put into: metres, z up, its own origin, labelled.

    A CityJSON file says what is a building; in a mesh the ground is found as the lowest surface, and what stands out of
    it is built. Colours and textures come along.

    Args:
        file: CityJSON 1.0 to 2.0 or CityJSONSeq (.json, .jsonl); .glb, .gltf, .obj, .ply, or a .zip with one of them
            and its textures; or any USD stage (.usd, .usda, .usdc, .usdz).
        output: Folder to write; its name is the name of the world.
        up: Axis that points up in .obj, .ply, .gltf and .glb, y or z; unless said, y for glTF and z for the others.
        scale: Metres that one unit of a mesh is, e.g. 0.01 for centimetres.
        attribution: Who made the data, where the file does not say so.
        license: Its licence, where the file does not say so.
    """
    from groundwork.output_folder import fresh_output

    said = {name: text for name, text in (("attribution", attribution), ("license", license)) if text}
    request = {"file": str(file.absolute()), "name": output.absolute().name, "said": said}
    request |= {"up": up, "scale": scale}
    with ConsoleProgress() as progress:
        found: dict[str, str] = {}

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
    _say(found)
    sys.stdout.write(f"world       {output / output.absolute().name}.usda\n")
    return 0


def info(world: File) -> int:
    """Say what an imported world holds, and whose it is.

    Args:
        world: Its root layer or folder.
    """
    _say(run_child(WORKER, {"world": str(world.absolute())}, time_limit=TIME_LIMIT, memory_limit=MEMORY_LIMIT))
    return 0


def _say(found: dict[str, str]) -> None:
    for name, text in found.items():
        sys.stdout.write(f"{name:<11} {text}\n")


BACKGROUND_VERBS = {"import": import_background, "info": info}
