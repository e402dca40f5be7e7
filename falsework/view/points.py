"""Points in the viewer: which are shown, which one a click selects, and its facts."""

from collections.abc import Collection
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from falsework.report.cloud_view import instance_color, uncertainty_levels, uncertainty_scale

if TYPE_CHECKING:
    from recon.cloud import Cloud

F64 = NDArray[np.float64]
U8 = NDArray[np.uint8]

PAINTS = ("RGB", "class", "instance", "uncertainty")
CONE = 0.008  # [rad] largest angle between the ray and a point
_GRAY = (154, 160, 166)


@dataclass(frozen=True)
class Sighting:
    """An image that saw a point.

    Attributes:
        image: Name of the image.
        row: Its row in the list of cameras of the cloud.
        pixel: Pixel of the point [px]; the center of the top-left pixel is (0.5, 0.5).
    """

    image: str
    row: int
    pixel: tuple[float, float]


@dataclass(frozen=True)
class PointFacts:
    """Facts of one point.

    Attributes:
        row: Its row in the cloud.
        place: Its position [m].
        class_name: Its class.
        instance: Component id, 0 for none.
        component: Kind of component, or empty.
        uncertainty: Its uncertainty [m]; NaN if unknown.
        sightings: The images that saw it.
    """

    row: int
    place: tuple[float, float, float]
    class_name: str
    instance: int
    component: str
    uncertainty: float
    sightings: tuple[Sighting, ...]

    def as_markdown(self) -> str:
        """Format it as Markdown; names from files are formatted as code, so that they cannot become tags or links."""
        sure = "not known" if np.isnan(self.uncertainty) else f"{1000.0 * self.uncertainty:.1f} mm"
        lines = [
            f"**class** {as_code(self.class_name)}",
            f"**instance** {self.instance or 'none'} {as_code(self.component) if self.component else ''}",
            f"**uncertainty** {sure}",
            f"**place** {', '.join(f'{value:.3f}' for value in self.place)} m",
            f"**seen by {len(self.sightings)} images** [px]",
        ]
        seen = [f"- {as_code(one.image)} at ({one.pixel[0]:.1f}, {one.pixel[1]:.1f})" for one in self.sightings]
        return "  \n".join(lines) + "\n\n" + "\n".join(seen)


def as_code(text: str) -> str:
    """Format text from a file as Markdown code that shows every character.

    Args:
        text: Any text.
    """
    plain = " ".join(text.replace("`", "'").split())
    return f"`{plain or ' '}`"


def shown_rows(cloud: "Cloud", limit: float, classes: Collection[int]) -> NDArray[np.int64]:
    """Choose the points of some classes up to an uncertainty.

    Args:
        cloud: A cloud.
        limit: Largest uncertainty [m]; +inf also shows points of unknown uncertainty.
        classes: Class ids.

    Returns:
        Rows of the cloud, shape (K,), int64.
    """
    mine = np.isin(cloud.columns["segment"], list(classes))
    if np.isfinite(limit):
        mine &= cloud.columns["uncertainty"] <= limit  # unknown counts as above every limit
    return np.flatnonzero(mine)


def point_colors(cloud: "Cloud", paint: str) -> U8:
    """Color all points of a cloud.

    Args:
        cloud: A cloud.
        paint: One of `PAINTS`.

    Returns:
        sRGB colors, shape (N, 3), uint8.
    """
    columns = cloud.columns
    if paint == "RGB":
        return columns["color"]
    if paint == "class":
        palette = np.tile(np.array(_GRAY, np.uint8), (256, 1))
        for row in cloud.classes:
            palette[row.id] = row.color
        return palette[columns["segment"]]
    if paint == "instance":
        numbers, inverse = np.unique(columns["instance"], return_inverse=True)
        return np.array([instance_color(int(number)) for number in numbers], np.uint8).reshape(-1, 3)[inverse.ravel()]
    return np.vstack([uncertainty_scale(), np.array([_GRAY], np.uint8)])[uncertainty_levels(columns["uncertainty"])]


def picked_row(places: F64, origin: F64, direction: F64) -> int:
    """Find the point that a ray selects: the first within a narrow cone about it.

    Args:
        places: Positions of the points that are shown [m], shape (K, 3), float64.
        origin: Origin of the ray [m], shape (3,), float64.
        direction: Unit vector along it [1], shape (3,), float64.

    Returns:
        Row in `places`, or -1.
    """
    apart = places - origin
    along = apart @ direction
    beside = np.linalg.norm(apart - along[:, None] * direction, axis=1)
    inside = np.flatnonzero((along > 1e-6) & (beside <= CONE * along))
    if not len(inside):
        return -1
    # Of the foremost points the one nearest to the ray; points within two cone widths in depth count as equally far.
    front = inside[along[inside] <= along[inside].min() * (1.0 + 4.0 * CONE)]
    return int(front[np.argmin(beside[front] / along[front])])


def point_facts(cloud: "Cloud", row: int) -> PointFacts:
    """Return the facts of a point.

    Args:
        cloud: A cloud.
        row: Row of the point.
    """
    columns, seen = cloud.columns, cloud.observations
    names = {one.id: one.name for one in cloud.classes}
    sightings = tuple(
        Sighting(
            _name(cloud, int(seen["image"][k])),
            int(seen["image"][k]),
            (float(seen["uv"][k][0]), float(seen["uv"][k][1])),
        )
        for k in range(int(seen["start"][row]), int(seen["start"][row + 1]))
    )
    x, y, z = (float(value) for value in columns["coord"][row])
    return PointFacts(
        row,
        (x, y, z),
        names.get(int(columns["segment"][row]), "unlabelled"),
        int(columns["instance"][row]),
        cloud.components[int(columns["component"][row])] if cloud.components else "",
        float(columns["uncertainty"][row]),
        sightings,
    )


def _name(cloud: "Cloud", row: int) -> str:
    told: Any = cloud.cameras[row]
    return str(told["name"])
