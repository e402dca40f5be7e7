"""Common frame of all report pages: one file without network access, light and dark, names escaped."""

import base64
import hashlib
import json
import math
import os
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

import jinja2
from markupsafe import Markup

from groundwork.files import write_text
from groundwork.output.file import SIGNATURE

if TYPE_CHECKING:
    import plotly.graph_objects as go

FONT = {"family": "system-ui, sans-serif", "size": 13, "color": "#2b2f33"}
BLUE, RED, GRAY = "#3d7cc0", "#d1453b", "#9aa0a6"  # visible on light and dark backgrounds
SERIES = (BLUE, "#d98324", "#3f9b58", "#a25bb5", RED, "#8a6d3b", "#2aa1a6", "#c2578e")
DEEPEST = 12  # levels of settings that are shown; our files have no deeper ones


def write_page(path: Path, template: str, *, title: str, lead: str, **values: Any) -> None:
    """Write a page.

    A content security policy allows only the scripts whose hashes the page states, and no network access, so that names
    from files cannot run as code.

    Args:
        path: HTML file to write.
        template: Name of the template.
        title: Heading.
        lead: Line below it.
        values: Values of the template.
    """
    body = _environment().get_template(template).render(title=title, lead=lead, **values)
    spaces, figures = 'class="card space"' in body, 'class="figure"' in body
    names = ["later.js"] * (spaces or figures) + ["space.js"] * spaces + ["figures.js"] * figures + ["page.js"]
    scripts, plotly = [_template(name) for name in names], ""
    if figures:
        from plotly.offline import get_plotlyjs  # imported only for pages with figures

        plotly = get_plotlyjs()
    frame = _environment().get_template("frame.html.j2")
    page = frame.render(
        signature=SIGNATURE,
        policy=_policy([*scripts, plotly] if plotly else scripts),
        title=title,
        style=Markup(_template("style.css")),
        body=Markup(body),
        plotly=Markup(plotly),  # text until a figure needs it
        scripts=[Markup(script) for script in scripts],
    )
    write_text(path, page)


def figure_json(figure: "go.Figure") -> Markup:
    """Encode a figure for `figures.js`.

    Args:
        figure: A figure; the caller must escape its texts, because Plotly interprets tags in them.
    """
    told = json.loads(figure.to_json() or "{}")
    told["layout"].pop("template", None)
    return script_json(told)


def script_json(value: object) -> Markup:
    """Encode JSON that is safe in a script element: names from files cannot close it.

    Args:
        value: Plain lists, tables, numbers and strings.
    """
    text = json.dumps(value, separators=(",", ":"))
    return Markup(text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026"))


def file_link(*parts: str) -> str:
    """Make a relative link to a file.

    Args:
        parts: Folders and the name, with any characters; an empty first part is the page's own folder.
    """
    return "/".join(["." if not parts[0] else quote(parts[0]), *(quote(part) for part in parts[1:])])


def way_to(folder: Path, page: Path) -> str:
    """Compute the relative path from a page to a folder; pages quote it.

    Args:
        folder: Any folder.
        page: HTML file.
    """
    return Path(os.path.relpath(folder.absolute(), page.absolute().parent)).as_posix()


def plain_layout(figure: "go.Figure", height: int) -> "go.Figure":
    """Set the margins and the font of a figure; its colors follow the light or dark mode of the browser.

    Args:
        figure: A figure.
        height: Its height [px].
    """
    return figure.update_layout(
        height=height,
        margin={"l": 55, "r": 15, "t": 30, "b": 45},
        font=FONT,
        template="none",
        paper_bgcolor="rgba(0,0,0,0)",
        plot_bgcolor="rgba(0,0,0,0)",
        legend={"orientation": "h", "y": 1.02, "yanchor": "bottom"},
    )


def number(value: Any) -> str:
    """Format a number, or another value of a record, for people.

    Args:
        value: A number, a word, or None for unknown.
    """
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.4g}"
    return f"{value:,}" if isinstance(value, int) else str(value)


def percent(value: float | None) -> str:
    """Format a share in per cent.

    Args:
        value: The share [1], or None for unknown.
    """
    return "–" if value is None or math.isnan(value) else f"{value:.1%}"


def settings_rows(value: Mapping[str, Any], depth: int = 0) -> list[dict[str, Any]]:
    """Format nested settings as rows.

    Args:
        value: JSON settings.
        depth: Level of nesting.

    Returns:
        Rows of `depth`, `name` and `value`; a row that opens a level has an empty value.
    """
    rows: list[dict[str, Any]] = []
    for name, inner in sorted(value.items()):
        if isinstance(inner, Mapping) and inner and depth < DEEPEST:
            rows.append({"depth": depth, "name": str(name), "value": ""})
            rows += settings_rows(inner, depth + 1)
        else:
            rows.append({"depth": depth, "name": str(name), "value": _spelled(inner)})
    return rows


def _spelled(value: Any) -> str:
    if value == {}:
        return "–"
    if isinstance(value, str | int | float | None):
        return "–" if value is None or value == "" else (value if isinstance(value, str) else f"{value}")
    if isinstance(value, Sequence) and all(isinstance(part, str | int | float) for part in value):
        return ", ".join(map(str, value)) or "–"
    return json.dumps(value, sort_keys=True)


@cache
def _environment() -> jinja2.Environment:
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("falsework.report"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["percent"] = percent
    environment.filters["number"] = number
    environment.filters["figure"] = figure_json
    return environment


def _policy(scripts: Sequence[str]) -> str:
    hashes = [base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in scripts]
    allowed = " ".join(f"'sha256-{value}'" for value in hashes)
    return f"default-src 'none'; img-src data: blob:; style-src 'unsafe-inline'; script-src {allowed}"


@cache
def _template(name: str) -> str:
    return files("falsework.report").joinpath("templates", name).read_text(encoding="utf-8")
