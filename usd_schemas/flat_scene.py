"""A composed stage as flat arrays for renderer and ray caster, without USD objects."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from usd_schemas.components import ClassRow
from usd_schemas.distortion import NO_DISTORTION, Distortion
from usd_schemas.flat_lights import Dome, SphereLight, Sun
from usd_schemas.pinhole import Pinhole, UsdLens

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
U32 = NDArray[np.uint32]
U8 = NDArray[np.uint8]

ALIKE = 2  # a value of `part_double_sided`
MOST_OCTAVES = 3  # of fine detail; each further one would cost the renderer a texture look-up per pixel


@dataclass(frozen=True)
class Geometry:
    """Every unique mesh, concatenated; a part is a run of triangles with one material.

    Attributes:
        positions: Mesh-local positions [stage units], shape (V, 3), float32.
        normals: Mesh-local unit normals [1], shape (V, 3), float32.
        st: First UV set [m], or [1] on foreign stages, shape (V, 2), float32, v upwards as in USD.
        st1: Second UV set, a 0 to 1 atlas [1], shape (V, 2), float32; zeros when absent.
        colors: Linear displayColor [1], shape (V, 3), float32; white when absent.
        triangles: Vertex numbers, shape (T, 3), uint32: counter-clockwise from outside in the mesh's own space, so that
            they run clockwise in the world where a draw's transform mirrors.
        part_first: First triangle of each part, shape (P,), int32.
        part_count: Number of triangles of each part, shape (P,), int32.
        part_double_sided: 1 where back faces are visible; `ALIKE` where both sides are lit alike, as for leaves,
            through which light passes (the stage does not state this); shape (P,), uint8.
    """

    positions: F32
    normals: F32
    st: F32
    st1: F32
    colors: F32
    triangles: U32
    part_first: I32
    part_count: I32
    part_double_sided: U8


@dataclass(frozen=True)
class Draws:
    """One row per visible part of each mesh instance.

    Attributes:
        part: Row in `Geometry.part_*`, shape (D,), int32.
        transform: Mesh-local stage units to world [m], Z up, for column vectors, shape (D, 4, 4), float64.
        material: Row in `FlatScene.materials`, shape (D,), int32.
        instance: Instance id, 0 where there is none, shape (D,), uint32.
        label: Class id, shape (D,), uint8.
    """

    part: I32
    transform: F64
    material: I32
    instance: U32
    label: U8


@dataclass(frozen=True)
class Texture:
    """A texture file.

    Attributes:
        file: Resolved path.
        srgb: Its values are sRGB-coded colors, not raw numbers.
        scale: Multiplier of (s, t) before the look-up [1], or [1/m] for `st` in meters.
        rotation: Counter-clockwise rotation of (s, t) [deg].
        translation: Added to (s, t) last [1].
        uv_set: 0 for `st`, 1 for `st1`.
        channel: Channel for a single number: 0 red, 1 green, 2 blue, 3 alpha.
        gain: Multiplier of linear red, green, blue [1]; for a single number the first is used.
        bias: Added after `gain` [1].
        wrap: Wrap mode along s and t: `repeat`, `mirror`, `clamp` or `black`.
        alpha: File of its opacity; empty if it is its own.
        alpha_channel: Channel of that file: 0 red, 1 green, 2 blue, 3 alpha.
        alpha_gain: Multiplier of that opacity [1].
        alpha_bias: Added after `alpha_gain` [1].
    """

    file: str
    srgb: bool
    scale: tuple[float, float] = (1.0, 1.0)
    rotation: float = 0.0
    translation: tuple[float, float] = (0.0, 0.0)
    uv_set: int = 0
    channel: int = 0
    gain: tuple[float, float, float] = (1.0, 1.0, 1.0)
    bias: tuple[float, float, float] = (0.0, 0.0, 0.0)
    wrap: tuple[str, str] = ("repeat", "repeat")
    alpha: str = ""
    alpha_channel: int = 3
    alpha_gain: float = 1.0
    alpha_bias: float = 0.0

    @property
    def is_plain(self) -> bool:
        """Whether its values are used without gain and bias."""
        return (self.gain, self.bias) == ((1.0, 1.0, 1.0), (0.0, 0.0, 0.0))


@dataclass(frozen=True)
class Detail:
    """Values of `FalseworkDetailAPI`: zero-mean multipliers of the base color.

    Attributes:
        file: Tileable gray texture, mean 0.5; empty for none.
        periods: Size of one tile of it for each octave [m], `MOST_OCTAVES` at most.
        amplitudes: Contrast of each octave [1]: the factor is 1 + amplitude * (2 g - 1).
        macro_file: RGB texture on `st1`, mean 0.5, multiplied as 2 g; empty for none.
    """

    file: str = ""
    periods: tuple[float, ...] = ()
    amplitudes: tuple[float, ...] = ()
    macro_file: str = ""


@dataclass(frozen=True)
class Material:
    """A material with the parameters of UsdPreviewSurface.

    Attributes:
        name: Prim path of the material, or a name for the fallback.
        base_color: Linear diffuse color, used without `base_texture` [1].
        use_display_color: Take the vertex color instead of `base_color`.
        base_texture: Diffuse color texture.
        roughness: Roughness, used without `roughness_texture` [1].
        roughness_texture: Roughness texture.
        metallic: Metallic, used without `metallic_texture` [1].
        metallic_texture: Metallic texture.
        normal_texture: Tangent-space normal map.
        emissive: Linear emitted color, used without `emissive_texture` [1].
        opacity_threshold: Fragments whose texture alpha is below are cut out; 0 for none [1].
        detail: Fine and macro detail.
        emissive_texture: Emitted color texture.
        specular: Linear specular color at normal incidence; None if it follows from `metallic` [1]. Black for surfaces
            without any shine.
        specular_texture: Its texture, of which the mean is used.
        opacity: Opacity of a blended surface [1]; it has no texture of its own.
        blends: Whether it is blended, by `opacity` or by the alpha of `base_texture`; in the truth it is opaque where
            that is 0.5 or more, and absent elsewhere.
    """

    name: str
    base_color: tuple[float, float, float] = (0.5, 0.5, 0.5)
    use_display_color: bool = False
    base_texture: Texture | None = None
    roughness: float = 0.7
    roughness_texture: Texture | None = None
    metallic: float = 0.0
    metallic_texture: Texture | None = None
    normal_texture: Texture | None = None
    emissive: tuple[float, float, float] = (0.0, 0.0, 0.0)
    opacity_threshold: float = 0.0
    detail: Detail = field(default_factory=Detail)
    emissive_texture: Texture | None = None
    specular: tuple[float, float, float] | None = None
    specular_texture: Texture | None = None
    opacity: float = 1.0
    blends: bool = False

    @property
    def is_matt(self) -> bool:
        """Whether it has no shine at all: its specular color is black."""
        return self.specular == (0.0, 0.0, 0.0) and self.specular_texture is None

    @property
    def is_mostly_transparent(self) -> bool:
        """Whether it is absent in the truth: its opacity is below 0.5."""
        return self.blends and self.opacity < 0.5 and not self.opacity_threshold

    def textures(self) -> list[Texture]:
        """List its textures, without those of its detail."""
        maps = (
            self.base_texture,
            self.roughness_texture,
            self.metallic_texture,
            self.normal_texture,
            self.emissive_texture,
            self.specular_texture,
        )
        return [texture for texture in maps if texture is not None]


@dataclass(frozen=True)
class CameraTrack:
    """A camera and its poses, one per image.

    Attributes:
        name: Survey id, or the camera's prim name.
        path: Prim path.
        lens: Lens attributes.
        poses: camera_to_world [m], Z up, camera axes right-down-forward, shape (N, 4, 4), float64.
        image_names: One stem per image, e.g. `000000`.
        calibration: Exact intrinsics if the stage states them; they override `lens` at their image size.
        sensor_width: Width of the sensor [m].
        near: Near clipping distance [m].
        gps: Measured local positions [m], shape (N, 3), float64, or None.
        gps_sigma: Standard deviation of `gps` along x, y, z [m].
        facts: Further JSON facts of the survey (kind, seed, spacing …).
        distortion: Distortion of the lens; none on a foreign stage.
        readout_time: Time from the first row of an image to its last [s]; 0 for a global shutter.
        make: Maker of the camera, or empty.
        model: Name of the camera, or empty.
        attitude: Measured yaw clockwise from +y, pitch and roll [deg], shape (N, 3), float64, or None.
        attitude_sigma: Standard deviation of `attitude` [deg].
        moments: Row in `FlatScene.moments` of each image; empty for a static scene.
    """

    name: str
    path: str
    lens: UsdLens
    poses: F64
    image_names: tuple[str, ...]
    calibration: Pinhole | None = None
    sensor_width: float = 0.036
    near: float = 0.1
    gps: F64 | None = None
    gps_sigma: tuple[float, float, float] = (0.0, 0.0, 0.0)
    facts: dict[str, object] = field(default_factory=dict)
    distortion: Distortion = NO_DISTORTION
    readout_time: float = 0.0
    make: str = ""
    model: str = ""
    attitude: F64 | None = None
    attitude_sigma: tuple[float, float, float] = (0.0, 0.0, 0.0)
    moments: tuple[int, ...] = ()


@dataclass(frozen=True)
class Product:
    """A RenderProduct: one camera at one resolution.

    Attributes:
        name: Survey id, or the product's prim name.
        camera: Row in `FlatScene.cameras`.
        width: Image width [px].
        height: Image height [px].
    """

    name: str
    camera: int
    width: int
    height: int


@dataclass(frozen=True)
class InstanceRow:
    """Meaning of one instance id.

    Attributes:
        id: Instance id, greater than 0.
        path: Path of its prim.
        component: Component kind; empty when unknown.
        class_name: Class name in the stage's table.
        parameters: JSON facts of the component, e.g. its dimensions.
        base_class: Class name in the base table, independent of the table in use; empty if unknown.
        moves: Whether its position, shape or existence changes between the moments of the scene.
    """

    id: int
    path: str
    component: str
    class_name: str
    parameters: dict[str, object] = field(default_factory=dict)
    base_class: str = ""
    moves: bool = False


@dataclass(frozen=True)
class FlatScene:
    """All data of a stage for rendering and ray casting.

    Attributes:
        geometry: Unique meshes.
        draws: Their visible instances.
        materials: Materials; row 0 is the fallback.
        sun: DistantLight, or None.
        dome: DomeLight, or None.
        cameras: Cameras with at least one pose.
        products: The products to render.
        instances: Instance ids in ascending order.
        classes: Class table of the stage.
        warnings: One line for each thing that could not be read as authored.
        origin: Hash of the composed stage content that was read.
        visibility: Distance at which haze leaves 2 % of the contrast [m]; None if the stage does not state it.
        sphere_lights: SphereLights and panels, in the order of the stage.
        moments: Draws of moving prims at each moment of an image; those of the first are the last rows of `draws`.
            Empty for a static stage.
    """

    geometry: Geometry
    draws: Draws
    materials: tuple[Material, ...]
    sun: Sun | None
    dome: Dome | None
    cameras: tuple[CameraTrack, ...]
    products: tuple[Product, ...]
    instances: tuple[InstanceRow, ...]
    classes: tuple[ClassRow, ...]
    warnings: tuple[str, ...]
    origin: str
    visibility: float | None = None
    sphere_lights: tuple[SphereLight, ...] = ()
    moments: tuple[Draws, ...] = ()

    def at_moment(self, number: int) -> "FlatScene":
        """Return the scene at one of its moments; a static scene is returned unchanged.

        Args:
            number: Row in `moments`.
        """
        if not self.moments:
            return self
        still = len(self.draws.part) - len(self.moments[0].part)
        moved = self.moments[number]
        draws = {name: np.concatenate([rows[:still], getattr(moved, name)]) for name, rows in vars(self.draws).items()}
        return replace(self, draws=Draws(**draws))


def without_mostly_transparent(scene: FlatScene) -> FlatScene:
    """Leave out draws with an opacity below a half, such as glass and smoke.

    Args:
        scene: A scene.
    """
    transparent_draws = np.array([material.is_mostly_transparent for material in scene.materials])[scene.draws.material]
    if not transparent_draws.any():
        return scene
    return replace(scene, draws=Draws(**{name: rows[~transparent_draws] for name, rows in vars(scene.draws).items()}))


def world_triangles(scene: FlatScene) -> tuple[F64, U32, U32]:
    """Expand every draw into world space; corners keep their order, so mirrored draws have reversed winding.

    Args:
        scene: Scene to expand.

    Returns:
        Corner positions [m], shape (T, 3, 3), float64; instance id per triangle, shape (T,), uint32; row in
        `scene.draws` per triangle, shape (T,), uint32.
    """
    corners, ids, rows = [np.zeros((0, 3, 3))], [np.zeros(0, np.uint32)], [np.zeros(0, np.uint32)]
    geometry, draws = scene.geometry, scene.draws
    for row, part in enumerate(draws.part):
        first, count = geometry.part_first[part], geometry.part_count[part]
        local = geometry.positions[geometry.triangles[first : first + count]].astype(np.float64)
        transform = draws.transform[row]
        corners.append(local @ transform[:3, :3].T + transform[:3, 3])
        ids.append(np.full(count, draws.instance[row], np.uint32))
        rows.append(np.full(count, row, np.uint32))
    return np.concatenate(corners), np.concatenate(ids), np.concatenate(rows)
