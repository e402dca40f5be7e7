"""The architecture page: packages ("rooms") and their folders, and a figure drawn from the imports of their modules."""

import ast
from html import escape
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FIGURE = "images/architecture.svg"

# Lowest first: each room imports only from those above it in this table.
ROOMS: dict[str, tuple[str, dict[str, str]]] = {
    "groundwork": (
        "errors, settings, progress, locks, child processes, files that are written atomically",
        {"output": "output files and folders: claimed, locked, replaced as a whole, read consistently"},
    ),
    "usd_schemas": (
        "the content of a stage: names, component and class tables, camera convention, a stage as flat arrays",
        {
            "reading": "composes a stage and reads it: meshes, materials, lights, cameras, labels",
            "guard": "checks of imported stages before USD opens them",
        },
    ),
    "authoring": (
        "scenario → layered stage",
        {
            "foreign": "opens models and textures of other programs",
            "shapes": "components, cross sections, the topology of surfaces",
            "axis": "alignment of the road or railway, clearances",
            "solids": "sweeps, extrusions, copies, texture atlas",
            "site": "the ground: valley, river, roads, rails, relief",
            "parts": "decks, girders, piers, bearings, cables, parapets",
            "families": "assembles parts: beam, girder, slab, arch, suspension, cable-stayed",
            "looks": "materials and textures, weathering",
            "light": "sun, sky, panorama",
            "backgrounds": "countryside, hillside, lakeside, hamlet, harbour, city",
            "surveys": "flights of the virtual UAV: paths, coverage, calibration",
            "layers": "writes the results of the folders above as USD layers",
            "imported": "worlds from files: glTF, meshes, CityJSON, USD",
            "scenes": "work on written scenes: validate, compare, check out",
            "variants": "looks and backgrounds added to a scene",
            "edits": "imports changes that were made in other programs",
            "exchange": "flattens, bakes and packs a scene for other programs",
        },
    ),
    "render": (
        "stage → capture",
        {
            "images": "encodes and decodes pictures, depth and labels",
            "gpu": "context, programs, textures, the scene in video memory",
            "light": "daylight, shadows, indirect light",
            "detail": "levels of detail, size of textures",
            "views": "the passes of one view, its lens",
            "sensor": "exposure, noise, rolling shutter",
            "writing": "the capture on disk, its journal",
        },
    ),
    "recon": (
        "capture, or photographs → cloud",
        {
            "photos": "reads photographs and their metadata",
            "sfm": "Structure from Motion: features, matches, cameras, tie points",
            "dense": "a depth for every pixel, fused into points",
            "placing": "alignment to the truth, to GPS or to control points, with stated errors",
            "points": "placed points, their observations, precision, duplicates",
            "truth": "labels by vote, uncertainty, distance to the true surface",
            "formats": "cloud formats of other programs: LAS, PLY, E57, COLMAP, …",
            "sampling": "clouds without images: points on surfaces, laser scans",
        },
    ),
    "learn": (
        "clouds → data sets, models, scores, labels for a scan",
        {
            "neighborhoods": "search, sampling, pyramids of neighbors",
            "datasets": "windows, tiles, splits, augmentation, class maps",
            "models": "PointNet++, PointNeXt, RandLA-Net, a forest",
            "scoring": "a class for every point, by votes of overlapping samples",
            "training": "recipes, the training loop, resuming",
            "compare": "ways of making training clouds, compared with intervals",
            "demo": "thinned clouds in the package",
            "predict": "labels a scan of any size",
        },
    ),
    "falsework": (
        "the user interface: scenario, store, runs, command line, report, Python API",
        {
            "report": "pages: of a scene, a run, a data set, a training, a comparison",
            "children": "work in separate processes",
            "view": "a scene in the browser: stage, cameras, pictures and cloud together",
            "store": "results under their keys: written once, verified, repaired",
            "execution": "planning of results and their execution, locally or on a cluster",
            "gallery": "contact sheets of families, worlds, looks and their combinations, one picture of a scenario",
            "commands": "the commands of the command line",
        },
    ),
}

_BOX, _GAP, _LEFT, _WIDTH, _LINE = 108, 8, 150, 7, 26  # [px], and boxes side by side
_INK, _EDGE = "#2b2f33", "#7f9cc4"
_FILLS = ("#eef1f4", "#e6eef8", "#e8f3e8", "#f8f1e2", "#f6e8e8", "#efe8f6", "#e6f3f4")


def folders_of(room: str) -> list[str]:
    """List the folders of a room, sorted.

    Args:
        room: Its name.
    """
    return sorted(path.parent.name for path in (ROOT / room).glob("*/__init__.py"))


