"""The camera of a survey: draws a frame at its moment of the scene, and with its lens."""

from collections.abc import Callable

from render.capture import Readout
from render.views.passes import Painter
from render.views.prepare import Prepared
from render.views.targets import View
from usd_schemas.flat_scene import CameraTrack, FlatScene
from usd_schemas.pinhole import Pinhole

Shot = Callable[[], View]


class CameraBody:
    """Draws frames of one survey.

    Attributes:
        widest: Intrinsics of the drawn views.
        prepared: The scene at the current moment.
    """

    def __init__(
        self, track: CameraTrack, camera: Pinhole, readout: Readout | None, prepared: Prepared, scene: FlatScene
    ) -> None:
        """Create the framebuffers.

        Args:
            track: Camera and poses.
            camera: Intrinsics of its images.
            readout: When rows are read out; None for a global shutter.
            prepared: The scene, ready to draw.
            scene: The scene with its meshes.
        """
        self._track, self._camera = track, camera
        self._bands = readout.bands if readout is not None else ((0, camera.height),)
        self._poses = readout.poses if readout is not None else track.poses[:, None]
        self._scene = scene if scene.moments else None  # otherwise its meshes are freed
        self._lens, self._first, self._moment = None, prepared, -1 if scene.moments else 0
        self.prepared, self.widest = prepared, camera
        self._painter: Painter
        if track.distortion.is_identity:
            self._painter = prepared.painter(camera, sharp=True)
        else:
            self._lens, self._painter = prepared.lens(scene, camera, track.distortion)
            self.widest = self._lens.wide

    def moment(self, row: int) -> int:
        """Return the moment of the scene that a frame shows.

        Args:
            row: Number of the frame.
        """
        return self._track.moments[row] if self._scene is not None and self._track.moments else 0

    def move(self, row: int) -> None:
        """Set the scene to the moment of a frame.

        Args:
            row: Number of the frame.
        """
        if self._scene is None or self.moment(row) == self._moment:
            return
        self._moment = self.moment(row)
        scene, former = self._scene.at_moment(self._moment), self.prepared
        self.prepared = self._first.moved(scene)
        self._painter.move(self.prepared.gpu, self.prepared.lamps)
        if former is not self._first:
            former.release_moment()
        if self._lens is not None:
            self._lens = self._lens.meeting(self.prepared.ray_geometry(scene))

    def shoot(self, row: int) -> Shot:
        """Draw a frame now, and return a function for its view, which another thread may call once.

        It keeps no reference to the view afterwards, because a thread pool holds its arguments until after the next
        frame is begun.

        Args:
            row: Number of the frame.
        """
        track, poses, bands, lens = self._track, self._poses[row], self._bands, self._lens
        if lens is None:
            return [self._painter.draw_bands(poses, bands, track.near)].pop
        windows = [lens.window(band) for band in bands]
        views = [
            self._painter.draw_window(pose, window, track.near) for pose, window in zip(poses, windows, strict=True)
        ]

        def look() -> View:
            return lens.look([views.pop(0) for _ in bands], poses, bands, track.near)

        return look
