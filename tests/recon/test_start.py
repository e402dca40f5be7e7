"""Where a mapper begins anew: images that their fixes contradict are told, and the next pair is one of the others."""

from itertools import combinations

import numpy as np
import pycolmap

from recon.sfm.start import contradicted_images, starting_pair
from tests.recon.test_misplaced import _fixes, _model

WRONG = range(41, 49)  # ids of a piece of the loop that hangs on the rest by one side


def test_a_turned_piece_is_told_and_nothing_else() -> None:
    """A loop of sixty cameras, eight of them turned away; with right cameras, or too few fixes, none is told."""
    rng = np.random.default_rng(3)
    angle = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    true = np.column_stack([40.0 * np.cos(angle), 12.0 * np.sin(angle), rng.uniform(4.0, 9.0, 60)])
    seen = true.copy()
    rows = np.array(WRONG) - 1
    seen[rows] += np.linspace(9.0, 60.0, len(rows))[:, None] * [0.3, 0.9, 0.1]
    for places, told in ((true, []), (seen, list(WRONG))):
        model = _model(places)
        fixes = _fixes(model, true + rng.normal(0.0, 0.8, true.shape) + rng.normal(0.0, 2.0, 3))
        assert contradicted_images(model, fixes) == told
        few = dict(list(fixes.items())[:9])
        assert contradicted_images(model, few) == []


def _shared_widely(model: pycolmap.Reconstruction, one: int, other: int) -> int:
    """Count the points that two images share; none where most rays meet under less than 16 degrees."""
    angles = []
    for point in model.points3D.values():
        if {one, other} <= {element.image_id for element in point.track.elements}:
            rays = [point.xyz - model.image(number).projection_center() for number in (one, other)]
            cosine = rays[0] @ rays[1] / np.linalg.norm(rays[0]) / np.linalg.norm(rays[1])
            angles.append(np.degrees(np.arccos(cosine)))
    return len(angles) if angles and np.median(angles) >= 16.0 else 0


def test_the_next_pair_shares_most_points_under_a_wide_angle() -> None:
    """As a loop over all pairs and points finds it, without what is left out; of one image there is none."""
    pycolmap.set_random_seed(2)
    frames = pycolmap.SyntheticDatasetOptions(
        num_rigs=1, num_cameras_per_rig=1, num_frames_per_rig=7, num_points3D=60, track_length=4
    )
    model = pycolmap.synthesize_dataset(frames)
    free = starting_pair(model, [])
    assert free is not None
    for without in ([], [free[0]], list(free)):
        left = [number for number in range(1, 8) if number not in without]
        wide = {pair: count for pair in combinations(left, 2) if (count := _shared_widely(model, *pair))}
        assert starting_pair(model, without) == max(sorted(wide), key=lambda pair: wide[pair])
    assert starting_pair(model, list(range(2, 8))) is None
