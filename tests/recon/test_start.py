"""Where a mapper begins anew: images that their fixes contradict are told, and the next pair is one of the others."""

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


def test_the_next_pair_shares_most_points_under_a_wide_angle() -> None:
    """It is one of the images that are not left out, and there is none where one image is left."""
    pycolmap.set_random_seed(2)
    frames = pycolmap.SyntheticDatasetOptions(
        num_rigs=1, num_cameras_per_rig=1, num_frames_per_rig=7, num_points3D=60, track_length=4
    )
    model = pycolmap.synthesize_dataset(frames)
    free = starting_pair(model, [])
    assert free is not None
    pair = starting_pair(model, [free[0]])
    assert pair is not None
    assert free[0] not in pair
    assert starting_pair(model, list(range(2, 8))) is None
