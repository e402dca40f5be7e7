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
from render.views.edge_samples import EdgeSamples
from render.views.edges import pixels_at_edges, smooth_edges
from render.views.mirror import Image, Mirror, look_up_uniforms
from render.views.targets import Targets, View, mended
from usd_schemas.pinhole import Pinhole

_STEADY = ("STEADY",)  # a feature of shaders: they draw nothing where the rasterizer gives no depth
_DRAW = np.uint32(2**27 - 1)  # bits of a draw's number; those above say how its face is turned, as in crease.glsl
MIRROR_UNIT = 14  # after those of light, materials, draws and ribbons
F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
U8 = NDArray[np.uint8]
U16 = NDArray[np.uint16]


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
        cards: Everything is drawn as a gray card.
        edge_samples: Samples of the photograph in each pixel in which surfaces meet [1]; 0: edges are smoothed.
    """

    quality: str
    extra: str = ""
    finer: int = 1
    cards: bool = False
    edge_samples: int = 0


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
        sampled = options.edge_samples > 0
        self._edge_samples = EdgeSamples(gl, programs, camera, options.edge_samples) if sampled else None
        self._blending: Blending | None = None
        self._mirror = Mirror(gl, camera) if gpu.waters.any() and not cards else None
        self._image: Image | None = None
        self._creases = ("CREASES",) if quality != "fast" and finer == 1 and (sampled or not targets.apart) else ()
        flags = {"SOFT": quality != "fast", "GREY_CARD": cards, "SAMPLED": sampled}
        self._soft = tuple(name for name, is_set in flags.items() if is_set)
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
        return self._read((0, self._camera.height), poses, bands, near)

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
        return self._read(window, pose[None], [window], near)

    def _clear(self, first: int, end: int) -> None:
        if self._coverage_layer is not None:
            self._coverage_layer.clear()
        self._targets.clear(first, end)

    def _draw_mirrored(self, pose: F64, near: float) -> None:
        if self._mirror is not None:
            self._image = self._mirror.draw(self._gpu, self._calls, pose, near, self._lamp_features)

    def _draw_band(self, pose: F64, first: int, end: int, near: float, steady: tuple[str, ...] = ()) -> None:
        gpu, camera, targets = self._gpu, self._camera, self._targets
        band = replace(camera, height=end - first, cy=camera.cy - first)
        rows = visible_boxes(gpu.lower, gpu.upper, band, pose)
        sight = Sight(camera, pose, near, clip_from_relative(camera, pose, near).T.tobytes())
        seen = self._sorted(rows, sight)
        self._place(sight)
        self._draw_photograph(seen, sight, (targets.samples * first, targets.samples * end), steady)
        exact = (targets.finer * first, targets.finer * end)
        if targets.apart or (len(seen.thin) and len(seen.through)):  # otherwise the pass of the photograph drew them
            targets.bind(targets.truth, *exact)
            self._calls.ids(np.concatenate([seen.opaque, seen.thin]), sight, targets.extra + self._creases + steady)
        if self._coverage_layer is not None and len(seen.thin) and not steady:
            self._draw_ribbons(self._coverage_layer, seen, sight, (first, end))
        if len(seen.through):  # last, because they are opaque in the truth and not in the photograph
            targets.bind(targets.truth, *exact)
            self._calls.ids(seen.through, sight, targets.extra + steady)
        if "TRIANGLES" not in targets.extra:
            self._draw_facets((first, end), rows, sight)

    def _place(self, sight: Sight) -> None:
        """Prepare for drawing from a camera's place."""
        if self._mirror is not None:
            self._mirror.texture.use(MIRROR_UNIT)
            self._calls.more = look_up_uniforms(self._image, sight.eye, self._gpu.anchor, MIRROR_UNIT)
        self._gpu.place(sight.eye)
        self._gpu.bind()

    def _sorted(self, rows: I64, sight: Sight) -> _Seen:
        """Group draws by how the photograph shows them."""
        gpu = self._gpu
        blended = gpu.blended[rows]
        opaque, through = rows[~blended], rows[blended]
        if self._coverage_layer is None:
            return _Seen(opaque, rows[:0], through)
        focal = max(sight.camera.fx, sight.camera.fy)
        thin = gpu.ribbons.thin(opaque, gpu.lower, gpu.upper, sight.eye, focal, sampled=self._edge_samples is not None)
        return _Seen(opaque[~thin], opaque[thin], through)

    def _draw_photograph(self, seen: _Seen, sight: Sight, span: tuple[int, int], steady: tuple[str, ...]) -> None:
        """Draw the photograph without ribbons; ids and depth are drawn with it unless they have a separate pass."""
        targets, calls, features = self._targets, self._calls, self._features + steady
        extra = () if targets.apart else targets.extra + self._creases
        # The depth of large draws first: shading is then saved where they hide others. This does not change images: in
        # any order, a surface is drawn where nothing is nearer.
        large = calls.worth_hiding(seen.opaque, sight)
        if len(large) and not steady:
            targets.bind(targets.nearest, *span)
            calls.depth(large, sight)
        targets.bind(targets.shaded, *span)
        calls.surfaces(seen.opaque, sight, features + extra)
        calls.sky(sight, () if targets.apart else targets.extra)
        if len(seen.thin):  # last: where they are thinner than a pixel, the surface behind them shows through
            panes = ("PANES",) if len(seen.through) else ()
            self._fade_in(seen.thin, sight, steady + extra + panes)
        if len(seen.through) and self._blending is not None:
            self._blending.begin(span)
            calls.panes(seen.through, sight, features)
            self._blending.end(span)

    def _fade_in(self, thin: I64, sight: Sight, extra: tuple[str, ...]) -> None:
        """Draw surfaces that fade where they are thin."""
        self._gl.context.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
        self._gl.functions.blend_only(0)  # ids and depth are not blended
        self._calls.surfaces(thin, sight, self._features + extra, "FADES")

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

    def _read(self, rows: tuple[int, int], poses: F64, bands: Sequence[tuple[int, int]], near: float) -> View:
        """Read some rows, with edges and ribbons."""
        view = self._targets.read(*rows)
        if not (view.depth > 0.0).all():
            view = self._mended(view, rows, poses, bands, near)
        if self._edge_samples is not None:
            self._take_samples(self._edge_samples, view, rows[0], poses, bands, near)
        if self._coverage_layer is not None:
            if self._edge_samples is None:
                self._smooth(view)
            self._coverage_layer.composite(view.code, *rows, self._camera.height)
        return replace(view, draw=view.draw & _DRAW) if self._creases else view

    def _mended(
        self, view: View, rows: tuple[int, int], poses: F64, bands: Sequence[tuple[int, int]], near: float
    ) -> View:
        """Draw the pixels without a depth again, without what the rasterizer gives none.

        The area on the image of a triangle that is seen edge-on may be so small that its depth is no number; such a
        triangle lies before all others. To leave it out in every view would cost some percent of the time.
        """
        self._targets.clear(*rows)
        for pose, (first, end) in zip(poses, bands, strict=True):
            self._draw_band(pose, first, end, near, _STEADY)
        return mended(view, self._targets.read(*rows))

    def _smooth(self, view: View) -> None:
        """Smooth the edges of a photograph with one sample, in place."""
        if not self._targets.apart:
            smooth_edges(view.code, view.draw, view.depth)
        elif view.middle is not None:
            from render.views.finer_edges import smooth_finer_edges

            smooth_finer_edges(view.code, view.middle, view.draw)

    def _wanted(self, view: View, top: int) -> U8:
        """Choose the pixels of a view, whose first row is `top`, that get samples."""
        leaves = np.concatenate([[False], self._gpu.cut_out & ~self._gpu.blended])
        if self._targets.finer > 1:
            from render.views.finer_edges import mixed_pixels

            wanted = mixed_pixels(view.draw, self._targets.finer, leaves)
        else:
            wanted = pixels_at_edges(view.draw, view.depth, leaves[view.draw & _DRAW])
        if self._coverage_layer is not None:
            wanted |= self._coverage_layer.covered(top, top + len(wanted), self._camera.height)
        return wanted

    def _take_samples(
        self, samples: EdgeSamples, view: View, top: int, poses: F64, bands: Sequence[tuple[int, int]], near: float
    ) -> None:
        """Replace the light of pixels that may show several surfaces by the mean of more samples, in place."""
        wanted = self._wanted(view, top)
        for pose, (first, end) in zip(poses, bands, strict=True):
            for start in range(first, end, samples.rows):
                rows = slice(start - top, min(start + samples.rows, end) - top)
                self._draw_samples(samples, view.code[rows], wanted[rows], start, pose, near)

    def _draw_samples(self, samples: EdgeSamples, code: U16, wanted: U8, first: int, pose: F64, near: float) -> None:
        if not wanted.any():
            return
        gpu, camera, calls, rows = self._gpu, self._camera, self._calls, len(wanted)
        seen = visible_boxes(gpu.lower, gpu.upper, replace(camera, height=rows, cy=camera.cy - first), pose)
        turn, projection = np.eye(4), samples.projection(first, near)
        turn[:3, :3] = pose[:3, :3].T
        clip = (projection @ turn).astype(np.float32).T.tobytes()
        sight = Sight(camera, pose, near, clip, projection=projection, pixels=samples.pixels)
        drawn, features = self._sorted(seen, sight), samples.lattice.features
        self._place(sight)
        samples.begin(wanted)
        calls.cut_depth(drawn.opaque, sight, features)
        samples.bind(samples.shaded, rows, keep_depth=True)  # what is hidden or blocked is not shaded, leaves included
        calls.surfaces(drawn.opaque, sight, self._features + features)
        samples.bind(samples.shaded, rows)
        calls.sky(sight, features)
        if len(drawn.thin):
            self._fade_in(drawn.thin, sight, features + (("PANES",) if len(drawn.through) else ()))
        if len(drawn.through):
            samples.open_panes(rows)
            calls.panes(drawn.through, sight, self._features + features)
        samples.end(code, wanted)
