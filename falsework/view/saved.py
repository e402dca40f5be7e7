"""The viewer as one page without a server: stage, cameras, pictures and a cloud, with facts of each point."""

from pathlib import Path

import numpy as np

from falsework.report.cloud_view import Shown, Surfaces, cloud_view
from falsework.report.flight import flight_of
from falsework.report.outline import outline_cloud
from falsework.report.page import file_link, write_page
from falsework.view.subject import Subject
from falsework.view.surfaces import read_surfaces
from groundwork.errors import InputError
from groundwork.files import read_json
from groundwork.progress import Progress
from recon.cloud import (
    COLUMNS,
    LIDAR_AIRBORNE,
    LIDAR_MOBILE,
    LIDAR_TERRESTRIAL,
    MESH,
    SFM_DENSE,
    SFM_SPARSE,
    Cloud,
    read_cloud,
    without_observations,
)
from render.capture import read_capture, read_truth
from usd_schemas.components import UNLABELED

CORNERS = 6000  # points that represent a stage without flight and cloud
POINTS, VIEWS = 50_000, 8  # of the page, which stays below 10 MB
TRIANGLES = 150_000
REACH = 200.0  # [m] around the bridge; 1/65,535 of twice that is 6 mm
PLACES = {
    "none": "",
    "countryside": "in the countryside",
    "city": "in a city",
    "lakeside": "by a lake",
    "hillside": "on a hillside",
}
SOURCES = {
    SFM_SPARSE: "tie points of its photographs",
    SFM_DENSE: "points reconstructed from its photographs",
    MESH: "points on the surface",
    LIDAR_TERRESTRIAL: "points of a laser scanner on the ground",
    LIDAR_MOBILE: "points of a laser scanner on a vehicle",
    LIDAR_AIRBORNE: "points of a laser scanner in the air",
}


def save_view(path: Path, subject: Subject, cloud_name: str, place: str, progress: Progress) -> None:
    """Write the page.

    Args:
        path: HTML file to write.
        subject: What to show.
        cloud_name: Name of one of its clouds; empty for the first.
        place: Relative path from the page to the folder of the scene, or empty if it has no captures.
        progress: Listener.

    Raises:
        InputError: No such cloud, or neither a cloud nor a flight over a bridge.
    """
    if cloud_name and cloud_name not in subject.clouds:
        raise InputError(
            "no such cloud", field="--cloud", value=cloud_name, allowed=", ".join(subject.clouds) or "none"
        )
    name = cloud_name or next(iter(subject.clouds), "")
    folder = subject.clouds.get(name)
    cloud = None if folder is None else read_cloud(folder)
    capture_folder = subject.capture_of(name)
    flight, drawn = None, cloud
    if capture_folder is not None:
        capture = read_capture(capture_folder)
        truth = read_truth(capture)
        link = file_link(*place.split("/"), "capture", capture_folder.name) if place else ""
        flight = flight_of(capture, truth, cloud, folder, link)
        drawn = cloud or (None if truth is None else outline_cloud(truth))
    surfaces = None if subject.stage is None else read_surfaces(subject.stage, TRIANGLES, progress, reach=REACH)[0]
    if drawn is None:
        if surfaces is None:
            raise InputError("neither a cloud nor a stage", where=path, hint="Name a scene of a run, or a cloud")
        drawn = corner_cloud(surfaces)
    write_page(
        path,
        "view.html.j2",
        title=title_words(subject),
        lead=lead_words(subject, name, cloud, "" if capture_folder is None else capture_folder.name),
        view=cloud_view(drawn, flight, Shown(POINTS, VIEWS), surfaces),
    )


def title_words(subject: Subject) -> str:
    """Say in a few words what is shown: the kind of bridge and where it stands, as far as its manifest tells.

    Args:
        subject: What is shown.
    """
    if subject.stage is None:
        return f"{'Point cloud' if subject.clouds else 'Flight'} {subject.name}"
    manifest = subject.stage.parent / "manifest.json"
    try:
        settings = read_json(manifest)["settings"] if manifest.is_file() else {}
        family, world = settings["bridge"]["family"], str(settings["background"]["name"])
    except (KeyError, TypeError, InputError):  # of another program, or damaged: its name has to do
        return f"Bridge {subject.name}"
    where = PLACES.get(world, f"in the world {Path(world).name}")
    kind = (
        f"{family.replace('_', '-').capitalize()} bridge" if isinstance(family, str) else "Bridge"
    )  # drawn by weights
    return " ".join([kind, *([where] if where else [])])


def lead_words(subject: Subject, name: str, cloud: Cloud | None, flight: str) -> str:
    """List what is shown together.

    Args:
        subject: What is shown.
        name: Name of the cloud, or empty.
        cloud: The cloud, or None.
        flight: Name of the capture, or empty.
    """
    parts = ["model"] if subject.stage is not None else []
    parts += [f"cameras of the flight {flight}"] if flight else []
    of = f" (cloud {name})" if name not in ("", flight, subject.name) else ""
    parts += ["no cloud"] if cloud is None else [f"{len(cloud):,} {SOURCES[cloud.source]}{of}"]
    words = ", ".join(parts)
    scene = f"; scene {subject.name}" if subject.captures and subject.stage is not None else ""
    return f"{words[:1].upper()}{words[1:]}{scene}"


def corner_cloud(surfaces: Surfaces) -> Cloud:
    """Make points from some corners of a surface, so that a stage without a cloud can be framed.

    Args:
        surfaces: The surface.

    Returns:
        Points without class and instance.
    """
    every = max(-(-len(surfaces.corners) // CORNERS), 1)
    coord, color = surfaces.corners[::every, 0], surfaces.colors[::every]
    count = len(coord)
    columns = {
        name: np.zeros((count, kind.width) if kind.width > 1 else count, kind.dtype) for name, kind in COLUMNS.items()
    }
    columns |= {
        "coord": coord,
        "color": color,
        "segment": np.full(count, UNLABELED, np.uint8),
        "uncertainty": np.full(count, np.nan, np.float32),
    }
    return Cloud(columns, without_observations(count), ("",), (), {}, (), {}, MESH)
