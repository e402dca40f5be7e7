"""Report page of planned flights: scores and 3D view of each, and the members that none shows."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from falsework.report.cloud_view import Shown, cloud_view, first_views
from falsework.report.dataset_page import class_rows_of
from falsework.report.figures import flight_figure
from falsework.report.flight import Flight
from falsework.report.flight_verdicts import ENOUGH_LINKED, ENOUGH_OVERLAP, coverage_word, judged
from falsework.report.page import BLUE, percent, plain_layout, write_page
from groundwork.slug import slug

if TYPE_CHECKING:
    from recon.cloud import Cloud

F64 = NDArray[np.float64]

PITCH_STEP = 15  # [deg]
NAMED = 40  # ids in a cell
_COLORS = {"well": "good", "partly": "", "poorly": "bad"}


def write_survey_page(path: Path, surveys: Sequence[Mapping[str, Any]], scene: str) -> None:
    """Write the page.

    Args:
        path: HTML file to write.
        surveys: Result of `falsework.children.survey_work.score`.
        scene: Name of the stage in the commands on the page.
    """
    last = surveys[-1]
    write_page(
        path,
        "survey.html.j2",
        title="Planned flights",
        lead=f"{scene}: calculated by ray casting for every image; nothing was rendered",
        surveys=first_views([_survey(number, row) for number, row in enumerate(surveys)]),
        unseen=[_unseen_row(name, few) for name, few in last.get("hardly_seen", {}).items()],
        proposal=_proposal(last.get("proposal"), scene),
    )


def _survey(number: int, row: Mapping[str, Any]) -> dict[str, Any]:
    poses, outline = _poses(row["poses"]), row["outline"]
    points = np.array(outline["points"], np.float64).reshape(-1, 3)
    cameras = Flight(
        names=tuple(f"image {image}" for image in range(len(poses))),
        rows=tuple(range(len(poses))),
        poses=poses,
        statuses=("ok",) * len(poses),
        half=(float(row["half"][0]), float(row["half"][1])),
        files=("",) * len(poses),
    )
    view = cloud_view(_surface_cloud(points, outline["ids"], outline["classes"]), cameras, Shown(views=0))
    return {
        "name": row["survey"],
        "key": f"{slug(row['survey'])}-{number}",
        "warnings": row["warnings"],
        "tiles": _tiles(row),
        "view": view,
        "path": flight_figure(poses[:, :3, 3], ["ok"] * len(poses), points, "images"),
        "pitch": _pitch_figure(row["pitches"]),
        "coverage": _coverage(row["by_class"]),
    }


def _tiles(row: Mapping[str, Any]) -> list[dict[str, str]]:
    median, worst = row["sampling"]
    overlap, linked = row["overlap"], row["linked"]
    return [
        {"value": f"{row['images']:,}", "label": "images"},
        {"value": f"{row['length']:.0f} m", "label": f"flight, {row['duration']:.0f} s"},
        {"value": f"{row['clearance']:.2f} m", "label": "smallest clearance"},
        {
            "value": percent(overlap),
            "label": f"overlap with the next image: {judged(overlap, ENOUGH_OVERLAP)}",
            "verdict": "good" if overlap >= ENOUGH_OVERLAP else "bad",
        },
        {
            "value": percent(linked),
            "label": f"images linked (prediction): {judged(linked, ENOUGH_LINKED)}",
            "verdict": "good" if linked >= ENOUGH_LINKED else "bad",
        },
        {"value": _millimeters(median), "label": f"pixel size, median; {_millimeters(worst)} at the 95th percentile"},
        {"value": f"{row['base_angle']:.0f}°", "label": "base angle, median"},
    ]


def _millimeters(length: float | None) -> str:
    return "–" if length is None else f"{1e3 * length:.1f} mm"


def _coverage(by_class: Mapping[str, float]) -> list[dict[str, str]]:
    """Make the rows of the classes, best first, with a rating of the coverage and the width of its bar."""
    rows = sorted(by_class.items(), key=lambda pair: (-pair[1], pair[0]))
    return [
        {
            "name": name,
            "share": percent(share),
            "width": f"{100.0 * min(max(share, 0.0), 1.0):.1f}",
            "word": coverage_word(share),
            "verdict": _COLORS[coverage_word(share)],
        }
        for name, share in rows
    ]


def _unseen_row(name: str, few: Mapping[str, Any]) -> list[str]:
    members = few["members"]
    ids = ", ".join(str(number) for number in members[:NAMED]) + (" …" if len(members) > NAMED else "")
    return [name, f"{len(members):,}", f"{few['of']:,}", f"{len(few['never']):,}", ids]


def _proposal(found: Mapping[str, Any] | None, scene: str) -> dict[str, Any] | None:
    """List legs that would show the members that no flight shows; None if they were not searched."""
    if not found:
        return None
    return {
        "refused": found["refused"],
        "images": found["images"],
        "shown": len(found["shown"]),
        "wanted": len(found["shown"]) + len(found["hidden"]),
        "hidden": ", ".join(str(number) for number in found["hidden"][:NAMED]),
        "command": f"falsework survey plan {scene} --kind inspection --for unseen",
    }


def _pitch_figure(pitches: Sequence[int]) -> go.Figure:
    middles = [-90 + PITCH_STEP * (k + 0.5) for k in range(len(pitches))]
    figure = go.Figure(go.Bar(x=middles, y=list(pitches), width=PITCH_STEP, marker_color=BLUE))
    plain_layout(figure, 340)
    axis = {"title": "pitch [deg]", "range": [-90, 90], "tickvals": [-90, -60, -30, 0, 30, 60, 90]}
    return figure.update_layout(xaxis=axis, yaxis={"title": "images"}, bargap=0)


def _poses(rows: Sequence[Sequence[float]]) -> F64:
    """Complete camera_to_world from its upper three rows, shape (N, 4, 4)."""
    poses = np.tile(np.eye(4), (len(rows), 1, 1))
    poses[:, :3] = np.array(rows, np.float64).reshape(-1, 3, 4)
    return poses


def _surface_cloud(points: F64, ids: Sequence[int], classes: Mapping[str, str]) -> "Cloud":
    """Make a cloud of samples of the bridge's surface, with their members and classes."""
    from recon.cloud import COLUMNS, MESH, Cloud, without_observations

    names = tuple(sorted(set(classes.values())))
    count, instance = len(points), np.array(ids, np.uint32)
    columns = {
        name: np.zeros((count, kind.width) if kind.width > 1 else count, kind.dtype) for name, kind in COLUMNS.items()
    }
    place = {int(number): names.index(name) for number, name in classes.items()}
    segment = np.array([place.get(int(number), 255) for number in ids], np.uint8)
    unknown = np.full(count, np.nan, np.float32)
    columns |= {"coord": points, "instance": instance, "segment": segment, "uncertainty": unknown}
    return Cloud(columns, without_observations(count), ("",), class_rows_of(names), {}, (), {}, MESH)
