"""Upper bound of the number of a stage's prims, computed from its layers before composition."""

from collections.abc import Iterator
from pathlib import Path

from pxr import Sdf

from groundwork.errors import InputError
from usd_schemas.guard.layer_walk import Bounds, Warn, open_layer
from usd_schemas.guard.package_walk import evaluated

CONVERTED = "unitsResolve"  # suffix of the transform operations with which a prim converts the units of a reference

_Site = tuple[Path, Sdf.Path]


class ComposedSize:
    """Counts the prims below a prim, including those of its composition arcs: an upper bound, in linear time.

    Nested references multiply, so that a file of 3 kB can describe millions of prims; their number is computed without
    composition.
    """

    def __init__(self, bounds: Bounds, limit: int, warn: Warn) -> None:
        """Start with nothing counted.

        Args:
            bounds: Folders that file names in messages are relative to.
            limit: Largest number of prims.
            warn: Called with one line for each arc to a layer in other units.
        """
        self._bounds = bounds
        self._limit = limit
        self._warn = warn
        self._known: dict[_Site, int] = {}
        self._open: list[_Site] = []
        self._stacks: dict[Path, tuple[Sdf.Layer, ...]] = {}

    def count(self, file: Path, prim: Sdf.Path = Sdf.Path.absoluteRootPath) -> int:
        """Count a prim of a layer, with its sublayers and everything below.

        Args:
            file: Resolved path of a layer.
            prim: Prim of it.

        Returns:
            Number of prims, the prim itself included.

        Raises:
            InputError: More than the limit, or circular references between layers.
        """
        site = (file, prim)
        if site in self._known:
            return self._known[site]
        if site in self._open:
            raise InputError(
                "references form a cycle",
                where=f"{self._bounds.name(file)}: {prim}",
                hint="Remove one of the references of the cycle",
            )
        self._open.append(site)
        total = 1
        for layer, spec in self._specs(file, prim):
            total += self._content(layer, spec, file)
            if total > self._limit:
                raise InputError(
                    f"composes to more than {self._limit} prims",
                    where=f"{self._bounds.name(file)}: {prim}",
                    hint="Use fewer nested references, or a PointInstancer",
                )
        self._open.pop()
        self._known[site] = total
        return total

    def _specs(self, file: Path, prim: Sdf.Path) -> Iterator[tuple[Sdf.Layer, Sdf.PrimSpec]]:
        """Find the specs of a prim in a layer and its sublayers."""
        if file not in self._stacks:
            self._stacks[file] = tuple(self._stack(file, ()))
        for layer in self._stacks[file]:
            spec = layer.GetPrimAtPath(prim) if prim != Sdf.Path.absoluteRootPath else layer.pseudoRoot
            if spec is not None:
                yield layer, spec

    def _stack(self, file: Path, above: tuple[Path, ...]) -> Iterator[Sdf.Layer]:
        if file in above:
            raise InputError(
                "is a sublayer of itself", where=self._bounds.name(file), hint="Remove it from its subLayers"
            )
        layer = open_layer(file, self._bounds)
        yield layer
        for name in layer.subLayerPaths:
            target = _file(layer, name)
            if target is not None:
                self._compare_units(layer, "a sublayer", target)
                yield from self._stack(target, (*above, file))

    def _content(self, layer: Sdf.Layer, spec: Sdf.PrimSpec, owner: Path) -> int:
        total = 0
        for child in spec.nameChildren:
            if not child.path.ContainsPrimVariantSelection():
                # Opinions of several layers on one child count once: by the strongest layer that has it.
                total += self.count(owner, child.path) if self._first(owner, child.path, layer) else 0
            else:
                total += 1 + self._content(layer, child, owner)
        for listing in (spec.referenceList, spec.payloadList):
            for arc in listing.GetAppliedItems():
                total += self._arc(layer, spec, arc, owner)
        for listing in (spec.inheritPathList, spec.specializesList):
            total += sum(self.count(owner, target) for target in listing.GetAppliedItems())
        for variants in spec.variantSets.values():
            total += max((self._content(layer, one.primSpec, owner) for one in variants.variantList), default=0)
        return total

    def _first(self, owner: Path, prim: Sdf.Path, layer: Sdf.Layer) -> bool:
        found = next(self._specs(owner, prim), None)
        return found is not None and found[0] == layer

    def _arc(self, layer: Sdf.Layer, spec: Sdf.PrimSpec, arc: Sdf.Reference | Sdf.Payload, owner: Path) -> int:
        target = _file(layer, arc.assetPath) if arc.assetPath else owner
        if target is None:
            return 0
        if arc.assetPath and not _converts(spec):
            self._compare_units(layer, str(spec.path), target)
        name = open_layer(target, self._bounds).defaultPrim
        prim = arc.primPath or (Sdf.Path.absoluteRootPath.AppendPath(name) if name else None)
        return self.count(target, prim) if prim else 0

    def _compare_units(self, layer: Sdf.Layer, holder: str, target: Path) -> None:
        ours, theirs = _units(layer), _units(open_layer(target, self._bounds))
        for what, own, other in zip(("metersPerUnit", "upAxis"), ours, theirs, strict=True):
            if own is not None and other is not None and own != other:
                self._warn(
                    f"{self._bounds.name(Path(layer.realPath))}: {holder} references {self._bounds.name(target)}, "
                    f"whose {what} is {other}, not {own}; USD does not convert it: add a transform that does"
                )


def _converts(spec: Sdf.PrimSpec) -> bool:
    return any(name.endswith(f":{CONVERTED}") for name in spec.attributes.keys())  # noqa: SIM118 - a proxy, no dict


def _units(layer: Sdf.Layer) -> tuple[float | None, str | None]:
    world = layer.pseudoRoot
    scale, up = (world.GetInfo(key) if world.HasInfo(key) else None for key in ("metersPerUnit", "upAxis"))
    return scale, str(up) if up else None


def _file(layer: Sdf.Layer, name: str) -> Path | None:
    """Find the layer file of an arc; None if there is none, which has been reported."""
    target = (Path(layer.realPath).parent / evaluated(layer, name).partition("[")[0]).resolve()
    return target if target.is_file() and Sdf.FileFormat.FindByExtension(target.suffix.lstrip(".")) else None
