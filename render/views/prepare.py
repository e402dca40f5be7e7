"""Preparation of a scene for drawing: textures, materials, light and buffers, once per survey."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from groundwork.progress import Progress
from render.gpu.bars import Bars, find_bars
from render.gpu.context import Gl
from render.gpu.facets import find_facets
from render.gpu.gpu_scene import GpuScene, check_scene, draw_boxes, upload_scene
from render.gpu.materials import channel_pairs, tabulate_materials, texture_keys
from render.gpu.programs import Programs
from render.gpu.textures import TextureKey, load_textures, sufficient_side
from render.gpu.waters import with_waters
from render.light.daylight import Daylight, read_daylight
from render.light.illumination import Illumination, Lamps, haze_distance
from render.light.light_level import dimmed, exposure_stops
from render.light.light_volume import LightVolume, Sampling, cast_light_volume
from render.light.local_lights import choose_local_lights
from render.light.region import region_of_interest
from render.light.shadow_squares import ShadowSquares
from render.light.shadows import Shadows
from render.settings import RenderSettings
from render.views.passes import Painter, ViewOptions
from usd_schemas.distortion import Distortion
from usd_schemas.flat_scene import FlatScene
from usd_schemas.pinhole import Pinhole

if TYPE_CHECKING:
    from render.views.lens import Geometry, Lens  # numba takes long to load, and most lenses have no distortion

F64 = NDArray[np.float64]

CastVolume = Callable[..., LightVolume]


@dataclass(frozen=True)
class Prepared:
    """A scene ready to draw.

    Attributes:
        gl: Open context.
        programs: Shader programs.
        gpu: Uploaded scene.
        lamps: What lights it.
        settings: How to draw it.
        warnings: One line for each thing that is not drawn as authored.
        light: Its illumination, as prepared.
        box: Lower and upper corner of the region of interest [m], each of shape (3,), float64.
        flight: Centers of all cameras [m], shape (N, 3), float64, and the largest distance of one from its stated
            position [m]; None for any.
    """

    gl: Gl
    programs: Programs
    gpu: GpuScene
    lamps: Lamps
    settings: RenderSettings
    warnings: tuple[str, ...]
    light: Illumination
    box: tuple[F64, F64]
    flight: tuple[F64, float] | None

    def moved(self, scene: FlatScene) -> "Prepared":
        """Return the scene at another of its moments; the light volume stays that of the first.

        Args:
            scene: The scene at that moment.
        """
        facets = find_facets(scene, self.gpu.anchor)
        gpu = self.gpu.moved(self.gl.context, scene, facets.near(*self.flight) if self.flight is not None else facets)
        if self.lamps.shadow is None:
            return replace(self, gpu=gpu)
        daylight, size = self.light.daylight, self.settings.shadow_size
        shadow = Shadows(self.gl, self.programs, gpu, daylight, self.box, size)
        return replace(self, gpu=gpu, lamps=self.lamps.shaded_by(shadow))

    def release_moment(self) -> None:
        """Release the buffers of `moved`."""
        self.gpu.release_places()
        if self.lamps.shadow is not None:
            self.lamps.shadow.release()

    def painter(self, camera: Pinhole, *, sharp: bool, cards: bool = False) -> Painter:
        """Create a painter for views of one size.

        Args:
            camera: Intrinsics of every view.
            sharp: Draw with the settings' quality; else with one sample per pixel, which is enough for metering.
            cards: Draw everything as gray cards, which show the incident light.
        """
        quality, extra = self.settings.quality, "NORMALS" if self.settings.normals else ""
        if not sharp:
            quality, extra = "standard" if quality == "fine" else quality, ""
        options = ViewOptions(quality, extra, cards=cards, edge_samples=self.settings.samples_on_edges if sharp else 0)
        return Painter(self.gl, self.programs, self.gpu, self.lamps, camera, options)

    def shadow_squares(self, poses: NDArray[np.float64], camera: Pinhole) -> ShadowSquares:
        """Choose the squares in which the cameras of a survey need sharp shadows.

        Args:
            poses: camera_to_world [m], shape (N, 4, 4), float64.
            camera: Intrinsics of every view.
        """
        if self.lamps.shadow is None:
            return ShadowSquares(np.zeros((1, 2)), np.zeros(len(poses), np.int64))
        return self.lamps.shadow.squares(poses, camera)

    def sharpen_shadows(self, squares: ShadowSquares, row: int) -> None:
        """Draw the sharp shadow map that a camera needs, unless it is already drawn.

        Args:
            squares: The squares of the survey.
            row: Number of the camera.
        """
        if self.lamps.shadow is not None:
            self.lamps.shadow.sharpen(squares.centers[squares.of_pose[row]])

    def lens(self, scene: FlatScene, camera: Pinhole, distortion: Distortion) -> "tuple[Lens, Painter]":
        """Create a lens with distortion, and a painter for its wider views.

        Args:
            scene: The scene that was prepared.
            camera: Intrinsics of every view.
            distortion: Distortion of the lens.

        Returns:
            The lens, and the painter of its wider views.
        """
        from render.views.lens import Lens

        lens = Lens(camera, distortion, self.ray_geometry(scene), normals=self.settings.normals)
        samples = self.settings.samples_on_edges
        options = ViewOptions(self.settings.quality, "TRIANGLES", lens.finer, edge_samples=samples)
        return lens, Painter(self.gl, self.programs, self.gpu, self.lamps, lens.wide, options)

    def ray_geometry(self, scene: FlatScene) -> "Geometry":
        """Convert the scene for the rays of a lens with distortion.

        Args:
            scene: The scene that was prepared, or moved to.
        """
        from render.views.lens import ray_geometry

        return ray_geometry(scene, self.gpu.cut_out)


def prepare(
    gl: Gl,
    scene: FlatScene,
    settings: RenderSettings,
    progress: Progress,
    *,
    cast: CastVolume = cast_light_volume,
    needs: Mapping[TextureKey, float] | None = None,
    flight: tuple[NDArray[np.float64], float] | None = None,
    bars: Bars | None = None,
) -> Prepared:
    """Upload a scene and compute its light.

    Args:
        gl: Open context.
        scene: What to draw.
        settings: How to draw it.
        progress: Listener for the light volume.
        cast: Casts the light volume, or loads one that was cast before.
        needs: Least width of a pixel in widths of each texture [1]; None for every texel.
        flight: Centers of all cameras that will be drawn [m], shape (N, 3), float64, and the largest distance from
            its stated position [m]; None for cameras anywhere.
        bars: Members that may be thinner than a pixel; found here when not given.

    Raises:
        InputError: The scene holds nothing to draw, or numbers that cannot be drawn.
    """
    check_scene(scene)
    box = _interest(scene)
    scene, daylight, dark = _drawable_light(scene, box)
    slots, warnings = load_textures(
        gl,
        *texture_keys(scene.materials, settings.quality),
        settings.texture_side,
        gl.driver.anisotropy(),
        enough=lambda key, side: sufficient_side(side, needs.get(key, 0.0) if needs else 0.0),
        packable=channel_pairs(scene.materials),
    )
    table = tabulate_materials(scene.materials, slots, settings.quality)
    table = with_waters(table, scene, *draw_boxes(scene))
    anchor = (box[0] + box[1]) / 2
    facets = find_facets(scene, anchor)
    if flight is not None:  # same name: facets far from all cameras are freed before the upload
        facets = facets.near(*flight)
    gpu = upload_scene(gl, scene, table, anchor, facets, bars if bars is not None else find_bars(scene))
    programs = Programs(gl.context)
    sunny = bool(daylight.sun_irradiance.any())
    shadow = Shadows(gl, programs, gpu, daylight, box, settings.shadow_size) if sunny else None
    volume = None
    if settings.quality != "fast":
        volume = cast(
            scene, daylight, table.means, box, Sampling(settings.volume_probes, settings.volume_rays), progress
        )
    local, unlit = choose_local_lights(scene, box)
    light = Illumination(daylight, shadow, volume, haze_distance(scene, settings), local)
    lamps = Lamps(gl.context, light, gpu.anchor)
    said = (*scene.warnings, *warnings, *dark, *unlit)
    return Prepared(gl, programs, gpu, lamps, settings, said, light, box, flight)


def _drawable_light(scene: FlatScene, box: tuple[F64, F64]) -> tuple[FlatScene, Daylight, list[str]]:
    """Read sun and sky, with the scene dimmed if its light is too strong, and warnings about them."""
    daylight, said = read_daylight(scene)
    times = exposure_stops(scene, daylight, box)
    if not times:
        return scene, daylight, said
    said = [
        *said,
        f"the light of the stage is drawn at 2^{-times} of its strength; it has no unit, so only the exposure changes",
    ]
    scene = dimmed(scene, times)
    return scene, read_daylight(scene)[0], said


def _interest(scene: FlatScene) -> tuple[F64, F64]:
    """Compute the region of interest over all moments."""
    boxes = []
    for number in range(len(scene.moments) or 1):
        moment = scene.at_moment(number)
        boxes.append(region_of_interest(moment, *draw_boxes(moment)))
    low, high = zip(*boxes, strict=True)
    return np.min(low, axis=0), np.max(high, axis=0)
