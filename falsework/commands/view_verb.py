"""The verb that shows a scene in the browser."""

import sys
import threading
from pathlib import Path

import tyro

from falsework.commands.console import ConsoleProgress
from falsework.commands.given_files import need_page
from groundwork.errors import InputError
from groundwork.output.file import fresh_file
from groundwork.output.reading import reading

PORTS = (1024, 65535)


def view(
    place: tyro.conf.Positional[Path],
    *,
    cloud: str = "",
    save: Path | None = None,
    port: int = 8080,
) -> int:
    """Show a scene in the browser: stage, cameras, pictures and cloud together.

    A click on a point shows its class, instance and uncertainty, and the images that saw it, with its pixel. Needs the
    extra view, except with --save. Only this machine can open it.

    Args:
        place: Scene of a run (`OUT/scenes/0000`), scene folder or USD file, capture, or cloud.
        cloud: Name of the cloud to show first; default: the first one.
        save: Write a page that needs no server, and exit.
        port: Port of the server; if it is taken, the next free one is used.
    """
    if save is not None:
        need_page(save, "--save")
    elif not PORTS[0] <= port <= PORTS[1]:
        raise InputError("no such port", field="--port", value=port, allowed=f"{PORTS[0]} to {PORTS[1]}")
    from falsework.view.subject import find_subject

    subject = find_subject(place)
    inputs = [place, *subject.captures.values(), *subject.clouds.values()]
    if cloud and cloud not in subject.clouds:
        raise InputError("no such cloud", field="--cloud", value=cloud, allowed=", ".join(subject.clouds) or "none")
    if save is not None:
        from falsework.report.page import way_to
        from falsework.view.saved import save_view

        way = way_to(place, save) if (place / "capture").is_dir() else ""
        with ConsoleProgress() as progress, reading(*inputs), fresh_file(save, inputs) as temporary:
            save_view(temporary, subject, cloud, way, progress)
        sys.stdout.write(f"page    {save}\n")
        return 0
    from falsework.view.viewer import Viewer

    with ConsoleProgress() as progress, reading(*inputs):
        viewer = Viewer(subject, port, progress, cloud)
    sys.stdout.write(f"view    {viewer.address}  (stop with Ctrl-C)\n")
    sys.stdout.flush()
    try:
        threading.Event().wait()
    except KeyboardInterrupt:  # the way to end it, not an interruption
        viewer.stop()
    return 0
