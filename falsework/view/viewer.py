"""The viewer: stage, cameras, pictures and cloud in a browser on this machine, with facts of selected points."""

import threading
from collections.abc import Callable
from contextlib import redirect_stdout
from dataclasses import dataclass
from io import StringIO
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import trimesh
import viser
from numpy.typing import NDArray
from trimesh.visual import ColorVisuals

from falsework.report.cloud_view import Surfaces
from falsework.report.flight import Flight, flight_of, small_picture
from falsework.view.points import PAINTS, PointFacts, picked_row, point_colors, point_facts, shown_rows
from falsework.view.subject import Subject
from falsework.view.surfaces import VariantSet, read_surfaces
from groundwork.errors import FalseworkError
from groundwork.progress import Progress
from render.capture import Capture, load_image, read_capture, read_truth

if TYPE_CHECKING:
    from recon.cloud import Cloud

F64 = NDArray[np.float64]
U8 = NDArray[np.uint8]

LOOPBACK = "127.0.0.1"  # not reachable from the network
SHOWN_POINTS = 400_000
TRIANGLES = 250_000
PICTURE = 160  # [px] width of the pictures in the frusta
MOST_PICTURES = 150
CROP, CROPS = 120, 3  # [px] size of a crop around a pixel; number of images with a crop
SLIDER_LOW, SLIDER_HIGH = -3.0, 1.0  # range of the slider: log10 of the uncertainty in meters; the right end: no limit
RAY, MARK = (235, 160, 40), (255, 90, 60)
OK, LOST = (61, 124, 192), (209, 69, 59)


@dataclass
class _Shown:
    """The cloud that is currently shown.

    Attributes:
        cloud: All of it.
        rows: Rows that pass slider and switches; a part of them is drawn.
        flight: Poses of its images.
        capture: Their capture, or None.
    """

    cloud: "Cloud"
    rows: NDArray[np.int64]
    flight: Flight
    capture: Capture | None


