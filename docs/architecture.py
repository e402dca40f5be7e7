"""The page of the house: its rooms and folders, and a figure drawn from what their modules import."""

import ast
from html import escape
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FIGURE = "images/architecture.svg"

# Lowest first: each room imports only from those above it in this table.
ROOMS: dict[str, tuple[str, dict[str, str]]] = {
    "groundwork": ("errors, settings, progress, child processes, files and folders that are written whole", {}),
    "usd_schemas": (
        "what a stage says: names, component and class tables, camera convention, a stage as flat arrays",
        {
            "reading": "composes a stage and reads it: meshes, materials, lights, cameras, labels",
            "guard": "what a stage from elsewhere must not do, before USD opens it",
        },
    ),
    "authoring": (
        "scenario → layered stage",
        {
            "foreign": "opens models and textures from elsewhere",
            "shapes": "components, cross sections, the topology of surfaces",
            "axis": "alignment of the road or railway, clearances",
            "solids": "sweeps, extrusions, copies, texture atlas",
            "site": "the ground: valley, river, roads, rails, relief",
            "parts": "decks, girders, piers, bearings, cables, parapets",
            "families": "puts parts together: beam, girder, slab, arch, suspension, cable-stayed",
            "looks": "materials and textures, weathering",
            "light": "sun, sky, panorama",
            "backgrounds": "countryside, hillside, lakeside, hamlet, harbour, city",
            "surveys": "flights of the virtual UAV: paths, coverage, calibration",
            "layers": "writes what the rooms above drew as USD layers",
            "imported": "worlds from files: glTF, meshes, CityJSON, USD",
            "scenes": "what one does with a written scene: validate, compare, check out",
            "variants": "looks and backgrounds that are added to a scene",
            "edits": "brings home what an artist changed elsewhere",
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
            "photos": "reads photographs and what they say of themselves",
            "sfm": "Structure from Motion: features, matches, cameras, tie points",
            "dense": "a depth for every pixel, fused into points",
            "placing": "alignment to the truth, to GPS or to control points, with stated errors",
            "points": "placed points, their observations, precision, duplicates",
            "truth": "labels by vote, uncertainty, distance to the true surface",
            "formats": "clouds of others: LAS, PLY, E57, COLMAP, …",
            "sampling": "clouds without images: points on surfaces, laser scans",
        },
    ),
    "learn": (
        "clouds → data sets, models, scores, labels for a scan",
        {
            "neighborhoods": "search, sampling, pyramids of neighbours",
            "datasets": "windows, tiles, splits, augmentation, class maps",
            "models": "PointNet++, PointNeXt, RandLA-Net, a forest",
            "scoring": "a class for every point, by votes of overlapping samples",
            "training": "recipes, the loop, going on where it stopped",
            "compare": "ways of making training clouds, compared with intervals",
            "demo": "thinned clouds that come with the package",
            "predict": "labels a scan of any size",
        },
    ),
    "falsework": (
        "the door: scenario, store, runs, command line, report, Python API",
        {
            "report": "pages: of a scene, a run, a data set, a training, a comparison",
            "children": "work that is done in a process of its own",
            "view": "a scene in the browser: stage, cameras, pictures and cloud together",
            "store": "results under their keys: written once, verified, repaired",
            "execution": "which results are wanted, who makes them, here or on a cluster",
            "gallery": "contact sheets of families, looks and worlds, one picture of a scenario",
            "commands": "the verbs of the command line",
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
        "# The house",
        "",
        "Generated by `python -m docs.generate`; the figure is drawn from the imports of the modules.",
        "",
        "One idea carries it: **the USD stage is the contract**. `authoring` writes stages, `render` reads stages, and",
        "neither knows the other. What follows reads folders that the room before has written: a capture, a cloud, a",
        "data set, a model. So each step can be replaced, and each can be fed with files from elsewhere.",
        "",
        f"![Rooms from bottom to top, and who imports from whom]({FIGURE})",
        "",
        "Rooms stand from bottom to top: none imports from one above it, and no folder from one that stands further",
        "right or below in its room's list (`tests/house` holds both orders). All import from",
        "`groundwork`, without arrows here.",
        "",
    ]
    for room, (about, folders) in ROOMS.items():
        lines += [f"## `{room}/`: {about}", ""]
        if folders:
            lines += ["| folder | what happens there |", "|---|---|"]
            lines += [f"| `{name}/` | {text} |" for name, text in folders.items()]
            lines.append("")
    lines += [
        "## One verb a stage",
        "",
        "`falsework run` goes through `falsework/stages.py`: stage, capture, model, cloud, sample, report. Each is a",
        "function from settings and input folders to one output folder, and its key in the store is the hash of",
        "exactly these. `falsework/pipeline.py` is the conductor; [scale.md](scale.md) says who works on what, and",
        "[formats.md](formats.md) what lies in the folders.",
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
