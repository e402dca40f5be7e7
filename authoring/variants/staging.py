"""A user's asset before it is added to a scene: made in a temporary folder, checked there, and moved if it is valid."""

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from pxr import Sdf, Usd

from authoring.layers.selection import AXES
from authoring.scenes.validate import RULES, asset_findings, usd_findings
from groundwork.errors import InputError
from groundwork.files import put_in_place, sweep, temporary_name
from usd_schemas import tokens
from usd_schemas.guard.layer_walk import Warn

_TRIAL = "falsework_trial"  # a name that no variant of a scene has
_NAMED = 3

Offer = Callable[[], None]


@dataclass(frozen=True)
class Staged:
    """An asset that is ready to be added; until then the scene is unchanged.

    Attributes:
        name: Its name in the scene.
        fresh: Its temporary folder, beside its place.
        place: Its final folder.
        offer: Adds it to the scene's choices.
    """

    name: str
    fresh: Path
    place: Path
    offer: Offer

    def commit(self) -> None:
        """Move the asset to its place, replacing a former one of its name, and add it to the scene's choices."""
        sweep(self.fresh)
        put_in_place(self.fresh, self.place)
        self.offer()

    def discard(self) -> None:
        """Delete the asset, if it is still in its temporary folder."""
        shutil.rmtree(self.fresh, ignore_errors=True)
        home = self.fresh.parent
        if home.is_dir() and not any(home.iterdir()):
            home.rmdir()  # made only for this asset


def fresh_folder(place: Path) -> Path:
    """Make an empty folder beside the place of an asset, under a unique name.

    Args:
        place: Final folder of the asset.
    """
    fresh = temporary_name(place, f"-{place.name}")
    fresh.mkdir(parents=True)
    return fresh


def check_asset(scene: Path, axis: str, layer: Path, file: Path, warn: Warn) -> None:
    """Validate an asset as composed in the scene.

    Args:
        scene: Root layer of the scene.
        axis: `background` or `look`.
        layer: Root layer of the asset.
        file: The file that it came from, for errors.
        warn: Called with one line for findings of USD's own validators, which do not refuse the asset.

    Raises:
        InputError: The scene would not be valid with it.
    """
    owner, shown = AXES[axis], tokens.BACKGROUND if axis == "background" else f"{tokens.BRIDGE}/BridgeLooks"
    mask = Usd.StagePopulationMask([shown, tokens.SEMANTIC_VAR])
    session = Sdf.Layer.CreateAnonymous(".usda")
    spec = Sdf.CreatePrimInLayer(session, owner)
    spec.variantSelections[axis] = _TRIAL
    variant = Sdf.VariantSpec(Sdf.VariantSetSpec(spec, axis), _TRIAL).primSpec
    if axis == "background":
        variant.payloadList.prependedItems = [Sdf.Payload(str(layer.resolve()))]
    else:
        looks = Sdf.PrimSpec(variant, "BridgeLooks", Sdf.SpecifierOver)
        looks.referenceList.prependedItems = [Sdf.Reference(str(layer.resolve()))]
    stage = Usd.Stage.OpenMasked(Sdf.Layer.FindOrOpen(str(scene.resolve())), session, mask)
    wrong = [*asset_findings(layer), *(line for rule in RULES if rule is not usd_findings for line in rule(stage))]
    if wrong:
        raise InputError("would make the scene invalid", where=file, field=axis, value=_few(wrong))
    odd = sorted(set(usd_findings(stage)))
    if odd:
        warn(f"{file.name}: used as it is, but USD's validators report: {_few(odd)}")


def _few(lines: list[str]) -> str:
    more = f"; and {len(lines) - _NAMED} more" if len(lines) > _NAMED else ""
    return "; ".join(lines[:_NAMED]) + more
