"""The choices that a scene offers, and choosing among them: variant selections in its root layer."""

from pathlib import Path

from pxr import Sdf, Usd

from authoring.layers.change import change_layer
from groundwork.errors import InputError
from usd_schemas import tokens

AXES = {"look": tokens.BRIDGE, "background": tokens.BACKGROUND, "light": tokens.ENVIRONMENT}


def offered(stage: Usd.Stage) -> dict[str, tuple[str, ...]]:
    """List what can be chosen on a stage: axis to names, sorted; axes that the stage lacks are left out.

    Args:
        stage: Stage of a scene.
    """
    names = {axis: _variants(stage, axis) for axis in AXES}
    return {axis: found for axis, found in names.items() if found}


def selected(stage: Usd.Stage) -> dict[str, str]:
    """List the selections of a stage: axis to name.

    Args:
        stage: Stage of a scene.
    """
    return {axis: stage.GetPrimAtPath(AXES[axis]).GetVariantSet(axis).GetVariantSelection() for axis in offered(stage)}


def select_in(layer: Sdf.Layer, selections: dict[str, str]) -> None:
    """Write selections into a layer in memory.

    Args:
        layer: Root layer of a scene or of a scene variant.
        selections: Axis to name.
    """
    for axis, name in sorted(selections.items()):
        Sdf.CreatePrimInLayer(layer, AXES[axis]).variantSelections[axis] = name


def choose(scene: Path, selections: dict[str, str]) -> None:
    """Select among the choices of a scene.

    The selections are written to the root layer itself, where other programs write them, and which is stronger than
    every sublayer, so that no earlier selection overrides them.

    Args:
        scene: Root layer.
        selections: Axis to name.

    Raises:
        InputError: The scene does not offer it.
    """
    stage = Usd.Stage.Open(str(scene), Usd.Stage.LoadNone)
    known = offered(stage)
    del stage
    for axis, name in selections.items():
        if name not in known.get(axis, ()):
            raise unknown_choice(scene, axis, name, known.get(axis, ()))
    change_layer(scene, lambda layer: select_in(layer, selections))


def unknown_choice(scene: Path, axis: str, name: str, allowed: tuple[str, ...]) -> InputError:
    """Build the error for an unknown choice.

    Args:
        scene: Root layer.
        axis: Axis.
        name: Requested name.
        allowed: Allowed names.
    """
    return InputError(f"unknown {axis}", where=scene, field=axis, value=name, allowed=", ".join(allowed) or "none")


def _variants(stage: Usd.Stage, axis: str) -> tuple[str, ...]:
    prim = stage.GetPrimAtPath(AXES[axis])
    return tuple(sorted(prim.GetVariantSet(axis).GetVariantNames())) if prim else ()
