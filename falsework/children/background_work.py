"""Child process of `falsework background import`: the file is untrusted."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from groundwork.child import answer_parent
from groundwork.errors import InputError
from groundwork.progress import Progress

if TYPE_CHECKING:
    from authoring.imported.model import CityModel

ADDRESS_LIMIT = 16.0  # [GB]


def import_world(request: dict[str, Any], progress: Progress) -> dict[str, Any]:
    """Read a city and write it as a world.

    Args:
        request: `{file, folder, name, said, up, scale}`.
        progress: Listener, for notes on what is left out.

    Returns:
        Facts of the world: counts, extent, attribution.
    """
    from authoring.imported.asset import write_city
    from groundwork.files import space_errors
    from usd_schemas.guard.guard import limit_memory

    limit_memory(ADDRESS_LIMIT)
    progress.stage("read", 0)
    model = _read(Path(request["file"]), request["up"], request["scale"], progress)
    progress.stage("write", 0)
    model = replace(model, attribution={**model.attribution, **request["said"]})
    folder = Path(request["folder"])
    with space_errors(folder):
        write_city(model, folder, request["name"])
    return _facts(model)


def _read(file: Path, up: str, scale: float, progress: Progress) -> "CityModel":
    """Read a file with the reader for its suffix."""
    from authoring.imported.cityjson import read_cityjson
    from authoring.imported.mesh import MESH_SUFFIXES, read_mesh
    from authoring.imported.usd import USD_SUFFIXES, read_usd

    suffix = file.suffix.lower()
    if suffix in (*MESH_SUFFIXES, ".zip"):
        return read_mesh(file, progress.note, up, scale)
    if up:
        raise InputError(
            "a format that states its own up axis", where=file, field="--up", value=up, hint="Leave it out"
        )
    if suffix in USD_SUFFIXES:
        return read_usd(file, progress.note, scale)
    if scale != 1.0:
        raise InputError(
            "a CityJSON file is always in meters", where=file, field="--scale", value=scale, hint="Leave it out"
        )
    return read_cityjson(file, progress.note)


def describe_world(request: dict[str, Any], progress: Progress) -> dict[str, Any]:
    """Read the facts of an imported world.

    Args:
        request: `{world}`.
        progress: Listener.
    """
    from authoring.imported.asset import read_city
    from usd_schemas.guard.guard import limit_memory

    limit_memory(ADDRESS_LIMIT)
    return _facts(read_city(Path(request["world"])))


def _facts(model: "CityModel") -> dict[str, Any]:
    size = model.extent[1] - model.extent[0]
    objects = {piece.owner for piece in model.textured if not piece.is_ground} | {b.name for b in model.buildings}
    return {
        "buildings": len(objects),
        "triangles": len(model.built) + len(model.ground),
        "ground_triangles": len(model.ground),
        "textured_triangles": sum(len(piece.triangles) for piece in model.textured),
        "images": len(model.skins),
        "image_bytes": sum(len(skin.image) for skin in model.skins),
        "extent": [float(size[0]), float(size[1])],  # [m]
        "attribution": dict(model.attribution),
    }


def _answer(request: dict[str, Any], progress: Progress) -> dict[str, Any]:
    return (describe_world if "world" in request else import_world)(request, progress)


if __name__ == "__main__":
    answer_parent(_answer)
