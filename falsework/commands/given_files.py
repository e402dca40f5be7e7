"""What a user names and is not there, or is a file where a folder is wanted, is said before any room is loaded."""

import functools
import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

import tyro

from groundwork.errors import InputError, MissingError

USD_SUFFIXES = (".usda", ".usdc", ".usd", ".usdz")
STAGE_FILES = f"{', '.join(USD_SUFFIXES)}, or the folder of a scene"
GIVEN = tyro.conf.Positional[Path]  # how the verbs annotate what they read


def files_first(verb: Callable[..., int]) -> Callable[..., int]:
    """Let a verb look for the files that it is given before it does anything else.

    Args:
        verb: Function of the command line; its arguments of the type `GIVEN` are files or folders that it reads.

    Returns:
        The same verb, which raises `MissingError` for the first of them that is not there.
    """
    signature = inspect.signature(verb)
    given = [name for name, parameter in signature.parameters.items() if parameter.annotation == GIVEN]

    @functools.wraps(verb)
    def checked(*values: Any, **named: Any) -> int:
        arguments = signature.bind(*values, **named).arguments
        for name in given:
            if not arguments[name].exists():
                raise MissingError("no such file or folder", where=arguments[name], hint="Check the path")
        return verb(*values, **named)

    return checked


def need_folder(place: Path, wanted: str, field: str | None = None, mark: str | None = None) -> None:
    """Refuse a file where a verb reads a folder, what is not there, and a folder of another kind.

    Args:
        place: What the user named.
        wanted: What it should be, such as `a capture, or a folder of photographs`.
        field: The option that named it; None for an argument without one.
        mark: File that such a folder holds; None where several kinds will do.

    Raises:
        MissingError: Nothing is there, or the folder lacks that file.
        InputError: It is a file.
    """
    if not place.exists():
        raise MissingError("no such folder", where=place, field=field, hint=f"Name {wanted}")
    if not place.is_dir():
        raise InputError("is a file, and a folder is wanted here", where=place, field=field, hint=f"Name {wanted}")
    from groundwork.output_reading import reading

    with reading(place):  # finishes what was being put into place
        there = mark is None or (place / mark).is_file()
    if not there:
        raise MissingError(f"holds no {mark}", where=place, field=field, hint=f"Name {wanted}")


def need_scenario(path: Path) -> None:
    """Refuse what is not TOML, before the settings of all rooms are loaded to read it.

    Args:
        path: What the user named.

    Raises:
        MissingError: There is no such file.
        InputError: Not a file, or not TOML.
    """
    from groundwork.settings import read_toml

    read_toml(path)


def need_page(page: Path, field: str) -> None:
    """Refuse the name of a page that no browser would open as one.

    Args:
        page: File to write.
        field: The option that named it.

    Raises:
        InputError: Its name does not end in .html or .htm.
    """
    if page.suffix.lower() not in (".html", ".htm"):
        raise InputError("not a page", field=field, value=str(page), allowed="a name that ends in .html")


def stage_file(stage: Path) -> Path:
    """Find the file of a stage: a scene's folder, or that of a scene in a run, stands for its root layer.

    Args:
        stage: USD file, scene folder, or a folder of a run such as `OUT/scenes/0000`.

    Raises:
        MissingError: No such file, or a folder without a scene.
        InputError: A file that USD does not open.
    """
    from authoring.scenes.checkout import find_root_layer
    from groundwork.output_reading import reading

    with reading(stage):
        if stage.is_dir():
            return find_root_layer(stage)
        if not stage.is_file():
            raise MissingError("no such file", where=stage, hint="Name a USD file, or the folder of a scene")
    if stage.suffix.lower() not in USD_SUFFIXES:
        raise InputError("not a USD file", where=stage, allowed=STAGE_FILES)
    return stage
