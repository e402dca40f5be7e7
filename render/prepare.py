"""From a flat scene to something that draws views: textures, materials, light and buffers, made once per survey."""

from dataclasses import dataclass

from groundwork.progress import Progress
from render.context import Gl
from render.daylight import read_daylight
from render.gpu_scene import GpuScene, check_scene, draw_boxes, upload_scene
from render.illumination import Illumination
from render.light_volume import cast_light_volume
from render.materials import tabulate_materials, texture_keys
from render.passes import Painter
from render.programs import Programs
from render.region import region_of_interest
from render.settings import RenderSettings
from render.shadows import draw_shadows
from render.textures import load_textures
from usd_schemas.flat_scene import FlatScene
from usd_schemas.pinhole import Pinhole


@dataclass(frozen=True)
class Prepared:
    """A scene ready to draw.

    Attributes:
        gl: Open context.
        programs: Shader programs.
        gpu: Uploaded scene.
        light: What lights it.
        settings: How to draw it.
        warnings: One line for each thing that is drawn otherwise than authored.
    """

    gl: Gl
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
        quality = self.settings.quality
        if not sharp and quality == "fine":
            quality = "standard"
        return Painter(self.gl, self.programs, self.gpu, self.light, camera, quality, normals=self.settings.normals)


def prepare(gl: Gl, scene: FlatScene, settings: RenderSettings, progress: Progress) -> Prepared:
    """Upload a scene and light it.

    Args:
        gl: Open context.
        scene: What to draw.
        settings: How to draw it.
        progress: Told about the light volume.

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
        volume = cast_light_volume(
            scene, daylight, table.means, box, settings.volume_probes, settings.volume_rays, progress
        )
    light = Illumination(daylight, shadow, volume, settings.haze_distance)
    return Prepared(gl, programs, gpu, light, settings, (*scene.warnings, *warnings, *dark))
