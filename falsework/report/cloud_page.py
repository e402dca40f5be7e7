"""Report page of clouds without a scene, such as of a user's photographs: scale, cameras, points, residuals."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from falsework.report.cloud_view import SHOWN_POINTS, Shown, cloud_view
from falsework.report.figures import flight_figure
from falsework.report.flight import flight_of_cloud
from falsework.report.page import file_link, way_to, write_page
from falsework.report.reconstruction import NOTHING, reconstruction_parts, sample_parts
from falsework.report.report import CLOUD, FILES, PAGE_POINTS
from falsework.report.scene_tables import headline_tiles, unit_of
from groundwork.slug import slug
from recon.cloud import RECONSTRUCTED, read_cloud

if TYPE_CHECKING:
    from recon.cloud import Cloud


def write_cloud_page(path: Path, title: str, clouds: Mapping[str, Path], page: Path) -> None:
    """Write the page.

    Args:
        path: HTML file to write.
        title: Heading.
        clouds: Name of each cloud to its folder.
        page: Path of the page, to which links are relative.

    Raises:
        InputError: A folder is not a cloud.
    """
    shown = Shown(min(SHOWN_POINTS, PAGE_POINTS // max(len(clouds), 1)), whole=True)
    found = {name: (read_cloud(folder), folder) for name, folder in clouds.items()}
    flown = {name: pair for name, pair in found.items() if pair[0].source in RECONSTRUCTED}
    notes = [str(cloud.alignment["note"]) for cloud, _ in flown.values() if cloud.alignment.get("note")]
    write_page(
        path,
        "report.html.j2",
        title=title,
        lead=notes[0] if notes else ", ".join(cloud.source for cloud, _ in found.values()),
        surveys=[_reconstructed(name, cloud, folder, shown) for name, (cloud, folder) in flown.items()],
        samples=[sample_parts(name, cloud, shown) for name, (cloud, _) in found.items() if name not in flown],
        settings=[],
        files=[row for name, folder in clouds.items() for row in _files(name, folder, page)],
    )


def _reconstructed(name: str, cloud: "Cloud", folder: Path, shown: Shown) -> dict[str, Any]:
    flight = flight_of_cloud(cloud, folder)
    centers, nothing = flight.poses[:, :3, 3], np.zeros((0, 3))
    plan = flight_figure(centers, list(flight.statuses), nothing, unit=unit_of(cloud)) if len(centers) else None
    return {
        **NOTHING,
        **reconstruction_parts(cloud, folder, {}),
        "name": name,
        "heading": f"Cloud {name}",
        "key": slug(name),
        "tiles": headline_tiles(len(cloud.cameras), cloud),
        "view": cloud_view(cloud, flight, shown),
        "flight": plan,
        **dict.fromkeys(("sheet", "frames", "legend"), ()),
    }


def _files(name: str, folder: Path, page: Path) -> list[tuple[str, str]]:
    home = way_to(folder, page).split("/")
    there = [file for file in FILES[CLOUD] if (folder / file).exists()]
    return [(f"{name}/{file}", file_link(*home, file)) for file in there]
