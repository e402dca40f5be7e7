"""Choice of bridges and windows for arms and tests: those that all compared clouds have."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from groundwork.errors import InputError
from learn.compare.experiment import ExperimentSettings, Part
from learn.compare.pieces import PieceCounts
from learn.compare.sources import WindowPlace
from learn.datasets.labeled_cloud import SourceFacts
from learn.datasets.settings import DatasetSettings
from learn.datasets.split import TEST, TRAIN, VAL, split_bridges
from learn.trained import FOREST


@dataclass(frozen=True)
class CutScene:
    """A bridge whose clouds are cut.

    Attributes:
        set: Name of the set that it belongs to.
        name: Its name in the set.
        bridge: Hash of the bridge.
        folder: What `learn.compare.pieces.cut_pieces` wrote.
        counts: Name of each cloud to its points in each window.
    """

    set: str
    name: str
    bridge: str
    folder: Path
    counts: Mapping[str, PieceCounts]


@dataclass(frozen=True)
class Losses:
    """Number of training windows that an arm has not enough points in.

    Attributes:
        group: Arms that share their windows.
        part: The clouds.
        bridges: Training bridges that have these clouds.
        candidates: Windows in which any clouds of the group have enough points.
        valid: Windows in which these clouds have enough points.
        common: Windows in which all clouds of the group have enough points.
    """

    group: tuple[str, ...]
    part: str
    bridges: int
    candidates: int
    valid: int
    common: int


def cloud_name(part: Part) -> str:
    """Return the name of a part's clouds in the pieces.

    Args:
        part: The part.
    """
    return f"{part.cloud}~{part.like}" if part.like else part.cloud


def parts_in(settings: ExperimentSettings, arms: Iterable[str]) -> tuple[Part, ...]:
    """List the clouds of some arms, each once.

    Args:
        settings: The experiment.
        arms: Names.
    """
    return tuple(dict.fromkeys(part for arm in arms for part in settings.parts(arm)))


def share_out(settings: ExperimentSettings, bridges: Mapping[str, Sequence[str]]) -> dict[tuple[str, str], str]:
    """Assign every bridge of every set to one split.

    A set that no arm is trained on is for testing; a set that is not tested on is for training and validation; of a set
    that is used for both, whole bridges are held out.

    Args:
        settings: The experiment.
        bridges: Name of each set to its bridges.

    Returns:
        Set and bridge to train, val or test.

    Raises:
        InputError: A bridge would be used for both training and test, or a bridge to be held out is missing.
    """
    trained = {part.set for part in parts_in(settings, settings.arms)}
    tested = {settings.test(name).set for name in settings.tests}
    found: dict[tuple[str, str], str] = {}
    strange = set(settings.held)
    for name, own in sorted(bridges.items()):
        if name not in trained:
            found |= {(name, bridge): TEST for bridge in own}
            continue
        train, val, test = settings.shares
        if name not in tested:
            train, val, test = train / max(train + val, 1e-9), val / max(train + val, 1e-9), 0.0
        facts = [SourceFacts(bridge, bridge, bridge, "") for bridge in own]
        held = tuple(one for one in settings.held if any(bridge.startswith(one) for bridge in own))
        if name in tested:
            strange -= {*held}
        how = DatasetSettings(shares=(train, val, test), seed=settings.split_seed, test=held if name in tested else ())
        found |= {(name, bridge): split for bridge, split in split_bridges(facts, how).items()}
    if strange:
        names = sorted({bridge[:12] for name, own in bridges.items() if name in trained & tested for bridge in own})
        raise InputError(
            "no bridge that can be held out has a name that begins with this",
            field="held",
            value=min(strange),
            allowed=", ".join(names) or "nothing: no set is both trained on and tested on",
        )
    seen = {bridge for (_, bridge), split in found.items() if split != TEST}
    both = sorted(bridge for (_, bridge), split in found.items() if split == TEST and bridge in seen)
    if both:
        raise InputError(
            "a bridge is in a set for training and in a set for the test",
            field="tests",
            value=both[0],
            hint="Use other bridges in one of them",
        )
    return found


def check_bridges(
    settings: ExperimentSettings, splits: Mapping[tuple[str, str], str], bridges: Iterable[tuple[str, str, set[str]]]
) -> None:
    """Refuse an experiment that lacks bridges for training, validation or test, before anything is made.

    Args:
        settings: The experiment.
        splits: Of `share_out`.
        bridges: Set, bridge, and the names of its clouds.

    Raises:
        InputError: An arm or a test has no bridge.
    """
    rows = [(part_set, splits[part_set, bridge], clouds) for part_set, bridge, clouds in bridges]

    def lacks(part: Part, parts: Iterable[Part], split: str) -> bool:
        needed = {name for other in parts if other.set == part.set for name in (other.cloud, other.like) if name}
        return not any((part.set, split) == (own, its) and needed <= clouds for own, its, clouds in rows)

    tests = [settings.test(name) for name in settings.tests]
    for name, part in zip(settings.tests, tests, strict=True):
        if lacks(part, tests if settings.windows == "all" else [part], TEST):
            raise _too_few("test", f"tests.{name}", part)
    for group in settings.groups:
        for arm in group:
            parts = settings.parts(arm)
            for part in parts:
                if lacks(part, parts_in(settings, group), TRAIN):
                    raise _too_few("train on", f"arms.{arm}", part)
            if set(settings.models) != {FOREST} and all(lacks(part, parts_in(settings, group), VAL) for part in parts):
                raise _too_few("validate on", f"arms.{arm}", parts[0])


def _too_few(what: str, field: str, part: Part) -> InputError:
    return InputError(
        f"no bridge is left to {what}",
        field=field,
        value=str(part),
        hint="Give more bridges, each with all the clouds that are compared, or change shares or held",
    )


def windows_of(
    scenes: Sequence[CutScene],
    splits: Mapping[tuple[str, str], str],
    settings: ExperimentSettings,
    *,
    arm: str,
    group: tuple[str, ...],
    split: str,
) -> list[WindowPlace]:
    """List the windows of an arm in which all arms of its group have enough points.

    Args:
        scenes: All bridges.
        splits: Of `share_out`.
        settings: The experiment.
        arm: The arm.
        group: Arms that share their windows, this one among them.
        split: train or val.
    """
    places = []
    for part in settings.parts(arm):
        needed = {cloud_name(other) for other in parts_in(settings, group) if other.set == part.set}
        for scene in scenes:
            if scene.set != part.set or splits[scene.set, scene.bridge] != split or not needed <= scene.counts.keys():
                continue
            for number in _valid(scene, needed, settings.fewest, quiet=split == TRAIN):
                points = scene.counts[cloud_name(part)].all[number]
                places.append(WindowPlace(scene.folder, cloud_name(part), number, scene.bridge, points))
    return places


def windows_to_test(
    scenes: Sequence[CutScene], splits: Mapping[tuple[str, str], str], settings: ExperimentSettings, test: str
) -> list[WindowPlace]:
    """List the windows of a test; with `windows = "all"` they are the same in all tests on one set of bridges.

    Args:
        scenes: All bridges.
        splits: Of `share_out`.
        settings: The experiment.
        test: Its name.
    """
    part = settings.test(test)
    others = {settings.test(name) for name in settings.tests} if settings.windows == "all" else {part}
    needed = {cloud_name(other) for other in others if other.set == part.set}
    return [
        WindowPlace(scene.folder, cloud_name(part), number, scene.bridge, scene.counts[cloud_name(part)].all[number])
        for scene in scenes
        if scene.set == part.set and splits[scene.set, scene.bridge] == TEST and needed <= scene.counts.keys()
        for number in _valid(scene, needed, settings.fewest, quiet=False)
    ]


def losses_of(
    scenes: Sequence[CutScene], splits: Mapping[tuple[str, str], str], settings: ExperimentSettings
) -> list[Losses]:
    """Count the training windows that each arm lacks.

    Args:
        scenes: All bridges.
        splits: Of `share_out`.
        settings: The experiment.
    """
    found = []
    for group in settings.groups:
        parts = parts_in(settings, group)
        for part in parts:
            needed = {cloud_name(other) for other in parts if other.set == part.set}
            mine = [scene for scene in scenes if scene.set == part.set and splits[part.set, scene.bridge] == TRAIN]
            whole = [scene for scene in mine if needed <= scene.counts.keys()]
            having = [scene for scene in mine if cloud_name(part) in scene.counts]
            found.append(
                Losses(
                    group,
                    str(part),
                    len({scene.bridge for scene in having}),
                    sum(len(_any(scene, needed, settings.fewest)) for scene in mine),
                    sum(len(_valid(scene, {cloud_name(part)}, settings.fewest, quiet=True)) for scene in having),
                    sum(len(_valid(scene, needed, settings.fewest, quiet=True)) for scene in whole),
                )
            )
    return found


def _valid(scene: CutScene, clouds: Iterable[str], fewest: int, *, quiet: bool) -> list[int]:
    """Find the windows in which all given clouds have enough points."""
    kept = [_enough(scene.counts[name], fewest, quiet) for name in clouds]
    return sorted(set.intersection(*kept)) if kept else []


def _any(scene: CutScene, clouds: Iterable[str], fewest: int) -> set[int]:
    return set().union(*(_enough(scene.counts[name], fewest, True) for name in clouds if name in scene.counts))


def _enough(counts: PieceCounts, fewest: int, quiet: bool) -> set[int]:
    return {number for number, points in enumerate(counts.quiet if quiet else counts.all) if points >= fewest}
