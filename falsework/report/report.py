"""One self-contained page about a scene: its frames, its flight, its reconstruction and its cloud."""

from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jinja2
import numpy as np
import plotly.graph_objects as go
from markupsafe import Markup
from plotly.offline import get_plotlyjs

from falsework.report.cloud_view import cloud_view
from falsework.report.figures import class_figure, contact_sheet, flight_figure, uncertainty_figure
from groundwork.files import read_json, write_text
from groundwork.output_file import SIGNATURE
from groundwork.slug import slug
from render.capture import Capture, Truth, read_capture, read_truth

if TYPE_CHECKING:
    from recon.cloud import Cloud

NOISE_THRESHOLD = 0.1  # [m] Shi 2024 calls points above it noisy
NEAR = 0.1  # [m]
REASONS = ("views", "reprojection", "deviation", "duplicate")
OUTLINE_POINTS = 4000
UNITS = {
    "center_error": "m",
    "rotation_error": "°",
    "surface_distance": "m",
    "uncertainty": "m",
    "mean_reprojection_error": "px",
}  # by the beginning of a statistic's name


def write_report(
    path: Path,
    title: str,
    stage: Path,
    surveys: dict[str, tuple[Path, dict[str, Path]]],
    samples: Mapping[str, Path] | None = None,
) -> None:
    """Write the page of one scene.

    Args:
        path: HTML file to write.
        title: Heading.
        stage: Scene folder or USD file; the manifest beside it gives the lead line.
        surveys: Survey id to its capture folder, and each cloud by what tells it apart, empty for an only one.
        samples: Id of each sample to its cloud folder.
    """
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("falsework.report"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
    )
    page = environment.get_template("report.html.j2").render(
        signature=SIGNATURE,
        title=title,
        lead=_lead(stage),
        plotly=Markup(get_plotlyjs()),
        cloud_script=Markup(_template("cloud.js")),
        surveys=[part for name, (capture, clouds) in sorted(surveys.items()) for part in _parts(name, capture, clouds)],
        samples=[_sample(name, folder) for name, folder in sorted((samples or {}).items())],
    )
    write_text(path, page)


def _parts(name: str, capture: Path, clouds: dict[str, Path]) -> list[dict[str, Any]]:
    """Show a survey once for each of its clouds; flight and frames stand with the first."""
    if not clouds:
        return [_survey(name, capture, None, pictures=True)]
    return [
        _survey(f"{name}, {mode}" if mode else name, capture, folder, pictures=number == 0)
        for number, (mode, folder) in enumerate(clouds.items())
    ]


def _survey(name: str, capture_folder: Path, cloud_folder: Path | None, *, pictures: bool) -> dict[str, Any]:
    from recon.cloud import read_cloud

    capture = read_capture(capture_folder)
    truth = read_truth(capture)
    cloud = None if cloud_folder is None else read_cloud(cloud_folder)
    centres = _centres(capture, truth)
    bridge = np.zeros((0, 3)) if truth is None else _bridge_outline(truth)
    statuses = ["ok"] * len(centres) if cloud is None else [camera["status"] for camera in cloud.cameras]
    noise = None if cloud is None else cloud.statistics.get("noise")
    seen = {row.class_name for row in truth.instances} if truth is not None else set()
    shown = {
        "name": name,
        "tiles": _tiles(capture, cloud),
        "frames": contact_sheet(capture, truth) if pictures else [],
        "flight": _html(flight_figure(centres, statuses, bridge), f"flight-{slug(name)}") if pictures else "",
        "legend": [row for row in truth.classes if row.name in seen] if truth is not None else [],
        "facts": [] if cloud is None else _facts(cloud),
        "threshold": None if noise is None else f"{noise['threshold']:g} m",
        "noise": _noise(noise),
        "kept": [] if cloud is None else _kept(cloud.statistics),
        "pixels": [] if cloud is None else _pixels(cloud.statistics),
        "cloud": None,
    }
    if cloud is None:
        return shown
    figures = {
        "classes": class_figure(cloud.columns["segment"], cloud.classes),
        "uncertainty": uncertainty_figure(cloud.columns["uncertainty"], NOISE_THRESHOLD),
    }
    view = cloud_view(dict(cloud.columns), cloud.classes, centres)
    return shown | {"cloud": view} | {key: _html(figure, f"{key}-{slug(name)}") for key, figure in figures.items()}


def _sample(name: str, folder: Path) -> dict[str, Any]:
    from recon.cloud import read_cloud

    cloud = read_cloud(folder)
    view = cloud_view(dict(cloud.columns), cloud.classes, np.zeros((0, 3)))
    classes = _html(class_figure(cloud.columns["segment"], cloud.classes), f"classes-{slug(name)}")
    return {"name": name, "source": cloud.source, "points": f"{len(cloud):,}", "cloud": view, "classes": classes}


def _tiles(capture: Capture, cloud: "Cloud | None") -> list[dict[str, str]]:
    tiles = [{"label": "images", "value": f"{len(capture.images)}"}]
    if cloud is None:
        return tiles
    good = [camera for camera in cloud.cameras if camera["status"] == "ok"]
    tiles[0] = {"label": "cameras registered", "value": f"{len(good)} of {len(cloud.cameras)}"}
    tiles.append({"label": "points", "value": f"{len(cloud):,}"})
    errors = np.array([camera["center_error"] for camera in good], dtype=np.float64)
    if np.isfinite(errors).any():
        tiles.append({"label": "median camera-centre error", "value": f"{np.nanmedian(errors) * 1000:.0f} mm"})
    if np.isfinite(cloud.columns["surface_distance"]).any():
        near = cloud.columns["surface_distance"] <= NEAR
        right = (
            float(np.mean(cloud.columns["segment"][near] == cloud.columns["surface_class"][near]))
            if near.any()
            else 0.0
        )
        quiet = float(np.mean(cloud.columns["uncertainty"] <= NOISE_THRESHOLD))
        tiles.append(
            {"label": f"of the points lie within {NEAR:g} m of the true surface", "value": f"{near.mean():.1%}"}
        )
        tiles.append({"label": f"have an uncertainty of at most {NOISE_THRESHOLD:g} m", "value": f"{quiet:.1%}"})
        tiles.append({"label": "of the near points carry the surface's class", "value": f"{right:.1%}"})
    return tiles


