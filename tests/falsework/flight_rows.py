"""Judged flights as the child of `falsework survey score` answers them, small enough to be written down."""

from typing import Any

import numpy as np


def judged_flight(word: str) -> dict[str, Any]:
    """Give a flight of twelve images over a slab of 3,000 points, all of whose names are a word."""
    poses = np.tile(np.diag([1.0, -1.0, -1.0, 1.0]), (12, 1, 1))
    poses[:, :3, 3] = np.column_stack([np.linspace(-10.0, 10.0, 12), np.zeros(12), np.full(12, 9.0)])
    points = np.random.default_rng(3).uniform((-10.0, -2.0, 0.0), (10.0, 2.0, 0.5), (3000, 3))
    ids = np.where(points[:, 1] > 0.0, 2, 1)
    return {
        "survey": word,
        "poses": poses[:, :3].reshape(-1, 12).tolist(),
        "half": [0.5, 0.4],
        "outline": {"points": points.tolist(), "ids": ids.tolist(), "classes": {"1": word, "2": "deck"}},
        "pitches": [12, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0],
        "images": 12,
        "length": 20.0,
        "duration": 20.0,
        "clearance": 8.5,
        "overlap": 0.75,
        "linked": 0.5,
        "sampling": [0.002, None],
        "base_angle": 12.0,
        "by_class": {word: 0.2, "deck": 0.6},
        "warnings": [word],
        "hardly_seen": {word: {"members": [1], "of": 2, "never": [1]}},
        "proposal": {"images": 30, "shown": [1], "hidden": [7], "refused": ""},
    }
