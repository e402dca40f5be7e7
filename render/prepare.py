"""From a flat scene to something that draws views: textures, materials, light and buffers, made once per survey."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from groundwork.progress import Progress
from render.context import Gl
from render.daylight import read_daylight
from render.gpu_scene import GpuScene, check_scene, draw_boxes, upload_scene
from render.illumination import Illumination, haze_distance
from render.light_volume import LightVolume, cast_light_volume
from render.materials import tabulate_materials, texture_keys
from render.passes import Painter
from render.programs import Programs
from render.region import region_of_interest
from render.settings import RenderSettings
from render.shadows import draw_shadows
from render.textures import load_textures
from usd_schemas.distortion import Distortion
from usd_schemas.flat_scene import FlatScene
from usd_schemas.pinhole import Pinhole

if TYPE_CHECKING:
    from render.lens import Lens  # numba takes long to load, and most lenses do not distort

CastVolume = Callable[..., LightVolume]


@dataclass(frozen=True)
class Prepared:
    """A scene ready to draw.

    Attributes:
        gl: Open context.
        scene: What is drawn.
        programs: Shader programs.
        gpu: Uploaded scene.
        light: What lights it.
        settings: How to draw it.
        warnings: One line for each thing that is drawn otherwise than authored.
    """

    gl: Gl
    scene: FlatScene
    programs: Programs
    gpu: GpuScene
    light: Illumination
    settings: RenderSettings
    warnings: tuple[str, ...]

    def painter(self, camera: Pinhole, *, sharp: bool) -> Painter:
        """Make what draws views of one size.

        Args:
            camera: Intrinsics of every view.
            sharp: Draw as the settings say; else with one sample a pixel, which is enough for metering.
        """
        quality, extra = self.settings.quality, "NORMALS" if self.settings.normals else ""
        if not sharp:
            quality, extra = "standard" if quality == "fine" else quality, ""
        return Painter(self.gl, self.programs, self.gpu, self.light, camera, quality, extra)

    def lens(self, camera: Pinhole, distortion: Distortion) -> "tuple[Lens, Painter]":
        """Make what draws views through a lens that distorts.

        Args:
            camera: Intrinsics of every view.
            distortion: Distortion of the lens.

        Returns:
            The lens, and what draws the wider views that it looks at.
        """
        from render.lens import FINER, Lens, ray_geometry

        cut_out = np.array(["CUT_OUT" in variant.features for variant in self.gpu.variants])[self.gpu.variant_rows]
        lens = Lens(camera, distortion, ray_geometry(self.scene, cut_out), normals=self.settings.normals)
        light, quality = self.light, self.settings.quality
        return lens, Painter(self.gl, self.programs, self.gpu, light, lens.wide, quality, "TRIANGLES", FINER)


def prepare(
    gl: Gl, scene: FlatScene, settings: RenderSettings, progress: Progress, cast: CastVolume = cast_light_volume
) -> Prepared:
    """Upload a scene and light it.

    Args:
        gl: Open context.
        scene: What to draw.
        settings: How to draw it.
        progress: Told about the light volume.
        cast: Casts the light volume, or finds the one that was cast before.

    Raises:
        InputError: The scene holds nothing to draw, or numbers that cannot be drawn.
    """
    check_scene(scene)
    slots, warnings = load_textures(
        gl.context, texture_keys(scene.materials), settings.texture_side, gl.driver.anisotropy()
    )
    table = tabulate_materials(scene.materials, slots, settings.quality)
    lower, upper = draw_boxes(scene)
    box = region_of_interest(scene, lower, upper)
    gpu = upload_scene(gl.context, scene, table, (box[0] + box[1]) / 2)
    programs = Programs(gl.context)
    daylight, dark = read_daylight(scene)
    sunny = bool(daylight.sun_irradiance.any())
    shadow = draw_shadows(gl.context, programs, gpu, daylight, box, settings.shadow_size) if sunny else None
    volume = None
    if settings.quality != "fast":
        volume = cast(scene, daylight, table.means, box, settings.volume_probes, settings.volume_rays, progress)
    light = Illumination(daylight, shadow, volume, haze_distance(scene, settings))
    return Prepared(gl, scene, programs, gpu, light, settings, (*scene.warnings, *warnings, *dark))
