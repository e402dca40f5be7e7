"""Figures of the report."""

import numpy as np
import pytest

from falsework.report.figures import cloud_figure, paint_uncertainty, uncertainty_figure
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


def test_every_uncertainty_has_a_color_of_its_own() -> None:
    """From 1 mm to 10 m each tenfold is another color, from blue to red; unknown and infinite ones have one too."""
    colors = paint_uncertainty(np.array([0.001, 0.01, 0.1, 1.0, 10.0, np.inf, np.nan], np.float32)).astype(int)
    assert colors.shape == (7, 3)
    assert len({tuple(color) for color in colors[:5].tolist()}) == 5
    assert colors[0, 2] > colors[0, 0]  # blue
    assert colors[4, 0] > colors[4, 2]  # red
    assert colors[5].tolist() == colors[4].tolist()
    assert colors[6].tolist() == colors[3].tolist()


def test_each_button_paints_each_point() -> None:
    """Photograph, class and uncertainty each give one color a point, and differ where the points differ."""
    count = 5
    columns = {
        "coord": np.arange(3.0 * count).reshape(count, 3), "color": np.arange(3 * count, dtype=np.uint8).reshape(-1, 3),
        "segment": np.arange(count, dtype=np.uint8), "uncertainty": np.geomspace(1e-3, 10.0, count).astype(np.float32),
    }  # fmt: skip
    classes = tuple(ClassRow(k, f"class{k}", (40 * k, 10, 10)) for k in range(count))
    figure = cloud_figure(columns, classes, np.eye(3)[:2]).to_dict()
    (menu,) = figure["layout"]["updatemenus"]
    painted = {button["label"]: button["args"][0]["marker.color"][0] for button in menu["buttons"]}
    assert list(painted) == ["photo", "class", "uncertainty"]
    for colors in painted.values():
        assert len(colors) == len(set(colors)) == count
