"""Finds the bridges of an experiment in the given folders, each with its clouds by name."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from falsework.commands.given_files import need_folder
from falsework.store.artefact import read_manifest
from groundwork.canonical import digest
from groundwork.errors import InputError, MissingError
from groundwork.files import MANIFEST
from learn.compare.preset import DEFAULT_SET
from learn.datasets.labeled_cloud import identify


@dataclass(frozen=True)
class Bridge:
    """One bridge of one set.

    Attributes:
        set: Name of the set.
        name: Its name in the set.
        bridge: Hash that all clouds of the bridge share, or a name from the user.
        clouds: Name of each cloud to its folder.
        digests: Name of each cloud to the hash of its contents.
    """

    set: str
    name: str
    bridge: str
    clouds: Mapping[str, Path]
    digests: Mapping[str, str]


def find_bridges(
    sources: Sequence[tuple[str, Path]], wanted: Mapping[str, set[str]], names: Sequence[str] = ()
) -> list[Bridge]:
    """Find bridges in runs and folders of clouds.

    Args:
        sources: Name of a set and a folder: of a run, or of one bridge with a folder for each of its clouds.
        wanted: Name of each set to the clouds that the experiment uses.
        names: A name for each source that is one bridge with clouds of an older format.

    Returns:
        All bridges that have any of the clouds.

    Raises:
        InputError: No cloud in a source, a missing set or cloud, clouds of two bridges in one folder, or clouds that do
            not state their bridge.
    """
    if names and len(names) != len(sources):
        raise InputError(
            "one name is needed for each source", field="--bridge", value=len(names), allowed=str(len(sources))
        )
    _check_sources(sources, wanted)
    bridges: list[Bridge] = []
    available: dict[str, set[str]] = {}
    for number, (name, folder) in enumerate(sources):
        for place, found in _clouds_by_place(folder, names[number] if names else "").items():
            available.setdefault(name, set()).update(found)
            clouds = {cloud: path for cloud, path in found.items() if cloud in wanted[name]}
            if clouds:
                label = place.parent.name if place.name == "cloud" else place.name
                taken = {one.name for one in bridges if one.set == name}
                label = label if label not in taken else f"{label}.{number}"
                bridges.append(_bridge(name, label, place, clouds, names[number] if names else ""))
    for name, needed in sorted(wanted.items()):
        if lacking := sorted(needed - available[name]):
            raise InputError(
                "no bridge has a cloud of this name",
                field=f"clouds of the set {name}",
                value=lacking[0],
                allowed=", ".join(sorted(available[name])),
                hint="In arms and tests, use only names of existing clouds",
            )
    return bridges


def _check_sources(sources: Sequence[tuple[str, Path]], wanted: Mapping[str, set[str]]) -> None:
    """Refuse sets without a folder, folders without a set, and duplicate folders."""
    for name in sorted(wanted):
        if name not in {found for found, _ in sources}:
            hint = "Name the folder of a run" if name == DEFAULT_SET else f"Give it as {name}=FOLDER"
            raise MissingError("no folder is given for a set of bridges", field="sources", value=name, hint=hint)
    for number, (name, folder) in enumerate(sources):
        if name not in wanted:
            raise InputError(
                "the experiment has no such set of bridges",
                where=folder,
                field="sources",
                value=name,
                allowed=", ".join(sorted(wanted)),
                hint="Leave it out, or write NAME=FOLDER",
            )
        if folder.resolve() in {other.resolve() for _, other in sources[:number]}:
            raise InputError("given twice", where=folder, field="sources", hint="Name each folder once")


def _clouds_by_place(folder: Path, given: str) -> dict[Path, dict[str, Path]]:
    """Find the folders of bridges in a source, each with its clouds; only one folder if a name is given for it."""
    places = {place: _clouds(place) for place in _places(folder)}
    if not any(places.values()):
        raise InputError(
            "contains no clouds",
            where=folder,
            field="sources",
            hint="Name a run, a folder with one folder for each cloud of a bridge, or a folder of such folders",
        )
    if given and len(places) > 1:
        raise InputError(
            "has several bridges, but --bridge gives one name",
            where=folder,
            field="--bridge",
            value=given,
            hint="Name the folder of each bridge, with one --bridge for each",
        )
    return places


def _clouds(place: Path) -> dict[str, Path]:
    """List the clouds of a bridge: the folders that hold one."""
    return {path.name: path for path in sorted(place.iterdir()) if (path / "cloud.json").is_file()}


def _places(folder: Path) -> list[Path]:
    """List the folders that hold one folder for each cloud of a bridge: of a run, itself, or its subfolders."""
    need_folder(folder, "a run, or a folder with a bridge's clouds")
    if (folder / "scenes").is_dir():
        return sorted(path for path in folder.glob("scenes/*/cloud") if path.is_dir())
    if _clouds(folder):
        return [folder]
    return sorted(path for path in folder.iterdir() if path.is_dir() and _clouds(path)) or [folder]


def _bridge(name: str, label: str, place: Path, clouds: Mapping[str, Path], given: str) -> Bridge:
    found, digests = set(), {}
    for cloud, path in clouds.items():
        if (path / MANIFEST).is_file():  # in a store: its files are already hashed
            digests[cloud] = digest(read_manifest(path / MANIFEST)["files"])
            found.add(given or _told(path))
        else:
            facts = identify(path, None, given)
            digests[cloud] = facts.digest
            found.add(facts.bridge)
    if len(found) > 1:
        raise InputError(
            "contains clouds of several bridges",
            where=place,
            field="bridge",
            value=", ".join(sorted(found)),
            hint="Put the clouds of each bridge into a separate folder",
        )
    return Bridge(name, label, found.pop(), dict(clouds), digests)


def _told(path: Path) -> str:
    from groundwork.files import read_json

    stored = read_json(path / "cloud.json")
    bridge = stored.get("bridge", "") if isinstance(stored, dict) else ""
    if not isinstance(bridge, str) or not bridge:
        raise InputError(
            "does not state its bridge, so no bridge can be held out for the test",
            where=path,
            field="bridge",
            hint="Make the cloud again, or name it with --bridge",
        )
    return bridge
