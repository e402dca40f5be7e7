"""A random forest as plain arrays: trained with scikit-learn, evaluated without it."""

from collections.abc import Mapping

import numpy as np
from numba import njit
from numpy.typing import NDArray

from groundwork.errors import InputError

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
Arrays = Mapping[str, NDArray[np.generic]]

_LEAF = -1


def grow_forest(
    features: F32, labels: I64, classes: int, *, trees: int, depth: int, seed: int
) -> dict[str, np.ndarray]:
    """Train a random forest with balanced classes, and convert it to arrays.

    Args:
        features: One row a point [m or 1], shape (N, C), float32.
        labels: Classes, shape (N,), int64.
        classes: Number of classes.
        trees: Number of trees.
        depth: Largest depth.
        seed: Seed of every draw.

    Returns:
        `first` (T + 1,), where each tree begins; of every node `column` (-1: a leaf), `threshold` [m or 1], `left`,
        `right` (nodes of the whole), shape (M,), and `share` of the classes [1], shape (M, classes).

    Raises:
        InputError: Fewer than two classes.
    """
    from sklearn.ensemble import RandomForestClassifier

    present = np.unique(labels)
    if len(present) < 2:
        raise InputError("all labeled points have one class; training needs at least two", field="labels")
    forest = RandomForestClassifier(
        trees, max_depth=depth, class_weight="balanced", random_state=seed, n_jobs=1, min_samples_leaf=2
    )
    forest.fit(features, labels)
    inner = [estimator.tree_ for estimator in forest.estimators_]
    first = np.cumsum([0, *(tree.node_count for tree in inner)])
    share = np.zeros((first[-1], classes))
    share[:, present] = np.concatenate([tree.value[:, 0] for tree in inner])
    leaf = np.concatenate([tree.children_left for tree in inner]) < 0
    start = np.repeat(first[:-1], np.diff(first))
    return {
        "first": first.astype(np.int64),
        "column": np.where(leaf, _LEAF, np.concatenate([tree.feature for tree in inner])).astype(np.int64),
        "threshold": np.concatenate([tree.threshold for tree in inner]),
        "left": np.where(leaf, 0, np.concatenate([tree.children_left for tree in inner]) + start).astype(np.int64),
        "right": np.where(leaf, 0, np.concatenate([tree.children_right for tree in inner]) + start).astype(np.int64),
        "share": share / share.sum(axis=1, keepdims=True),
    }


def forest_probabilities(arrays: Arrays, features: F32) -> F32:
    """Average the class shares of the trees.

    Args:
        arrays: As `grow_forest`: `first`, shape (T + 1,); of every node `column`, `threshold`, `left`, `right`, shape
            (M,), and `share`, shape (M, classes).
        features: One row a point [m or 1], shape (N, C), float32.

    Returns:
        Mean share of each class over the trees [1], shape (N, classes), float32.

    Raises:
        InputError: The arrays are not a forest for these features.
    """
    _check(arrays, features.shape[1])
    return _vote(
        np.ascontiguousarray(features, dtype=np.float32),
        arrays["first"].astype(np.int64),
        np.stack([arrays[name].astype(np.int64) for name in ("column", "left", "right")]),
        arrays["threshold"].astype(np.float64),
        arrays["share"].astype(np.float64),
    ).astype(np.float32)


def _check(arrays: Arrays, columns: int) -> None:
    """Refuse indices out of range, and cycles: children must follow their parent within the same tree."""
    names = {"first", "column", "threshold", "left", "right", "share"}
    if arrays.keys() != names or arrays["share"].ndim != 2:
        raise InputError("not a forest", field="arrays", value=sorted(arrays), allowed=", ".join(sorted(names)))
    count = len(arrays["column"])
    nodes = np.arange(count)
    inside = arrays["column"].astype(np.int64) >= 0
    first = arrays["first"].astype(np.int64)
    sound = all(len(arrays[name]) == count for name in ("threshold", "left", "right", "share")) and count > 0
    sound = sound and len(first) > 1 and bool((first[:-1] >= 0).all() and (first[:-1] < count).all())
    sound = sound and int(arrays["column"].astype(np.int64).max()) < columns
    for name in ("left", "right") if sound else ():
        child = arrays[name].astype(np.int64)[inside]
        sound = sound and bool((child > nodes[inside]).all() and (child < count).all())
    if not sound:
        raise InputError("a damaged forest, or one with other features", field="arrays", value=columns)


@njit(cache=True, nogil=True)
def _vote(features: F32, first: I64, nodes: I64, threshold: F64, share: F64) -> F64:
    column, left, right = nodes[0], nodes[1], nodes[2]
    total = np.zeros((len(features), share.shape[1]))
    for row in range(len(features)):
        for tree in range(len(first) - 1):
            node = first[tree]
            while column[node] >= 0:
                node = left[node] if features[row, column[node]] <= threshold[node] else right[node]
            for number in range(share.shape[1]):
                total[row, number] += share[node, number]
    return total / (len(first) - 1)
