"""Reading CityJSON 1.0 to 2.0 and CityJSONSeq: buildings at their highest level of detail, and the relief.

Source: the CityJSON specifications 1.0.3, 1.1.3 and 2.0.1 (geometry objects, semantics, transform, templates).
"""

from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from authoring.imported.model import Building, CityModel, sound_triangles, split_faces
from authoring.imported.rings import ring_triangles
from groundwork.errors import InputError, MissingError
from groundwork.foreign_file import parse_json, read_regular
from usd_schemas.guard.layer_walk import Warn

F64 = NDArray[np.float64]

VERSIONS = ("1.0", "1.1", "2.0")
MOST_BYTES = 1_000_000_000  # of a file; parsed JSON takes some ten times as much memory
FARTHEST = 20_000.0  # [m] from the middle: largest tile
BUILDINGS = ("Building", "BuildingPart", "BuildingInstallation", "BuildingConstructiveElement", "BuildingUnit")
RELIEF = ("TINRelief", "LandUse", "Road", "Square", "TransportSquare", "Railway", "WaterBody", "PlantCover")
_DEPTH = {"MultiSurface": 0, "CompositeSurface": 0, "Solid": 1, "MultiSolid": 2, "CompositeSolid": 2}

Surface = tuple[list[F64], str]


def read_cityjson(file: Path, warn: Warn) -> CityModel:
    """Read a city.

    Args:
        file: `.json`, `.city.json` or `.jsonl` file; its references are not opened.
        warn: Called with one line for each kind of thing that is left out.

    Returns:
        Buildings and terrain in meters about the middle of the file's extent.

    Raises:
        MissingError: There is no such file.
        InputError: Not CityJSON, an unknown version, or numbers out of range.
    """
    if not file.is_file():
        raise MissingError("no such file", where=file, hint="Check the path")
    if file.stat().st_size > MOST_BYTES:
        raise InputError(
            "too large to import", where=file, allowed=f"up to {MOST_BYTES / 1e9:g} GB", hint="Cut out a smaller tile"
        )
    parts = [_Part.read(file, document) for document in _documents(file)]
    unknown = sorted({o["type"] for p in parts for o in p.objects.values()} - {*BUILDINGS, *RELIEF, "CityObjectGroup"})
    if unknown:
        warn(f"left out of the city: {', '.join(unknown)}")
    points = np.concatenate([part.vertices for part in parts])
    if not len(points):
        raise InputError("holds no geometry", where=file)
    middle = np.round(0.5 * (points.min(axis=0) + points.max(axis=0)))
    if np.abs(points - middle).max() > FARTHEST:
        raise InputError(
            f"extends {np.abs(points - middle).max() / 1e3:.0f} km from its middle",
            where=file,
            allowed=f"up to {FARTHEST / 1e3:g} km",
            hint="Cut out a smaller tile",
        )
    middle[2] = points[:, 2].min()
    buildings, terrain = _model(parts, middle)
    if not buildings and not len(terrain):
        raise InputError("holds neither buildings nor ground", where=file, allowed=", ".join((*BUILDINGS, *RELIEF)))
    return CityModel(buildings, terrain, _attribution(parts[0].document, file, middle))


def _documents(file: Path) -> list[Any]:
    """Parse a file: one document, or the lines of a sequence."""
    text = read_regular(file, MOST_BYTES)
    lines = [line for line in text.split(b"\n") if line.strip()]
    try:
        return [parse_json(text, file)]
    except InputError:
        if len(lines) < 2 or not lines[0].rstrip().endswith(b"}"):
            raise
    return [parse_json(line, file) for line in lines]


