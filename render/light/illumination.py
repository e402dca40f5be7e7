"""The illumination of a scene, and its upload to the shaders."""

from copy import copy
from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from render.gpu.programs import set_uniform
from render.light.daylight import Daylight
from render.light.half_axes import MEAN
from render.light.light_volume import LightVolume
from render.light.local_lights import LocalLights
from render.light.shadows import Shadows
from render.light.surface_fit import AHEAD
from render.settings import ShadingSettings
from usd_schemas.flat_scene import FlatScene

F64 = NDArray[np.float64]

CLEAR_DAY = 6000.0  # default distance at which haze removes 63 % of the contrast [m]
LEAST_CONTRAST = 0.02  # contrast that is left at the visibility [1]
BRIGHTEST = 16.0  # largest radiance of a pixel's 16-bit code
_MOST_RADIANCE = 6.0e4  # of the panorama: half floats end at 65,504, and an infinite texel spreads over the mipmaps
_AIR = 1.16e-5  # extinction of green by air alone [1/m]
_BY_AIR, _BY_HAZE = np.array([0.656, 1.0, 1.98]), np.array([0.874, 1.0, 1.244])  # of 610, 550 and 465 nm [1]
_SHADOW_UNIT, _VOLUME_UNIT, _PANORAMA_UNIT, FIRST_FREE_UNIT = 0, 1, 4, 5


@dataclass(frozen=True)
class Illumination:
    """The illumination of a scene.

    Attributes:
        daylight: Sun and sky.
        shadow: The sun's shadow maps, or None without a sun.
        volume: The light volume, or None.
        haze_distance: Distance at which haze removes 63 % of the contrast [m].
        local: Lamps in the scene.
    """

    daylight: Daylight
    shadow: Shadows | None
    volume: LightVolume | None
    haze_distance: float
    local: LocalLights

    def features(self) -> tuple[str, ...]:
        """List the features of the surface shader."""
        sun, volume = self.shadow is not None, self.volume is not None
        return (*(("SUN",) if sun else ()), *(("VOLUME",) if volume else ()), *self.local.features())


def haze_distance(scene: FlatScene, settings: ShadingSettings) -> float:
    """Find the distance at which haze removes 63 % of the contrast [m]: from the settings, else the stage.

    Source: Koschmieder, Theorie der horizontalen Sichtweite, 1924: contrast falls with exp(-3.912 distance /
    visibility), to 2 % at the visibility.

    Args:
        scene: The scene.
        settings: How it is drawn.
    """
    if settings.haze_distance is not None:
        return settings.haze_distance
    return scene.visibility / -np.log(LEAST_CONTRAST) if scene.visibility is not None else CLEAR_DAY


class Lamps:
    """The light of a scene as textures and uniforms.

    Attributes:
        features: Features of the surface shader.
        shadow: The sun's shadow maps, or None without a sun.
    """

    def __init__(self, context: moderngl.Context, light: Illumination, anchor: F64) -> None:
        """Upload the light.

        Args:
            context: Open context.
            light: The illumination of the scene.
            anchor: Origin of positions in the shading [m], shape (3,), float64.
        """
        self.features, self.shadow = light.features(), light.shadow
        panorama = np.minimum(light.daylight.panorama, _MOST_RADIANCE).astype(np.float16)
        self._panorama = context.texture(panorama.shape[1::-1], 3, panorama.tobytes(), dtype="f2")
        self._panorama.build_mipmaps()
        self._panorama.repeat_y = False
        self._volume = _volume_textures(context, light.volume) if light.volume is not None else []
        self._values = _uniforms(light, anchor)

    def shaded_by(self, shadow: Shadows) -> "Lamps":
        """Return the same light with the shadows of another moment.

        Args:
            shadow: The sun's shadow maps.
        """
        other = copy(self)
        other.shadow, other._values = shadow, {**self._values, **shadow.uniforms()}
        return other

    def shine_on(self, program: moderngl.Program) -> None:
        """Set a program's uniforms, and bind its textures.

        Args:
            program: Compiled program.
        """
        self._panorama.use(_PANORAMA_UNIT)
        if self.shadow is not None:
            self.shadow.texture.use(_SHADOW_UNIT)
        for unit, texture in enumerate(self._volume, _VOLUME_UNIT):
            texture.use(unit)
        for name, value in self._values.items():
            set_uniform(program, name, value)

    def aim(self, program: moderngl.Program, eye: F64) -> None:
        """Set a program's uniforms of the camera position and of the sharp shadow map.

        Args:
            program: Compiled program.
            eye: Camera center, counted from the anchor [m], shape (3,), float64.
        """
        set_uniform(program, "eye", tuple(eye.tolist()))
        if self.shadow is not None:
            for name, value in self.shadow.seen_from(eye).items():
                set_uniform(program, name, value)


def _extinction(distance: float) -> F64:
    """Compute the extinction of air for red, green and blue [1/m], shape (3,).

    Source: Rayleigh 1871 and Angstrom 1929, as in `authoring.light.sun`: air by the fourth power of the wave number,
    haze by its power of 1.3.

    Args:
        distance: Distance at which haze removes 63 % of the contrast of green [m].
    """
    air = min(_AIR, 1.0 / distance)
    return air * _BY_AIR + (1.0 / distance - air) * _BY_HAZE


def _volume_textures(context: moderngl.Context, volume: LightVolume) -> list[moderngl.Texture3D]:
    """Upload one texture per axis: its lower half holds light along the axis, its upper half against it.

    The fourth channels of the three are red, green and blue of the mean.
    """
    coefficients = volume.coefficients.astype(np.float32)  # float16 would take a CPU longer to read
    textures = []
    for axis in range(3):
        mean = coefficients[..., MEAN, axis, None]
        halves = [np.concatenate([coefficients[..., 2 * axis + side, :], mean], axis=-1) for side in range(2)]
        both = np.concatenate(halves)
        texture = context.texture3d(both.shape[2::-1], 4, both.tobytes(), dtype="f4")
        texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
        texture.repeat_x = texture.repeat_y = texture.repeat_z = False
        textures.append(texture)
    return textures


def _uniforms(light: Illumination, anchor: F64) -> dict[str, object]:
    daylight = light.daylight
    values: dict[str, object] = {
        "to_sun": tuple(daylight.sun_direction.tolist()),
        "sun_irradiance": tuple(daylight.sun_irradiance.tolist()),
        "open_sky": daylight.open_sky.astype(np.float32).tobytes(),
        "haze": daylight.haze.astype(np.float32).tobytes(),
        "haze_density": tuple((_extinction(light.haze_distance) / np.log(2.0)).tolist()),  # for powers of two
        "code_scale": 1.0 / BRIGHTEST,
        "panorama": _PANORAMA_UNIT,
        "dome_from_world": daylight.dome_from_world.T.astype(np.float32).tobytes(),
    }
    if light.shadow is not None:
        values |= {"shadow_map": _SHADOW_UNIT, **light.shadow.uniforms()}
    if light.volume is not None:
        cell, counts = light.volume.cell, np.array(light.volume.coefficients.shape[2::-1])
        values |= {
            "volume_x": _VOLUME_UNIT,
            "volume_y": _VOLUME_UNIT + 1,
            "volume_z": _VOLUME_UNIT + 2,
            "volume_lower": tuple((light.volume.lower - cell / 2 - anchor).tolist()),
            "volume_scale": tuple((1.0 / (cell * counts)).tolist()),
            "volume_cell": cell,
            "volume_ahead": AHEAD * cell,
        }
    return values | light.local.uniforms(anchor)