class Viewer:
    """A subject on a server of its own.

    Every action of a click or a control is a method, so that it can also be called without a browser.
    """

    def __init__(self, subject: Subject, port: int, progress: Progress, cloud: str = "") -> None:
        """Start the server and show the subject.

        Args:
            subject: What to show.
            port: Port; if it is taken, the next free one is used.
            progress: Listener.
            cloud: Name of the cloud to show first; empty for the first one.
        """
        self.subject, self.progress = subject, progress
        with redirect_stdout(StringIO()):  # its banner
            self.server = viser.ViserServer(LOOPBACK, port, label=f"Falsework: {subject.name}", verbose=False)
        self.server.scene.set_up_direction("+z")
        self.server.gui.configure_theme(dark_mode=True, control_width="large", show_logo=False, show_share_button=False)
        self._lock = threading.RLock()
        self.shown: _Shown | None = None
        self.origin = np.zeros(3)
        self.chosen: dict[tuple[str, str], str] = {}
        self.facts: PointFacts | None = None
        self._stage_handle: Any = None
        self._marks: list[Any] = []
        self._frusta: list[Any] = []
        surfaces, variants = (None, ()) if subject.stage is None else read_surfaces(subject.stage, TRIANGLES, progress)
        first = self._first_place(surfaces)
        self.origin = np.round(first)
        self._build_controls(variants, cloud)
        if surfaces is not None:
            self._show_surfaces(surfaces)
        self.show_cloud(self.cloud_name)
        self.server.scene.on_click()(self._clicked)
        self._aim()

    @property
    def address(self) -> str:
        """Address for the browser."""
        return f"http://{LOOPBACK}:{self.server.get_port()}"

    @property
    def cloud_name(self) -> str:
        """Name of the selected cloud; empty if there is none."""
        return str(self.clouds.value) if self.subject.clouds else ""

    def stop(self) -> None:
        """Close the server."""
        with redirect_stdout(StringIO()):
            self.server.stop()

    def show_cloud(self, name: str) -> None:
        """Show another cloud, with the cameras of its images.

        Args:
            name: Name of the cloud, or empty for the cameras only.
        """
        from recon.cloud import read_cloud

        with self._lock:
            cloud = read_cloud(self.subject.clouds[name]) if name else None
            place = self.subject.capture_of(name)
            capture = None if place is None else read_capture(place)
            flight = None
            if capture is not None:
                flight = flight_of(capture, read_truth(capture), cloud, self.subject.clouds.get(name), "")
                self._show_cameras(flight, capture)
            if cloud is not None:
                empty = Flight((), (), np.zeros((0, 4, 4)), (), (1.0, 1.0), ())
                self.shown = _Shown(cloud, np.zeros(0, np.int64), flight or empty, capture)
                self._list_classes(cloud)
        self.refresh()

    def refresh(self) -> None:
        """Draw the points with the current settings of slider, switches and color."""
        with self._lock:
            if self.shown is None:
                return
            cloud, limit = self.shown.cloud, self.limit
            classes = [number for number, box in self.classes.items() if box.value]
            rows = shown_rows(cloud, limit, classes)
            every = max(-(-len(rows) // SHOWN_POINTS), 1)
            self.shown.rows = rows[::every]
            drawn = self.shown.rows
            self.server.scene.add_point_cloud(
                "/cloud",
                (cloud.columns["coord"][drawn] - self.origin).astype(np.float32),
                point_colors(cloud, str(self.paint.value))[drawn],
                point_size=float(self.size.value),
                point_shape="circle",
                precision="float32",
                visible=bool(self.points.value) and len(drawn) > 0,
            )
            words = "any" if np.isinf(limit) else f"{1000.0 * limit:.3g} mm" if limit < 1.0 else f"{limit:.3g} m"
            part = f", one of {every} drawn" if every > 1 else ""
            self.count.content = f"uncertainty at most **{words}**: {len(rows):,} of {len(cloud):,} points{part}"

    @property
    def limit(self) -> float:
        """Largest uncertainty that is shown [m]."""
        value = float(self.slider.value)
        return float("inf") if value >= SLIDER_HIGH else 10.0**value

    def click(self, origin: tuple[float, float, float], direction: tuple[float, float, float]) -> PointFacts | None:
        """Show the facts of the point that a ray selects, and the images that saw it.

        Args:
            origin: Origin of the ray in drawn coordinates [m].
            direction: Direction of the ray [1].

        Returns:
            The shown text, or None if the ray selects no point.
        """
        with self._lock:
            for mark in self._marks:
                mark.remove()
            self._marks, self.facts = [], None
            if self.shown is not None and bool(self.points.value):
                places = self.shown.cloud.columns["coord"][self.shown.rows] - self.origin
                ray = np.array(direction, np.float64)
                found = picked_row(places, np.array(origin, np.float64), ray / np.linalg.norm(ray))
                if found >= 0:
                    self.facts = point_facts(self.shown.cloud, int(self.shown.rows[found]))
            self._tell()
            return self.facts

    def _clicked(self, event: viser.SceneClickEvent) -> None:
        self.click(event.ray_origin, event.ray_direction)

    def choose_variant(self, prim: str, name: str, value: str) -> None:
        """Show the stage with another variant; it moves neither bridge nor cameras.

        Args:
            prim: Prim path of the variant set.
            name: Its name.
            value: The variant.
        """
        if self.subject.stage is None:
            return
        with self._lock:
            self.chosen[prim, name] = value
            self.state.content = f"reading {value} …"
            try:
                surfaces, _ = read_surfaces(self.subject.stage, TRIANGLES, self.progress, self.chosen)
            except FalseworkError as error:
                self.state.content = f"cannot be shown: {error}".replace("<", "‹")
                return
            self._show_surfaces(surfaces)

    def _build_controls(self, variants: tuple[VariantSet, ...], cloud: str) -> None:
        gui, redraw = self.server.gui, self.refresh
        self.variants: dict[tuple[str, str], Any] = {}
        with gui.add_folder("Stage", visible=self.subject.stage is not None):
            self.surfaces = gui.add_checkbox("surfaces", self.subject.stage is not None)
            for one in variants:
                chosen = one.selected if one.selected in one.names else one.names[0]
                handle = gui.add_dropdown(one.name, one.names, initial_value=chosen, hint=one.prim)
                handle.on_update(self._variant_changed(one, handle))
                self.variants[one.prim, one.name] = handle
            self.state = gui.add_markdown("")
        with gui.add_folder("Cameras", visible=bool(self.subject.captures)):
            self.cameras = gui.add_checkbox("frusta with pictures", True)
        with gui.add_folder("Cloud", visible=bool(self.subject.clouds)):
            self.points = gui.add_checkbox("points", True)
            names = tuple(self.subject.clouds) or ("none",)
            self.clouds = gui.add_dropdown("cloud", names, initial_value=cloud or names[0])
            self.paint = gui.add_dropdown("color", PAINTS)
            marks = ((-3, "1 mm"), (-2, "1 cm"), (-1, "10 cm"), (0, "1 m"), (1, "any"))
            self.slider = gui.add_slider("at most", SLIDER_LOW, SLIDER_HIGH, 0.02, SLIDER_HIGH, marks=marks)
            self.count = gui.add_markdown("")
            self.size = gui.add_slider("size of points", 0.005, 0.3, 0.005, 0.05)
            self.classes_folder = gui.add_folder("classes", expand_by_default=False)
        self.classes: dict[int, Any] = {}
        with gui.add_folder("Point"):
            self.told = gui.add_markdown("Click a point.")
            self.crops = gui.add_image(np.zeros((4, 4, 3), np.uint8), visible=False)
        for control in (self.points, self.paint, self.slider, self.size):
            control.on_update(lambda _: redraw())
        self.clouds.on_update(lambda _: self.show_cloud(self.cloud_name))
        self.surfaces.on_update(lambda _: self._set_visible([self._stage_handle], bool(self.surfaces.value)))
        self.cameras.on_update(lambda _: self._set_visible(self._frusta, bool(self.cameras.value)))

    def _variant_changed(self, one: VariantSet, handle: Any) -> Callable[[Any], None]:
        return lambda _: self.choose_variant(one.prim, one.name, str(handle.value))

    def _list_classes(self, cloud: "Cloud") -> None:
        for box in self.classes.values():
            box.remove()
        counts = np.bincount(cloud.columns["segment"], minlength=256)
        names = {row.id: row.name for row in cloud.classes}
        with self.classes_folder:
            self.classes = {
                int(number): self.server.gui.add_checkbox(
                    f"{names.get(int(number), 'unlabelled')} ({counts[number]:,})", True
                )
                for number in np.flatnonzero(counts)
            }
        for box in self.classes.values():
            box.on_update(lambda _: self.refresh())

    def _show_surfaces(self, surfaces: Surfaces) -> None:
        count = len(surfaces.corners)
        mesh = trimesh.Trimesh(
            (surfaces.corners - self.origin).reshape(-1, 3), np.arange(3 * count).reshape(-1, 3), process=False
        )
        alpha = np.full((count, 1), 255, np.uint8)
        colors = np.hstack([surfaces.colors, alpha])
        mesh.visual = ColorVisuals(mesh, vertex_colors=np.repeat(colors, 3, axis=0))
        shown = bool(self.surfaces.value)
        self._stage_handle = self.server.scene.add_mesh_trimesh("/stage", mesh, visible=shown, cast_shadow=False)
        self.state.content = f"{count:,} triangles, in the mean colors of their materials"

    def _show_cameras(self, flight: Flight, capture: Capture) -> None:
        for frustum in self._frusta:
            frustum.remove()
        self._frusta = []
        every = max(-(-len(flight.names) // MOST_PICTURES), 1)
        steps = np.linalg.norm(np.diff(flight.poses[:, :3, 3], axis=0), axis=1)
        scale = float(np.clip(0.6 * np.median(steps), 0.2, 6.0)) if len(steps) else 1.0
        for number, (name, pose) in enumerate(zip(flight.names, flight.poses, strict=True)):
            file = capture.folder / capture.images[flight.rows[number]].file
            frustum = self.server.scene.add_camera_frustum(
                f"/cameras/{number:06d}",
                fov=float(2.0 * np.arctan(flight.half[1])),
                aspect=float(flight.half[0] / flight.half[1]),
                scale=scale,
                color=OK if flight.statuses[number] == "ok" else LOST,
                image=small_picture(file, PICTURE) if number % every == 0 else None,
                wxyz=rotation_quaternion(pose[:3, :3]),
                position=pose[:3, 3] - self.origin,
                visible=bool(self.cameras.value),
            )
            frustum.on_click(lambda _, row=number, name=name: self._tell_image(row, name, capture, flight))
            self._frusta.append(frustum)

    def _tell_image(self, row: int, name: str, capture: Capture, flight: Flight) -> None:
        from falsework.view.points import as_code

        with self._lock:
            self.told.content = f"**image** {as_code(name)}  \n**status** {as_code(flight.statuses[row])}"
            pixels = small_picture(capture.folder / capture.images[flight.rows[row]].file, 640)
            self.crops.visible = pixels is not None
            if pixels is not None:
                self.crops.image = pixels

    def _tell(self) -> None:
        """Show the facts of the selected point."""
        facts, shown = self.facts, self.shown
        self.told.content = "Click a point." if facts is None else facts.as_markdown()
        self.crops.visible = False
        if facts is None or shown is None:
            return
        place = np.array(facts.place) - self.origin
        scene = self.server.scene
        self._marks.append(scene.add_icosphere("/point", 1.6 * float(self.size.value), MARK, position=place))
        eyes = dict(zip(shown.flight.rows, shown.flight.poses[:, :3, 3] - self.origin, strict=True))
        rays = [[place, eyes[one.row]] for one in facts.sightings if one.row in eyes]
        if rays:
            self._marks.append(scene.add_line_segments("/rays", np.array(rays, np.float32), RAY, thickness=0.02))
        crops = [] if shown.capture is None else sighting_crops(shown.capture, facts)
        if crops:
            self.crops.image = np.hstack(crops)
            self.crops.visible = True

    def _first_place(self, surfaces: Surfaces | None) -> F64:
        """Choose the origin of drawn coordinates, so that single precision suffices [m]."""
        from recon.cloud import read_cloud

        for folder in self.subject.clouds.values():
            coord = read_cloud(folder).columns["coord"]
            if len(coord):
                return np.median(coord, axis=0)
        return np.zeros(3) if surfaces is None else np.median(surfaces.corners.reshape(-1, 3), axis=0)

    def _aim(self) -> None:
        """Aim the view at the bridge from beside and above."""
        span, middle = 40.0, np.zeros(3)
        if self.shown is not None and len(self.shown.cloud):
            columns = self.shown.cloud.columns
            mine = ~np.isin(columns["segment"], (0, 255))
            places = columns["coord"][mine if mine.any() else slice(None)] - self.origin
            low, high = np.percentile(places, [1, 99], axis=0)
            span, middle = float(np.linalg.norm(high - low)), 0.5 * (low + high)
        elif self._frusta:
            middle = np.mean([frustum.position for frustum in self._frusta], axis=0)
        camera = self.server.initial_camera
        camera.look_at = np.asarray(middle, np.float64)
        camera.position = np.asarray(middle + span * np.array([0.55, -0.75, 0.5]), np.float64)

    @staticmethod
    def _set_visible(handles: list[Any], visible: bool) -> None:
        for handle in handles:
            if handle is not None:
                handle.visible = visible


def sighting_crops(capture: Capture, facts: PointFacts) -> list[U8]:
    """Crop the first images around the pixel of a point, with a cross on it.

    Args:
        capture: Their capture.
        facts: The point.

    Returns:
        sRGB colors, shape (CROP, CROP, 3), uint8, each.
    """
    names = {image.name: row for row, image in enumerate(capture.images)}
    crops = []
    for one in [one for one in facts.sightings if one.image in names][:CROPS]:
        try:
            pixels = load_image(capture, names[one.image])
        except FalseworkError:
            continue
        x, y = (int(np.floor(value)) for value in one.pixel)
        half = CROP // 4  # enlarged twice
        padded = np.pad(pixels, ((half, half), (half, half), (0, 0)))
        x, y = (min(max(value, 0), most - 1) for value, most in ((x, pixels.shape[1]), (y, pixels.shape[0])))
        crop = np.repeat(np.repeat(padded[y : y + 2 * half, x : x + 2 * half], 2, axis=0), 2, axis=1).copy()
        middle = 2 * half
        cv2.drawMarker(crop, (middle, middle), MARK, cv2.MARKER_CROSS, 21, 1)
        crops.append(crop)
    return crops


def rotation_quaternion(rotation: F64) -> tuple[float, float, float, float]:
    """Convert a rotation to a unit quaternion.

    Args:
        rotation: Rotation [1], shape (3, 3), float64.

    Returns:
        w, x, y, z [1].
    """
    from scipy.spatial.transform import Rotation

    x, y, z, w = (float(value) for value in Rotation.from_matrix(rotation).as_quat())
    return w, x, y, z
