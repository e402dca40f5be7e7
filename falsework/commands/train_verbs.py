"""The verbs of learning: train a model on a data set, and score a model."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from falsework.commands.answers import AsJson, tell
from falsework.commands.console import ConsoleProgress
from falsework.commands.given_files import need_folder
from falsework.commands.given_settings import given_settings
from groundwork.canonical import file_digest
from groundwork.errors import InputError
from groundwork.files import read_json
from groundwork.output.file import SIGNATURE, check_output_file, write_fresh_file
from groundwork.output.folder import fresh_output
from groundwork.output.reading import reading
from groundwork.settings import parse_settings
from learn.device import Device

if TYPE_CHECKING:
    from learn.sample import SampleSource, ScoredSource
    from learn.trained import ModelFacts
    from learn.training.settings import TrainSettings

OF_DATASET, OF_MODEL = "a folder that falsework dataset has written", "a folder that falsework train has written"

SHIPPED = "shipped"  # word for the model of the package

File = tyro.conf.Positional[Path]
Output = Annotated[Path, tyro.conf.arg(aliases=["-o"])]
Given = tyro.conf.UseAppendAction[tuple[str, ...]]


def train(
    dataset: tyro.conf.Positional[Path | None] = None,
    *,
    output: Output,
    demo: bool = False,
    model: str = "",
    recipe: Literal["paper", "modern"] = "modern",
    epochs: int | None = None,
    batch: int = 8,
    seed: int = 0,
    channels: str = "",
    init: Path | None = None,
    freeze_encoder: bool = False,
    set: Given = (),
    as_json: AsJson = False,
) -> int:
    """Train a network on a data set; an interrupted command can be repeated and continues (a forest starts again).

    The best epoch is chosen by the mean IoU on whole bridges that are held out.

    Args:
        dataset: Folder that falsework dataset has written.
        output: Folder to write: a model.
        demo: Train for a few minutes on thinned clouds of eighteen bridges of the package, and print the scores on
            four others; takes no further options but --seed and --epochs.
        model: pointnet2-ssg, pointnet2-msg, pointnext-s, pointnext-b, randlanet, or forest, which has no epochs;
            default: that of --init, else pointnet2-ssg.
        recipe: paper: the paper's training, as far as it is known. modern: current practice.
        epochs: Passes over the training samples; default: 50.
        batch: Samples per step.
        seed: Seed of weights, order, draws and dropout.
        channels: Inputs of the network per point, separated by commas; default: those of --init, else x,y,z, and with
            --recipe modern the height above the estimated ground, if the data set has it.
        init: A model to start from, or `shipped`, the model of the package; its last layer is initialized at random if
            the classes differ.
        freeze_encoder: Train only the decoder and the head, as for a few labeled scans.
        set: A further setting, such as `learning_rate=0.001`, or of the network, such as `network.unit=2.0`; may be
            given more than once.
        as_json: Print one JSON object instead of lines.
    """
    if demo:
        given = {"dataset": dataset, "--model": model, "--channels": channels, "--init": init, "--set": set}
        given |= {"--recipe": recipe != "modern", "--batch": batch != 8, "--freeze-encoder": freeze_encoder}
        return _demo(output, seed, epochs, [name for name, value in given.items() if value], as_json)
    dataset, init = _given(dataset), _start_of(init)
    settings = _settings(
        {"model": model, "recipe": recipe, "epochs": epochs, "batch": batch, "seed": seed}
        | {"freeze_encoder": freeze_encoder},
        begun := _begun(init),
        set,
    )
    if settings.freeze_encoder and settings.model == "forest":
        raise InputError("a forest has no encoder", field="--freeze-encoder", value=True, hint="Leave it out")
    if init is not None and settings.model == "forest":
        raise InputError(
            "a forest cannot start from another model", field="--init", value=init, hint="Leave --init out"
        )
    names = _words(channels) or begun.get("channels") or _channels_of(dataset, settings)
    _fit(dataset, output, settings, names, init)
    return tell(_model_facts(output) if as_json else {}, [f"model   {output}"], as_json)


def _model_facts(model: Path) -> dict[str, Any]:
    """Describe what was trained, on which data, and its score on the held-out bridges."""
    from learn.trained import read_facts

    facts = read_facts(model)
    training = {} if facts.training is None else dict(facts.training)
    what = {"network": facts.network, "classes": list(facts.classes), "channels": list(facts.channels)}
    return {"model": str(model), **what, "training": training}


def _given(dataset: Path | None) -> Path:
    if dataset is None:
        raise InputError("no data set is given", hint=f"Name {OF_DATASET}, or give --demo")
    need_folder(dataset, OF_DATASET, mark="dataset.json")
    return dataset


def _fit(dataset: Path, output: Path, settings: "TrainSettings", channels: tuple[str, ...], init: Path | None) -> None:
    source, held = _training_split(dataset, channels, settings), _split(dataset, "val", channels)
    asked = [file_digest(dataset / "dataset.json"), channels, str(init), settings.model_dump(mode="json")]
    inputs = [dataset] if init is None else [dataset, init]
    with ConsoleProgress() as progress, reading(*inputs):
        if settings.model == "forest":
            from learn.training.forest import train_forest

            fresh_output(
                output,
                "model",
                lambda folder: train_forest(
                    source, settings, folder, progress, _facts(source), held=held if len(held) else None
                ),
                inputs=inputs,
                asked=asked,
            )
        else:
            from learn.training.train import TrainingData, train_network

            data = TrainingData(source, held if len(held) else None, _facts(source))

            fresh_output(
                output,
                "model",
                lambda folder: train_network(data, settings, folder, progress, init=init),
                inputs=inputs,
                asked=asked,
                resume=True,
            )


def evaluate(
    model: File,
    dataset: tyro.conf.Positional[Path],
    *,
    split: Literal["train", "val", "test"] = "test",
    output: Annotated[Path | None, tyro.conf.arg(aliases=["-o"])] = None,
    device: Device = "cpu",
    as_json: AsJson = False,
) -> int:
    """Score a model on one split of a data set; every point counts once.

    Accuracy, IoU, precision and F1 of each class, confusion, calibration, mean IoU by uncertainty, panoptic quality,
    over all bridges and for each. Predictions of component kinds are summed into the data set's classes.

    Args:
        model: Folder that falsework train has written.
        dataset: Folder that falsework dataset has written.
        split: Part of the data set.
        output: JSON file for the scores; the tables go into a .md file beside it.
        device: Where a network computes: cpu, gpu, or auto: a GPU if torch finds one.
        as_json: Print one JSON object instead of a table.
    """
    need_folder(model, OF_MODEL, mark="model.json")
    need_folder(dataset, OF_DATASET, mark="dataset.json")
    from learn.evaluate import evaluate_model
    from learn.scoring.table import score_lines, short_lines
    from learn.trained import read_model

    if output is not None:
        _check_scores_file(output, [model, dataset])
    with reading(model, dataset):
        trained = read_model(model, device)
        source = _scored(trained.facts, dataset, split)
    with ConsoleProgress() as progress, reading(model, dataset):
        if known := _trained_on(trained.facts, source):
            progress.note(
                f"the model, or one that it began with, was trained on {len(known)} of these bridges, "
                "so its scores are too good: " + ", ".join(name[:12] for name in known)
            )
        record = evaluate_model(_in_classes_of(source, trained), source, progress, _voxel(source))
    if output is not None:
        write_fresh_file(
            output, json.dumps(record, sort_keys=True, indent=2).encode() + b"\n", [model, dataset], _is_evaluation
        )
        page = [
            f"<!-- {SIGNATURE} -->",
            f"# Scores of {model.name} on {dataset.name}, {split}",
            "",
            *score_lines(record),
        ]
        write_fresh_file(output.with_suffix(".md"), "\n".join([*page, ""]).encode(), [model, dataset])
    shown = short_lines(record) if output is not None else score_lines(record)
    return tell(record, shown, as_json)


def _check_scores_file(output: Path, inputs: list[Path]) -> None:
    if output.suffix == ".md":
        raise InputError(
            "this is the name of the file of tables beside the scores",
            where=output,
            field="-o",
            hint="Name a .json file; the tables are written beside it",
        )
    check_output_file(output, inputs, _is_evaluation)
    check_output_file(output.with_suffix(".md"), inputs)


def _scored(facts: "ModelFacts", dataset: Path, split: str) -> "ScoredSource":
    """Open a split for a model; samples scaled differently from those of its training are refused."""
    from learn.trained import check_scaling

    source: Any = _split(dataset, split, facts.channels)
    if split == "train":  # its samples are drawn at random, and differ from their truth, unless it is asked otherwise
        source = source.unchanged()
    if not len(source):
        raise InputError(
            "this split has no samples",
            where=dataset,
            field="--split",
            value=split,
            hint="Name another split, or make the data set with bridges for this one",
        )
    check_scaling(facts, _facts(source), dataset)
    return source


def _in_classes_of(source: "SampleSource", trained: Any) -> Any:
    from learn.predict.class_sum import summed_model

    facts = trained.facts
    table = str(_facts(source).get("table", ""))
    return summed_model(trained, trained.classes, str(facts.data.get("table", "")), table, source.classes)


def _voxel(source: "SampleSource") -> float:
    """Return the side of the cubes that the clouds of a data set were thinned by [m]; 0 if they were not."""
    settings = _facts(source).get("settings", {})
    return float(settings["tile"]["voxel"]) if settings.get("mode") == "metric" else 0.0


def _trained_on(facts: "ModelFacts", source: "SampleSource") -> list[str]:
    """List the bridges of a split that the model, or one that it began with, has seen in training."""
    from learn.seen_bridges import seen_bridges

    return sorted({*seen_bridges(facts.training, facts.data)} & {source.bridge(row) for row in range(len(source))})


def _is_evaluation(path: Path) -> bool:
    """Tell whether a file holds scores of `falsework evaluate`."""
    try:
        record = read_json(path)
    except InputError:
        return False
    return isinstance(record, dict) and record.get("format") == "falsework.evaluation"


def _settings(chosen: dict[str, Any], begun: dict[str, Any], given: tuple[str, ...]) -> "TrainSettings":
    """Combine the settings of a training: those of the initial model, options, and --set."""
    from learn.training.settings import TrainSettings

    values = {name: value for name, value in chosen.items() if value is not None}
    options = values.keys() - given_settings(given).keys()
    values["model"] = values["model"] or begun.get("network", "pointnet2-ssg")
    values["network"] = dict(begun["settings"]) if values["model"] == begun.get("network") else {}
    for key, value in given_settings(given).items():
        group, point, inner = key.partition(".")
        if point and group in ("network", "sensors"):
            values[group] = {**values.get(group, {}), inner: value}
        else:
            values[key] = value
    return parse_settings(TrainSettings, values, "train", options)


def _demo(output: Path, seed: int, epochs: int | None, unwanted: list[str], as_json: bool) -> int:
    """Train on the shipped clouds, and print the table."""
    if unwanted:
        raise InputError("not allowed with --demo, which has its own", field=unwanted[0], hint="Leave it or --demo out")
    from learn.demo.demo import demo_table, run_demo

    changed: dict[str, Any] = {"seed": seed} | ({} if epochs is None else {"epochs": epochs})
    lines: list[str] = []

    def write(folder: Path) -> None:
        lines.extend(demo_table(*run_demo(folder, progress, changed=changed)))

    with ConsoleProgress() as progress:
        fresh_output(output, "model", write, inputs=[], asked=["demo", changed], resume=True)
    return tell(_model_facts(output) if as_json else {}, [*lines, f"model   {output}"], as_json)


def _start_of(init: Path | None) -> Path | None:
    """Replace the word for the model of the package by its folder, unless the user has a folder of that name."""
    if init is None or str(init) != SHIPPED or init.exists():
        return init
    from learn.predict.model import shipped_folder

    return shipped_folder()


def _begun(init: Path | None) -> dict[str, Any]:
    """Take network and channels from the initial model."""
    from learn.trained import read_facts

    if init is None:
        return {}
    need_folder(init, OF_MODEL, "--init", "model.json")
    return vars(read_facts(init))


def _channels_of(dataset: Path, settings: "TrainSettings") -> tuple[str, ...]:
    """Return the recipe's channels; data sets before version 2, and the paper's, have no height."""
    from learn.datasets.layout import read_facts
    from learn.datasets.patch import CHANNELS
    from learn.training.settings import recipe_of

    present = ("coord", *read_facts(dataset).inputs)
    return tuple(name for name in recipe_of(settings).channels if CHANNELS[name] in present)


def _training_split(dataset: Path, channels: tuple[str, ...], settings: "TrainSettings") -> "SampleSource":
    from learn.datasets.stored import StoredSplit
    from learn.training.settings import recipe_of

    return StoredSplit(dataset, "train", channels, sensors=recipe_of(settings).sensors)


def _words(text: str) -> tuple[str, ...]:
    return tuple(word.strip() for word in text.split(",") if word.strip())


def _split(dataset: Path, split: str, channels: tuple[str, ...]) -> "SampleSource":
    from learn.datasets.stored import StoredSplit

    return StoredSplit(dataset, split, channels)


def _facts(source: object) -> dict[str, Any]:
    """Collect how the data set was made, which a prediction needs to cut a scan the same way."""
    facts = getattr(source, "facts", None)
    settings = getattr(facts, "settings", None)
    if facts is None or settings is None:
        return {}
    return {"settings": settings.model_dump(mode="json"), "scaling": vars(facts.scaling), "table": settings.table}
