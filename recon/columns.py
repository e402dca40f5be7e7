"""The columns of a cloud: type, unit and meaning of each. The module `cloud` reads and writes them."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

Column = NDArray[Any]


@dataclass(frozen=True)
class ColumnKind:
    """What one column holds.

    Attributes:
        dtype: numpy name of its numbers.
        width: Numbers per row; 1 for a flat column.
        unit: Unit.
        meaning: One sentence.
    """

    dtype: str
    width: int
    unit: str
    meaning: str


COLUMNS: Mapping[str, ColumnKind] = {
    "coord": ColumnKind("float64", 3, "m", "Position in the world, z up."),
    "color": ColumnKind("uint8", 3, "1", "sRGB color, mean over the views; of a sampled point: that of the material."),
    "normal": ColumnKind(
        "float32", 3, "1", "Unit normal of the surface; of a sparse point: towards the mean of its cameras."
    ),
    "segment": ColumnKind("uint8", 1, "1", "Class id by vote of the views that show its surface; 255 without truth."),
    "instance": ColumnKind("uint32", 1, "1", "Component id by vote within the class; 0 for none."),
    "component": ColumnKind("uint16", 1, "1", "Row in the list `components` of cloud.json."),
    "confidence": ColumnKind("float32", 1, "1", "Share of the views that show the class."),
    "label_margin_px": ColumnKind(
        "float32", 1, "px", "Largest distance of a keypoint to a label edge, over the views."
    ),
    "uncertainty": ColumnKind(
        "float32", 1, "m", "Median over the views of |true depth - reconstructed depth|, aligned reconstructed pose."
    ),
    "uncertainty_min": ColumnKind("float32", 1, "m", "Smallest depth error of a view."),
    "uncertainty_max": ColumnKind("float32", 1, "m", "Largest depth error of a view."),
    "uncertainty_relative": ColumnKind("float32", 1, "1", "Median of depth error over reconstructed depth."),
    "displacement": ColumnKind(
        "float32", 1, "m", "Median distance to the point that the true camera sees at the keypoint's true depth."
    ),
    "surface_distance": ColumnKind("float32", 1, "m", "Distance to the nearest true surface."),
    "surface_class": ColumnKind("uint8", 1, "1", "Class id of the nearest true surface; 255 without truth."),
    "reprojection_error": ColumnKind(
        "float32", 1, "px", "Mean distance between keypoints and reprojected point; NaN of a dense point."
    ),
    "n_views": ColumnKind("uint16", 1, "1", "Number of valid cameras that saw the point."),
}

OPTIONAL_COLUMNS: Mapping[str, ColumnKind] = {
    "intensity": ColumnKind(
        "float32", 1, "1", "Strength of the echo: reflectance times the cosine of the incidence angle."
    ),
    "range": ColumnKind("float32", 1, "m", "Measured distance from the scanner."),
    "station": ColumnKind("uint16", 1, "1", "Row in the list `stations` of the statistics: position of the scanner."),
}

OBSERVATION_COLUMNS: Mapping[str, ColumnKind] = {
    "start": ColumnKind(
        "int64", 1, "1", "First observation of each point, then the number of observations: one row more than points."
    ),
    "image": ColumnKind("uint32", 1, "1", "Row in the list `cameras` of cloud.json."),
    "uv": ColumnKind(
        "float64", 2, "px", "Keypoint, or where a dense point appears; the top-left pixel's center is (0.5, 0.5)."
    ),
    "label": ColumnKind("uint8", 1, "1", "Class id at the keypoint's pixel; 255 without truth."),
    "instance": ColumnKind("uint32", 1, "1", "Component id at the keypoint's pixel."),
    "depth_error": ColumnKind("float32", 1, "m", "|true depth - reconstructed depth| at the keypoint's pixel."),
}
