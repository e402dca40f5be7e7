"""The classes of a data set, and the conversion of labels of our clouds to them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from groundwork.errors import InputError
from recon.cloud import Cloud
from usd_schemas.components import NOISY_POINT, UNLABELED, class_rows, component_classes
from usd_schemas.taxonomies import BASE, RESERVED, TAXONOMIES, Taxonomy, taxonomy

U8 = NDArray[np.uint8]
BACKGROUND_CLASS = "background"
COMPONENTS = "components"
"""A table of a data set alone: every component kind is a class, so that a model of them fits every other table."""
NOISY_CLASS = "noisy_point"
OWN = "own"  # instead of a table: the classes of a class map, unchanged


@dataclass(frozen=True)
class ClassTable:
    """The classes of a data set; a point's label is the index of its class in the list.

    Attributes:
        name: Name of the table.
        names: Class names in the order of the table.
        colors: sRGB color of each, for people.
    """

    name: str
    names: tuple[str, ...]
    colors: tuple[tuple[int, int, int], ...]

    def index(self, name: str) -> int:
        """Return the label of a class, 255 if the table has none of that name.

        Args:
            name: Class name.
        """
        return self.names.index(name) if name in self.names else UNLABELED


def is_background(classes: Sequence[str]) -> NDArray[np.bool_]:
    """Tell which classes are not part of a bridge.

    Args:
        classes: Component kinds, or classes of the base table.

    Returns:
        Whether each is, shape (C,), bool.
    """
    kinds = component_classes()
    return np.array([kinds.get(name, name) == BACKGROUND_CLASS for name in classes])


def class_table(name: str, noisy: bool = False) -> ClassTable:
    """List the classes of one of the project's tables.

    Args:
        name: One of `usd_schemas.taxonomies.TAXONOMIES`, or `components`.
        noisy: Whether `noisy_point` is a class too.

    Raises:
        InputError: There is no such table.
    """
    if name == COMPONENTS:
        return _table_of_components(noisy)
    if name not in TAXONOMIES:
        raise InputError("unknown table", field="--table", value=name, allowed=", ".join((*TAXONOMIES, COMPONENTS)))
    left_out = set(RESERVED) - ({NOISY_POINT} if noisy else set())
    rows = [row for row in taxonomy(name).rows if row.id not in left_out]
    return ClassTable(name, tuple(row.name for row in rows), tuple(row.color for row in rows))


def own_table(names: Sequence[str]) -> ClassTable:
    """Make a table of a user's own classes, from a class map.

    Args:
        names: Name of each class, in the order of the labels.
    """
    hues = ((int(255 * (0.5 + 0.5 * np.cos(k + 2.1 * channel))) for channel in range(3)) for k in range(len(names)))
    colors = tuple((r, g, b) for r, g, b in hues)
    return ClassTable(OWN, tuple(names), colors)


def _table_of_components(noisy: bool) -> ClassTable:
    kinds, colors = component_classes(), {row.name: row.color for row in class_rows()}
    names = (*kinds, NOISY_CLASS) if noisy else tuple(kinds)
    return ClassTable(COMPONENTS, names, tuple(colors[kinds.get(n, n)] for n in names))


def labels_of_cloud(cloud: Cloud, table: ClassTable) -> U8:
    """Convert the labels of a cloud of ours to those of a data set.

    The component is used where it is known, because it is finer than the class; a class that the table does not have
    becomes 255.

    Args:
        cloud: A cloud, with any class table.
        table: The classes.

    Returns:
        Labels, shape (N,), uint8.
    """
    segment = cloud.columns["segment"].astype(np.int64)
    pair = segment * len(cloud.components) + cloud.columns["component"].astype(np.int64)
    values, inverse = np.unique(pair, return_inverse=True)
    names = {row.id: row.name for row in cloud.classes}
    based = {row.name for row in cloud.classes} == {row.name for row in taxonomy(BASE).rows}
    found = [
        _label(
            names.get(int(value) // len(cloud.components), ""),
            cloud.components[int(value) % len(cloud.components)],
            based,
            table,
        )
        for value in values
    ]
    return np.array(found, np.uint8)[inverse.reshape(-1)] if len(values) else np.zeros(0, np.uint8)


def _label(class_name: str, component: str, based: bool, table: ClassTable) -> int:
    """Find the label for a class of the cloud's own table and a component kind."""
    if class_name in ("", "unlabelled"):
        return UNLABELED
    if table.name == COMPONENTS:
        return table.index(component)
    target = taxonomy(table.name)
    if not based:
        if component in component_classes():
            return table.index(target.classes[component])
        return table.index(class_name) if class_name in table.names else UNLABELED
    return table.index(class_of(target, component, class_name))


def class_of(target: Taxonomy, component: str, base_class: str) -> str:
    """Find the class for a component kind and a class of the base table; empty if the target has neither.

    Args:
        target: Table.
        component: Component kind, or empty.
        base_class: Class of the base table, or empty.
    """
    name = target.class_of(component, base_class)
    return name if name in {row.name for row in target.rows} else ""
