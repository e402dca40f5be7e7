"""The reference of the scenario by topic: the page of each section, and the introduction of each page."""

from dataclasses import dataclass

from docs.settings_table import kind_of, sections, table
from falsework.scenario import Scenario

_GENERATED = "Generated from the settings models by `python -m docs.generate`."


@dataclass(frozen=True)
class Topic:
    """One page of the reference.

    Attributes:
        title: Its heading.
        about: What one decides here, and where it is explained.
        heads: Sections, each with those below it, in the order of the page.
        apart: Sections below a head that have a page of their own.
        example: A scenario that shows the commonest keys.
    """

    title: str
    about: str
    heads: tuple[str, ...]
    apart: tuple[str, ...] = ()
    example: str = ""


FAMILIES = tuple(f"bridge.{name}" for name in ("slab", "beam", "girder", "arch", "suspension", "cable_stayed"))

TOPICS = {
    "run": Topic(
        "The run, and a stage to start from",
        "How many scenes, what stays on the disk, and which files from elsewhere have names. "
        "[Making many bridges](../scale.md) explains the run.",
        ("", "stage"),
        example='seed = 7\nscenes = 20\nkeep = ["stage", "cloud"]',
    ),
    "bridge": Topic(
        "The bridge",
        "What all families share: deck, track, parapets, piers, abutments, bearings, alignment. "
        "What is left out is drawn from the seed. [Bridges](../bridges.md) shows the families.",
        ("bridge",),
        FAMILIES,
        '[bridge]\nfamily = "beam"\nservice = "road"\n\n[bridge.alignment]\nkind = "arc"\nradius = 300.0',
    ),
    "families": Topic(
        "The six families",
        "The parameters of each family. A section counts only if its family can be drawn. "
        "[Bridges](../bridges.md) has the sources of the ranges.",
        FAMILIES,
        example='[bridge]\nfamily = "arch"\n\n[bridge.arch]\nspan = 60.0',
    ),
    "surroundings": Topic(
        "Site and background",
        "What the bridge crosses, and the world behind it. The bridge stands on its site with any background. "
        "[Backgrounds](../backgrounds.md) shows the worlds, and how to bring one.",
        ("site", "background"),
        example='[site]\ncrossing = "river"\n\n[background]\nname = "hillside"',
    ),
    "appearance": Topic(
        "Looks, light and labels",
        "Surfaces, sun and sky, and the table of classes. None of them moves a camera or a pier. "
        "[Looks](../looks.md), [light](../light.md), [classes](../classes.md). "
        "`[variants]` makes several of them from one bridge and one flight.",
        ("look", "light", "labels", "variants"),
        example='[look]\nname = "random"\n\n[light]\ndate = "2024-12-21T10:00"',
    ),
    "flights": Topic(
        "Flights",
        "Each `[[survey]]` is one flight and becomes one capture. Its `kind` says which of these sections it is. "
        "[Surveys](../surveys.md) explains how each flies.",
        ("survey",),
        example='[[survey]]\nkind = "local"\ncamera = "mini_like"\nwidth = 1600',
    ),
    "photographs": Topic(
        "Photographs",
        "How a stage becomes photographs. The truth beside them does not depend on the sensor's noise. "
        "[Rendering](../rendering.md) explains both.",
        ("render", "sensor"),
        example='[render]\nquality = "standard"\n\n[sensor]\nnoise = true',
    ),
    "clouds": Topic(
        "Clouds",
        "Reconstruction of photographs (`[recon]`), and clouds without photographs (`[[sample]]`). "
        "[From photographs to a cloud](../reconstruction.md), [sampling and laser scans](../sampling.md).",
        ("recon", "sample"),
        example='[recon]\nmode = "dense"\nquality = "high"\n\n[[sample]]\nkind = "terrestrial"\nid = "tls"',
    ),
}


def topic_of(section: str) -> list[str]:
    """List the topics that show a section; the tests demand exactly one."""

    def below(head: str) -> bool:
        return section == head or (head != "" and section.startswith(f"{head}."))

    return [name for name, topic in TOPICS.items() if any(map(below, topic.heads)) and not any(map(below, topic.apart))]


def topic_page(name: str) -> str:
    """Write one page of the reference as Markdown.

    Args:
        name: A key of `TOPICS`.
    """
    topic = TOPICS[name]
    lines = [f"# {topic.title}", "", topic.about, "", _GENERATED, ""]
    if topic.example:
        lines += ["```toml", topic.example, "```", ""]
    order = {head: place for place, head in enumerate(topic.heads)}

    def place(section: str) -> int:
        return max(order[head] for head in order if section == head or section.startswith(f"{head}."))

    found = [(section, model) for section, model in sections(Scenario) if name in topic_of(section)]
    for section, model in sorted(found, key=lambda one: place(one[0])):
        rows = table(model)
        if rows:
            about = (model.__doc__ or "").splitlines()[0]
            lines += [_heading(section, kind_of(model)), "", *([about, ""] if section else []), *rows, ""]
    return "\n".join(lines)


def index_page() -> str:
    """Write the index of the topics: every section with its page."""
    lines = ["# Keys of the scenario", ""]
    lines += [
        "A scenario is one TOML file. Every section and every key is optional: what it leaves out is drawn from the",
        "seed, or has the default below. An unknown key is an error that names the nearest valid key.",
        "",
        _GENERATED,
        "",
        "| topic | sections |",
        "|---|---|",
    ]
    seen: dict[str, list[str]] = {name: [] for name in TOPICS}
    for section, _ in sections(Scenario):
        (name,) = topic_of(section)
        label = f"`[{section}]`" if section else "top level"
        if label not in seen[name]:
            seen[name].append(label)
    lines += [f"| [{topic.title}](scenario/{name}.md) | {', '.join(seen[name])} |" for name, topic in TOPICS.items()]
    lines += ["", "Start with `scenarios/demo.toml`, which explains each line.", ""]
    return "\n".join([*lines, "```{toctree}", ":hidden:", "", *(f"scenario/{name}" for name in TOPICS), "```", ""])


def _heading(section: str, kind: str) -> str:
    if not section:
        return "## Top level"
    return f'## `[[{section}]]` with `kind = "{kind}"`' if kind else f"## `[{section}]`"
