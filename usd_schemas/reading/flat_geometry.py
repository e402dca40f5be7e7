"""Converts placed prims to the arrays of a flat scene: each mesh once, one draw per visible part of each instance."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom, UsdShade

from usd_schemas.flat_scene import Draws, FlatScene, Geometry, InstanceRow, Material
from usd_schemas.reading.geometry_pile import GeometryPile
from usd_schemas.reading.labels import Label, Register, Warn, inherit_label
from usd_schemas.reading.materials import GRAY, PLAIN_COLOR, ReadMaterial, read_material
from usd_schemas.reading.meshes import FlatMesh, read_mesh
from usd_schemas.reading.placements import Placement
from usd_schemas.reading.subsets import subset_faces
from usd_schemas.reading.tiles import tile_materials, tile_numbers
from usd_schemas.reading.traversal import UnreadableMeshError, guarded, numbers_of, table_of
from usd_schemas.reading.uv_sets import on_sets, share_sets
from usd_schemas.taxonomies import Taxonomy

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

FALLBACK, DISPLAY_COLOR = 0, 1  # the first two materials
_BIND_FAMILY = "materialBind"
_MOST_TINTS = 4096  # colors of instances that are kept without rounding
_SHADES = 15  # steps of each of red, green and blue, if there are more colors than that
_LEAST_SCALE = 1e-9  # [1] instances with a smaller scale count as hidden


@dataclass(frozen=True)
class _Group:
    """Faces of a mesh with one material and one label: names of their GeomSubsets, empty for the rest of the mesh."""

    material_subset: str
    label_subset: str


@dataclass(frozen=True)
class _Split:
    """How GeomSubsets divide a mesh: `face` gives the group of each face, or None where all faces are one group."""

    groups: tuple[_Group, ...]
    face: I64 | None


@dataclass(frozen=True)
class Flattened:
    """The placements of a stage as arrays.

    Attributes:
        geometry: Unique meshes.
        draws: Their visible instances.
        materials: Materials.
        instances: Instance rows in ascending order.
        ends: Number of draws up to the end of each run of placements.
    """

    geometry: Geometry
    draws: Draws
    materials: tuple[Material, ...]
    instances: tuple[InstanceRow, ...]
    ends: tuple[int, ...]


def flatten(runs: list[list[Placement]], stage_to_world: F64, table: Taxonomy, level: int, warn: Warn) -> Flattened:
    """Read every placed mesh once and list its draws.

    Args:
        runs: What is drawn, in groups: first what never moves, then what moves, one group for each moment.
        stage_to_world: Stage units to meters with z up [m per stage unit], shape (4, 4), float64.
        table: Class table of the stage.
        level: How many times subdivision surfaces are refined.
        warn: Called with one line for each thing that could not be read as authored.
    """
    placements = [placement for run in runs for placement in run]
    splits: dict[object, _Split] = {}
    for placement in placements:
        key = mesh_key(placement)
        if key not in splits:
            splits[key] = _split(placement, warn)
    register = Register(table, warn)
    register.reserve(_authored_ids(placements, splits))
    materials, pile = _Materials(placements, splits, warn), GeometryPile()
    work = _Work(stage_to_world, splits, materials, register, _Parts(pile, level, warn), warn)
    ends, number = [], 0
    for run in runs:
        for placement in run:
            work.draw(placement, number)
            number += 1
        ends.append(work.pile.draw_count)
    instances = tuple(register.rows[number] for number in sorted(register.rows))
    return Flattened(work.pile.geometry(), work.pile.draws(), tuple(work.materials.flat), instances, tuple(ends))


class _Work:
    """Materials, meshes and draws that have been read so far."""

    def __init__(
        self,
        stage_to_world: F64,
        splits: dict[object, _Split],
        materials: "_Materials",
        register: Register,
        parts: "_Parts",
        warn: Warn,
    ) -> None:
        self.pile, self.materials, self._parts = parts.pile, materials, parts
        self._stage_to_world, self._splits, self._register, self._warn = stage_to_world, splits, register, warn

    def draw(self, placement: Placement, number: int) -> None:
        """Add the draws of one placement, which is number `number` in the list of materials."""
        key = mesh_key(placement)
        mesh = self._parts.mesh(key, placement, self.materials.sets[key], self.materials.color_name(number))
        transforms, rows = _usable(placement, self._stage_to_world @ placement.transforms, self._warn)
        if mesh is None or not len(rows):
            return
        numbers = placement.numbers[rows] if placement.numbers is not None else None
        for group, names in enumerate(self._splits[key].groups):
            label = _group_label(placement, names)
            own_numbers = numbers if label.instance_id == placement.label.instance_id else None
            ids = self._register.instance_ids(label, placement.owner.GetPath(), own_numbers, len(rows))
            material = self.materials.rows(number, group, mesh.colored, placement, rows)
            class_id = self._register.class_id(label)
            face, tiles = self._splits[key].face, self.materials.tiles_of(material)
            for tile, own in (tiles or {None: material}).items():
                part = self._parts.row(key, group, face, tile, tuple(tiles))
                if part is not None:
                    self.pile.add_draws(part, transforms, own, ids, class_id)


def mesh_key(placement: Placement) -> object:
    """Return a key that is equal for placements of the same mesh; a deforming mesh is another mesh at each time.

    Args:
        placement: A drawn prim, maybe an instance proxy.
    """
    path = _shared(placement.prim).GetPath()
    return (path, placement.time.GetValue()) if placement.deforms else path


def _shared(prim: Usd.Prim) -> Usd.Prim:
    """Find the prim that all instances share; of an instance proxy, that in its prototype."""
    return prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim


def world_bounds(scene: FlatScene | Flattened) -> tuple[F64, F64]:
    """Find an axis-aligned box around everything that is drawn; a rotated mesh counts with its rotated local box.

    Args:
        scene: Scene with at least one draw.

    Returns:
        Lower and upper corner [m], shape (3,) each, float64.
    """
    geometry, draws = scene.geometry, scene.draws
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for part in np.unique(draws.part).tolist():
        first, count = geometry.part_first[part], geometry.part_count[part]
        used = geometry.positions[np.unique(geometry.triangles[first : first + count])].astype(np.float64)
        ends = np.stack([used.min(axis=0), used.max(axis=0)])
        corners = np.array([[ends[bit, axis] for axis, bit in enumerate(bits)] for bits in np.ndindex(2, 2, 2)])
        transforms = draws.transform[draws.part == part]
        placed = np.einsum("nij,cj->nci", transforms[:, :3, :3], corners) + transforms[:, None, :3, 3]
        low, high = np.minimum(low, placed.min(axis=(0, 1))), np.maximum(high, placed.max(axis=(0, 1)))
    return low, high


def _split(placement: Placement, warn: Warn) -> _Split:
    whole, prim = _Split((_Group("", ""),), None), placement.prim
    subsets: list[tuple[Usd.Prim, str, I64]] = []
    with guarded(prim, warn, "its subsets are left out"):
        subsets = subset_faces(prim) if prim.IsA(UsdGeom.Mesh) else []
    if not subsets:
        return whole
    counts = numbers_of(UsdGeom.Mesh(prim).GetFaceVertexCountsAttr().Get(placement.time))
    count = len(counts) if counts is not None else 0
    names = ["", *(subset.GetName() for subset, _, _ in subsets)]
    bound, labeled = np.zeros(count, np.int64), np.zeros(count, np.int64)
    for row, (subset, family, faces) in enumerate(subsets, start=1):
        if len(faces) and not 0 <= faces.min() <= faces.max() < count:
            warn(f"{subset.GetPath()}: its indices name faces that do not exist: ignored")
            faces = faces[(faces >= 0) & (faces < count)]
        if family == _BIND_FAMILY:
            bound[faces] = row
        with guarded(subset, warn, "its label is left out"):
            if inherit_label(subset, Label(), warn=warn) != Label():
                labeled[faces] = row
    pairs, face = np.unique(bound * len(names) + labeled, return_inverse=True)
    groups = tuple(_Group(names[pair // len(names)], names[pair % len(names)]) for pair in pairs.tolist())
    return _Split(groups, face) if count else whole


def _group_label(placement: Placement, group: _Group) -> Label:
    if not group.label_subset:
        return placement.label
    return inherit_label(placement.prim.GetChild(group.label_subset), placement.label)


def _authored_ids(placements: list[Placement], splits: dict[object, _Split]) -> set[int]:
    ids: set[int] = set()
    for placement in placements:
        if placement.numbers is not None:
            ids |= set(placement.numbers.tolist())
        for group in splits[mesh_key(placement)].groups:
            ids.add(_group_label(placement, group).instance_id)
    return ids


def _usable(placement: Placement, transforms: F64, warn: Warn) -> tuple[F64, I64]:
    """Leave out instances with an invalid position or without volume; returns the others and their row numbers."""
    finite = np.isfinite(transforms).all(axis=(1, 2))
    if not finite.all():
        warn(f"{placement.prim.GetPath()}: its transform is not finite: not drawn")
    sizes = np.linalg.norm(transforms[:, :3, :3], axis=1)
    full = sizes.min(axis=1) > _LEAST_SCALE
    if (finite & ~full & (sizes.max(axis=1) > _LEAST_SCALE)).any():  # without any size they are hidden on purpose
        warn(f"{placement.prim.GetPath()}: a scale of 0 along an axis: not drawn")
    rows = np.flatnonzero(finite & full)
    return transforms[rows], rows


class _Materials:
    """Materials of every group of every placement, each read once; `sets` names the UV sets of each mesh."""

    def __init__(self, placements: list[Placement], splits: dict[object, _Split], warn: Warn) -> None:
        self.flat = [Material("fallback", base_color=GRAY), Material("displayColor", use_display_color=True)]
        prims, self._starts = [], []
        for placement in placements:
            self._starts.append(len(prims))
            for group in splits[mesh_key(placement)].groups:
                name = group.material_subset
                prims.append(placement.prim.GetChild(name) if name else placement.prim)
        bound, _ = UsdShade.MaterialBindingAPI.ComputeBoundMaterials(prims, UsdShade.Tokens.full)
        known: dict[object, tuple[int | None, ReadMaterial]] = {None: (None, ReadMaterial(None))}
        self._found, self._tints = [], {}
        self._tiles: dict[int, dict[int | None, int]] = {}
        for material in bound:
            key = _shared(material.GetPrim()).GetPath() if material else None
            if key not in known:
                read = read_material(material, warn)
                known[key] = (None if read.material is None else self._add(read.material), read)
            self._found.append(known[key])
        self.sets = self._share_sets(placements, warn)
        unbound = {prim.GetPath() for prim, material in zip(prims, bound, strict=True) if not material}
        if unbound:
            warn(f"{len(unbound)} parts have no material: drawn in displayColor or gray")

    def _add(self, material: Material) -> int:
        row = len(self.flat)
        bare, tiles = tile_materials(material)
        self.flat += [bare, *tiles.values()]
        if tiles:
            self._tiles[row] = {0: row, **dict(zip(tiles, range(row + 1, len(self.flat)), strict=True))}
        return row

    def tiles_of(self, material: int | I64) -> dict[int | None, int]:
        """Rows of a tiled material's materials by tile, 0 for all outside the tiles; empty if not tiled."""
        return self._tiles.get(material, {}) if isinstance(material, int) else {}

    def rows(self, number: int, group: int, colored: bool, placement: Placement, places: I64) -> int | I64:
        """Find the material of a group of placement number `number`: one, or one for each of some of its instances."""
        found, read = self._found[self._starts[number] + group]
        row = found if found is not None else (DISPLAY_COLOR if colored else FALLBACK)
        if row != FALLBACK and not self.flat[row].use_display_color:
            return row
        tints = _tints(placement, read.color_name, colored)
        if tints is None:
            plain = self.flat[row].use_display_color and not colored
            return self._tinted(row, self.flat[row].base_color) if plain else row
        return self._tinted_all(row, tints if len(tints) == 1 else tints[places])

    def _tinted_all(self, row: int, tints: F64) -> int | I64:
        if len(np.unique(tints, axis=0)) > _MOST_TINTS:
            tints = np.round(tints * _SHADES) / _SHADES
        colors, place = np.unique(tints, axis=0, return_inverse=True)
        found = np.array([self._tinted(row, (red, green, blue)) for red, green, blue in colors.tolist()])
        return int(found[0]) if len(found) == 1 else found[place.reshape(-1)]

    def _tinted(self, row: int, color: tuple[float, float, float]) -> int:
        """Find the row of a material with one uniform color."""
        if (row, color) not in self._tints:
            self._tints[row, color] = len(self.flat)
            self.flat.append(replace(self.flat[row], base_color=color, use_display_color=False))
        return self._tints[row, color]

    def _groups(self, placement: int) -> range:
        """Places of the materials of placement number `placement` in `_found`."""
        ends = [*self._starts[placement + 1 : placement + 2], len(self._found)]
        return range(self._starts[placement], ends[0])

    def _share_sets(self, placements: list[Placement], warn: Warn) -> dict[object, tuple[str, str]]:
        """Choose the UV sets of each mesh; materials whose own are numbered otherwise are replaced by others."""
        meshes: dict[object, tuple[Placement, list[int]]] = {}
        for number, placement in enumerate(placements):
            meshes.setdefault(mesh_key(placement), (placement, []))[1].extend(self._groups(number))
        sets: dict[object, tuple[str, str]] = {}
        renumbered: dict[tuple[int, tuple[str, str]], int] = {}
        for key, (placement, places) in meshes.items():
            read = {(one.uv_names, _reads_atlas(one)): None for one in (self._found[place][1] for place in places)}
            sets[key] = share_sets(placement.prim, [names for names, _ in read], any(atlas for _, atlas in read), warn)
            for place in places:
                row, one = self._found[place]
                moved = one.material and on_sets(one.material, one.uv_names, sets[key])
                if row is not None and moved is not None and moved is not one.material:
                    if (row, sets[key]) not in renumbered:
                        renumbered[row, sets[key]] = self._add(moved)
                    self._found[place] = (renumbered[row, sets[key]], one)
        return sets

    def color_name(self, placement: int) -> str:
        """Name the primvar of the colors that the materials of a placement read."""
        read = [self._found[place][1] for place in self._groups(placement)]
        return next((one.color_name for one in read if one.color_name != PLAIN_COLOR), PLAIN_COLOR)


