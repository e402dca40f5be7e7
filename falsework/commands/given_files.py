"""Early checks of the files and folders that a user names, before other rooms are imported."""

import functools
import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

import tyro

from groundwork.errors import InputError, MissingError

USD_SUFFIXES = (".usda", ".usdc", ".usd", ".usdz")
STAGE_FILES = f"{', '.join(USD_SUFFIXES)}, or the folder of a scene"
GIVEN = tyro.conf.Positional[Path]  # annotation of the files that a verb reads


def files_first(verb: Callable[..., int]) -> Callable[..., int]:
    """Make a verb check its input files before anything else.

    Args:
        verb: Function of the command line; arguments of the type `GIVEN` are files or folders that it reads.

    Returns:
        The verb, which raises `MissingError` for the first file that does not exist.
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
    """Refuse a missing folder, a file instead of a folder, and a folder of another kind.

    Args:
        place: Path from the user.
        wanted: Expected kind, such as `a capture, or a folder of photographs`.
        field: The option that named it; None for an argument without one.
        mark: File that such a folder contains; None if several kinds are accepted.

    Raises:
        MissingError: The folder does not exist, or lacks that file.
        InputError: It is a file.
    """
    if not place.exists():
        raise MissingError("no such folder", where=place, field=field, hint=f"Name {wanted}")
    if not place.is_dir():
        raise InputError("is a file, not a folder", where=place, field=field, hint=f"Name {wanted}")
    from groundwork.output.reading import reading

    with reading(place):  # finishes an interrupted replacement
        there = mark is None or (place / mark).is_file()
    if not there:
        raise MissingError(f"has no {mark}", where=place, field=field, hint=f"Name {wanted}")


def need_scenario(path: Path) -> None:
    """Refuse a file that is not TOML, before the settings of all rooms are imported.

    Args:
        path: Path from the user.

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
    """Find the root layer of a stage, also in a scene's folder or in that of a scene of a run.

    Args:
        stage: USD file, scene folder, or a folder of a run such as `OUT/scenes/0000`.

    Raises:
        MissingError: No such file, or a folder without a scene.
        InputError: Not a USD file.
    """
    from authoring.scenes.checkout import find_root_layer
    from groundwork.output.reading import reading

    with reading(stage):
        if stage.is_dir():
            return find_root_layer(stage)
        if not stage.is_file():
            raise MissingError("no such file", where=stage, hint="Name a USD file, or the folder of a scene")
    if stage.suffix.lower() not in USD_SUFFIXES:
        raise InputError("not a USD file", where=stage, allowed=STAGE_FILES)
    return stage
