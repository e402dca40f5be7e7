"""Report page of a scene: its frames, its flight, its reconstruction and its cloud."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from falsework.report.cloud_view import MOST_VIEWS, SHOWN_POINTS, Shown, cloud_view, first_views
from falsework.report.figures import flight_figure
from falsework.report.flight import flight_of
from falsework.report.outline import outline_cloud
from falsework.report.page import file_link, settings_rows, write_page
from falsework.report.pictures import data_uri, depth_range, paint_depth, paint_labels
from falsework.report.reconstruction import (
    NOTHING,
    cloud_parts,
    reconstruction_parts,
    sample_parts,
)
from falsework.report.scene_tables import headline_tiles
from groundwork.errors import InputError
from groundwork.files import read_json
from groundwork.slug import slug
from render.capture import Capture, Truth, load_image, read_capture, read_truth

if TYPE_CHECKING:
    from recon.cloud import Cloud

PAGE_POINTS = 60_000  # of all clouds of a page together, so that it stays below 10 MB
PAGE_FRAMES = 12  # of all surveys together that are shown with labels and depth
SHEET_FRAMES = 24  # of a survey in its contact sheet
FRAME_WIDTH, SHEET_WIDTH = 640, 320  # [px]
STAGE, CAPTURE, CLOUD = "stage", "capture", "cloud"
FILES = {  # files for people to open, if they exist
    STAGE: ("scene.usda", "manifest.json", "edits/user.usda"),
    CAPTURE: ("cameras.json", "images", "truth", "truth/poses.json", "truth/render.json"),
    CLOUD: ("cloud.laz", "cloud.ply", "cloud.json", "cameras_sfm.json", "sparse"),
}


def write_report(
    path: Path,
    title: str,
    stage: Path,
    surveys: dict[str, tuple[Path, dict[str, Path]]],
    others: Mapping[str, Path] | None = None,
    place: str = "",
) -> None:
    """Write the page of one scene.

    Args:
        path: HTML file to write.
        title: Heading.
        stage: Scene folder or USD file; the manifest beside it gives the lead line.
        surveys: Survey id to its capture folder, and the folder of each cloud by its suffix, empty for a single one.
        others: Name of each further cloud to its folder: samples, and clouds whose photographs were removed.
        place: Relative path from the page to the folder of the scene; empty for the page's own folder.
    """
    from recon.cloud import RECONSTRUCTED, read_cloud

    found = {name: (read_cloud(folder), folder) for name, folder in sorted((others or {}).items())}
    alone = {name: pair for name, pair in found.items() if pair[0].source in RECONSTRUCTED}
    clouds = sum(max(len(several), 1) for _, several in surveys.values()) + len(found)
    shown = Shown(min(SHOWN_POINTS, PAGE_POINTS // min(max(clouds, 1), MOST_VIEWS)))
    frames = max(PAGE_FRAMES // max(2 * len(surveys), 1), 1)
    parts = [
        _survey(name, mode, capture, folder, shown, frames=frames if first else 0, place=place)
        for name, (capture, several) in sorted(surveys.items())
        for first, mode, folder in _clouds(several)
    ] + [_alone(name, cloud, folder, shown, place) for name, (cloud, folder) in alone.items()]
    samples = [sample_parts(name, cloud, shown) for name, (cloud, _) in found.items() if name not in alone]
    drawn = first_views(parts + samples)
    settings = [("stage", settings_rows(recipe))] if (recipe := _recipe(stage)) else []
    write_page(
        path,
        "report.html.j2",
        title=title,
        lead=_lead(stage),
        surveys=drawn[: len(parts)],
        samples=drawn[len(parts) :],
        settings=settings + [group for part in parts for group in part["settings"]],
        files=_files(place, STAGE, "", stage if stage.is_dir() else stage.parent, FILES[STAGE])
        + [row for part in parts for row in part["files"]]
        + [
            row
            for name in sorted(found.keys() - alone.keys())
            for row in _files(place, CLOUD, name, found[name][1], FILES[CLOUD])
        ],
    )


def _clouds(several: dict[str, Path]) -> list[tuple[bool, str, Path | None]]:
    """List a survey once for each of its clouds; flight and frames are shown with the first."""
    if not several:
        return [(True, "", None)]
    return [(number == 0, mode, folder) for number, (mode, folder) in enumerate(several.items())]


def _survey(
    name: str, mode: str, capture_folder: Path, folder: Path | None, shown: Shown, *, frames: int, place: str
) -> dict[str, Any]:
    from recon.cloud import read_cloud

    capture = read_capture(capture_folder)
    truth = read_truth(capture)
    cloud = None if folder is None else read_cloud(folder)
    home = file_link(*_at(place), CAPTURE, name)
    title, first = f"{name}, {mode}" if mode else name, frames > 0
    flight = flight_of(capture, truth, cloud, folder, f"{home}")
    outline = None if truth is None else outline_cloud(truth)
    seen = {row.class_name for row in truth.instances} if truth is not None else set()
    drawn = cloud or outline
    found: dict[str, Any] = {
        **NOTHING,
        "name": title,
        "heading": f"Survey {title}",
        "key": slug(title),
        "tiles": headline_tiles(len(capture.images), cloud),
        "view": None if drawn is None or not (first or cloud) else cloud_view(drawn, flight, shown),
        "flight": _plan(capture, truth, cloud, outline) if first else None,
        "sheet": _sheet(capture, home) if first else [],
        "frames": _frames(capture, truth, home, frames) if first and truth is not None else [],
        "legend": [row for row in truth.classes if row.name in seen] if truth is not None else [],
        "files": _files(place, CAPTURE, name, capture_folder, FILES[CAPTURE]) if first else [],
        "settings": _settings(f"capture {name}", capture_folder) if first else [],
    }
    if cloud is None or folder is None:
        return found
    own = f"{name}+{mode}" if mode else name
    more = _files(place, CLOUD, own, folder, FILES[CLOUD])
    settings = found["settings"] + _settings(f"cloud {own}", folder)
    links = dict(zip(flight.names, flight.files, strict=True))
    parts = reconstruction_parts(cloud, folder, links, capture, truth, of_model=first)
    return {**found, **parts, "files": found["files"] + more, "settings": settings}


def _plan(capture: Capture, truth: Truth | None, cloud: "Cloud | None", outline: "Cloud | None") -> Any:
    """Plot plan and elevation, if positions are known."""
    places = _centers(capture, truth)
    if not len(places):
        return None
    shown = [truth is not None or image.gps is not None for image in capture.images]
    rows = () if cloud is None else cloud.cameras
    statuses = [str(row["status"]) for row in rows] if len(rows) == len(shown) else ["ok"] * len(shown)
    statuses = [status for status, place in zip(statuses, shown, strict=True) if place]
    bridge = np.zeros((0, 3)) if outline is None else outline.columns["coord"]
    return flight_figure(places, statuses, bridge, "registered" if cloud is not None else "images")


def _sheet(capture: Capture, home: str) -> list[dict[str, str]]:
    """Show evenly chosen photographs; a click enlarges one, with a link to the file."""
    return [
        {
            "name": capture.images[index].name,
            "file": f"{home}/{file_link(*capture.images[index].file.split('/'))}",
            "rgb": data_uri(load_image(capture, index), SHEET_WIDTH, quality=80),
        }
        for index in _spread(len(capture.images), SHEET_FRAMES)
    ]


def _frames(capture: Capture, truth: Truth, home: str, count: int) -> list[dict[str, str]]:
    """Show some photographs beside their labels and their depth."""
    return [
        {
            "name": capture.images[index].name,
            "file": f"{home}/{file_link(*capture.images[index].file.split('/'))}",
            "rgb": data_uri(load_image(capture, index), FRAME_WIDTH, quality=80),
            "labels": data_uri(paint_labels(truth.semantic(index), truth.classes), FRAME_WIDTH, smooth=False),
            "depth": data_uri(paint_depth(depth), FRAME_WIDTH, quality=80),
            "range": "" if (ends := depth_range(depth)) is None else f"{ends[0]:.1f} m to {ends[1]:.0f} m",
        }
        for index in _spread(len(capture.images), count)
        for depth in (truth.depth(index),)
    ]


def _spread(count: int, wanted: int) -> list[int]:
    return np.unique(np.linspace(0, count - 1, min(wanted, count)).round().astype(int)).tolist()


def _alone(name: str, cloud: "Cloud", folder: Path, shown: Shown, place: str) -> dict[str, Any]:
    """Show a reconstructed cloud whose photographs were removed."""
    more = {"files": _files(place, CLOUD, name, folder, FILES[CLOUD]), "settings": _settings(f"cloud {name}", folder)}
    return {**cloud_parts(name, cloud, folder, shown), **more}


def _settings(name: str, folder: Path) -> list[tuple[str, list[dict[str, Any]]]]:
    """Format the settings and versions of a run's result, if its manifest is beside it."""
    path = folder / "artefact.json"
    if not path.is_file():
        return []
    try:
        stored = read_json(path)["settings"]
        return [(name, settings_rows(stored))] if isinstance(stored, Mapping) else []
    except (KeyError, TypeError, InputError):
        return []