def arrows() -> set[tuple[str, str]]:
    """Find which rooms import from which: pairs of importing and imported room; all import from the lowest."""
    found: set[tuple[str, str]] = set()
    lowest = next(iter(ROOMS))
    for room in ROOMS:
        for path in sorted((ROOT / room).rglob("*.py")):
            imported = {name.partition(".")[0] for name in _imports(path)} & ROOMS.keys() - {room, lowest}
            found.update((room, other) for other in imported)
    return found


def _imports(path: Path) -> list[str]:
    names = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.append(node.module)
    return names


def architecture_page() -> str:
    """Write the page as Markdown."""
    lines = [
        "# Architecture",
        "",
        "Generated by `python -m docs.generate`; the figure is drawn from the imports of the modules.",
        "",
        "Main idea: **the USD stage is the contract**. `authoring` writes stages, `render` reads stages, and neither",
        "imports the other. Each later step reads a folder that the step before has written: a capture, a cloud, a",
        "data set, a model. So each step can be replaced, and each accepts files of other programs.",
        "",
        f"![Rooms from bottom to top, and the imports between them]({FIGURE})",
        "",
        "A *room* is a top-level package. The figure shows the rooms from bottom to top: none imports from a room",
        "above it, and no folder from a folder that is further right or below in its room's list (`tests/house`",
        "checks both orders). All import from `groundwork`; these arrows are left out.",
        "",
    ]
    for room, (about, folders) in ROOMS.items():
        lines += [f"## `{room}/`: {about}", ""]
        if folders:
            lines += ["| folder | task |", "|---|---|"]
            lines += [f"| `{name}/` | {text} |" for name, text in folders.items()]
            lines.append("")
    lines += [
        "## Steps of a run",
        "",
        "`falsework run` executes the steps of `falsework/stages.py`: stage, capture, model, cloud, sample, report.",
        "Each is a function from settings and input folders to one output folder, and its key in the store is the",
        "hash of exactly these. `falsework/pipeline.py` calls them in order; [scale.md](scale.md) describes the",
        "scheduling, and [formats.md](formats.md) the contents of the folders.",
        "",
    ]
    return "\n".join(lines)


def architecture_figure() -> str:
    """Draw rooms, folders and arrows as SVG."""
    pairs, places, parts, top = arrows(), {}, [], 14
    right = _LEFT + _WIDTH * (_BOX + _GAP)
    for number, (room, (_, folders)) in reversed(list(enumerate(ROOMS.items()))):
        rows = max(1, -(-len(folders) // _WIDTH))
        height = rows * (_LINE + _GAP) + _GAP
        places[room] = top + height / 2
        parts.append(f'<rect x="10" y="{top}" width="{right}" height="{height}" rx="8" fill="{_FILLS[number]}"/>')
        parts.append(_text(22, top + height / 2 + 5, room, 15, _INK, bold=True))
        for index, name in enumerate(folders):
            x, y = _LEFT + index % _WIDTH * (_BOX + _GAP), top + _GAP + index // _WIDTH * (_LINE + _GAP)
            parts.append(f'<rect x="{x}" y="{y}" width="{_BOX}" height="{_LINE}" rx="5" fill="#fff" stroke="#d5dae0"/>')
            parts.append(_text(x + _BOX / 2, y + 17, name, 12, _INK, middle=True))
        top += height + 12
    names = list(ROOMS)
    reach = {pair: abs(names.index(pair[0]) - names.index(pair[1])) for pair in pairs}
    for upper, lower in sorted(pairs, key=lambda pair: (reach[pair], pair)):
        x, step = right + 10, 22 + 26 * reach[upper, lower]
        start, end = places[upper] + 3 * reach[upper, lower], places[lower] - 3 * reach[upper, lower]
        parts.append(
            f'<path d="M{x},{start:.0f} C{x + step},{start:.0f} {x + step},{end:.0f} {x + 4},{end:.0f}" fill="none" '
            f'stroke="{_EDGE}" stroke-width="1.6" marker-end="url(#tip)"/>'
        )
    size = f'width="{right + 160}" height="{top}" viewBox="0 0 {right + 160} {top}"'
    tip = (
        '<marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="9" markerHeight="9" orient="auto" '
        f'markerUnits="userSpaceOnUse"><path d="M0,0 L8,4 L0,8 z" fill="{_EDGE}"/></marker>'
    )
    ground = f'<rect width="{right + 160}" height="{top}" fill="#fff"/>'
    body = "\n".join(parts)
    return f'<svg xmlns="http://www.w3.org/2000/svg" {size}>\n<defs>{tip}</defs>\n{ground}\n{body}\n</svg>\n'


def _text(x: float, y: float, text: str, size: int, color: str, *, bold: bool = False, middle: bool = False) -> str:
    weight = ' font-weight="600"' if bold else ""
    anchor = ' text-anchor="middle"' if middle else ""
    place = f'x="{x:.0f}" y="{y:.0f}" font-size="{size}" fill="{color}"'
    return f'<text {place} font-family="system-ui, sans-serif"{weight}{anchor}>{escape(text)}</text>'