def _facts(cloud: "Cloud") -> list[tuple[str, str]]:
    plain = sorted((key, value) for key, value in cloud.statistics.items() if isinstance(value, int | float | str))
    return [*((key.replace("_", " "), _number(value) + _unit(key)) for key, value in plain), *_placing(cloud.alignment)]


def _placing(alignment: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Say how far a model may be off where no truth placed it, and what every control point leaves over."""
    units = {"scale_percent": " %", "tilt_deg": "°", "heading_deg": "°", "place_m": " m"}
    limits = alignment.get("expected_error", {})
    rows = [
        (f"error of {key.partition('_')[0]}, 95 % below", f"{limits[key]:.2g}{unit}")
        for key, unit in units.items()
        if limits.get(key) is not None
    ]
    for row in alignment.get("control_points", ()):
        left_out = "" if row["agrees"] else ", left out"
        rows.append((f"control point {row['name']} off by", f"{row['distance']:.3f} m{left_out}"))
    rows += [
        (f"scale bar {' to '.join(row['ends'])} off by", f"{row['error']:+.4f} m")
        for row in alignment.get("scale_bars", ())
    ]
    return rows


def _kept(statistics: Mapping[str, Any]) -> list[list[str]]:
    """Say of each class what stayed, what went and why, and in how many windows along the bridge it is few."""
    rows = []
    for name, row in statistics.get("classes", {}).items():
        dropped = [f"{row['dropped'][why]:,}" for why in REASONS]
        few = f"{row['few_in']} of {row['windows']}" if row.get("windows") else ""
        rows.append([name, f"{row['kept']:,}", *dropped, few])
    return rows


def _pixels(statistics: Mapping[str, Any]) -> list[list[str]]:
    """Say of each class how many pixels of the depth maps show it, which share is in points, and why others are not."""
    rows = []
    for name, row in statistics.get("pixels", {}).items():
        total = sum(row.values())
        shares = [_share(row[fate] / total) for fate in ("in_points", "no_depth", "views", "seen_through", "angle")]
        rows.append([name, f"{total:,}", *shares])
    return rows


def _noise(noise: dict[str, Any] | None) -> list[tuple[str, str]]:
    """Say how many points are noisy at which distance, and how far their uncertainty finds what is off."""
    if noise is None:
        return []
    rows = []
    for band in noise["by_distance"]:
        span = f"from {band['from']:g} m" if band["to"] is None else f"{band['from']:g} to {band['to']:g} m"
        rows.append((f"noisy of the {band['points']:,} seen {span} away", _share(band["noisy_share"])))
    for name, place in (("displacement", "where their pixels look"), ("surface_distance", "the true surface")):
        found, limit = noise[f"against_{name}"], f"{noise['threshold']:g} m"
        if name != "displacement":  # the noisy are displaced by definition
            rows.append((f"of the noisy, off by more than {limit} from {place}", _share(found["precision"])))
        rows.append((f"of those off by more than {limit} from {place}, noisy", _share(found["recall"])))
    return rows


def _share(value: float | None) -> str:
    return "none" if value is None else f"{value:.1%}"


def _number(value: float | str) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    return f"{value:,}" if isinstance(value, int) else value


def _unit(key: str) -> str:
    return next((f" {unit}" for start, unit in UNITS.items() if key.startswith(start)), "")


def _centres(capture: Capture, truth: Truth | None) -> np.ndarray:
    if truth is not None:
        return truth.poses[:, :3, 3]
    return np.array([image.gps for image in capture.images if image.gps is not None]).reshape(-1, 3)


def _bridge_outline(truth: Truth) -> np.ndarray:
    """Scatter points evenly over what is neither background nor unlabelled."""
    corners, ids, _ = truth.surface()
    bridge = [row.id for row in truth.instances if row.class_name not in ("background", "unlabelled")]
    first, second, third = np.moveaxis(corners[np.isin(ids, bridge)], 1, 0)
    if not len(first):
        return first
    area = np.linalg.norm(np.cross(second - first, third - first), axis=1)
    draw = np.random.default_rng(0)
    pick = draw.choice(len(area), OUTLINE_POINTS, p=area / area.sum())
    u, v = draw.random((2, OUTLINE_POINTS, 1))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    return first[pick] + u * (second - first)[pick] + v * (third - first)[pick]


def _lead(stage: Path) -> str:
    manifest = (stage if stage.is_dir() else stage.parent) / "manifest.json"
    if not manifest.is_file():
        return stage.name
    recipe = read_json(manifest)
    settings = recipe["settings"]
    names = [f"{section} {settings[section]['name']}" for section in ("background", "look")]
    return ", ".join([f"{settings['bridge']['family']} bridge", *names, f"random streams of {recipe['seed']}"])


def _template(name: str) -> str:
    return files("falsework.report").joinpath("templates", name).read_text(encoding="utf-8")


def _html(figure: go.Figure, name: str) -> Any:
    options = {"displaylogo": False, "displayModeBar": False, "responsive": True}
    text = figure.to_html(full_html=False, include_plotlyjs=False, div_id=name, config=options)
    return Markup(text)
