"""Draws views of an uploaded scene: photograph, ids and depth of one view come from the same samples."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import moderngl
import numpy as np
from numpy.typing import NDArray

from render.gpu.camera import clip_from_relative, visible_boxes
from render.gpu.context import Gl
from render.gpu.gpu_scene import GpuScene
from render.gpu.programs import Programs
from render.light.illumination import Lamps
from render.views.blending import Blending
from render.views.coverage_layer import CoverageLayer
from render.views.draw_calls import DrawCalls, Sight
from render.views.edges import smooth_edges
from render.views.mirror import Image, Mirror, look_up_uniforms
from render.views.targets import Targets, View
from usd_schemas.pinhole import Pinhole

_DRAW = np.uint32(2**27 - 1)  # bits of a draw's number; those above say how its face is turned, as in crease.glsl
MIRROR_UNIT = 14  # after those of light, materials, draws and ribbons
F64 = NDArray[np.float64]
I64 = NDArray[np.int64]


@dataclass(frozen=True)
class _Seen:
    """The draws that a view may show, each of shape (N,), int64."""

    opaque: I64
    thin: I64  # opaque, with bars that may be thinner than a pixel
    through: I64  # transparent


@dataclass(frozen=True)
class ViewOptions:
    """How views are drawn.

    Attributes:
        quality: `fast`, `standard` or `fine`.
        extra: `NORMALS` or `TRIANGLES` for one more exact image, or empty.
        finer: Resolution of the exact images as a multiple of the photograph's, along rows and columns.
        cards: Everything is drawn as a grey card.
    """

    quality: str
    extra: str = ""
    finer: int = 1
    cards: bool = False


class Painter:
    """Draws views of one scene at one size."""

    def __init__(
        self,
        gl: Gl,
        programs: Programs,
        gpu: GpuScene,
        lamps: Lamps,
        camera: Pinhole,
        options: ViewOptions,
    ) -> None:
        """Create the framebuffers.

        Args:
            gl: Open context.
            programs: Shader programs.
            gpu: Uploaded scene.
            lamps: Its lights.
            camera: Intrinsics of every view.
            options: How they are drawn.
        """
        quality, finer, cards = options.quality, options.finer, options.cards
        self._gl, self._programs, self._camera = gl, programs, camera
        self._targets = targets = Targets(gl, programs, camera, options.extra, finer, fine=quality == "fine")
        behind = targets.exact if quality == "fine" and finer == 1 else targets.shaded
        self._coverage_layer = CoverageLayer(gl, behind) if quality != "fast" else None
        self._calls = DrawCalls(gl, programs, gpu, lamps, (behind.width / 2, behind.height / 2))
        self._blending: Blending | None = None
        self._mirror = Mirror(gl, camera) if gpu.waters.any() and not cards else None
        self._image: Image | None = None
        self._creases = ("CREASES",) if quality != "fast" and not targets.apart else ()
        self._soft = (("SOFT",) if quality != "fast" else ()) + (("GREY_CARD",) if cards else ())
        self._aim_at(gpu, lamps)

    def _aim_at(self, gpu: GpuScene, lamps: Lamps) -> None:
        self._gpu, self._lamp_features = gpu, lamps.features
        self._features = (*lamps.features, *self._soft)
        if gpu.blended.any() and self._blending is None:
            shaded = self._targets.shaded
            self._blending = Blending(self._gl, self._programs, self._targets.color, shaded.depth_attachment)

    def move(self, gpu: GpuScene, lamps: Lamps) -> None:
        """Switch to another moment of the scene.

        Args:
            gpu: The scene, uploaded.
            lamps: Its lights.
        """
        self._calls.move(gpu, lamps)
        self._aim_at(gpu, lamps)

    def draw(self, camera_to_world: F64, near: float) -> View:
        """Draw one view.

        Args:
            camera_to_world: Camera pose [m], shape (4, 4), float64.
            near: Near plane [m].
        """
        return self.draw_bands(camera_to_world[None], [(0, self._camera.height)], near)

    def draw_bands(self, poses: F64, bands: Sequence[tuple[int, int]], near: float) -> View:
        """Draw one view whose rows were read out one band after the other while the camera moved.

        Args:
            poses: Camera pose of each band [m], shape (B, 4, 4), float64.
            bands: First row of each band and the row after its last; rows of no band stay empty.
            near: Near plane [m].
        """
        self._draw_mirrored(poses[len(poses) // 2], near)
        self._clear(0, self._camera.height)
        for pose, (first, end) in zip(poses, bands, strict=True):
            self._draw_band(pose, first, end, near)
        return self._read(0, self._camera.height)

    def draw_window(self, pose: F64, window: tuple[int, int], near: float) -> View:
        """Draw some rows of a view, and return only these.

        Args:
            pose: Camera pose [m], shape (4, 4), float64.
            window: First row, and the row after the last.
            near: Near plane [m].
        """
        first, end = window
        self._draw_mirrored(pose, near)
        self._clear(first, end)
        self._draw_band(pose, first, end, near)
        return self._read(first, end)

    def _clear(self, first: int, end: int) -> None:
        if self._coverage_layer is not None:
            self._coverage_layer.clear()
        self._targets.clear(first, end)

    def _draw_mirrored(self, pose: F64, near: float) -> None:
        if self._mirror is not None:
            self._image = self._mirror.draw(self._gpu, self._calls, pose, near, self._lamp_features)

    def _draw_band(self, pose: F64, first: int, end: int, near: float) -> None:
        gpu, camera, targets = self._gpu, self._camera, self._targets
        band = replace(camera, height=end - first, cy=camera.cy - first)
        rows = visible_boxes(gpu.lower, gpu.upper, band, pose)
        sight = Sight(camera, pose, near, clip_from_relative(camera, pose, near).T.tobytes())
        seen = self._sorted(rows, sight)
        if self._mirror is not None:
            self._mirror.texture.use(MIRROR_UNIT)
            self._calls.more = look_up_uniforms(self._image, sight.eye, gpu.anchor, MIRROR_UNIT)
        gpu.place(sight.eye)
        gpu.bind()
        self._draw_photograph(seen, sight, (targets.samples * first, targets.samples * end))
        exact = (targets.finer * first, targets.finer * end)
        if targets.apart or (len(seen.thin) and len(seen.through)):  # otherwise the pass of the photograph drew them
            targets.bind(targets.truth, *exact)
            self._calls.ids(np.concatenate([seen.opaque, seen.thin]), sight, targets.extra + self._creases)
        if self._coverage_layer is not None and len(seen.thin):
            self._draw_ribbons(self._coverage_layer, seen, sight, (first, end))
        if len(seen.through):  # last, because they are opaque in the truth and not in the photograph
            targets.bind(targets.truth, *exact)
            self._calls.ids(seen.through, sight, targets.extra)
        if "TRIANGLES" not in targets.extra:
            self._draw_facets((first, end), rows, sight)

    def _sorted(self, rows: I64, sight: Sight) -> _Seen:
        """Group draws by how the photograph shows them."""
        gpu = self._gpu
        blended = gpu.blended[rows]
        opaque, through = rows[~blended], rows[blended]
        if self._coverage_layer is None:
            return _Seen(opaque, rows[:0], through)
        focal = max(sight.camera.fx, sight.camera.fy)
        thin = gpu.ribbons.thin(opaque, gpu.lower, gpu.upper, sight.eye, focal)
        return _Seen(opaque[~thin], opaque[thin], through)

    def _draw_photograph(self, seen: _Seen, sight: Sight, span: tuple[int, int]) -> None:
        """Draw the photograph without ribbons; ids and depth are drawn with it unless they have a separate pass."""
        targets, calls = self._targets, self._calls
        extra = () if targets.apart else targets.extra + self._creases
        # The depth of large draws first: shading is then saved where they hide others. This does not change images: in
        # any order, a surface is drawn where nothing is nearer.
        large = calls.worth_hiding(seen.opaque, sight)
        if len(large):
            targets.bind(targets.nearest, *span)
            calls.depth(large, sight)
        targets.bind(targets.shaded, *span)
        calls.surfaces(seen.opaque, sight, self._features + extra)
        calls.sky(sight, () if targets.apart else targets.extra)
        if len(seen.thin):  # last: where they are thinner than a pixel, the surface behind them shows through
            self._gl.context.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
            self._gl.functions.blend_only(0)  # ids and depth are not blended
            panes = ("PANES",) if len(seen.through) else ()
            calls.surfaces(seen.thin, sight, self._features + extra + panes, "FADES")
        if len(seen.through) and self._blending is not None:
            self._blending.begin(span)
            calls.panes(seen.through, sight, self._features)
            self._blending.end(span)

    def _draw_ribbons(self, coverage_layer: CoverageLayer, seen: _Seen, sight: Sight, rows: tuple[int, int]) -> None:
        """Draw members thinner than a pixel, and transparent surfaces in front of them."""
        coverage_layer.bind(*rows, self._camera.height, panes=bool(len(seen.through)))
        self._calls.surfaces(self._gpu.ribbons.upwards(seen.thin), sight, self._features, "RIBBON")
        if len(seen.through):
            coverage_layer.open_panes()
            self._calls.panes(seen.through, sight, (*self._features, "VEILED"))

    def _draw_facets(self, span: tuple[int, int], rows: I64, sight: Sight) -> None:
        """Draw the depth of long thin triangles again, where they are visible."""
        visible = np.zeros(len(self._gpu.lower), bool)
        visible[rows] = True
        corners = self._gpu.facets.seen(visible, self._camera, span, sight.pose, sight.near, self._gpu.origins)
        if len(corners):
            self._targets.bind(self._targets.depth, *span)
            self._calls.facets(corners, sight)

    def _read(self, first: int, end: int) -> View:
        view = self._targets.read(first, end)
        if self._coverage_layer is not None:
            if not self._targets.apart:
                smooth_edges(view.code, view.draw, view.depth)
            self._coverage_layer.composite(view.code, first, end, self._camera.height)
        return replace(view, draw=view.draw & _DRAW) if self._creases else view
