"""The few OpenGL functions that moderngl does not offer, called through ctypes."""

import ctypes
from collections.abc import Callable

_LOWER_LEFT, _ZERO_TO_ONE = 0x8CA1, 0x935F
_COLOR, _DEPTH = 0x1800, 0x1801
_BLEND = 0x0BE2
_TEXTURE_2D, _TEXTURE_2D_ARRAY = 0x0DE1, 0x8C1A
_BYTES = {1: 0x8229, 4: 0x8058}  # internal formats R8 and RGBA8
_WRAP_S, _WRAP_T, _MINIFIED, _MAGNIFIED, _ANISOTROPY = 0x2802, 0x2803, 0x2801, 0x2800, 0x84FE
_DEPTH_COMPONENT, _DEPTH_COMPONENT32F, _FLOAT = 0x1902, 0x8CAC, 0x1406


class GlFunctions:
    """OpenGL functions of the current context.

    Attributes:
        flush: Makes the driver start the commands issued so far.
    """

    def __init__(self, load: Callable[[str], int]) -> None:
        """Look up the functions.

        Args:
            load: Gives the address of a function by name, 0 when absent.
        """
        self._clip_control = _function(load, "glClipControl", ctypes.c_uint, ctypes.c_uint)
        self._clear_float = _function(load, "glClearBufferfv", ctypes.c_uint, ctypes.c_int, ctypes.c_void_p)
        self._clear_uint = _function(load, "glClearBufferuiv", ctypes.c_uint, ctypes.c_int, ctypes.c_void_p)
        self.flush = _function(load, "glFlush")
        self._enable_one = _function(load, "glEnablei", ctypes.c_uint, ctypes.c_uint)
        self._bind_sampler = _function(load, "glBindSampler", ctypes.c_uint, ctypes.c_uint)
        self._make_samplers = _function(load, "glGenSamplers", ctypes.c_int, ctypes.c_void_p)
        number = (ctypes.c_uint, ctypes.c_uint)
        self._sampler_number = _function(load, "glSamplerParameteri", *number, ctypes.c_int)
        self._sampler_float = _function(load, "glSamplerParameterf", *number, ctypes.c_float)
        self._bind_texture = _function(load, "glBindTexture", ctypes.c_uint, ctypes.c_uint)
        sizes = (ctypes.c_uint, *[ctypes.c_int] * 5, ctypes.c_uint, ctypes.c_uint, ctypes.c_void_p)
        self._texture_image = _function(load, "glTexImage2D", *sizes)
        self._texture_storage = _function(
            load, "glTexStorage3D", ctypes.c_uint, ctypes.c_int, ctypes.c_uint, *[ctypes.c_int] * 3
        )

    def bind_sampler(self, unit: int, sampler: int) -> None:
        """Let a texture unit use a sampler.

        Args:
            unit: Texture unit.
            sampler: OpenGL name of the sampler; 0 for the modes of its texture.
        """
        self._bind_sampler(unit, sampler)

    def make_sampler(self, modes: tuple[int, int], filters: tuple[int, int], anisotropy: float) -> int:
        """Make a sampler, whose border is black and transparent.

        Args:
            modes: OpenGL's wrap modes along s and t.
            filters: OpenGL's filters for minification and magnification.
            anisotropy: Anisotropic filtering [1]; 1 for none.

        Returns:
            OpenGL name of the sampler.
        """
        name = (ctypes.c_uint * 1)()
        self._make_samplers(1, name)
        for parameter, value in zip((_WRAP_S, _WRAP_T, _MINIFIED, _MAGNIFIED), (*modes, *filters), strict=True):
            self._sampler_number(name[0], parameter, value)
        if anisotropy > 1.0:
            self._sampler_float(name[0], _ANISOTROPY, anisotropy)
        return int(name[0])

    def clip_depth_zero_to_one(self) -> None:
        """Let clip-space depth run from 0 to w, so that reversed depth keeps all digits of its float."""
        self._clip_control(_LOWER_LEFT, _ZERO_TO_ONE)

    def clear_color(self, attachment: int, value: tuple[float, float, float, float]) -> None:
        """Clear one floating-point or normalized attachment of the bound framebuffer.

        Args:
            attachment: Number of the color attachment.
            value: New value of every pixel [any unit].
        """
        self._clear_float(_COLOR, attachment, (ctypes.c_float * 4)(*value))

    def clear_ids(self, attachment: int) -> None:
        """Clear one unsigned integer attachment to 0; glClear leaves it undefined.

        Args:
            attachment: Number of the color attachment.
        """
        self._clear_uint(_COLOR, attachment, (ctypes.c_uint * 4)(0, 0, 0, 0))

    def clear_depth(self, value: float) -> None:
        """Clear the depth of the bound framebuffer.

        Args:
            value: New value of every pixel [1].
        """
        self._clear_float(_DEPTH, 0, (ctypes.c_float * 1)(value))

    def blend_only(self, attachment: int) -> None:
        """Enable blending for one attachment of the bound framebuffer only.

        Args:
            attachment: Number of the color attachment.
        """
        self._enable_one(_BLEND, attachment)

    def make_array(self, texture: int, side: int, layers: int, channels: int) -> None:
        """Allocate all levels of a texture array; otherwise mipmaps are built in a copy, twice as large.

        Args:
            texture: OpenGL name of the texture.
            side: Side of the layers [px], a power of two.
            layers: Number of layers.
            channels: 1 or 4 bytes per texel.
        """
        self._bind_texture(_TEXTURE_2D_ARRAY, texture)
        self._texture_storage(_TEXTURE_2D_ARRAY, side.bit_length(), _BYTES[channels], side, side, layers)

    def make_depth_float(self, texture: int, width: int, height: int) -> None:
        """Allocate a depth texture of 32-bit floats; moderngl's own has 24-bit integers.

        Args:
            texture: OpenGL name of the texture.
            width: Width [px].
            height: Height [px].
        """
        self._bind_texture(_TEXTURE_2D, texture)
        self._texture_image(_TEXTURE_2D, 0, _DEPTH_COMPONENT32F, width, height, 0, _DEPTH_COMPONENT, _FLOAT, None)


def _function(load: Callable[[str], int], name: str, *arguments: type) -> Callable[..., None]:
    return ctypes.CFUNCTYPE(None, *arguments)(load(name))
