"""Child process of the verbs of `falsework scene`: the stages that they open are untrusted."""

from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from falsework.children.products import ADDRESS_LIMIT
from groundwork.child import answer_parent
from groundwork.progress import Progress

Request = dict[str, Any]


def info(request: Request, progress: Progress) -> dict[str, Any]:
    """Describe a scene.

    Args:
        request: `{scene, depth}`.
        progress: Listener.
    """
    from authoring.scenes.inventory import take_inventory

    return asdict(take_inventory(Path(request["scene"]), request["depth"]))


def validate(request: Request, progress: Progress) -> list[str]:
    """Validate a scene in every variant.

    Args:
        request: `{scene}`.
        progress: Listener.
    """
    from authoring.scenes.validate import validate_scene

    return validate_scene(Path(request["scene"]))


def diff(request: Request, progress: Progress) -> dict[str, Any]:
    """Compare two scenes.

    Args:
        request: `{scene, second}`.
        progress: Listener.
    """
    from authoring.scenes.diff import diff_scenes

    found = diff_scenes(Path(request["scene"]), Path(request["second"]))
    return {**asdict(found), "same": found.same}


def choose(request: Request, progress: Progress) -> dict[str, str]:
    """Choose look, background and light of a scene, or write a variant with these choices.

    Args:
        request: `{scene, choices, variant, origin}`; `variant` is empty for the scene itself.
        progress: Listener, for notes on what is lost of a user's file.
    """
    from authoring.variants.add import set_choices, write_variant

    scene, choices = Path(request["scene"]), request["choices"]
    origin = tuple(request["origin"]) if request["origin"] else None
    if request["variant"]:
        return {"variant": str(write_variant(scene, request["variant"], choices, progress.note, origin))}
    return set_choices(scene, choices, progress.note, origin)


def flatten(request: Request, progress: Progress) -> list[str]:
    """Flatten a scene into one layer.

    Args:
        request: `{scene, out}`.
        progress: Listener.
    """
    from authoring.exchange.flatten import flatten_scene

    return flatten_scene(Path(request["scene"]), Path(request["out"]))


def package(request: Request, progress: Progress) -> list[str]:
    """Package a scene as one file.

    Args:
        request: `{scene, out, bake, texels}`.
        progress: Listener.
    """
    from authoring.exchange.export import export_scene

    return export_scene(Path(request["scene"]), Path(request["out"]), request["bake"], request["texels"], progress.note)


WORK: dict[str, Callable[[Request, Progress], Any]] = {
    "info": info,
    "validate": validate,
    "diff": diff,
    "choose": choose,
    "flatten": flatten,
    "package": package,
}


def _answer(request: Request, progress: Progress) -> Any:
    from usd_schemas.guard.guard import check_stage, limit_memory

    limit_memory(ADDRESS_LIMIT)
    said: dict[str, None] = {}
    for stage in request["stages"]:
        check_stage(Path(stage), tuple(Path(root) for root in request["allow_roots"]), said.setdefault)
    for line in said:
        progress.note(line)
    return WORK[request["work"]](request, progress)


if __name__ == "__main__":
    answer_parent(_answer)
