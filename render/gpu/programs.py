"""Shader programs, compiled with the features that a material needs and no others.

A driver on the CPU runs both sides of a branch, so a program must not contain what its material does not use.
"""

import re
from importlib.resources import files

import moderngl

from render.gpu.row_texture import UNITS

_INCLUDE = re.compile(r"^// #include (\S+)$", re.MULTILINE)


class Programs:
    """Compiles programs and caches them."""

    def __init__(self, context: moderngl.Context) -> None:
        """Start without programs.

        Args:
            context: Open context.
        """
        self._context = context
        self._compiled: dict[tuple[str, str, tuple[str, ...]], moderngl.Program] = {}

    def get(self, vertex: str, fragment: str, features: tuple[str, ...] = ()) -> moderngl.Program:
        """Compile a program, or return the one compiled before.

        Args:
            vertex: File name of the vertex shader.
            fragment: File name of the fragment shader.
            features: Names to define.
        """
        key = (vertex, fragment, features)
        if key not in self._compiled:
            self._compiled[key] = self._context.program(
                vertex_shader=_source(vertex, features), fragment_shader=_source(fragment, features)
            )
            for name, unit in UNITS.items():
                set_uniform(self._compiled[key], name, unit)
        return self._compiled[key]


def set_uniform(program: moderngl.Program, name: str, value: object) -> None:
    """Set a uniform if the program uses it: compilers drop what has no effect.

    Args:
        program: Compiled program.
        name: Name of the uniform.
        value: Number, tuple or bytes.
    """
    if name not in program:
        return
    member = program[name]
    if not isinstance(member, moderngl.Uniform):
        return
    if isinstance(value, bytes):
        member.write(value)
    else:
        member.value = value


def _source(name: str, features: tuple[str, ...]) -> str:
    folder = files("render").joinpath("shaders")
    text = folder.joinpath(name).read_text(encoding="utf-8")
    while _INCLUDE.search(text):
        text = _INCLUDE.sub(lambda match: folder.joinpath(match[1]).read_text(encoding="utf-8"), text)
    defines = "".join(f"#define {feature}\n" for feature in features)
    return f"#version 450 core\n{defines}{text}"
