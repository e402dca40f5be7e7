"""The verb `falsework predict`: class, confidence and instance for every point of a scan, in a copy of it."""

import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from falsework.commands.answers import AsJson, tell
from falsework.commands.console import ConsoleProgress
from falsework.commands.given_files import need_folder
from groundwork.errors import InputError, MissingError
from groundwork.output.place import output_place
from groundwork.settings import parse_settings
from learn.datasets.scan_units import Unit, Up
from learn.device import Device

if TYPE_CHECKING:
    from learn.predict.predict import Prediction


def predict(
    scan: tyro.conf.Positional[Path],
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])],
    *,
    model: str = "",
    unit: Unit | None = None,
    scale: float | None = None,
    up: Up = "z",
    table: str = "",
    classes: tuple[str, ...] = (),
    min_confidence: float = 0.0,
    link: float | None = None,
    chunk: int = 2_000_000,
    device: Device = "cpu",
    as_json: AsJson = False,
) -> int:
    """Label a scan: write a copy with a class, a confidence and an instance for every point, and all else unchanged.

    Needs the extra learn.

    Args:
        scan: LAS, LAZ, PLY, E57, NPY or text file, or a cloud's folder with cloud.laz (for a PLY: cloud.ply) in it.
        output: File to write, of the same format, or .las or .laz; boxes of the instances go into a .json beside it.
        model: Trained model: a folder that falsework train has written, or module:function of a model of your own.
            Default: the small model of the package, which uses positions only; its card (its path is printed) states
            its limits.
        unit: Unit of the coordinates; overrides the unit that the scan states.
        scale: Meters per unit, for a cloud without a scale.
        up: Axis of the scan that points up.
        table: Class table of the result (docs/classes.md); default: the model's own; falsework for a model of
            components.
        classes: Classes to write; points of others get 255.
        min_confidence: Points with a lower confidence get class 255.
        link: Points of a class in touching cubes of this side are one instance [m]; default: 0.3, or twice the model's
            voxel if that is more.
        chunk: Number of points of the scan in memory at once.
        device: Where a network computes: cpu, whose labels are the same bytes each time, gpu, or auto: a GPU if torch
            finds one.
        as_json: Print one JSON object instead of lines.
    """
    _check_paths(scan, output, model)
    _check_table(table)
    from learn.predict.model import named_model, shipped_folder
    from learn.predict.predict import predict_scan
    from learn.predict.settings import PredictSettings

    values: dict[str, Any] = {"unit": unit, "scale": scale, "up": up, "table": table, "classes": classes}
    values |= {"min_confidence": min_confidence, "link": link, "chunk": chunk}
    settings = parse_settings(PredictSettings, values, "predict", values.keys())
    known = named_model(model, device)
    if model and Path(model).is_dir():
        output_place(output, [Path(model)])
    with ConsoleProgress() as progress:
        made = predict_scan(scan, output, known, settings, progress)
    for doubt in made.doubts:
        sys.stderr.write(f"warning: {doubt}\n")
    own = [] if model else [f"with the model of the package; its limits: {shipped_folder() / 'README.md'}"]
    return tell({"labelled": str(output), **asdict(made)}, [*_counts(made), f"labeled {output}", *own], as_json)


def _check_paths(scan: Path, output: Path, model: str) -> None:
    if model and Path(model).exists():
        need_folder(Path(model), "a folder that falsework train has written", "--model", "model.json")
    if not scan.exists():
        raise MissingError("no such file", where=scan, hint="Name a scan, or the folder of a cloud")
    if scan.is_dir():
        need_folder(scan, "a scan, or the folder of a cloud", mark="cloud.json")
    if not output.suffix:
        raise InputError(
            "has no suffix, which selects the format", where=output, field="-o", hint="Add one, such as .laz"
        )
    if scan.is_file():
        from recon.formats.labeled_copy import check_copy

        check_copy(scan, output)


def _check_table(table: str) -> None:
    from learn.datasets.class_tables import OWN
    from learn.predict.class_sum import check_table

    if table not in ("", OWN):  # whether a model has classes of its own is seen when it is read
        check_table(table)


def _counts(made: "Prediction") -> list[str]:
    rows = {**made.counts, **({"no class": made.unlabelled} if made.unlabelled else {})}
    lines = [f"{name:<16} {count:>10} points  {count / made.points:6.1%}" for name, count in rows.items()]
    return [*lines, f"{made.instances} instances; after thinning, the model saw {made.thinned} of {made.points} points"]