@dataclass(frozen=True, eq=False)
class _Part:
    """One document of a file.

    Attributes:
        file: Its source, for errors.
        document: The JSON object.
        objects: City objects by name.
        vertices: Positions [m], shape (V, 3), float64.
        templates: Positions of the templates' vertices [m], shape (W, 3), float64.
    """

    file: Path
    document: dict[str, Any]
    objects: dict[str, dict[str, Any]]
    vertices: F64
    templates: F64

    @staticmethod
    def read(file: Path, document: Any) -> "_Part":
        """Check a document and place its vertices."""
        kind = document.get("type") if isinstance(document, dict) else None
        if kind not in ("CityJSON", "CityJSONFeature"):
            raise InputError("not CityJSON", where=file, field="type", value=kind, allowed="CityJSON, CityJSONFeature")
        version = str(document.get("version", "2.0"))
        if version[:3] not in VERSIONS:
            raise InputError("unknown version", where=file, field="version", value=version, allowed=", ".join(VERSIONS))
        try:
            objects = {name: dict(entry) for name, entry in document.get("CityObjects", {}).items()}
            transform = document.get("transform", {"scale": [1, 1, 1], "translate": [0, 0, 0]})
            vertices = _positions(document.get("vertices", ()), file, "vertices")
            vertices = vertices * np.array(transform["scale"], np.float64) + np.array(
                transform["translate"], np.float64
            )
            templates = document.get("geometry-templates", {}).get("vertices-templates", ())
            if any("type" not in entry for entry in objects.values()):
                raise KeyError("type")
            return _Part(file, document, objects, vertices, _positions(templates, file, "vertices-templates"))
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise InputError(f"invalid CityJSON ({type(error).__name__}: {error})", where=file) from None

    def surfaces(self, geometry: dict[str, Any]) -> list[Surface]:
        """List the surfaces of a geometry: rings, and the semantic type of the surface, or nothing."""
        kind = geometry.get("type")
        if kind == "GeometryInstance":
            return self._instance(geometry)
        if kind not in _DEPTH:
            return []
        semantics = geometry.get("semantics") or {}
        names = [str(entry.get("type", "")) for entry in semantics.get("surfaces", ())]
        boundaries, values = geometry["boundaries"], semantics.get("values")
        for _ in range(_DEPTH[kind]):
            boundaries = list(chain.from_iterable(boundaries))
            values = None if values is None else list(chain.from_iterable(entry or () for entry in values))
        if values is None or len(values) != len(boundaries):
            values = [None] * len(boundaries)
        return [
            ([self._ring(ring, self.vertices) for ring in rings], names[value] if value is not None else "")
            for rings, value in zip(boundaries, values, strict=True)
        ]

    def _instance(self, geometry: dict[str, Any]) -> list[Surface]:
        template = self.document["geometry-templates"]["templates"][geometry["template"]]
        place = np.array(geometry["transformationMatrix"], np.float64).reshape(4, 4)
        origin = self._ring(geometry["boundaries"], self.vertices)[0]
        own = _Part(self.file, {}, {}, self.templates, self.templates)
        return [
            ([ring @ place[:3, :3].T + place[:3, 3] + origin for ring in rings], name)
            for rings, name in own.surfaces(template)
        ]

    def _ring(self, numbers: list[int], vertices: F64) -> F64:
        index = np.array(numbers, np.int64)
        if index.ndim != 1 or not len(index) or index.min() < 0 or index.max() >= len(vertices):
            raise InputError(
                "names a vertex that does not exist",
                where=self.file,
                field="boundaries",
                value=str(numbers)[:60],
                allowed=f"0 to {len(vertices) - 1}",
            )
        return vertices[index]


def _positions(rows: Any, file: Path, field: str) -> F64:
    points = np.array(rows, np.float64).reshape(-1, 3)
    if not np.isfinite(points).all():
        raise InputError("holds a number that is not finite", where=file, field=field)
    return points


def _model(parts: list[_Part], middle: F64) -> tuple[tuple[Building, ...], F64]:
    ground: list[F64] = []
    built: dict[str, list[tuple[F64, str]]] = {}
    for part, name, entry in ((source, *item) for source in parts for item in source.objects.items()):
        if entry["type"] not in (*BUILDINGS, *RELIEF):
            continue
        try:
            faces = _faces(part, entry, middle)
        except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
            problem = f"invalid CityJSON ({type(error).__name__}: {error})"
            raise InputError(problem, where=part.file, field=name) from None
        if entry["type"] in BUILDINGS:
            built.setdefault(_root(part.objects, name), []).extend(faces)
        else:
            ground += [triangles for triangles, _ in faces]
    buildings = [_building(name, faces) for name, faces in sorted(built.items())]
    terrain = sound_triangles(np.concatenate([np.zeros((0, 3, 3)), *ground]))
    return tuple(building for building in buildings if len(building.corners)), terrain


def _faces(part: _Part, entry: dict[str, Any], middle: F64) -> list[tuple[F64, str]]:
    geometries = [geometry for geometry in entry.get("geometry", ()) if geometry.get("type") != "MultiPoint"]
    if not geometries:
        return []
    finest = max(geometries, key=lambda geometry: str(geometry.get("lod", "")))
    return [(ring_triangles([ring - middle for ring in rings]), name) for rings, name in part.surfaces(finest)]


def _root(objects: dict[str, dict[str, Any]], name: str) -> str:
    seen = {name}
    while (parents := objects.get(name, {}).get("parents")) and parents[0] not in seen:
        name = parents[0]
        seen.add(name)
    return name


def _building(name: str, faces: list[tuple[F64, str]]) -> Building:
    walls, roofs = [np.zeros((0, 3, 3))], [np.zeros((0, 3, 3))]
    for triangles, semantic in faces:
        sound = sound_triangles(triangles)
        if "Roof" in semantic:
            roofs.append(sound)
        elif "Wall" in semantic:
            walls.append(sound)
        elif not semantic:
            upright, up, _ = split_faces(sound)
            walls.append(upright)
            roofs.append(up)
    return Building(name, np.concatenate(walls), np.concatenate(roofs))


def _attribution(document: dict[str, Any], file: Path, middle: F64) -> dict[str, str]:
    metadata = document.get("metadata") or {}
    found = {"source": file.name, "origin": " ".join(f"{value:.3f}" for value in middle)}
    for key, name in (("title", "title"), ("referenceSystem", "crs"), ("license", "license")):
        if isinstance(metadata.get(key), str):
            found[name] = metadata[key]
    contact = metadata.get("pointOfContact")
    if isinstance(contact, dict) and isinstance(contact.get("contactName"), str):
        found["author"] = contact["contactName"]
    return found
