"""Report page of clouds without a scene, such as of a user's photographs: scale, cameras, points, residuals."""

from collections.abc import Mapping
from pathlib import Path

from falsework.report.cloud_view import MOST_VIEWS, SHOWN_POINTS, Shown, first_views
from falsework.report.page import file_link, way_to, write_page
from falsework.report.reconstruction import cloud_parts, sample_parts
from falsework.report.report import CLOUD, FILES, PAGE_POINTS
from recon.cloud import RECONSTRUCTED, read_cloud


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
    shown = Shown(min(SHOWN_POINTS, PAGE_POINTS // min(max(len(clouds), 1), MOST_VIEWS)), whole=True)
    found = {name: (read_cloud(folder), folder) for name, folder in clouds.items()}
    flown = {name: pair for name, pair in found.items() if pair[0].source in RECONSTRUCTED}
    notes = [str(cloud.alignment["note"]) for cloud, _ in flown.values() if cloud.alignment.get("note")]
    parts = [cloud_parts(name, cloud, folder, shown) for name, (cloud, folder) in flown.items()]
    parts += [sample_parts(name, cloud, shown) for name, (cloud, _) in found.items() if name not in flown]
    parts = first_views(parts)
    write_page(
        path,
        "report.html.j2",
        title=title,
        lead=notes[0] if notes else ", ".join(dict.fromkeys(cloud.source for cloud, _ in found.values())),
        surveys=parts[: len(flown)],
        samples=parts[len(flown) :],
        settings=[],
        files=[row for name, folder in clouds.items() for row in _files(name, folder, page)],
    )


def _files(name: str, folder: Path, page: Path) -> list[tuple[str, str]]:
    home = way_to(folder, page).split("/")
    there = [file for file in FILES[CLOUD] if (folder / file).exists()]
    return [(f"{name}/{file}", file_link(*home, file)) for file in there]
