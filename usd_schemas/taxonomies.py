"""Class tables: the classes of other data sets and standards for each component; a stage uses one of them."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files

from groundwork.errors import InputError
from usd_schemas.components import NOISY_POINT, UNLABELED, ClassRow, class_rows, component_classes

BASE = "falsework"
TAXONOMIES = (BASE, "kim2020", "kim2023", "semanticbridge", "randla_bridgenet", "hgcnn", "ifc43", "asprs")
RESERVED = (NOISY_POINT, UNLABELED)


@dataclass(frozen=True)
class Taxonomy:
    """A table of classes, and the mapping from labels to them.

    Attributes:
        name: Name of the table; empty for an unnamed one of a stage.
        rows: Classes in the order of their ids, including `noisy_point` and `unlabelled`.
        classes: Label to class name; a label is a component kind or a class of the base table. Empty if a stage has
            classes but no such map.
        title: Name shown to users.
        source: Where the classes come from.
        reconstructed: Whether we chose the classes, because the original list could not be read.
    """

    name: str
    rows: tuple[ClassRow, ...]
    classes: Mapping[str, str] = field(default_factory=dict)
    title: str = ""
    source: str = ""
    reconstructed: bool = False

    def class_of(self, component: str, base_class: str) -> str:
        """Find the class for a label.

        The component is used, because it is finer, unless its class in the base table differs from the class label:
        then the class was relabelled by hand. A label that is not in the map is taken as a class of this table.

        Args:
            component: Component kind; empty where none is known.
            base_class: Class in the base table; empty where none is known.
        """
        agreed = component_classes().get(component, component) == base_class
        if agreed and component in self.classes:
            return self.classes[component]
        return self.classes.get(base_class, base_class)

    def row_of(self, component: str) -> ClassRow:
        """Find the class that a component kind has in this table.

        Args:
            component: Component kind, e.g. `pier_cap`.

        Raises:
            InputError: The table has no row for it.
        """
        name = self.classes.get(component)
        for row in self.rows:
            if row.name == name:
                return row
        raise InputError(
            f"no class in the taxonomy {self.name}", field="component", value=component, allowed=", ".join(self.classes)
        )


@cache
def taxonomy(name: str) -> Taxonomy:
    """Read one of the project's tables.

    Ids 16 and 255 mean `noisy_point` and `unlabelled` in every table: these two rows are added to each.

    Args:
        name: One of `TAXONOMIES`.

    Raises:
        InputError: There is no such table.
    """
    if name not in TAXONOMIES:
        raise InputError("unknown taxonomy", field="taxonomy", value=name, allowed=", ".join(TAXONOMIES))
    if name == BASE:
        own = {name: name for name in component_classes().values()}
        source = "the seventeen classes of the method"
        return Taxonomy(BASE, class_rows(), {**own, **component_classes()}, "Falsework", source)
    text = files("usd_schemas").joinpath(f"tables/taxonomies/{name}.toml").read_text(encoding="utf-8")
    table = tomllib.loads(text)
    rows, classes = [row for row in class_rows() if row.id in RESERVED], {}
    for entry in table["class"]:
        red, green, blue = entry["color"]
        rows.append(ClassRow(entry["id"], entry["name"], (red, green, blue)))
        classes |= dict.fromkeys([*entry["components"], *entry["classes"]], entry["name"])
    ordered = tuple(sorted(rows, key=lambda row: row.id))
    return Taxonomy(name, ordered, classes, table["title"], table["source"], table["reconstructed"])
