"""Class maps: the meaning of class numbers in files from elsewhere, as data files."""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from groundwork.errors import InputError, MissingError
from groundwork.files import read_json
from groundwork.settings import Settings, parse_settings, read_toml
from learn.datasets.class_tables import COMPONENTS, OWN, ClassTable, class_of
from usd_schemas.components import UNLABELED, component_classes
from usd_schemas.taxonomies import BASE, RESERVED, TAXONOMIES, taxonomy

U8 = NDArray[np.uint8]

SEGMENT, CLASSIFICATION = "segment", "classification"


class CodeRow(Settings):
    """Meaning of one number in a file."""

    id: int = Field(ge=0, le=255, description="Class number in the file")
    name: str = Field(description="Name of the class in the file")
    parts: tuple[str, ...] = Field(
        default=(), description="Component kinds, or classes of the base table, that it covers"
    )
    to: Mapping[str, str] = Field(
        default={}, description="Class in a table of classes, if `parts` does not determine it"
    )


class ClassMapFile(Settings):
    """A class map as TOML or JSON."""

    title: str = Field(default="", description="Title of the map")
    source: str = Field(default="", description="Source of the class numbers")
    licence: str = Field(default="", description="License of the data")
    column: str = Field(
        default=SEGMENT,
        min_length=1,
        description="Column of the class numbers: segment (labels under any usual name), classification (the field of "
        "LAS), or the name of any other column",
    )
    use: Literal["train", "evaluate"] = Field(default="train", description="Permitted use of the data")
    table: str = Field(default="", description="Table of classes of Falsework with the same numbers")
    test: tuple[str, ...] = Field(default=(), description="Bridges that the publisher reserves for the test")
    code: tuple[CodeRow, ...] = Field(default=(), description="The class numbers")


@dataclass(frozen=True)
class ClassMap:
    """Meaning of the numbers of a file.

    Attributes:
        name: Name of the map.
        facts: Facts that the class map states about the data.
        codes: Each number and its meaning.
    """

    name: str
    facts: ClassMapFile
    codes: Mapping[int, CodeRow]

    def label(self, code: int, table: ClassTable) -> int:
        """Find the label of a number; 255 where it is unknown, or covers parts of several classes.

        Args:
            code: Number in the file.
            table: The classes.
        """
        row = self.codes.get(code)
        if row is None:
            return UNLABELED
        if table.name == OWN:
            return table.index(row.name)
        if table.name in row.to:
            return table.index(row.to[table.name])
        if self.facts.table == table.name:
            return table.index(row.name)
        if table.name == COMPONENTS:
            return table.index(row.parts[0]) if len(row.parts) == 1 else UNLABELED
        target, kinds = taxonomy(table.name), component_classes()
        found = {class_of(target, part, kinds.get(part, part)) for part in row.parts}
        return table.index(found.pop()) if len(found) == 1 else UNLABELED

    def labels(self, codes: U8, table: ClassTable) -> U8:
        """Convert the numbers of a file to labels of a data set.

        Args:
            codes: Numbers, shape (N,), uint8.
            table: The classes.

        Returns:
            Labels, shape (N,), uint8; 255 where no class is known.
        """
        return np.array([self.label(code, table) for code in range(256)], np.uint8)[codes]


def map_names() -> tuple[str, ...]:
    """List the class maps of the package."""
    found = (entry.name for entry in files("learn").joinpath("datasets/maps").iterdir())
    return tuple(sorted(name.removesuffix(".toml") for name in found if name.endswith(".toml")))


def read_class_map(name: str) -> ClassMap:
    """Read a class map of the package, or a user's.

    Args:
        name: One of `map_names`, or the path of a .toml or .json file.

    Raises:
        MissingError: Neither the name of a class map nor a file.
        InputError: The file is not a class map.
    """
    if name in map_names():
        entry = files("learn").joinpath(f"datasets/maps/{name}.toml")
        return _checked(name, parse_settings(ClassMapFile, _toml(entry.read_text(encoding="utf-8")), name), name)
    path = Path(name)
    if path.suffix not in (".toml", ".json") or not path.is_file():
        raise MissingError(
            "no such class map",
            field="--class-map",
            value=name,
            allowed=f"{', '.join(map_names())}, or a .toml or .json file",
        )
    return _checked(path.stem, parse_settings(ClassMapFile, _read(path), path), path)


def _toml(text: str) -> dict[str, Any]:
    import tomllib

    return tomllib.loads(text)


def _read(path: Path) -> dict[str, Any]:
    if path.suffix == ".toml":
        return read_toml(path)
    found = read_json(path)
    if not isinstance(found, dict):
        raise InputError("not a class map", where=path, allowed="a JSON object with title, column and code")
    return found


def _checked(name: str, facts: ClassMapFile, where: object) -> ClassMap:
    """Check that every component and class of a map exists, and that each number occurs once."""
    if facts.table and facts.table not in TAXONOMIES:
        raise InputError(
            "an unknown table", where=where, field="table", value=facts.table, allowed=", ".join(TAXONOMIES)
        )
    rows = {row.id: row for row in _rows_of_table(facts.table)} if facts.table else {}
    seen: set[int] = set()
    parts = {*component_classes(), *taxonomy(BASE).classes}
    for row in facts.code:
        if row.id in seen:
            raise InputError("a number occurs twice", where=where, field="code.id", value=row.id)
        seen.add(row.id)
        for part in row.parts:
            if part not in parts:
                raise InputError(
                    "an unknown part",
                    where=where,
                    field=f"code {row.id}",
                    value=part,
                    allowed=f"a component kind or a class: {', '.join(sorted(parts))}",
                )
        for table, target in row.to.items():
            names = [known.name for known in taxonomy(table).rows]
            if target not in [*names, "unlabelled"]:
                raise InputError(
                    "an unknown class",
                    where=where,
                    field=f"code {row.id}.to.{table}",
                    value=target,
                    allowed=", ".join(names),
                )
        before = rows.get(row.id)
        rows[row.id] = (
            row if before is None or "parts" in row.model_fields_set else row.model_copy(update={"parts": before.parts})
        )
    if not rows:
        raise InputError("has no class number", where=where, field="code", hint="Add [[code]] with id, name and parts")
    return ClassMap(name, facts, rows)


def _rows_of_table(name: str) -> list[CodeRow]:
    """Make a class map of one of our tables: each number with the components that it covers."""
    table = taxonomy(name)
    return [
        CodeRow(
            id=row.id,
            name=row.name,
            parts=tuple(kind for kind in component_classes() if table.classes.get(kind) == row.name),
        )
        for row in table.rows
        if row.id not in RESERVED
    ]
