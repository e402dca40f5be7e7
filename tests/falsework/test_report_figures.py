"""Figures of the report."""

import numpy as np
import pytest

from falsework.report.figures import uncertainty_figure


@pytest.mark.parametrize("threshold", [0.01, 0.1, 2.0])
def test_the_threshold_is_written_beside_its_line(threshold: float) -> None:
    """On the logarithmic axis the line stands at the value, its text at the exponent: the same place."""
    figure = uncertainty_figure(np.geomspace(1e-3, 1, 50).astype(np.float32), threshold)
    layout = figure.to_dict()["layout"]
    (line,), (text,) = layout["shapes"], layout["annotations"]
    assert layout["xaxis"]["type"] == "log"
    assert 10.0 ** text["x"] == pytest.approx(line["x0"]) == pytest.approx(threshold)
    assert text["text"] == f"{threshold:g} m"
