"""Where the settings of an experiment come from: a preset of the package, or a file of the user's."""

from importlib.resources import files
from pathlib import Path
from typing import Any

from groundwork.errors import InputError
from groundwork.foreign_file import parse_toml
from groundwork.settings import read_toml

DEFAULT_SET = "bridges"


def preset_names() -> tuple[str, ...]:
    """Name the presets of the package."""
    found = (entry.name for entry in files("learn").joinpath("compare/presets").iterdir())
    return tuple(sorted(name.removesuffix(".toml") for name in found if name.endswith(".toml")))


def preset_values(what: str) -> dict[str, Any]:
    """Read what an experiment says, not yet validated.

    Args:
        what: Name of a preset, or path of a TOML file.

    Raises:
        InputError: Neither of them.
    """
    if what in preset_names():
        return parse_toml(files("learn").joinpath(f"compare/presets/{what}.toml").read_bytes(), Path(what))
    if Path(what).suffix == ".toml":
        return read_toml(Path(what))
    raise InputError(
        "no such experiment", field="--preset", value=what, allowed=f"{', '.join(preset_names())}, or a .toml file"
    )
