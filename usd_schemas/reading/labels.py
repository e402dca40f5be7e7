"""Labels of drawn prims: class, component and instance id, inherited from the nearest labeled ancestor."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Usd

from usd_schemas import tokens
from usd_schemas.apis import direct_label, read_component
from usd_schemas.components import BACKGROUND, ClassRow, class_rows, component_classes
from usd_schemas.flat_scene import InstanceRow
from usd_schemas.reading.traversal import numbers_of, table_of
from usd_schemas.taxonomies import RESERVED, Taxonomy

U32 = NDArray[np.uint32]
Warn = Callable[[str], None]

LARGEST_ID = 2**32 - 1  # instance ids are stored as uint32


@dataclass(frozen=True)
class Label:
    """Label of a prim, which its descendants inherit.

    Attributes:
        class_name: Class in the base table; empty where none is known.
        component: Component kind; empty where none is known.
        instance_id: Instance id; 0 where none is authored.
        carrier: Path of the prim with the id or, if none has one, of the prim that gets one.
        parameters: Facts about the component.
    """

    class_name: str = ""
    component: str = ""
    instance_id: int = 0
    carrier: Sdf.Path = Sdf.Path.emptyPath
    parameters: dict[str, object] = field(default_factory=dict)


def inherit_label(prim: Usd.Prim, above: Label, keep_id: bool = False, warn: Warn | None = None) -> Label:
    """Find the label of a prim, given that of its parent.

    A label in the taxonomy `class` has priority over the class of a `component` label; each may be a LabelsAPI label or
    its copy as a user property. The prim's component API is used last.

    Args:
        prim: Any prim.
        above: Label of its parent.
        keep_id: Keep the inherited id even if the prim has one (inside an instance with its own id).
        warn: Called with one line if its id is not used because it is out of range.
    """
    facts = read_component(prim)
    component = direct_label(prim, tokens.COMPONENT_TAXONOMY) or facts.kind
    name = direct_label(prim, tokens.CLASS_TAXONOMY) or component_classes().get(component, component)
    label = above
    if name:
        label = replace(label, class_name=name, component=component)
    mirror = prim.GetAttribute(tokens.USER_INSTANCE_ID)
    number = facts.instance_id or (int(mirror.Get() or 0) if mirror and isinstance(mirror.Get(), int) else 0)
    if not 0 <= number <= LARGEST_ID:
        if warn is not None:
            warn(f"{prim.GetPath()}: its instance id {number} is not between 1 and {LARGEST_ID:,}: ignored")
        number = 0
    if number > 0 and not keep_id:
        label = replace(label, instance_id=number, carrier=prim.GetPath(), parameters=facts.parameters)
    elif facts.parameters and not label.instance_id:
        label = replace(label, parameters=facts.parameters)
    return label


def read_taxonomy(stage: Usd.Stage, warn: Warn) -> Taxonomy:
    """Read the class table of the stage's semantic render variable; default: the project's own.

    Args:
        stage: Composed stage.
        warn: Called with one line if the table is unusable.
    """
    prim = stage.GetPrimAtPath(tokens.SEMANTIC_VAR)
    rows = _read_rows(prim, warn)
    if rows is None:
        return Taxonomy("", class_rows())
    reserved = {row.id: row.name for row in class_rows() if row.id in RESERVED}
    for row in rows:
        if row.name != reserved.get(row.id, row.name):
            warn(f"{tokens.SEMANTIC_VAR}: class id {row.id} is reserved for {reserved[row.id]}: it is not {row.name!r}")
    labels, classes = (_words(_value(prim, name)) for name in (tokens.LABEL_NAMES, tokens.LABEL_CLASSES))
    if len(labels) != len(classes) or not set(classes) <= {row.name for row in rows}:
        warn(f"{tokens.SEMANTIC_VAR}: labelNames and labelClasses do not fit the classes: ignored")
        labels, classes = [], []
    pairs = {str(label): str(name) for label, name in zip(labels, classes, strict=True)}
    return Taxonomy(str(_value(prim, tokens.TAXONOMY_NAME) or ""), rows, pairs)


class Register:
    """Converts labels to class ids and instance ids, and holds the table of instances.

    Attributes:
        rows: Instance rows by id, filled as draws are registered.
    """

    def __init__(self, table: Taxonomy, warn: Warn) -> None:
        """Start an empty table.

        Args:
            table: Class table of the stage.
            warn: Called with one line for each unknown class and each id that two prims share.
        """
        self.rows: dict[int, InstanceRow] = {}
        self._table = table
        self._classes = {row.name: row.id for row in table.rows}
        self._names = {row.id: row.name for row in table.rows}
        self._warn = warn
        self._unknown: set[str] = set()
        self._given: dict[Sdf.Path, int] = {}
        self._next = 1
        self._used: set[int] = set()

    def reserve(self, numbers: set[int]) -> None:
        """Reserve the authored ids, so that none of them is assigned to another prim.

        Args:
            numbers: Authored ids.
        """
        self._used |= numbers

    def class_id(self, label: Label) -> int:
        """Find the class id of a label; unknown labels are background.

        Args:
            label: Label of a drawn prim.
        """
        name = self._table.class_of(label.component, label.class_name)
        if name and name not in self._classes and name not in self._unknown:
            self._unknown.add(name)
            self._warn(f"{label.carrier or 'label'}: unknown class {name!r}: drawn as background")
        return self._classes.get(name, BACKGROUND)

    def instance_ids(self, label: Label, own: Sdf.Path, numbers: U32 | None, count: int) -> U32:
        """Find the instance id of each instance of a drawn prim.

        Args:
            label: Its label.
            own: Path of the prim that gets an id if there is none.
            numbers: Ids authored on its instancer, shape (N,), uint32, or None.
            count: Number of instances.

        Returns:
            Ids over 0, shape (N,), uint32.
        """
        ids = numbers if numbers is not None else np.full(count, self._number(label, own), np.uint32)
        carrier = str(label.carrier if label.instance_id or numbers is not None else own)
        base = label.class_name if label.class_name in component_classes().values() else ""
        for number in dict.fromkeys(ids.tolist()):
            row = self.rows.get(number)
            if row is None:
                name = self._names.get(self.class_id(label), "background")
                self.rows[number] = InstanceRow(number, carrier, label.component, name, label.parameters, base)
            elif row.path != carrier:
                self._warn(f"{carrier}: instance id {number} is already that of {row.path}")
        return ids

    def _number(self, label: Label, own: Sdf.Path) -> int:
        if label.instance_id:
            return label.instance_id
        if own not in self._given:
            while self._next in self._used:
                self._next += 1
            self._given[own] = self._next
            self._used.add(self._next)
        return self._given[own]


def _value(prim: Usd.Prim, name: str) -> Any:
    attribute = prim.GetAttribute(name) if prim else None
    return attribute.Get() if attribute else None


def _words(value: Any) -> list[str]:
    return [] if value is None or isinstance(value, str | int | float) else [str(word) for word in value]


def _read_rows(prim: Usd.Prim, warn: Warn) -> tuple[ClassRow, ...] | None:
    """Read names, ids and colors of the classes; None where there are none or they are unusable."""
    names = _value(prim, tokens.CLASS_NAMES)
    if not names:
        return None
    told = _value(prim, tokens.CLASS_IDS)
    numbers = np.arange(len(names)) if told is None else numbers_of(told)
    ids = [] if numbers is None else numbers.tolist()
    fit = len(ids) == len(names) == len(set(ids)) and all(0 <= number <= 255 for number in ids)
    if not (fit and not isinstance(names, str) and all(str(name).isprintable() for name in names)):
        warn(f"{tokens.SEMANTIC_VAR}: classNames and classIds do not fit together; the built-in classes are used")
        return None
    colors = table_of(_value(prim, tokens.CLASS_COLORS), 3)
    if colors is None or not ((colors >= 0.0) & (colors <= 255.0)).all():
        warn(f"{tokens.SEMANTIC_VAR}: classColors are no colors: those of the built-in classes are used")
        colors = np.zeros((0, 3))
    if len(colors) == len(names) and colors.max(initial=0.0) <= 1.0:
        colors = colors * 255.0
    known = {row.name: row.color for row in class_rows()}
    rows = []
    for place, (number, name) in enumerate(zip(ids, names, strict=True)):
        own = tuple(round(value) for value in colors[place].tolist()) if len(colors) == len(names) else None
        red, green, blue = own or known.get(str(name), (128, 128, 128))
        rows.append(ClassRow(int(number), str(name), (red, green, blue)))
    return tuple(sorted(rows, key=lambda row: row.id))
