"""Which prims of a stage are drawn, and where: visibility, purpose, instances and point instancers resolved."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom, UsdShade

from usd_schemas.reading.choices import DRAWN_PURPOSES
from usd_schemas.reading.labels import LARGEST_ID, Label, Warn, inherit_label
from usd_schemas.reading.shapes import SHAPES
from usd_schemas.reading.strands import STRANDS, has_width
from usd_schemas.reading.traversal import COMPOSED, EARLIEST, guarded, numbers_of, table_of

F64 = NDArray[np.float64]
U32 = NDArray[np.uint32]

# Prototypes of an instancer may be below `over` or `class` prims, which the default predicate leaves out.
_PROTOTYPE = Usd.TraverseInstanceProxies(Usd.PrimIsActive & Usd.PrimIsLoaded)
_DEEPEST = 8  # nested instancers
_INSTANCED = ("protoIndices", "positions", "orientations", "orientationsf", "scales", "invisibleIds")
_DRIFTS = (("positions", "velocities"), ("orientations", "angularVelocities"), ("orientationsf", "angularVelocities"))
_SHAPED = (
    "points",
    "normals",
    "widths",
    "faceVertexIndices",
    "size",
    "radius",
    "radiusTop",
    "radiusBottom",
    "height",
    "width",
    "length",
    "axis",
)


@dataclass(frozen=True)
class Placement:
    """A mesh or native gprim, and its transforms.

    Attributes:
        prim: What is drawn; an instance proxy inside instances.
        transforms: Prim to stage, for column vectors [stage units], shape (N, 4, 4), float64.
        label: Its labels.
        numbers: Instance id of each of its N transforms if an instancer states them, shape (N,), uint32, or None.
        owner: The prim that gets an id if none is authored: the instancer's path, or the prim's own.
        moves: Its transform or its visibility may change with time.
        deforms: Its shape may change with time.
        time: Time code at which it was read.
        colors: Linear displayColor of each of its N transforms if an instancer states them [1], shape (N, 3), or None.
    """

    prim: Usd.Prim
    transforms: F64
    label: Label
    numbers: U32 | None
    owner: Usd.Prim
    moves: bool = False
    deforms: bool = False
    time: Usd.TimeCode = EARLIEST
    colors: F64 | None = None


@dataclass(frozen=True)
class _Above:
    """What a prim inherits from its ancestors.

    `base` transforms the space of `root` to the stage, shape (N, 4, 4); `root` is None for the stage itself.
    """

    base: F64
    root: Usd.Prim | None
    purpose: str
    label: Label
    numbers: U32 | None
    owner: Usd.Prim | None
    own_id: bool
    moves: bool
    depth: int
    colors: F64 | None = None


@dataclass(frozen=True)
class Placements:
    """The drawn prims of a stage at one time.

    Attributes:
        found: Everything that is drawn, in namespace order.
        moving: Whether the transform, shape or visibility of anything may differ at another time.
    """

    found: list[Placement]
    moving: bool


def find_placements(
    stage: Usd.Stage, warn: Warn, time: Usd.TimeCode = EARLIEST, purposes: tuple[str, ...] = DRAWN_PURPOSES
) -> Placements:
    """List everything that is drawn, in namespace order.

    Args:
        stage: Composed stage.
        warn: Called with one line for each thing that cannot be drawn.
        time: Time code at which the stage is read.
        purposes: Purposes of USD (`render`, `proxy` …) that are drawn.
    """
    walker = _Walker(warn, time, purposes)
    above = _Above(np.eye(4)[None], None, UsdGeom.Tokens.default_, Label(), None, None, False, False, 0)
    found = [item for prim in stage.GetPseudoRoot().GetFilteredChildren(COMPOSED) for item in walker.walk(prim, above)]
    for kind, paths in sorted(walker.undrawn.items()):
        warn(f"{paths[0]}: {kind} is not drawn" + (f" (nor {len(paths) - 1} more)" if len(paths) > 1 else ""))
    return Placements(found, walker.moving)


class _Walker:
    def __init__(self, warn: Warn, time: Usd.TimeCode, purposes: tuple[str, ...]) -> None:
        self.undrawn: dict[str, list[str]] = {}
        self.moving = False
        self._warn = warn
        self._time = time
        self._purposes = purposes
        self._cache = UsdGeom.XformCache(time)

    def walk(self, prim: Usd.Prim, above: _Above) -> Iterator[Placement]:
        here = None
        with guarded(prim, self._warn, "not drawn"):
            here = above if prim.IsA(UsdGeom.Subset) else self._look(prim, above)  # its label is read with its mesh
        if here is None:
            return
        if prim.IsA(UsdGeom.PointInstancer):
            yield from self._expand(UsdGeom.PointInstancer(prim), here)
            return
        if prim.IsA(UsdGeom.Gprim) and here.purpose in self._purposes:
            with guarded(prim, self._warn, "not drawn"):
                yield from self._placed(prim, here)
        predicate = COMPOSED if above.root is None else _PROTOTYPE
        for child in prim.GetFilteredChildren(predicate):
            yield from self.walk(child, here)

    def _look(self, prim: Usd.Prim, above: _Above) -> _Above | None:
        """Find what a prim passes on to those below it; None if it is not visible."""
        if prim.IsA(UsdShade.Material):
            return None
        imageable, xformable = UsdGeom.Imageable(prim), UsdGeom.Xformable(prim)
        moves = above.moves or bool(xformable and xformable.TransformMightBeTimeVarying())
        if imageable:
            blinks = imageable.GetVisibilityAttr().ValueMightBeTimeVarying()
            self.moving, moves = self.moving or blinks, moves or blinks
            if imageable.GetVisibilityAttr().Get(self._time) == UsdGeom.Tokens.invisible:
                return None
        purpose = above.purpose
        if imageable and imageable.GetPurposeAttr().HasAuthoredValue():
            purpose = str(imageable.GetPurposeAttr().Get())
        label = inherit_label(prim, above.label, above.own_id, self._warn)
        # Prims inside an instance share the ids of its prototype: an id on the instance itself distinguishes instances.
        own_id = above.own_id or (prim.IsInstance() and label.carrier == prim.GetPath())
        if prim.IsA(UsdGeom.PointInstancer):
            moves = (
                moves
                or _first_drift(prim) is not None
                or any(
                    UsdGeom.PointInstancer(prim).GetPrim().GetAttribute(name).ValueMightBeTimeVarying()
                    for name in _INSTANCED
                )
            )
        return replace(above, purpose=purpose, label=label, own_id=own_id, moves=moves)

    def _placed(self, prim: Usd.Prim, here: _Above) -> Iterator[Placement]:
        kind = str(prim.GetTypeName())
        if kind in STRANDS and not has_width(prim):
            kind += " without width"
        if not prim.IsA(UsdGeom.Mesh) and kind not in (*SHAPES, *STRANDS):
            self.undrawn.setdefault(kind, []).append(str(prim.GetPath()))
            return
        transforms = here.base @ self._relative(prim, here.root)
        deforms = any(attribute.ValueMightBeTimeVarying() for attribute in map(prim.GetAttribute, _SHAPED) if attribute)
        self.moving = self.moving or here.moves or deforms
        owner = here.owner or prim
        moves = here.moves or deforms
        yield Placement(prim, transforms, here.label, here.numbers, owner, moves, deforms, self._time, here.colors)

    def _relative(self, prim: Usd.Prim, root: Usd.Prim | None) -> F64:
        """Compute the transform of a prim to a prototype's root or to the stage, for column vectors: (4, 4)."""
        if root is None:
            return np.array(self._cache.GetLocalToWorldTransform(prim)).T
        matrix, _ = self._cache.ComputeRelativeTransform(prim, root)
        return np.array(matrix).T

    def _expand(self, instancer: UsdGeom.PointInstancer, here: _Above) -> Iterator[Placement]:
        below: list[tuple[Usd.Prim, _Above]] = []
        with guarded(instancer.GetPrim(), self._warn, "not drawn"):
            below = self._prototypes(instancer, here)
        for target, above in below:
            yield from self.walk(target, above)

    def _prototypes(self, instancer: UsdGeom.PointInstancer, here: _Above) -> list[tuple[Usd.Prim, _Above]]:
        """List the prototypes that an instancer places, each with what it inherits from the instancer."""
        prim = instancer.GetPrim()
        path = prim.GetPath()
        targets = [
            prim.GetStage().GetPrimAtPath(target) for target in instancer.GetPrototypesRel().GetForwardedTargets()
        ]
        chosen = numbers_of(instancer.GetProtoIndicesAttr().Get(self._time))
        if chosen is None:
            raise ValueError("protoIndices")
        time = self._time
        if time == EARLIEST:  # velocities would carry the instances back to the beginning of time
            time = _first_drift(prim) or time
        matrices = instancer.ComputeInstanceTransformsAtTime(
            time, time, UsdGeom.PointInstancer.IncludeProtoXform, UsdGeom.PointInstancer.IgnoreMask
        )
        matrices = np.array(matrices, np.float64).reshape(-1, 4, 4).transpose(0, 2, 1)
        if len(matrices) != len(chosen) or here.depth >= _DEEPEST or not all(targets):
            if len(chosen):
                self._warn(f"{path}: a PointInstancer without prototypes or positions: not drawn")
            return []
        if len(chosen) and not 0 <= chosen.min() <= chosen.max() < len(targets):
            self._warn(f"{path}: protoIndices name prototypes that do not exist: those instances are not drawn")
        mask = np.array(instancer.ComputeMaskAtTime(self._time), bool)
        seen = mask if len(mask) == len(chosen) else np.ones(len(chosen), bool)
        numbers, colors = self._numbers(prim, len(chosen)), self._colors(prim, len(chosen))
        to_stage = here.base @ self._relative(prim, here.root)
        below = []
        for number, target in enumerate(targets):
            rows = np.flatnonzero((chosen == number) & seen)
            if not len(rows):
                continue
            base = (to_stage[:, None] @ matrices[rows][None]).reshape(-1, 4, 4)
            ids = np.tile(numbers[rows], len(to_stage)) if numbers is not None else None
            if here.numbers is not None:  # ids of the outermost instancer have priority
                ids = np.repeat(here.numbers, len(rows))
            tints = None if here.colors is None else np.repeat(here.colors, len(rows), axis=0)
            if colors is not None:  # colors of the innermost one have priority
                tints = np.tile(colors[rows], (len(to_stage), 1))
            label = here.label if numbers is None or here.numbers is not None else replace(here.label, carrier=path)
            below.append(
                (
                    target,
                    _Above(
                        base,
                        target,
                        here.purpose,
                        label,
                        ids,
                        here.owner or prim,
                        bool(here.own_id or here.label.instance_id),
                        here.moves,
                        here.depth + 1,
                        tints,
                    ),
                )
            )
        return below

    def _numbers(self, prim: Usd.Prim, count: int) -> U32 | None:
        attribute = prim.GetAttribute("falsework:component:instanceIds")
        values = np.array((attribute.Get() if attribute else None) or [], np.int64)
        if not len(values):
            return None
        if len(values) != count or not 0 < values.min() <= values.max() <= LARGEST_ID:
            self._warn(f"{prim.GetPath()}: instanceIds do not fit the instances: ignored")
            return None
        return values.astype(np.uint32)

    def _colors(self, prim: Usd.Prim, count: int) -> F64 | None:
        primvar = UsdGeom.PrimvarsAPI(prim).GetPrimvar("displayColor")
        if not primvar or not primvar.HasAuthoredValue():
            return None
        values = table_of(primvar.ComputeFlattened(self._time), 3)
        if values is None or len(values) not in (1, count) or not np.isfinite(values).all():
            self._warn(f"{prim.GetPath()}: primvars:displayColor does not fit the instances: ignored")
            return None
        return np.broadcast_to(values, (count, 3))


def _first_drift(prim: Usd.Prim) -> Usd.TimeCode | None:
    """Find the first sample that an instancer's velocities start from; None if they move nothing."""
    for place, speed in _DRIFTS:
        samples = prim.GetAttribute(place).GetTimeSamples()
        if samples and prim.GetAttribute(speed).GetNumTimeSamples():
            return Usd.TimeCode(samples[0])
    return None
