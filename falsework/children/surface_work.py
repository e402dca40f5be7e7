"""Child process that reads the surfaces of an untrusted stage: few triangles with one color each, for display."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from falsework.children.products import ADDRESS_LIMIT
from falsework.children.shown_triangles import LAND_PARTS, shown_triangles
from groundwork.child import answer_parent
from groundwork.progress import Progress
from usd_schemas.texels import linear_to_srgb, srgb_to_linear

SMALL = 64  # [px] to which a texture is reduced for its mean
GRAY = (0.5, 0.5, 0.5)

U8 = NDArray[np.uint8]


def material_color(material: Any) -> tuple[float, float, float]:
    """Compute the mean sRGB color of a material [1]; gray for an unreadable texture.

    Args:
        material: A `usd_schemas.flat_scene.Material`.
    """
    import cv2

    if material.base_texture is None:
        return _coded(np.array(material.base_color))
    pixels = cv2.imread(material.base_texture.file, cv2.IMREAD_REDUCED_COLOR_8)
    if pixels is None:
        return GRAY
    small = cv2.resize(pixels, (SMALL, SMALL), interpolation=cv2.INTER_AREA).reshape(-1, 3).mean(axis=0)
    color = (float(small[2]) / 255.0, float(small[1]) / 255.0, float(small[0]) / 255.0)
    texture = material.base_texture
    if texture.srgb and texture.gain == (1.0, 1.0, 1.0) and texture.bias == (0.0, 0.0, 0.0):
        return color
    linear = srgb_to_linear(np.array(color)) if texture.srgb else np.array(color)
    return _coded(linear * np.array(texture.gain) + np.array(texture.bias))


def _coded(linear: NDArray[Any]) -> tuple[float, float, float]:
    red, green, blue = linear_to_srgb(np.clip(linear, 0.0, 1.0)).tolist()
    return red, green, blue


def _variants(path: Path) -> list[dict[str, Any]]:
    """List the variant sets of a stage with more than one variant."""
    from pxr import Usd

    found, stage = [], Usd.Stage.Open(str(path))  # kept alive: prims expire with their stage
    for prim in stage.Traverse():
        for name in prim.GetVariantSets().GetNames():
            one = prim.GetVariantSet(name)
            names = sorted(one.GetVariantNames())
            if len(names) > 1:
                selected = one.GetVariantSelection()
                found.append({"prim": str(prim.GetPath()), "set": name, "names": names, "selected": selected})
    return found


def _colors(scene: Any, rows: NDArray[np.uint32]) -> U8:
    """Compute the color of each triangle: that of its material, or the mean of its vertex colors, shape (T, 3)."""
    geometry, draws = scene.geometry, scene.draws
    of_material = np.array([material_color(material) for material in scene.materials])
    colors = of_material[draws.material][rows]
    for row in np.flatnonzero([scene.materials[number].use_display_color for number in draws.material]):
        part = draws.part[row]
        first, count = geometry.part_first[part], geometry.part_count[part]
        mean = geometry.colors[geometry.triangles[first : first + count]].mean(axis=1)
        colors[rows == row] = linear_to_srgb(mean)
    return (255.0 * np.clip(colors, 0.0, 1.0)).round().astype(np.uint8)


def _answer(request: dict[str, Any], progress: Progress) -> dict[str, Any]:
    from usd_schemas.flat_scene import world_triangles
    from usd_schemas.guard.guard import check_stage, limit_memory
    from usd_schemas.reading.choices import choices_from
    from usd_schemas.reading.scene_cache import load_scene

    limit_memory(ADDRESS_LIMIT)
    stage = Path(request["stage"])
    check_stage(stage, (), progress.note)
    scene = load_scene(stage, choices=choices_from(request.get("choices")))
    corners, ids, rows = world_triangles(scene)
    bridge = [row.id for row in scene.instances if row.class_name not in ("background", "unlabelled", "")]
    plants = [row.id for row in scene.instances if row.component == "vegetation"]
    level = np.where(np.isin(ids, bridge), 0, np.where(np.isin(ids, plants), 2, 1))
    land = np.isin(ids, [row.id for row in scene.instances if row.component in LAND_PARTS])
    most, reach = int(request["most"]), float(request["reach"] or np.inf)
    shown, chosen = shown_triangles(corners, level, rows, most, reach, land)
    colors = _colors(scene, rows)[chosen]
    np.savez(request["file"], corners=shown, colors=colors)  # not atomic: a temporary folder of the parent
    return {"variants": _variants(stage), "triangles": len(corners)}


if __name__ == "__main__":
    answer_parent(_answer)
