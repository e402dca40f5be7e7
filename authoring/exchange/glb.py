"""A stage as GLB, for the web and for tools without USD: nodes named like prims, labels as extras."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from authoring.exchange.texture_files import read_all, read_color
from authoring.looks.encode import encode_raw, encode_srgb
from groundwork.files import write_bytes
from groundwork.output.file import SIGNATURE
from usd_schemas.flat_scene import FlatScene, Material, Texture
from usd_schemas.guard.layer_walk import Warn
from usd_schemas.reading.stage_reader import read_stage
from usd_schemas.texels import opacity, placed, srgb_to_linear

if TYPE_CHECKING:
    from trimesh import Trimesh

Y_UP = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])  # glTF's vertical is y
_SHINE, _DIELECTRIC = "KHR_materials_specular", 0.04  # what an index of 1.5 mirrors, to which its factors refer [1]
MOST_TEXELS = 1024  # [px] along a side of a tiled texture: web pages do not need more


def write_glb(stage: Path, out: Path, warn: Warn) -> list[str]:
    """Write the visible surfaces of a stage, with base colors, roughness and labels.

    Args:
        stage: Any USD stage.
        out: File to write.
        warn: Called with one line for each thing that cannot be read or that GLB cannot express.

    Returns:
        Names of the nodes.
    """
    import trimesh
    from trimesh.exchange.gltf import export_glb

    scene = read_stage(stage)
    for line in scene.warnings:
        warn(line)
    if any(material.detail.file or material.detail.macro_file for material in scene.materials):
        warn("GLB has no detail or macro textures: they are left out; --bake bakes them into the other textures")
    result = trimesh.Scene(base_frame="world")
    pictures: dict[tuple[Texture, bool], _Picture] = {}
    meshes: dict[tuple[int, int], str] = {}
    rows = {row.id: row for row in scene.instances}
    classes = {row.id: row.name for row in scene.classes}
    used: Counter[str] = Counter()
    for draw, part in enumerate(scene.draws.part.tolist()):
        number = int(scene.draws.material[draw])
        row = rows.get(int(scene.draws.instance[draw]))
        stem = row.path.rpartition("/")[2] if row else "unnumbered"
        node = f"{stem}_{used[stem]}" if used[stem] else stem
        used[stem] += 1
        facts = {"class": classes.get(int(scene.draws.label[draw]), ""), "instance": int(scene.draws.instance[draw])}
        if row:
            facts |= {"component": row.component, "path": row.path}
        matrix = Y_UP @ scene.draws.transform[draw]
        known = meshes.get((part, number))
        if known is None:
            meshes[part, number] = f"mesh_{len(meshes):05d}"
            mesh = _mesh(scene, part, scene.materials[number], pictures)
            result.add_geometry(mesh, node, meshes[part, number], transform=matrix, metadata=facts)
        else:
            result.graph.update(node, "world", matrix=matrix, geometry=known, metadata=facts)
    out.parent.mkdir(parents=True, exist_ok=True)
    shines = constant_shines(scene.materials)

    def finish(tree: dict[str, Any]) -> None:
        _tell_shines(tree, shines)
        _sign(tree)

    write_bytes(out, export_glb(result, include_normals=True, tree_postprocessor=finish))
    return sorted(result.graph.nodes_geometry)


def _short(material: Material) -> str:
    """Find the name of a material in a GLB."""
    return material.name.rpartition("/")[2]


def constant_shines(materials: Sequence[Material]) -> dict[str, tuple[float, float, float]]:
    """Find what materials mirror at normal incidence by their names in a GLB.

    Args:
        materials: Materials of a scene.

    Returns:
        Linear specular colors [1]; not of dielectrics of index 1.5, of pictures of shine, and of names that materials
        of different shine share.
    """
    found: dict[str, set[tuple[float, float, float] | None]] = {}
    for material in materials:
        found.setdefault(_short(material), set()).add(None if material.specular_texture else material.specular)
    return {name: shine for name, (shine, *others) in found.items() if shine is not None and not others}


def _tell_shines(tree: dict[str, Any], shines: dict[str, tuple[float, float, float]]) -> None:
    """Record the shine of surfaces that are no dielectric of index 1.5, as the matt ground: its factor is relative."""
    for material in tree.get("materials", []):
        if (shine := shines.get(material.get("name", ""))) is not None:
            color = [value / _DIELECTRIC for value in shine]
            told = {"specularFactor": float(any(color)), "specularColorFactor": color if any(color) else [1.0] * 3}
            material["extensions"] = {**material.get("extensions", {}), _SHINE: told}
            tree["extensionsUsed"] = sorted({*tree.get("extensionsUsed", []), _SHINE})


def _sign(tree: dict[str, Any]) -> None:
    """Record the generator in the file, before any long entry."""
    asset = {**tree.pop("asset"), "generator": SIGNATURE}
    rest = dict(tree)
    tree.clear()
    tree |= {"asset": asset, **rest}


def _mesh(
    scene: FlatScene, part: int, material: Material, pictures: "dict[tuple[Texture, bool], _Picture]"
) -> "Trimesh":
    import trimesh
    from trimesh.visual import TextureVisuals
    from trimesh.visual.material import PBRMaterial

    geometry = scene.geometry
    first = int(geometry.part_first[part])
    corners = geometry.triangles[first : first + int(geometry.part_count[part])]
    vertices, faces = np.unique(corners, return_inverse=True)
    texture = material.base_texture
    metallic = float(material.metallic)
    settings: dict[str, Any] = {
        "name": _short(material),
        "metallicFactor": metallic,
        "roughnessFactor": material.roughness,
        "doubleSided": bool(geometry.part_double_sided[part]),
    }
    uv = geometry.st[vertices]
    if texture is None:
        settings["baseColorFactor"] = [*(round(value * 255) for value in material.base_color), 255]
    else:
        cut_out = material.opacity_threshold > 0.0
        if (texture, cut_out) not in pictures:
            pictures[texture, cut_out] = _Picture(texture, keeps_alpha=cut_out)
        settings["baseColorTexture"] = pictures[texture, cut_out]
        if cut_out:  # leaves are cards with a cut-out texture
            settings |= {"alphaMode": "MASK", "alphaCutoff": float(material.opacity_threshold)}
        if not texture.is_plain and not texture.alpha:  # GLB has a factor, but no offset
            settings["baseColorFactor"] = [*(round(min(value, 1.0) * 255) for value in texture.gain), 255]
        uv = placed(texture, (geometry.st1 if texture.uv_set else geometry.st)[vertices])
    visual = TextureVisuals(uv=uv, material=PBRMaterial(**settings))
    return trimesh.Trimesh(
        geometry.positions[vertices],
        faces.reshape(-1, 3),
        vertex_normals=geometry.normals[vertices],
        visual=visual,
        process=False,
    )


class _Picture:
    """A JPEG or PNG file in memory, with the image interface that trimesh's GLB writer uses."""

    def __init__(self, texture: Texture, *, keeps_alpha: bool) -> None:
        import cv2

        self.format = "PNG" if keeps_alpha else "JPEG"

        if texture.alpha:
            image = _composed(texture)
        else:
            image = read_all(texture.file) if keeps_alpha else read_color(texture.file)
        if texture.uv_set == 0 and max(image.shape) > MOST_TEXELS:
            image = cv2.resize(image, (MOST_TEXELS, MOST_TEXELS), interpolation=cv2.INTER_AREA)
        ending, quality = (".png", []) if keeps_alpha else (".jpg", [cv2.IMWRITE_JPEG_QUALITY, 90])
        self._data = cv2.imencode(ending, image, quality)[1].tobytes()

    def tobytes(self) -> bytes:
        """Return bytes that identify the material."""
        return self._data

    def save(self, file: BinaryIO, format: str) -> None:
        """Write the file.

        Args:
            file: File to write to.
            format: JPEG, or PNG where it is a cut-out.
        """
        file.write(self._data)


def _composed(texture: Texture) -> NDArray[np.uint8]:
    """Join a color and the opacity of a file or channel of its own, each with scale and bias; shape (H, W, 4)."""
    import cv2

    color = read_color(texture.file)[..., ::-1].astype(np.float32) / 255
    if texture.srgb:
        color = srgb_to_linear(color)
    color = encode_srgb((color * np.array(texture.gain) + np.array(texture.bias)).astype(np.float32))
    mask = read_all(texture.alpha)
    mask = mask[..., None] if mask.ndim == 2 else mask[..., [2, 1, 0, 3][: mask.shape[2]]]
    alpha = cv2.resize(encode_raw(opacity(texture, mask)), color.shape[1::-1], interpolation=cv2.INTER_AREA)
    return np.dstack([color[..., ::-1], alpha]).astype(np.uint8, copy=False)
