"""The verbs of `falsework dataset`: make training sets from clouds, and export them."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from falsework.commands.answers import AsJson, tell
from falsework.commands.console import ConsoleProgress
from falsework.commands.given_files import need_folder
from falsework.commands.given_settings import given_settings
from falsework.commands.origins import origin_of
from groundwork.errors import InputError, MissingError
from groundwork.output.folder import fresh_output
from groundwork.output.reading import reading
from groundwork.settings import parse_settings
from learn.datasets.scan_units import AS_STATED, ScanUnits, Unit, Up

Sources = tyro.conf.Positional[tuple[Path, ...]]
Output = Annotated[Path, tyro.conf.arg(aliases=["-o"])]
Given = tyro.conf.UseAppendAction[tuple[str, ...]]


def local(
    sources: Sources,
    output: Output,
    *,
    mode: Literal["metric", "paper"] = "metric",
    table: str = "kim2023",
    split: Literal["bridge", "random"] = "bridge",
    class_map: str = "",
    bridge: Given = (),
    unit: Unit | None = None,
    scale: float | None = None,
    up: Up = "z",
    seed: int = 0,
    set: Given = (),
    as_json: AsJson = False,
) -> int:
    """Make a data set of local pieces of some meters from clouds.

    Args:
        sources: Folders of clouds, output folders of runs, or scans from elsewhere (these with --class-map).
        output: Folder to write: a data set.
        mode: Metric tiles, as in prediction; or the paper's windows along the bridge.
        table: Table of classes, one of those in docs/classes.md.
        split: Hold out whole bridges, or pieces at random as in the paper.
        class_map: Meaning of the class numbers of a scan: a map of the package, or a .toml or .json file.
        bridge: Name of the bridge of each source, if it does not state one; once for each source, in their order.
        unit: Unit of the coordinates of the scans; overrides the unit that a scan states.
        scale: Length of one unit of scans without a scale [m].
        up: Axis of the scans that points up.
        seed: Seed of splits and draws.
        set: A further setting, such as `points=2048` or `tile.size=8.0`; may be given more than once.
        as_json: Print one JSON object instead of lines.
    """
    values = {"mode": mode, "table": table, "split": split, "seed": seed}
    clouds = _Clouds(sources, class_map, bridge, {"unit": unit, "scale": scale, "up": up})
    return _build("local", clouds, output, values, set, as_json)


def whole(
    sources: Sources,
    output: Output,
    *,
    mode: Literal["metric", "paper"] = "metric",
    table: str = "falsework",
    split: Literal["bridge", "random"] = "bridge",
    stratified: int = 0,
    class_map: str = "",
    bridge: Given = (),
    unit: Unit | None = None,
    scale: float | None = None,
    up: Up = "z",
    seed: int = 0,
    set: Given = (),
    as_json: AsJson = False,
) -> int:
    """Make a data set of whole bridges or large parts of them, with noisy points as a class.

    Args:
        sources: Folders of clouds, output folders of runs, or scans from elsewhere (these with --class-map).
        output: Folder to write: a data set.
        mode: Large metric tiles, as in prediction; or one draw from each cloud, as in the paper.
        table: Table of classes, one of those in docs/classes.md.
        split: Hold out whole bridges, or clouds at random.
        stratified: Least number of points of each class in a training draw, if the piece has them; 0: no minimum.
        class_map: Meaning of the class numbers of a scan: a map of the package, or a .toml or .json file.
        bridge: Name of the bridge of each source, if it does not state one; once for each source, in their order.
        unit: Unit of the coordinates of the scans; overrides the unit that a scan states.
        scale: Length of one unit of scans without a scale [m].
        up: Axis of the scans that points up.
        seed: Seed of splits and draws.
        set: A further setting, such as `points=32768` or `noisy=0.03`; may be given more than once.
        as_json: Print one JSON object instead of lines.
    """
    values = {"mode": mode, "table": table, "split": split, "seed": seed, "stratified": stratified}
    clouds = _Clouds(sources, class_map, bridge, {"unit": unit, "scale": scale, "up": up})
    return _build("global", clouds, output, values, set, as_json)


def export(
    dataset: tyro.conf.Positional[Path],
    output: Output,
    *,
    to: Literal["s3dis", "hdf5", "parquet"],
    as_json: AsJson = False,
) -> int:
    """Write a data set for other training code.

    Pointcept reads the folders of a data set without export.

    Args:
        dataset: A data set.
        output: Folder to write.
        to: Format.
        as_json: Print one JSON object instead of lines.
    """
    need_folder(dataset, "a folder that falsework dataset has written", mark="dataset.json")
    from learn.datasets.export import export_dataset

    def write(folder: Path) -> None:
        export_dataset(dataset, to, folder)

    with reading(dataset):
        fresh_output(output, "export", write, inputs=[dataset])
    return tell({"format": to, "folder": str(output)}, [f"export  {output}"], as_json)


def demo(output: Output, *, photographs: bool = False, as_json: AsJson = False) -> int:
    """Write the labeled clouds of random bridges that the package contains, one folder each, with a card.

    They are small, sampled on the mesh and thinned; the card states their limits.

    Args:
        output: Folder to write.
        photographs: Make three small scenes of different families, too: photographs with labels, depth and poses, and
            a sparse and a dense cloud with measured uncertainty. Takes about six minutes on two cores. Fewer of the
            clouds are written, so that everything stays below 60 MB.
        as_json: Print one JSON object instead of lines.
    """
    from falsework.commands.photographed_scenes import photographed_scenario, scene_lines, write_scenes
    from falsework.execution.interrupts import prompt_ending
    from learn.demo.clouds import demo_clouds
    from learn.demo.ready_made import BESIDE_SCENES, small_enough, write_ready_made

    clouds = small_enough(demo_clouds(), BESIDE_SCENES, ()) if photographs else small_enough(demo_clouds())
    counts, scenes = list[int](), list[str]()

    def write(folder: Path) -> None:
        made = write_scenes(folder, photographed_scenario(), progress) if photographs else []
        scenes.extend(scene.name for scene in made)
        counts.append(write_ready_made(clouds, folder, scene_lines(made) if made else ()))

    with prompt_ending(), ConsoleProgress() as progress:
        fresh_output(output, "clouds", write)
    card = output / "README.md"
    also = f", {len(scenes)} scenes with photographs" if scenes else ""
    line = f"clouds  {output}: {len(clouds)} bridges, {counts[-1]:,} points{also}; read {card}"
    facts = {"folder": str(output), "bridges": len(clouds), "points": counts[-1], "card": str(card)}
    return tell(facts | ({"scenes": scenes} if photographs else {}), [line], as_json)


@dataclass(frozen=True)
class _Clouds:
    """Sources of a data set: files and folders, class map and units of the scans, and names of their bridges."""

    sources: tuple[Path, ...]
    class_map: str
    bridges: tuple[str, ...]
    units: dict[str, Any]


def _build(
    kind: str, clouds: _Clouds, output: Path, values: dict[str, Any], given: tuple[str, ...], as_json: bool
) -> int:
    from learn.datasets.class_map import read_class_map
    from learn.datasets.class_tables import OWN, class_table
    from learn.datasets.settings import dataset_settings

    for source in clouds.sources:
        if not source.exists():
            raise MissingError("no such file or folder", where=source, hint="Name the folder of a cloud, or a scan")
    settings = dataset_settings(kind, values | nested(given_settings(given)), "--set")
    if settings.table != OWN:
        class_table(settings.table, settings.noisy_class)
    known = read_class_map(clouds.class_map) if clouds.class_map else None
    from learn.datasets.build import Source, build_dataset

    bridges = clouds.bridges
    paths = [path for source in clouds.sources for path in clouds_in(source)]
    if bridges and len(bridges) != len(paths):
        raise InputError(
            "one name is needed for each source", field="--bridge", value=len(bridges), allowed=str(len(paths))
        )
    units = _units(clouds.units, paths)
    named = [
        Source(path, None if path.is_dir() else known, name, *origin_of(path), units)
        for path, name in zip(paths, bridges or [""] * len(paths), strict=True)
    ]

    def write(folder: Path) -> None:
        build_dataset(named, folder, settings, progress)

    with ConsoleProgress() as progress, reading(*paths):
        fresh_output(output, "dataset", write, inputs=paths)
    return tell(_facts(output) if as_json else {}, [f"dataset {output}"], as_json)


def _units(given: dict[str, Any], paths: list[Path]) -> ScanUnits:
    """Read the unit of the scans; without a scan none may be given, because clouds are in meters."""
    units = parse_settings(ScanUnits, given, "dataset", given.keys())
    if units != AS_STATED and all(path.is_dir() for path in paths):
        raise InputError(
            "is given, and no source is a scan: clouds are in meters, z up",
            field=next(f"--{name}" for name in given if getattr(units, name) != getattr(AS_STATED, name)),
            hint="Leave it out",
        )
    return units


def _facts(dataset: Path) -> dict[str, Any]:
    """Count pieces, points and bridges of each split of a data set."""
    from learn.datasets.layout import read_facts

    facts, splits = read_facts(dataset), dict[str, dict[str, int]]()
    for name in sorted({piece.split for piece in facts.pieces}):
        rows = [piece for piece in facts.pieces if piece.split == name]
        bridges = len({piece.bridge for piece in rows})
        splits[name] = {"pieces": len(rows), "points": sum(piece.points for piece in rows), "bridges": bridges}
    return {"dataset": str(dataset), "classes": list(facts.classes), "splits": splits}


def nested(given: dict[str, Any]) -> dict[str, Any]:
    """Convert dotted keys such as `tile.size` to nested tables, of any depth.

    Args:
        given: Settings of `--set`.
    """
    whole: dict[str, Any] = {}
    for key, value in given.items():
        *groups, last = key.split(".")
        table = whole
        for group in groups:
            if not isinstance(table.get(group), dict):
                table[group] = {}
            table = table[group]
        table[last] = value
    return whole


def clouds_in(source: Path) -> list[Path]:
    """List the clouds of a run; any other source is returned unchanged.

    Args:
        source: Output folder of a run, a cloud, or a scan.

    Raises:
        InputError: A run without a cloud.
    """
    if not (source / "scenes").is_dir() or (source / "cloud.json").is_file():
        return [source]
    found = sorted(path for path in (source / "scenes").glob("*/cloud/*") if (path / "cloud.json").is_file())
    if not found:
        raise InputError(
            "the run has no cloud",
            where=source,
            hint="Complete the run first; falsework plan shows what is missing",
        )
    return found


DATASET_VERBS = {"local": local, "global": whole, "export": export, "demo": demo}
