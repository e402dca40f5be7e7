"""Wrap modes of textures that do not repeat: sampler objects, bound in addition to the texture arrays."""

import moderngl

from render.gpu.gl_functions import GlFunctions

_MODES = {"repeat": 0x2901, "mirror": 0x8370, "clamp": 0x812F, "black": 0x812D}


class Wraps:
    """The samplers of a scene, each made once."""

    def __init__(self, functions: GlFunctions) -> None:
        """Start without samplers.

        Args:
            functions: The OpenGL functions of the context.
        """
        self._functions = functions
        self._known: dict[tuple[tuple[str, str], int, float], int] = {}
        self._bound: set[int] = set()

    def bind(self, unit: int, array: moderngl.TextureArray, wrap: tuple[str, str] | None) -> None:
        """Bind a texture array, and its wrap modes.

        Args:
            unit: Texture unit.
            array: The textures, shape (side, side, layers).
            wrap: Modes along s and t; None if it repeats.
        """
        array.use(unit)
        if wrap is None:
            if unit in self._bound:
                self._functions.bind_sampler(unit, 0)
                self._bound.discard(unit)
            return
        key = (wrap, array.components, array.anisotropy)
        if key not in self._known:
            modes = (_MODES[wrap[0]], _MODES[wrap[1]])
            self._known[key] = self._functions.make_sampler(modes, array.filter, array.anisotropy)
        self._functions.bind_sampler(unit, self._known[key])
        self._bound.add(unit)

    def clear(self) -> None:
        """Let every unit use the modes of its texture."""
        for unit in sorted(self._bound):
            self._functions.bind_sampler(unit, 0)
        self._bound.clear()
