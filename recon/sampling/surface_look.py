"""The unlit color of a surface at points: vertex color, constant or texel, with fine and macro detail."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from groundwork.errors import InputError
from groundwork.foreign_file import check_regular
from recon.sampling.scene_surface import SceneSurface
from usd_schemas.flat_scene import MOST_OCTAVES, FlatScene, Material, Texture
from usd_schemas.texels import linear_to_srgb, opacity, placed, srgb_to_linear

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
U8 = NDArray[np.uint8]

LARGEST = 1024  # [px] a larger texture is reduced to this side: a few texels per centimeter are enough for a point
_BRIGHTEST = 0.95  # as in the renderer: largest reflectance
_CHUNK = 500_000  # points looked up at once


class SurfaceLook:
    """Looks up colors; a texture is read once, when first needed."""

    def __init__(self, scene: FlatScene, surface: SceneSurface) -> None:
        """Prepare the lookup for a scene.

        Args:
            scene: A composed stage.
            surface: Its surface.
        """
        self._geometry = scene.geometry
        self._materials = scene.materials
        self._material_of = scene.draws.material.astype(np.int64)[surface.draws]
        self._vertices = surface.vertices
        self._texels: dict[str, U8 | None] = {}
        self.unread: tuple[str, ...] = ()  # unreadable textures
        self.has_holes = any(
            material.opacity_threshold > 0 and material.base_texture is not None for material in scene.materials
        )

    def at(self, rows: I64, barycentric: F64) -> tuple[F32, NDArray[np.bool_]]:
        """Look up the base color.

        Args:
            rows: Triangles, shape (N,), int64.
            barycentric: Positions in them [1], shape (N, 3), float64.

        Returns:
            Linear colors [1], shape (N, 3), float32, and whether there is a surface at all where a texture cuts
            holes, shape (N,), bool.
        """
        colors, solid = np.empty((len(rows), 3), np.float32), np.ones(len(rows), bool)
        for begin in range(0, len(rows), _CHUNK):
            material = self._material_of[rows[begin : begin + _CHUNK]]
            order = np.argsort(material, kind="stable")
            first = np.searchsorted(material[order], np.arange(len(self._materials) + 1))
            for number in np.unique(material):
                at = begin + order[first[number] : first[number + 1]]
                vertices = self._vertices[rows[at]]
                colors[at], solid[at] = self._look_up(self._materials[number], vertices, barycentric[at])
        return colors, solid

    def _look_up(self, material: Material, vertices: NDArray[np.uint32], weights: F64) -> tuple[F32, Any]:
        def blend(values: F32) -> F64:
            return np.einsum("nk,nki->ni", weights, values[vertices])

        st, st1 = blend(self._geometry.st), blend(self._geometry.st1)
        solid: Any = True
        texels = self._read(material.base_texture)
        if texels is not None and material.base_texture is not None:
            place = placed(material.base_texture, st1 if material.base_texture.uv_set else st)
            found = _nearest(texels, place)
            color = _linear(found[:, :3]) if material.base_texture.srgb else found[:, :3].astype(np.float32) / 255
            gain, bias = np.array([material.base_texture.gain, material.base_texture.bias], np.float32)
            color = np.clip(color * gain + bias, 0.0, 1.0)
            if material.opacity_threshold > 0:
                solid = self._opacity(material.base_texture, found, place) >= material.opacity_threshold
        elif material.use_display_color:
            color = blend(self._geometry.colors).astype(np.float32)
        else:
            color = np.tile(np.array(material.base_color, np.float32), (len(vertices), 1))
        detail = self._read(Texture(material.detail.file, srgb=False)) if material.detail.periods else None
        if detail is not None:
            octaves = list(zip(material.detail.periods, material.detail.amplitudes, strict=False))
            for period, amplitude in octaves[:MOST_OCTAVES]:
                gray = _nearest(detail, st / period)[:, :1].astype(np.float32) / 255
                color *= 1.0 + np.float32(amplitude) * (2.0 * gray - 1.0)
        macro = self._read(Texture(material.detail.macro_file, srgb=False))
        if macro is not None:
            color *= 2.0 * _nearest(macro, st1)[:, :3].astype(np.float32) / 255
        return np.clip(color, 0.0, _BRIGHTEST).astype(np.float32), solid

    def _opacity(self, texture: Texture, found: U8, place: F64) -> F32:
        """Look up the opacity of a texture, which may be a channel of another file; shape (N,)."""
        other = self._read(Texture(texture.alpha, srgb=False))
        if other is None:
            return opacity(replace(texture, alpha_channel=3), found)
        return opacity(texture, _nearest(other, place))

    def _read(self, texture: Texture | None) -> U8 | None:
        """Read texels in RGB order, shape (H, W, 3 or 4), uint8; None if there is no texture or it is unreadable."""
        if texture is None or not texture.file:
            return None
        if texture.file not in self._texels:
            self._texels[texture.file] = texels = _decode(texture.file)
            if texels is None:
                self.unread += (Path(texture.file).name,)
        return self._texels[texture.file]


def encode_srgb(linear: F32) -> U8:
    """Encode linear colors as sRGB.

    Args:
        linear: Linear colors [1], shape (N, 3), float32.

    Returns:
        sRGB colors [0 to 255], shape (N, 3), uint8.
    """
    return np.rint(255 * linear_to_srgb(linear)).astype(np.uint8)


def _decode(file: str) -> U8 | None:
    try:
        check_regular(Path(file))
        pixels = cv2.imread(file, cv2.IMREAD_UNCHANGED)
    except (cv2.error, InputError):  # larger than OpenCV reads, or missing
        return None
    if pixels is None or pixels.dtype not in (np.uint8, np.uint16):
        return None
    if pixels.ndim == 3 and pixels.shape[2] not in (3, 4):
        return None
    if pixels.dtype == np.uint16:
        pixels = np.right_shift(pixels, 8).astype(np.uint8)
    longest = max(pixels.shape[:2])
    if longest > LARGEST:
        size = tuple(max(1, round(side * LARGEST / longest)) for side in (pixels.shape[1], pixels.shape[0]))
        pixels = cv2.resize(pixels, size, interpolation=cv2.INTER_AREA)
    if pixels.ndim == 2:
        return np.repeat(pixels[..., None], 3, axis=2).astype(np.uint8)
    return np.ascontiguousarray(pixels[..., [2, 1, 0, 3][: pixels.shape[2]]]).astype(np.uint8)


def _nearest(texels: U8, place: F64) -> U8:
    """Return the nearest texel at each position of a tiled image, v upwards."""
    height, width = texels.shape[:2]
    column = np.floor((place[:, 0] % 1.0) * width).astype(np.int64)
    row = np.floor(((1.0 - place[:, 1]) % 1.0) * height).astype(np.int64)
    return texels[np.minimum(row, height - 1), np.minimum(column, width - 1)]


def _linear(coded: U8) -> F32:
    return srgb_to_linear(np.arange(256) / 255.0).astype(np.float32)[coded]
