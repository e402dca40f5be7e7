"""The page about flights that are not flown yet: plan and elevation, 3D, coverage and pitch."""

from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
import plotly.graph_objects as go
from markupsafe import Markup
from plotly.offline import get_plotlyjs

from falsework.report.figures import flight_figure
from falsework.report.page import FONT
from groundwork.files import write_text
from groundwork.output_file import SIGNATURE
from groundwork.slug import slug

PITCH_STEP = 15  # [deg]
_MARGIN = {"l": 50, "r": 10, "t": 20, "b": 45}


def write_page(path: Path, surveys: list[dict[str, Any]]) -> None:
    """Write the page.

    Args:
        path: HTML file to write.
        surveys: What `falsework.children.survey_work.score` answers.
    """
    template = files("falsework.report").joinpath("templates/survey.html.j2").read_text(encoding="utf-8")
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True)
    rows = [
        {**row, "figures": [_embed(figure, f"{slug(row['survey'])}_{k}") for k, figure in enumerate(_figures(row))]}
        for row in surveys
    ]
    write_text(
        path, environment.from_string(template).render(signature=SIGNATURE, plotly=Markup(get_plotlyjs()), surveys=rows)
    )


def _figures(row: dict[str, Any]) -> list[go.Figure]:
    centers, bridge = np.array(row["centres"]), np.array(row["outline"])
    return [
        flight_figure(centers, ["ok"] * len(centers), bridge, "images"),
        _space_figure(row, centers, bridge),
        _coverage_figure(row),
        _pitch_figure(row),
    ]


def _space_figure(row: dict[str, Any], centers: Any, bridge: Any) -> go.Figure:
    """Show cameras and where they look in space."""
    figure = go.Figure()
    points = {"mode": "markers", "hoverinfo": "skip"}
    x, y, z = bridge.T
    figure.add_scatter3d(x=x, y=y, z=z, marker={"size": 1.2, "color": "#b9bec4"}, name="bridge", **points)
    tips = centers + np.array(row["looks"])
    gap = np.full_like(centers, np.nan)
    x, y, z = np.stack([centers, tips, gap], axis=1).reshape(-1, 3).T
    figure.add_scatter3d(x=x, y=y, z=z, mode="lines", line={"color": "#c8322b", "width": 2}, name="view")
    x, y, z = centers.T
    figure.add_scatter3d(x=x, y=y, z=z, mode="lines+markers", marker={"size": 2, "color": "#1f5fa8"}, name="flight")
    figure.update_layout(height=620, font=FONT, margin={"l": 0, "r": 0, "t": 10, "b": 0}, scene={"aspectmode": "data"})
    return figure


def _coverage_figure(row: dict[str, Any]) -> go.Figure:
    shares = {escape(name): 100.0 * share for name, share in row["by_class"].items()}
    figure = go.Figure(go.Bar(x=list(shares), y=list(shares.values()), marker_color="#4a7ab5"))
    figure.update_layout(
        height=320, font=FONT, margin=_MARGIN, yaxis={"title": "surface covered [%]", "range": [0, 100]}
    )
    return figure


def _pitch_figure(row: dict[str, Any]) -> go.Figure:
    middles = [-90 + PITCH_STEP * (k + 0.5) for k in range(len(row["pitches"]))]
    figure = go.Figure(go.Bar(x=middles, y=row["pitches"], width=PITCH_STEP, marker_color="#4a7ab5"))
    figure.update_layout(
        height=320, font=FONT, margin=_MARGIN, xaxis={"title": "pitch [deg]"}, yaxis={"title": "images"}, bargap=0
    )
    return figure


def _embed(figure: go.Figure, name: str) -> Markup:
    options = {"displaylogo": False, "displayModeBar": False}
    return Markup(figure.to_html(full_html=False, include_plotlyjs=False, div_id=name, config=options))
