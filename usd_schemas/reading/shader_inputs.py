"""What is connected to the inputs of a shader: constants, textures, and the paths of texture files."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pxr import Sdf, Usd, UsdShade

from usd_schemas.reading.packages import unpacked
from usd_schemas.reading.tiles import MARK, tiles_of
from usd_schemas.reading.traversal import EARLIEST

GLASS = 1.5  # default of `ior` [1]: the 4 % that all surfaces that are no metals mirror
_NEAR = 1e-6


@dataclass(frozen=True)
class Source:
    """What is connected to a shader input: a value, or an output of a shader.

    Attributes:
        value: The constant, or None.
        shader: The shader whose output is connected, or None.
        output: Name of that output.
        color_space: Color space that the attribute states, or empty.
    """

    value: Any = None
    shader: UsdShade.Shader | None = None
    output: str = ""
    color_space: str = ""


def find_source(shader: UsdShade.Shader, name: str) -> Source:
    """Follow an input through node graphs and material interfaces to its value or to the shader connected to it.

    Args:
        shader: A shader.
        name: Name of its input.
    """
    source = shader.GetInput(name)
    attributes = source.GetValueProducingAttributes() if source else []
    if not attributes:
        return Source()
    if UsdShade.Output.IsOutput(attributes[0]):
        output = UsdShade.Output(attributes[0])
        return Source(shader=UsdShade.Shader(attributes[0].GetPrim()), output=str(output.GetBaseName()))
    return Source(value=_value(attributes[0]), color_space=str(attributes[0].GetColorSpace() or ""))


def _value(attribute: Usd.Attribute) -> Any:
    """Read an attribute; the path of a tiled texture, which USD does not resolve, relative to its layer."""
    value = attribute.Get(EARLIEST)
    if not isinstance(value, Sdf.AssetPath) or MARK not in value.path or value.resolvedPath:
        return value
    holders = [spec.layer for spec in attribute.GetPropertyStack(EARLIEST) if spec.HasDefaultValue()]
    return Sdf.AssetPath(value.path, holders[0].ComputeAbsolutePath(value.path)) if holders else value


def asset_file(value: Any) -> str:
    """Find the file of an asset path.

    Args:
        value: Value of an asset attribute.

    Returns:
        Absolute path of an existing file, or empty; for a file inside a usdz package, that of a copy; for a tiled
        texture, the path with `MARK`, if it has any tiles.
    """
    resolved = str(value.resolvedPath) if isinstance(value, Sdf.AssetPath) else ""
    if MARK in resolved:
        return resolved if tiles_of(resolved) else ""
    if resolved.endswith("]"):
        return unpacked(resolved)
    return str(Path(resolved).resolve()) if resolved and Path(resolved).is_file() else ""


def number_of(source: Source, default: float) -> float:
    """Take a number from a constant source.

    Args:
        source: What is connected to an input.
        default: Used if that is not a number [any unit].

    Returns:
        The number, in the unit of the input [any unit].
    """
    return float(source.value) if isinstance(source.value, int | float) else default


def shine_by_ior(surface: UsdShade.Shader) -> tuple[float, float, float] | None:
    """Compute what a surface that is no metal mirrors at normal incidence, from its refractive index.

    Source: the specification of UsdPreviewSurface: ((1 - ior) / (1 + ior))^2.

    Args:
        surface: A UsdPreviewSurface in the metallic workflow.

    Returns:
        Linear specular color [1]; None where `ior` has its default, is connected or is not finite, and for metals.
    """
    index, metallic = find_source(surface, "ior"), find_source(surface, "metallic")
    value = max(number_of(index, GLASS), 0.0)
    if index.shader or metallic.shader or number_of(metallic, 0.0) != 0.0 or not math.isfinite(value):
        return None
    if abs(value - GLASS) <= _NEAR:
        return None
    share = ((1.0 - value) / (1.0 + value)) ** 2
    return share, share, share


def channel_of(output: str) -> int | None:
    """Find the channel of a texture that an output passes on.

    Args:
        output: Name of an output of one number, e.g. `r` of UsdUVTexture or `outg` of MaterialX's separate nodes.

    Returns:
        0 red, 1 green, 2 blue, 3 alpha; None for another output.
    """
    name = output.removeprefix("out")
    return "rgba".index(name) if name in ("r", "g", "b", "a") else None


def pair_of(source: Source, default: tuple[float, float]) -> tuple[float, float]:
    """Take two numbers from a constant source.

    Args:
        source: What is connected to an input.
        default: Used if nothing is connected, or a number is not finite [any unit].

    Returns:
        The two numbers, in the unit of the input [any unit].
    """
    if source.value is None:
        return default
    first, second = float(source.value[0]), float(source.value[1])
    return (first, second) if math.isfinite(first) and math.isfinite(second) else default


def triple_of(source: Source, default: tuple[float, float, float]) -> tuple[float, float, float]:
    """Take three numbers from a constant source.

    Args:
        source: What is connected to an input.
        default: Used if nothing is connected [any unit].

    Returns:
        The three numbers, in the unit of the input [any unit].
    """
    if source.value is None:
        return default
    red, green, blue = (float(value) for value in source.value)
    return red, green, blue
