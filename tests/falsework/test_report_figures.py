"""Figures of the report."""

import numpy as np
import pytest

from falsework.report.figures import class_figure, uncertainty_figure
from usd_schemas.components import ClassRow


@pytest.mark.parametrize("threshold", [0.01, 0.1, 2.0])
def test_the_threshold_is_written_beside_its_line(threshold: float) -> None:
    """On the logarithmic axis the line stands at the value, its text at the exponent: the same place."""
    figure = uncertainty_figure(np.geomspace(1e-3, 1, 50).astype(np.float32), threshold)
    layout = figure.to_dict()["layout"]
    (line,), (text,) = layout["shapes"], layout["annotations"]
    assert layout["xaxis"]["type"] == "log"
    assert 10.0 ** text["x"] == pytest.approx(line["x0"]) == pytest.approx(threshold)
    assert text["text"] == f"{threshold:g} m"


def test_every_class_has_its_name_and_count() -> None:
    """Seventeen classes are seventeen rows, none without its name; the count of the longest stands inside the axis."""
    rows = tuple(ClassRow(k, f"kind {k}", (k, 0, 0)) for k in range(17))
    segment = np.repeat(np.arange(17, dtype=np.uint8), [1, 1_000_000, *range(2, 17)])
    figure = class_figure(segment, rows).to_dict()
    (bar,), layout = figure["data"], figure["layout"]
    assert list(bar["y"]) == [row.name for row in rows]
    assert (bar["text"][0], bar["text"][1]) == ("1", "1,000,000")
    assert layout["yaxis"]["dtick"] == 1
    assert layout["height"] >= 17 * 20
    assert layout["xaxis"]["range"][0] == 0  # bars begin at one point
    assert layout["xaxis"]["range"][1] > 6 * 1.25
