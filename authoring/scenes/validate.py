"""Validation of a scene: USD's own validators and our rules, in every variant."""

from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from pxr import Kind, Sdf, Usd, UsdGeom, UsdUtils, UsdValidation

from groundwork.errors import InputError
from usd_schemas import tokens
from usd_schemas.apis import direct_label, read_component, read_survey
from usd_schemas.components import class_rows, component_classes
from usd_schemas.pinhole import UsdLens, lens_from_pinhole
from usd_schemas.reading.labels import read_taxonomy

LENS_TOLERANCE = 1e-4  # relative

_WARNING = UsdValidation.ValidationErrorType.Warn

Rule = Callable[[Usd.Stage], Iterator[str]]


def validate_scene(path: Path) -> list[str]:
    """Find every fault of a scene.

    Args:
        path: `scene.usda` or any other stage.

    Returns:
        One line for each finding, naming the prim or layer; empty if the scene is valid in every variant.

    Raises:
        InputError: USD cannot open the file.
    """
    try:
        stage = Usd.Stage.Open(str(path))
    except Exception as error:
        raise InputError("not readable as a USD stage", where=path, hint="Check the file") from error
    findings = Counter(list(asset_findings(path)))
    selections = [(), *_selections(stage)]
    stage.SetEditTarget(stage.GetSessionLayer())
    for selection in selections:
        stage.GetSessionLayer().Clear()
        if selection:
            prim, name, variant = selection
            stage.GetPrimAtPath(prim).GetVariantSet(name).SetVariantSelection(variant)
        label = f" ({selection[1]}={selection[2]})" if selection else ""
        for line in sorted({line for rule in RULES for line in rule(stage)}):
            if line not in findings:  # findings of the scene itself are not repeated for each variant
                findings[line + label] += 1
    return sorted(findings)


def usd_findings(stage: Usd.Stage) -> Iterator[str]:
    """Run USD's own validators, except those of packages and physics.

    Args:
        stage: Stage to check.
    """
    registry = UsdValidation.ValidationRegistry()
    names = [metadata.name for metadata in registry.GetAllValidatorMetadata()]
    chosen = [name for name in names if not any(word in name for word in ("Package", "FileExtension", "Physics"))]
    context = UsdValidation.ValidationContext([registry.GetOrLoadValidatorByName(name) for name in sorted(chosen)])
    for error in context.Validate(stage):
        sites = [str(site.GetPrim().GetPath()) for site in error.GetSites() if site.IsPrim()]
        if _is_elsewhere(error) or (error.GetType() == _WARNING and sites and sites[0].startswith(tokens.BACKGROUND)):
            continue  # advice about a world of the user's, who may flip normals if the image was made that way
        yield f"{sites[0] if sites else 'stage'}: {error.GetMessage()} [{error.GetName()}]"


def label_findings(stage: Usd.Stage) -> Iterator[str]:
    """Check that every visible surface has one component and one class, both in the tables and consistent.

    The class on a prim is always that of the base table; a taxonomy of the stage must be valid and
    have a row for each component.

    Args:
        stage: Stage to check.
    """
    table, names = component_classes(), {row.name for row in class_rows()}
    unusable: list[str] = []
    in_force = read_taxonomy(stage, unusable.append)
    yield from unusable
    for prim in surfaces(stage):
        component = _inherited(prim, tokens.COMPONENT_TAXONOMY)
        label = _inherited(prim, tokens.CLASS_TAXONOMY)
        if label not in names:
            yield f"{prim.GetPath()}: class {label!r} is not in the class table"
        if component and component not in table:
            yield f"{prim.GetPath()}: component {component!r} is not in the component table"
        elif component and table[component] != label:
            yield f"{prim.GetPath()}: component {component!r} belongs to class {table[component]!r}, not {label!r}"
        elif not component and not str(prim.GetPath()).startswith((tokens.BACKGROUND, tokens.ADDITIONS)):
            yield f"{prim.GetPath()}: has no component label"
        if component and in_force.classes and component not in in_force.classes:
            yield f"{prim.GetPath()}: component {component!r} has no class in the taxonomy {in_force.name!r}"


