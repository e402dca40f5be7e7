"""Our networks give the logits of other implementations of the same networks, not only of our literal twins."""

from __future__ import annotations

import sys

import pytest
import torch

from benchmarks.learn.logits import RANDLANET, open3d_difference, open3d_randlanet


@pytest.fixture(autouse=True)
def open3d_ml() -> None:
    """Skip where there is no Open3D-ML."""
    torch.set_num_threads(1)
    try:
        open3d_randlanet()
    except ImportError as error:
        pytest.skip(str(error))


@pytest.mark.parametrize("layers", RANDLANET)
def test_logits_equal_those_of_open3d_ml(layers: str) -> None:
    """Copied weights, the same points and neighbors: Open3D-ML's RandLA-Net gives the same logits.

    Its attention has random biases, which change nothing. The limits are some roundings of numbers of about 1.
    """
    found = open3d_difference(**RANDLANET[layers])
    assert found.spread > 0.05
    assert found.single < 1e-5
    assert found.double < 1e-13


def test_the_comparison_sees_another_slope() -> None:
    """Open3D-ML's own slope after the residual sum, 0.01 where the authors have 0.2, changes the logits."""
    assert open3d_difference(**RANDLANET["four layers"], slope=None).double > 1e-3


def test_no_stand_in_stays_behind() -> None:
    """The class comes from its own file; the modules that stood in for the rest of Open3D-ML are gone."""
    assert not [name for name in sys.modules if name.startswith("open3d_ml_alone")]
    assert open3d_randlanet().__module__ == "open3d_ml_alone.torch.models.randlanet"
