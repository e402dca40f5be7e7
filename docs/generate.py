"""Write the pages that are generated from the code: keys of the scenario and the samplers, classes, architecture.

Usage: python -m docs.generate [--check]
"""

import sys
import types
import typing
from pathlib import Path

from pydantic_core import PydanticUndefined

from authoring.surveys.settings import LegSettings
from docs.architecture import FIGURE, architecture_figure, architecture_page
from falsework.scenario import Scenario
from groundwork.files import write_text
from groundwork.settings import Settings
from recon.sampling.sampler_settings import MeshSettings, MobileSettings, TerrestrialSettings
from usd_schemas.components import ClassRow, component_classes
from usd_schemas.taxonomies import TAXONOMIES, Taxonomy, taxonomy

HERE = Path(__file__).resolve().parent

_INTRODUCTION = (
    "Each part of a scene carries a `component` and the class that it has in the base table, `falsework`. Another",
    'table is switched in as a layer (`[labels] taxonomy = "kim2023"`), and label images, instance tables and clouds',
    "then carry its classes. *Class alone* is what a prim is taken for that says a class of the base table and no",
    "component. Ids 16 and 255 mean the same in every table: `noisy_point` is made on read by a threshold,",
    "`unlabelled` says that no class is known. Class 0 is what the sky shows.",
)


def scenario_page() -> str:
    """Spell every key of the scenario as Markdown tables, one for each section."""
    lines = ["# Keys of the scenario", "", "Generated from the settings models by `python -m docs.generate`.", ""]
    for name, model in _sections(Scenario, ""):
        lines += [f"## `[{name}]`" if name else "## Top level", "", *_table(model), ""]
    return "\n".join(lines)


def samplers_page() -> str:
    """Spell every setting of `falsework sample` as Markdown tables, one for each sampler."""
    lines = [
        "# Settings of the samplers",
        "",
        "Generated from the settings models by `python -m docs.generate`.",
        "Each can be given as `--set key=value`; [sampling.md](sampling.md) explains them.",
        "",
    ]
    for verb, model in (
        ("mesh", MeshSettings),
        ("lidar --kind terrestrial", TerrestrialSettings),
        ("lidar --kind mobile", MobileSettings),
    ):
        lines += [f"## `falsework sample {verb}`", "", *_table(model), ""]
    return "\n".join(lines)


def classes_page() -> str:
    """Spell every table of classes and the components of each class as Markdown."""
    lines = ["# Classes and components", "", "Generated from `usd_schemas/tables` by `python -m docs.generate`.", ""]
    lines += [*_INTRODUCTION, ""]
    for name in TAXONOMIES:
        table = taxonomy(name)
        note = " The original's own list of classes could not be read: these are ours." if table.reconstructed else ""
        lines += [f"## `{name}`: {table.title}", "", f"Source: {table.source}.{note}", ""]
        lines += ["| id | class | color | components | class alone |", "|---|---|---|---|---|"]
        lines += [
            f"| {row.id} | {row.name} | {_color(row)} | {_kinds(table, row)} | {_alone(table, row)} |"
            for row in table.rows
        ]
        lines.append("")
    return "\n".join(lines)


PAGES = {
    "scenario.md": scenario_page,
    "classes.md": classes_page,
    "samplers.md": samplers_page,
    "architecture.md": architecture_page,
    FIGURE: architecture_figure,
}


def main(arguments: list[str]) -> int:
    """Write the pages, or with `--check` tell which of them are not what the code says.

    Args:
        arguments: Words of the command line.

    Returns:
        Exit code.
    """
    stale = [name for name, page in PAGES.items() if not (HERE / name).is_file() or (HERE / name).read_text() != page()]
    if "--check" not in arguments:
        for name in stale:
            write_text(HERE / name, PAGES[name]())
        return 0
    for name in stale:
        sys.stderr.write(f"docs/{name} is not what the code says: run python -m docs.generate\n")
    sys.stdout.write(f"{len(PAGES) - len(stale)} passed, {len(stale)} failed\n")
    return int(bool(stale))


def _table(model: type[Settings]) -> list[str]:
    """One row for each key that holds a value, not further settings."""
    lines = ["| key | type | default | meaning |", "|---|---|---|---|"]
    for key, field in model.model_fields.items():
        if _is_list_of_kinds(field.annotation):
            lines.append(f"| `{key}` | sections `[[survey.{key}]]` of the kinds above | – | {field.description} |")
        elif not _models_in(field.annotation):
            default = field.get_default(call_default_factory=True, validated_data={})
            nothing = "–" if "left out" in (field.description or "") else "drawn"
            shown = "required" if default is PydanticUndefined else nothing if default is None else f"`{default!r}`"
            meaning = (field.description or "").replace("\n", " ").replace("|", "\\|")
            lines.append(f"| `{key}` | {_type_name(field.annotation)} | {shown} | {meaning} |")
    return lines


def _kinds(table: Taxonomy, row: ClassRow) -> str:
    return ", ".join(f"`{kind}`" for kind in component_classes() if table.classes[kind] == row.name)


def _alone(table: Taxonomy, row: ClassRow) -> str:
    base = dict.fromkeys(component_classes().values())
    return ", ".join(name for name in base if table.classes[name] == row.name)


def _color(row: ClassRow) -> str:
    red, green, blue = row.color
    return f"`#{red:02x}{green:02x}{blue:02x}`"


def _sections(model: type[Settings], name: str) -> list[tuple[str, type[Settings]]]:
    found = [(name, model)]
    for key, field in model.model_fields.items():
        inner_models = [] if _is_list_of_kinds(field.annotation) else _models_in(field.annotation)
        for inner in inner_models:
            found += _sections(inner, f"{name}.{key}" if name else key)
    return found


def _is_list_of_kinds(annotation: object) -> bool:
    """Tell whether a field lists sections of several kinds that the page shows anyway, such as the legs of a mix."""
    return {model.__name__ for model in _models_in(annotation)} == {model.__name__ for model in _models_in(LegSettings)}


def _models_in(annotation: object) -> list[type[Settings]]:
    if isinstance(annotation, type) and not isinstance(annotation, types.GenericAlias):
        return [annotation] if issubclass(annotation, Settings) else []
    return [inner for argument in typing.get_args(annotation) for inner in _models_in(argument)]


def _type_name(annotation: object) -> str:
    if typing.get_origin(annotation) is typing.Literal:
        return ", ".join(f"`{choice}`" for choice in typing.get_args(annotation))
    if typing.get_origin(annotation) is typing.Annotated:
        return _type_name(typing.get_args(annotation)[0])
    if typing.get_origin(annotation) is tuple:
        return f"tuple[{', '.join('...' if part is ... else _type_name(part) for part in typing.get_args(annotation))}]"
    name = annotation.__name__ if isinstance(annotation, type) else str(annotation)
    return name.replace("typing.", "").replace(" | None", "").replace("|", "or")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