def _files(place: str, kind: str, name: str, folder: Path, wanted: tuple[str, ...]) -> list[tuple[str, str]]:
    """List the files for people to open: text and link."""
    home = [*_at(place), kind, *([name] if name else [])]
    return [
        ("/".join(part for part in (kind, name, file) if part), file_link(*home, *file.split("/")))
        for file in wanted
        if (folder / file).exists()
    ]


def _at(place: str) -> list[str]:
    return [""] if not place else place.split("/")


def _centers(capture: Capture, truth: Truth | None) -> np.ndarray:
    if truth is not None:
        return truth.poses[:, :3, 3]
    return np.array([image.gps for image in capture.images if image.gps is not None]).reshape(-1, 3)


def _recipe(stage: Path) -> dict[str, Any]:
    manifest = (stage if stage.is_dir() else stage.parent) / "manifest.json"
    if not manifest.is_file():
        return {}
    told = read_json(manifest)
    return {"seed": told["seed"], "settings": told["settings"], "versions": told.get("versions", {})}


def _lead(stage: Path) -> str:
    recipe = _recipe(stage)
    if not recipe:
        return stage.name
    settings = recipe["settings"]
    names = [f"{section} {settings[section]['name']}" for section in ("background", "look")]
    return ", ".join([f"{settings['bridge']['family']} bridge", *names, f"scene seed {recipe['seed']}"])
