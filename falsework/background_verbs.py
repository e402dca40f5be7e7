"""The verbs of `falsework background`: real surroundings for scenes."""

import sys
from pathlib import Path
from typing import Annotated

import tyro

from falsework.console import ConsoleProgress
from groundwork.child import run_child

WORKER = "falsework.background_work"
TIME_LIMIT = 1800.0  # [s]
MEMORY_LIMIT = 12.0  # [GB]

File = tyro.conf.Positional[Path]
Output = Annotated[Path, tyro.conf.arg(aliases=["-o"])]


def import_background(file: File, output: Output, *, attribution: str = "", license: str = "") -> int:
    """Turn a city model into a world that scenes are put into: metres, z up, its own origin, labelled.

    Args:
        file: CityJSON file, 1.0 to 2.0, or CityJSONSeq.
        output: Folder to write; its name is the name of the world.
        attribution: Who made the data, where the file does not say so.
        license: Its licence, where the file does not say so.
    """
    from groundwork.files import fresh_output

    said = {name: text for name, text in (("attribution", attribution), ("license", license)) if text}
    request = {"file": str(file.absolute()), "name": output.absolute().name, "said": said}
    with ConsoleProgress() as progress:
        found: dict[str, str] = {}

        def fill(folder: Path) -> None:
            found.update(
                run_child(
                    WORKER, {**request, "folder": str(folder.absolute())}, time_limit=TIME_LIMIT,
                    memory_limit=MEMORY_LIMIT, progress=progress,
                )
            )  # fmt: skip

        fresh_output(output, "world", fill)
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
