"""Conversion of a model's class probabilities to the classes of another table, by summation."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from groundwork.errors import InputError
from learn.datasets.class_tables import BACKGROUND_CLASS, COMPONENTS, NOISY_CLASS, OWN, class_of
from learn.sample import Sample
from learn.scoring.votes import Predicting
from usd_schemas.components import UNLABELED, component_classes
from usd_schemas.taxonomies import BASE, TAXONOMIES, taxonomy

F32 = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class ClassSum:
    """Mapping from the classes of a model to the classes of a file.

    Attributes:
        table: Class table of the file.
        names: Classes of the file.
        ids: Id of each in the file, shape (T,), uint8.
        matrix: Mapping of the model's classes [1], shape (K, T), float32, one 1 in each row.
        kept: Whether each class is written; others become 255, shape (T,), bool.
        rest: Whether each class is background or noise, shape (T,), bool.
    """

    table: str
    names: tuple[str, ...]
    ids: NDArray[np.uint8]
    matrix: F32
    kept: NDArray[np.bool_]
    rest: NDArray[np.bool_]

    def decide(self, summed: F32, least: float) -> tuple[NDArray[np.uint8], F32]:
        """Choose the most probable class of each point.

        Args:
            summed: Probabilities of the classes of the file [1], shape (N, T), float32.
            least: Confidence below which a point gets no class [1].

        Returns:
            Class ids, 255 for none, shape (N,), uint8; summed probability of the chosen class [1], shape (N,), float32.
        """
        best, sure = summed.argmax(axis=1), summed.max(axis=1)
        ids = np.where((sure >= least) & self.kept[best], self.ids[best], UNLABELED)
        return ids.astype(np.uint8), sure

    @property
    def background(self) -> tuple[int, ...]:
        """List the ids of background and noise, which have no instances."""
        return tuple(self.ids[self.rest].tolist())


@dataclass(frozen=True, eq=False)
class SummedModel:
    """A model whose classes are converted to those of a data set, so that it can be scored there.

    Attributes:
        model: The model.
        matrix: Mapping of its classes to those of the data set [1], shape (K, T), float32.
    """

    model: Predicting
    matrix: F32

    def probabilities(self, samples: Sequence[Sample]) -> list[F32]:
        """Compute the probability of each class of the data set at each point.

        Args:
            samples: Clouds as in training.

        Returns:
            For each sample probabilities [1], shape (N, T), float32.
        """
        return [told @ self.matrix for told in self.model.probabilities(samples)]


def summed_model(model: Predicting, classes: tuple[str, ...], own: str, table: str, names: Sequence[str]) -> Predicting:
    """Convert a model to the classes of a data set; a model that already has them is returned unchanged.

    Args:
        model: The model.
        classes: Its classes.
        own: Their table.
        table: Table of the data set.
        names: Classes of the data set.

    Raises:
        InputError: The model's classes do not determine those of the table.
    """
    if tuple(names) == classes:
        return model
    if table in (COMPONENTS, OWN) or not own:
        raise InputError(
            "the data set has other classes than the model",
            field="classes",
            value=", ".join(names),
            allowed=", ".join(classes),
        )
    summing = sum_classes(classes, own, table, ())
    return SummedModel(model, np.ascontiguousarray(summing.matrix[:, [summing.names.index(name) for name in names]]))


def sum_classes(
    classes: tuple[str, ...], own: str, table: str, kept: tuple[str, ...], ids: tuple[int, ...] = ()
) -> ClassSum:
    """Map the classes of a model to a table.

    Args:
        classes: Classes of the model: component kinds or classes of the base table, or classes of another table.
        own: Table of these.
        table: Table to sum into; empty for the model's own.
        kept: Classes of the table to write; empty for all.
        ids: Id of each class in the file, for a user's own classes.

    Raises:
        InputError: No such table, a table that the model's classes do not determine, or a class that it lacks.
    """
    if own == OWN and table in ("", OWN):
        return _as_they_are(classes, ids or tuple(range(len(classes))), kept)
    wanted = table or (BASE if own == COMPONENTS else own)
    check_table(wanted)
    if own not in (wanted, BASE, COMPONENTS):
        raise InputError(
            f"the model has the classes of {own}, which do not determine those of another table",
            field="--table",
            value=wanted,
            allowed=own,
        )
    rows = [row for row in taxonomy(wanted).rows if row.id != UNLABELED]
    names, known = tuple(row.name for row in rows), taxonomy(wanted)
    matrix = np.zeros((len(classes), len(rows)), np.float32)
    for place, name in enumerate(classes):
        found = name if name in names and own == wanted else class_of(known, name, component_classes().get(name, name))
        if found not in names:
            raise InputError(
                "the table has no class for a class of the model",
                field="--table",
                value=name,
                allowed=", ".join(names),
            )
        matrix[place, names.index(found)] = 1.0
    _check_kept(kept, names)
    reached = matrix.any(axis=0)
    surroundings = np.array([component_classes().get(name, name) == BACKGROUND_CLASS for name in classes])
    always = {class_of(known, "", BACKGROUND_CLASS), NOISY_CLASS}
    rest = np.array([name in always for name in names]) | (reached & ~matrix[~surroundings].any(axis=0))
    chosen = np.array([row.name in kept or not kept for row in rows])
    return ClassSum(wanted, names, np.array([row.id for row in rows], np.uint8), matrix, chosen & reached, rest)


def check_table(table: str) -> None:
    """Refuse a table that nothing can be summed into.

    Args:
        table: What a user named.

    Raises:
        InputError: There is no such table.
    """
    if table not in TAXONOMIES:
        raise InputError("unknown table", field="--table", value=table, allowed=", ".join(TAXONOMIES))


def _as_they_are(classes: tuple[str, ...], ids: tuple[int, ...], kept: tuple[str, ...]) -> ClassSum:
    """Keep a user's own classes with their own numbers."""
    _check_kept(kept, classes)
    chosen = np.array([name in kept or not kept for name in classes])
    rest = np.array([name in (BACKGROUND_CLASS, NOISY_CLASS) for name in classes])
    return ClassSum(OWN, classes, np.array(ids, np.uint8), np.eye(len(classes), dtype=np.float32), chosen, rest)


def _check_kept(kept: tuple[str, ...], names: tuple[str, ...]) -> None:
    for name in kept:
        if name not in names:
            raise InputError("no such class", field="--classes", value=name, allowed=", ".join(names))
