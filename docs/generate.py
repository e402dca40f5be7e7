"""Write the pages that are generated from the code: keys of the scenario, commands, classes, architecture, notebooks.

Usage: python -m docs.generate [--check]
"""

import sys
from functools import partial
from pathlib import Path

from docs.architecture import FIGURE, architecture_figure, architecture_page
from docs.command_page import commands_page
from docs.learning_keys import learning_page
from docs.notebook_files import SCRIPTS, notebook, notebook_page
from docs.scenario_pages import TOPICS, index_page, topic_page
from docs.settings_table import table
from groundwork.files import write_text
from recon.sampling.sampler_settings import AirborneSettings, MeshSettings, MobileSettings, TerrestrialSettings
from usd_schemas.components import ClassRow, component_classes
from usd_schemas.taxonomies import TAXONOMIES, Taxonomy, taxonomy

HERE = Path(__file__).resolve().parent

_INTRODUCTION = (
    "Each part of a scene carries a `component` and the class that it has in the base table, `falsework`. Another",
    'table is switched in as a layer (`[labels] taxonomy = "kim2023"`), and label images, instance tables and clouds',
    "then carry its classes. *Class alone*: the component assumed for a prim that has a class of the base table but no",
    "component. Ids 16 and 255 mean the same in every table: `noisy_point` is assigned on reading, from a threshold of",
    "the uncertainty; `unlabelled` says that no class is known. The sky has class 0.",
)


def samplers_page() -> str:
    """Write every setting of `falsework sample` as Markdown tables, one for each sampler."""
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
        ("lidar --kind airborne", AirborneSettings),
    ):
        lines += [f"## `falsework sample {verb}`", "", *table(model), ""]
    return "\n".join(lines)


def classes_page() -> str:
    """Write every table of classes and the components of each class as Markdown."""
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
    "scenario.md": index_page,
    **{f"scenario/{name}.md": partial(topic_page, name) for name in TOPICS},
    "commands.md": commands_page,
    "classes.md": classes_page,
    "samplers.md": samplers_page,
    "learning_settings.md": learning_page,
    "architecture.md": architecture_page,
    FIGURE: architecture_figure,
    **{f"notebooks/{name}.ipynb": partial(notebook, name) for name in SCRIPTS},
    **{f"notebooks/{name}.md": partial(notebook_page, name) for name in SCRIPTS},
}


def main(arguments: list[str]) -> int:
    """Write the pages, or with `--check` list those that differ from the code.

    Args:
        arguments: Words of the command line.

    Returns:
        Exit code.
    """
    stale = [name for name, page in PAGES.items() if not (HERE / name).is_file() or (HERE / name).read_text() != page()]
    if "--check" not in arguments:
        for name in stale:
            (HERE / name).parent.mkdir(exist_ok=True)
            write_text(HERE / name, PAGES[name]())
        return 0
    for name in stale:
        sys.stderr.write(f"docs/{name} is not what the code says: run python -m docs.generate\n")
    sys.stdout.write(f"{len(PAGES) - len(stale)} passed, {len(stale)} failed\n")
    return int(bool(stale))


def _kinds(table: Taxonomy, row: ClassRow) -> str:
    return ", ".join(f"`{kind}`" for kind in component_classes() if table.classes[kind] == row.name)


def _alone(table: Taxonomy, row: ClassRow) -> str:
    base = dict.fromkeys(component_classes().values())
    return ", ".join(name for name in base if table.classes[name] == row.name)


def _color(row: ClassRow) -> str:
    red, green, blue = row.color
    return f"`#{red:02x}{green:02x}{blue:02x}`"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
