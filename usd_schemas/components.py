"""The table of component kinds and training classes, used by the whole project."""

import tomllib
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

from groundwork.errors import InputError

BACKGROUND = 0
NOISY_POINT = 16
UNLABELED = 255


@dataclass(frozen=True)
class ClassRow:
    """One training class.

    Attributes:
        id: Number in label images and clouds, 0 to 255.
        name: Name in lower snake case.
        color: Display color, sRGB, 0 to 255.
    """

    id: int
    name: str
    color: tuple[int, int, int]


@cache
def class_rows() -> tuple[ClassRow, ...]:
    """List the training classes in the order of their ids."""
    rows = tomllib.loads(files("usd_schemas").joinpath("tables/classes.toml").read_text(encoding="utf-8"))["class"]
    red, green, blue = 0, 1, 2
    return tuple(
        ClassRow(row["id"], row["name"], (row["color"][red], row["color"][green], row["color"][blue])) for row in rows
    )


@cache
def component_classes() -> dict[str, str]:
    """Map every component kind to the name of its training class."""
    table = tomllib.loads(files("usd_schemas").joinpath("tables/components.toml").read_text(encoding="utf-8"))
    return {kind: name for name, row in table.items() for kind in row["components"]}


def class_of(component: str) -> str:
    """Find the training class of a component kind.

    Args:
        component: Component kind, e.g. `pier_cap`.

    Returns:
        Class name.

    Raises:
        InputError: The table has no such component.
    """
    try:
        return component_classes()[component]
    except KeyError:
        raise InputError(
            "unknown component", field="component", value=component, allowed=", ".join(sorted(component_classes()))
        ) from None


def class_id(name: str) -> int:
    """Find the number of a training class.

    Args:
        name: Class name, e.g. `pier_cap`.

    Returns:
        Class id.

    Raises:
        InputError: There is no such class.
    """
    for row in class_rows():
        if row.name == name:
            return row.id
    raise InputError("unknown class", field="class", value=name, allowed=", ".join(row.name for row in class_rows()))
