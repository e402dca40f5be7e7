"""The reference of learning: every setting of data sets, trainings and networks that `--set` takes."""

from docs.settings_table import sections, table
from groundwork.settings import Settings

# Keys that have an option of their own, or that users do not set.
_OPTIONS = {*("kind", "mode", "table", "split", "own", "seed"), *("model", "network", "recipe", "epochs", "batch")} | {
    "freeze_encoder"
}


def learning_page() -> str:
    """Write the page as Markdown."""
    from learn.datasets.settings import DatasetSettings, dataset_settings
    from learn.models.registry import NETWORKS  # torch comes along
    from learn.training.forest import ForestSettings
    from learn.training.settings import RECIPES, TrainSettings

    lines = [
        "# Settings of learning",
        "",
        "Generated from the settings models by `python -m docs.generate`.",
        "Each can be given as `--set key=value`; [learning.md](learning.md) explains them. Settings that have an",
        "option of their own are in [the command line](commands.md).",
        "",
        "## `falsework dataset local`, `falsework dataset global`",
        "",
        "The defaults are those of `local`; `global` has others for the keys in the second table.",
        "",
        *_rows("", DatasetSettings),
    ]
    local, whole = (dataset_settings(kind, {}, "") for kind in ("local", "global"))
    lines += ["", "| key | default of `global` |", "|---|---|"]
    lines += [f"| `{key}` | `{value}` |" for key, value in _differing("", local, whole)]
    lines += ["", "## `falsework train`", "", *_rows("", TrainSettings), ""]
    modern, paper = RECIPES["modern"], RECIPES["paper"]
    lines += ["What a recipe sets where nothing is given:", "", "| key | `modern` | `paper` |", "|---|---|---|"]
    lines += [
        f"| `{key}` | `{getattr(modern, key)}` | `{getattr(paper, key)}` |"
        for key in ("learning_rate", "class_aware", "doubt")
    ]
    lines += [
        "| `sensors.…` | the defaults above | none |",
        f"| with `--model randlanet`: `learning_rate` | as above | `{RECIPES['paper randlanet'].learning_rate}` |",
        "",
    ]
    models: dict[type[Settings], list[str]] = {}
    for name, (model, _) in NETWORKS.items():
        models.setdefault(model, []).append(name)
    for model, names in {**models, ForestSettings: ["forest"]}.items():
        lines += [f"## {' and '.join(f'`--model {name}`' for name in names)}", "", *_rows("network", model), ""]
    return "\n".join(lines)


def _rows(prefix: str, model: type[Settings]) -> list[str]:
    """List the keys of a model and of the models within it, as they are spelled behind `--set`."""
    found = ["| key | type | default | meaning |", "|---|---|---|---|"]
    for section, inner in sections(model, prefix):
        for row in table(inner)[2:]:
            key = row.removeprefix("| `").partition("`")[0]
            if section or key not in _OPTIONS:
                found.append(row.replace(f"`{key}`", f"`{section}.{key}`" if section else f"`{key}`", 1))
    return [row for row in found if not row.startswith(f"| `{prefix}.kind`")]


def _differing(prefix: str, one: Settings, other: Settings) -> list[tuple[str, str]]:
    """List the keys whose values differ between two records, with the values of the second."""
    found: list[tuple[str, str]] = []
    for name in type(one).model_fields:
        a, b = getattr(one, name), getattr(other, name)
        if isinstance(a, Settings) and isinstance(b, Settings):
            found += _differing(f"{name}.", a, b)
        elif a != b and name not in _OPTIONS:
            found.append((prefix + name, str(b).lower()))
    return found
