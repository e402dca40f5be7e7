"""What `falsework background import` does, in a child process: the file may come from anywhere."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from groundwork.child import answer_parent
from groundwork.progress import Progress

if TYPE_CHECKING:
    from authoring.backgrounds.city_model import CityModel

ADDRESS_LIMIT = 16.0  # [GB]


def import_world(request: dict[str, Any], progress: Progress) -> dict[str, str]:
    """Read a city model and write it as a world.

    Args:
        request: `{file, folder, name, said}`.
        progress: Told what is left out.

    Returns:
        What was found: counts, extent, attribution.
    """
    from authoring.backgrounds.city_asset import write_city
    from authoring.backgrounds.city_model import CityModel
    from authoring.backgrounds.import_cityjson import read_cityjson
    from groundwork.files import space_errors
    from usd_schemas.guard import limit_memory

    limit_memory(ADDRESS_LIMIT)
    model = read_cityjson(Path(request["file"]), progress.note)
    model = CityModel(model.buildings, model.terrain, {**model.attribution, **request["said"]})
    folder = Path(request["folder"])
    with space_errors(folder):
        write_city(model, folder, request["name"])
    return _facts(model)


def describe_world(request: dict[str, Any], progress: Progress) -> dict[str, str]:
    """Read a world back.

    Args:
        request: `{world}`.
        progress: Listener.
    """
    from authoring.backgrounds.city_asset import read_city
    from usd_schemas.guard import limit_memory

    limit_memory(ADDRESS_LIMIT)
    return _facts(read_city(Path(request["world"])))


def _facts(model: "CityModel") -> dict[str, str]:
    size = model.extent[1] - model.extent[0]
    triangles = len(model.terrain) + sum(len(b.walls) + len(b.roofs) for b in model.buildings)
    counts = {"buildings": f"{len(model.buildings)}", "triangles": f"{triangles}"}
    return {**counts, "extent": f"{size[0]:.0f} x {size[1]:.0f} m", **model.attribution}


def _answer(request: dict[str, Any], progress: Progress) -> dict[str, str]:
    return (describe_world if "world" in request else import_world)(request, progress)


if __name__ == "__main__":
    answer_parent(_answer)