def _reads_atlas(read: ReadMaterial) -> bool:
    return read.material is not None and bool(read.material.detail.macro_file)


def _tints(placement: Placement, name: str, colored: bool) -> F64 | None:
    """Find colors that instances set and the prim itself does not: one, one for each instance, or None."""
    primvars = UsdGeom.PrimvarsAPI(placement.prim)
    if primvars.GetPrimvar(name).HasAuthoredValue():
        return None
    if placement.prim.IsInstanceProxy():
        above = primvars.FindPrimvarWithInheritance(name)
        value = table_of(above.Get(placement.time), 3) if above and above.HasValue() else None
        if value is not None and len(value) and np.isfinite(value).all():
            return value[:1]
        if colored and placement.colors is None:  # another instance of this prototype sets a color
            return np.array([GRAY])
    return placement.colors if name == PLAIN_COLOR and (placement.prim.IsInstanceProxy() or not colored) else None


class _Parts:
    """Meshes already read, and the rows of their groups of faces as parts."""

    def __init__(self, pile: GeometryPile, level: int, warn: Warn) -> None:
        self.pile = pile
        self._level = level
        self._warn = warn
        self._meshes: dict[object, tuple[FlatMesh, int] | None] = {}
        self._rows: dict[tuple[object, int, int | None], int] = {}

    def mesh(self, key: object, placement: Placement, uv_names: tuple[str, str], color: str) -> FlatMesh | None:
        """Read a mesh, or return it if it has been read; None if it cannot be drawn."""
        if key not in self._meshes:
            self._meshes[key] = self._read(placement, uv_names, color)
        known = self._meshes[key]
        return known[0] if known else None

    def _read(self, placement: Placement, uv_names: tuple[str, str], color: str) -> tuple[FlatMesh, int] | None:
        prim, mesh = placement.prim, None
        try:
            with guarded(prim, self._warn, "not drawn"):
                mesh = read_mesh(prim, uv_names, placement.time, self._level, color)
        except UnreadableMeshError as error:
            self._warn(f"{prim.GetPath()}: {error}: not drawn")
        if mesh is None:
            return None
        for note in mesh.notes:
            self._warn(f"{prim.GetPath()}: {note}")
        return (mesh, self.pile.add_mesh(mesh)) if len(mesh.triangles) else None

    def row(
        self, key: object, group: int, face: I64 | None, tile: int | None, tiles: tuple[int | None, ...]
    ) -> int | None:
        """Find the part of a group of faces, or of those of its faces that are on one of several tiles."""
        if (key, group, tile) not in self._rows:
            known = self._meshes[key]
            mesh, first = known if known else (None, 0)
            if mesh is None:
                return None
            chosen = np.ones(len(mesh.triangles), bool) if face is None else face[mesh.face] == group
            if tile is not None:
                number = tile_numbers(mesh.st, mesh.triangles)
                chosen &= number == tile if tile else ~np.isin(number, [other for other in tiles if other])
            triangles = mesh.triangles[chosen] + first
            if not len(triangles):
                return None
            self._rows[key, group, tile] = self.pile.add_part(triangles, mesh.double_sided)
        return self._rows[key, group, tile]