def mesh_findings(stage: Usd.Stage) -> Iterator[str]:
    """Check that visible meshes of the scene have faces: one without was cut away entirely, and shows nothing.

    Args:
        stage: Stage to check.
    """
    for prim in surfaces(stage):
        brought = str(prim.GetPath()).startswith(tokens.BACKGROUND) and not _known(prim)  # a world of the user's
        if brought or not prim.IsA(UsdGeom.Mesh):
            continue
        if not UsdGeom.Mesh(prim).GetFaceVertexCountsAttr().Get(Usd.TimeCode.EarliestTime()):
            yield f"{prim.GetPath()}: a mesh without faces"


def id_findings(stage: Usd.Stage) -> Iterator[str]:
    """Check that instance ids are positive and unique; leaf names and stable ids are unique, as other programs need.

    Args:
        stage: Stage to check.
    """
    ids: Counter[int] = Counter()
    for prim in pickable_prims(stage):
        facts = read_component(prim)
        own = facts.instance_ids or ((facts.instance_id,) if facts.instance_id else ())
        if not own and not str(prim.GetPath()).startswith(tokens.BACKGROUND):
            yield f"{prim.GetPath()}: has no instance id"
        if min(own, default=1) < 1:
            yield f"{prim.GetPath()}: instance ids must be above 0"
        ids.update(set(own))
    yield from (f"instance id {number}: used by {count} prims" for number, count in ids.items() if count > 1)
    xforms = [prim for prim in stage.Traverse() if prim.IsA(UsdGeom.Xformable)]
    # An imported world has its own names, and is not matched by name.
    named = [prim for prim in xforms if _known(prim) or not str(prim.GetPath()).startswith(tokens.BACKGROUND)]
    names = Counter(prim.GetName() for prim in named)
    yield from (f"prim name {name}: used {count} times" for name, count in names.items() if count > 1)
    stable = Counter(str(prim.GetAttribute(tokens.USER_FALSEWORK_ID).Get() or "") for prim in xforms)
    yield from (f"falseworkId {name}: used {count} times" for name, count in stable.items() if name and count > 1)


def kind_findings(stage: Usd.Stage) -> Iterator[str]:
    """Check that model kinds have no gap: a group or component is below groups only.

    Args:
        stage: Stage to check.
    """
    for prim in stage.Traverse():
        kind = Usd.ModelAPI(prim).GetKind()
        if kind and Kind.Registry.IsA(kind, Kind.Tokens.model) and not prim.IsModel():
            yield f"{prim.GetPath()}: kind {kind!r} below a prim that is not a group"


def camera_findings(stage: Usd.Stage) -> Iterator[str]:
    """Check that poses lie at the integer codes 0 to N - 1, and that the lens equals the calibration.

    Args:
        stage: Stage to check.
    """
    for prim in stage.Traverse():
        if not prim.HasAPI("FalseworkSurveyAPI"):
            continue
        camera = UsdGeom.Camera(prim)
        samples = [sample for op in camera.GetOrderedXformOps() for sample in op.GetTimeSamples()]
        facts = read_survey(prim, 0)
        if samples != [float(code) for code in range(len(samples))] or len(samples) != len(facts.image_names):
            yield f"{prim.GetPath()}: time samples are not 0 to N - 1 for its N image names"
        if facts.calibration is None:
            yield f"{prim.GetPath()}: has no calibration"
            continue
        expected = lens_from_pinhole(facts.calibration, facts.sensor_width, UsdGeom.GetStageMetersPerUnit(stage))
        found = UsdLens(
            camera.GetFocalLengthAttr().Get(),
            camera.GetHorizontalApertureAttr().Get(),
            camera.GetVerticalApertureAttr().Get(),
            camera.GetHorizontalApertureOffsetAttr().Get(),
            camera.GetVerticalApertureOffsetAttr().Get(),
        )
        ours, theirs = np.array(lens_values(expected)), np.array(lens_values(found))
        if np.abs(ours - theirs).max() > LENS_TOLERANCE * expected.focal_length:
            yield f"{prim.GetPath()}: lens {lens_values(found)} differs from the calibration {lens_values(expected)}"


def asset_findings(path: Path) -> Iterator[str]:
    """Check that every arc and file in any layer, in any variant, starts with ./ , has no `..`, and exists.

    Args:
        path: Root layer.
    """
    root = path.resolve().parent
    pending, seen = [path.resolve()], set()
    while pending:
        layer = pending.pop()
        if layer in seen:
            continue
        seen.add(layer)
        for group in UsdUtils.ExtractExternalReferences(str(layer)):
            for name in group:
                target = (layer.parent / name).resolve()
                where = f"{layer.relative_to(root).as_posix()}: {name}"
                if not name.startswith("./") or ".." in Path(name).parts:
                    yield f"{where}: must start with ./ and have no .."
                elif not target.is_file():
                    yield f"{where}: there is no such file"
                elif Sdf.FileFormat.FindByExtension(target.suffix.lstrip(".")):
                    pending.append(target)


RULES: tuple[Rule, ...] = (
    usd_findings,
    label_findings,
    mesh_findings,
    id_findings,
    kind_findings,
    camera_findings,
)


def surfaces(stage: Usd.Stage) -> Iterator[Usd.Prim]:
    """Walk the visible Gprims and PointInstancers of a stage, with instance proxies and without prototypes.

    Args:
        stage: Stage to walk.
    """
    walk = iter(Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies()))
    for prim in walk:
        if prim.IsA(UsdGeom.PointInstancer):
            walk.PruneChildren()
        elif not prim.IsA(UsdGeom.Gprim):
            continue
        if UsdGeom.Imageable(prim).ComputeVisibility() != UsdGeom.Tokens.invisible:
            yield prim


def pickable_prims(stage: Usd.Stage) -> Iterator[Usd.Prim]:
    """Iterate over the selectable prims of a stage: its surfaces, and native instances instead of their surfaces.

    Args:
        stage: Stage to walk.
    """
    last = None
    for prim in surfaces(stage):
        while prim.IsInstanceProxy():
            prim = prim.GetParent()
        if prim != last:  # the surfaces of an instance follow one another
            yield prim
        last = prim


def lens_values(lens: UsdLens) -> tuple[float, float, float, float, float]:
    """List the values of a lens.

    Args:
        lens: Lens attributes.

    Returns:
        Focal length, horizontal and vertical aperture, horizontal and vertical offset [0.1 stage units].
    """
    return (
        lens.focal_length,
        lens.horizontal_aperture,
        lens.vertical_aperture,
        lens.horizontal_offset,
        lens.vertical_offset,
    )


def _is_elsewhere(error: UsdValidation.ValidationError) -> bool:
    """Check whether a finding is only that MaterialX is not installed here: the shader is for other programs."""
    return error.GetName() == "MissingShaderIdInRegistry" and "'ND_" in error.GetMessage()


def _known(prim: Usd.Prim) -> bool:
    return bool(prim.GetAttribute(tokens.USER_FALSEWORK_ID).Get())


def _inherited(prim: Usd.Prim, taxonomy: str) -> str:
    while prim and not prim.IsPseudoRoot():
        label = direct_label(prim, taxonomy)
        if label:
            return label
        prim = prim.GetParent()
    return ""


def _selections(stage: Usd.Stage) -> list[tuple[Sdf.Path, str, str]]:
    chosen = []
    for prim in stage.Traverse():
        for name in prim.GetVariantSets().GetNames():
            variants = prim.GetVariantSet(name)
            current = variants.GetVariantSelection()
            chosen += [(prim.GetPath(), name, one) for one in sorted(variants.GetVariantNames()) if one != current]
    return chosen
