"""The verbs of `falsework scene`: inspect a scene, choose variants, compare, copy, flatten and package."""

import sys
from collections import Counter
from contextlib import nullcontext
from pathlib import Path
from typing import Annotated, Any

import tyro

from falsework.children.products import read_safely
from falsework.commands.answers import AsJson, answer, tell
from falsework.commands.console import ConsoleProgress
from falsework.commands.edit_verbs import import_edits
from falsework.commands.given_files import stage_file
from groundwork.child import run_child
from groundwork.errors import InputError
from groundwork.output.place import output_place
from groundwork.output.reading import reading
from groundwork.progress import Progress
from groundwork.slug import slug

WORKER = "falsework.children.scene_work"
LONG_WORK = ("choose", "flatten", "package")  # no time limit: they author and bake
TIME_LIMIT = 3600.0  # [s]
MEMORY_LIMIT = 16.0  # [GB]
_FEW = 3  # names of one parent, or of one material, that a line of `diff` holds

File = tyro.conf.Positional[Path]
Output = Annotated[Path, tyro.conf.arg(aliases=["-o"])]
Roots = tuple[Path, ...]


def info(
    scene: File,
    *,
    depth: int = 4,
    files: bool = False,
    members: bool = False,
    allow_root: Roots = (),
    as_json: AsJson = False,
) -> int:
    """Show what is in a scene: its tree, choices, counts per component and class, surveys, hashes.

    Args:
        scene: Scene folder, its root layer, or any other USD file.
        depth: Levels of the tree.
        files: List every layer and texture with its hash.
        members: List every part of the bridge with its instance id, component and class.
        allow_root: Further folders from which the scene may load files.
        as_json: Print one JSON object instead of lines.
    """
    found = _work("info", scene, {"depth": depth}, allow_root)
    if as_json:
        return answer(found)
    for row in found["tree"]:
        indent = "  " * (row["path"].count("/") - 1)
        surfaces = f"  {row['surfaces']} surfaces" if row["surfaces"] else ""
        _say(f"{indent}{row['path'].rpartition('/')[2]}  {row['type'] or '-'}{surfaces}")
    for axis, names in found["choices"].items():
        marked = " ".join(f"[{name}]" if name == found["selected"][axis] else name for name in names)
        _say(f"choice      {axis}: {marked}")
    for name, survey in found["surveys"].items():
        _say(f"survey      {name}: {survey['images']} images of {survey['width']} x {survey['height']}")
    for title in ("classes", "components"):
        _say(f"{title:<11} " + ", ".join(f"{name} {count}" for name, count in found[title].items()))
    _say(f"triangles   {found['triangles']:,}")
    for row in found["members"] if members else ():
        _say(f"{row['id']:>7}  {row['component']:<20} {row['class']:<12} {row['path']}")
    for name, code in found["layers"].items() if files else ():
        _say(f"{code}  {name}")
    _say(
        f"files       {len(found['layers'])}, hash {found['scene_hash']}, of the selected variants "
        f"{found['variant_hash']}"
    )
    for line in found["changed"]:
        _say(f"changed     {line}")
    return 0


def validate(scene: File, *, allow_root: Roots = (), as_json: AsJson = False) -> int:
    """Validate a scene in every variant; exit code 1 if anything is wrong.

    Args:
        scene: Scene folder, its root layer, or any other USD file.
        allow_root: Further folders from which the scene may load files.
        as_json: Print one JSON object instead of lines.
    """
    findings = _work("validate", scene, {}, allow_root)
    if as_json:
        answer({"findings": findings})
    else:
        for line in findings:
            _say(line)
        _say(f"{len(findings)} findings" if findings else "valid in every variant")
    return int(bool(findings))


def diff(first: File, second: File, *, allow_root: Roots = (), as_json: AsJson = False) -> int:
    """Compare two scenes: prims that moved, changed shape, look or label, and that were added or removed.

    Args:
        first: Scene folder or root layer before.
        second: Scene folder or root layer after.
        allow_root: Further folders from which the scenes may load files.
        as_json: Print one JSON object instead of lines.
    """
    other = stage_file(second)
    found = _work("diff", first, {"second": str(other)}, allow_root, other)
    if as_json:
        return answer(found)
    lines = [f"selection   {axis}: {before} -> {after}" for axis, (before, after) in found["selections"].items()]
    lines += [f"moved       {path}  {meters:.6g} m" for path, meters in found["moved"].items()]
    lines += [f"reshaped    {path}" for path in found["reshaped"]]
    lines += [f"look        {line}" for line in _looks(found["look"])]
    for path, (before, after) in found["relabelled"].items():
        lines.append(f"relabeled   {path}  {' '.join(filter(None, before))} -> {' '.join(filter(None, after))}")
    lines += [f"{word:<11} {line}" for word in ("light", "added", "removed") for line in _together(found[word])]
    folders = Counter((name.rpartition("/")[0] or ".", what) for name, what in found["layers"].items())
    lines += [f"files       {folder}: {count} {what}" for (folder, what), count in sorted(folders.items())]
    for line in lines:
        _say(line)
    if found["same"]:
        _say("the composed scenes are equal" if lines else "no difference")
    elif not any(found[word] for word in ("moved", "reshaped", "relabelled")):
        _say("unchanged   everything that both scenes have: places, shapes, cameras and labels")
    return 0


def set_(
    scene: File,
    choices: tyro.conf.Positional[tuple[str, ...]],
    *,
    variant: str = "",
    re_origin: tuple[float, float, float] | None = None,
    allow_root: Roots = (),
    as_json: AsJson = False,
) -> int:
    """Choose look, background, light or class table of a scene; missing variants are made or imported first.

    Args:
        scene: Scene folder, or its root layer.
        choices: look=NAME background=NAME light=NAME, or your own USD file as NAME (a look with materials named like
            the roles, or a background); for a look also a folder or ZIP file of surfaces, for a background the folder
            of an imported world, for the light a date and time, 2024-12-21T10:00, or a photographed sky (.hdr, .exr);
            taxonomy=kim2023 selects another class table.
        variant: Do not change the scene, but write variant_NAME.usda beside it.
        re_origin: X Y Z of the point of your own background at the scene's origin, where the bridge begins, in meters
            with z up; for a background in map coordinates.
        allow_root: Further folders from which your own file may load layers and textures.
        as_json: Print one JSON object instead of lines.
    """
    pairs = [choice.partition("=") for choice in choices]
    for axis, _, value in pairs:
        if not axis or not value:
            raise InputError("not a choice", field="set", value=axis, allowed="look=… background=… light=… taxonomy=…")
    wanted = {axis: value for axis, _, value in pairs}
    with ConsoleProgress() as progress:
        chosen = choose_layers(scene, wanted, variant, re_origin, allow_root, progress)
    if as_json:
        return answer(chosen)
    for axis, name in chosen.items():
        _say(f"{axis:<11} {name}")
    return 0


def choose_layers(
    scene: Path,
    choices: dict[str, str],
    variant: str,
    origin: tuple[float, float, float] | None,
    roots: Roots,
    progress: Progress,
) -> dict[str, str]:
    """Choose layers of a scene in a child process; what is missing is made or imported first.

    Args:
        scene: Scene folder, or its root layer.
        choices: Name, USD file, or date and time, by `look`, `background`, `light` or `taxonomy`.
        variant: Name of a layer to write beside the scene, which stays as it is; empty to change the scene.
        origin: Point of the user's own background at the scene's origin [m].
        roots: Further folders from which it may load files.
        progress: Listener.

    Returns:
        What was chosen, by axis.
    """
    if variant and slug(variant) != variant:
        raise InputError(
            "not a name of a variant",
            field="--variant",
            value=variant,
            allowed="letters, digits, . _ and -, a letter or digit first",
            hint=f"Use {slug(variant)}",
        )
    own = [Path(value) for value in choices.values() if Path(value).suffix.startswith(".usd")]
    request = {"choices": choices, "variant": variant, "origin": origin}
    return _work("choose", scene, request, roots, *own, progress=progress)


def checkout(source: File, output: Output, *, as_json: AsJson = False) -> int:
    """Copy a scene out of the read-only store for editing.

    Args:
        source: Scene folder, its root layer, or a folder such as `OUT/scenes/0000`.
        output: Folder to make; an existing one is never replaced.
        as_json: Print one JSON object instead of a line.
    """
    from authoring.scenes.checkout import checkout_scene

    root = checkout_scene(source, output)
    return tell({"scene": str(root)}, [f"scene   {root}"], as_json)


def flatten(scene: File, output: Output, *, allow_root: Roots = (), as_json: AsJson = False) -> int:
    """Write a scene as one layer, with its selected variants; texture paths stay relative.

    Args:
        scene: Scene folder, or its root layer.
        output: File to write, .usda or .usdc.
        allow_root: Further folders from which the scene may load files.
        as_json: Print one JSON object instead of lines.
    """
    output_place(output, [scene])  # if a folder is named, its other files are inputs as well
    missing = _work("flatten", scene, {"out": str(output)}, allow_root)
    for path in missing:
        sys.stderr.write(f"texture not found: {path}\n")
    return tell({"layer": str(output), "missing_textures": missing}, [f"layer   {output}"], as_json)


def package(
    scene: File,
    output: Output,
    *,
    bake: bool = False,
    texels: int = 4096,
    allow_root: Roots = (),
    as_json: AsJson = False,
) -> int:
    """Package a scene as one file: usdz with all variants, or GLB for the web with the selected ones.

    Args:
        scene: Scene folder, or its root layer.
        output: File to write, .usdz or .glb.
        bake: Bake weathering and fine detail into the textures, for renderers that do not support them; the file then
            holds only the selected variants.
        texels: Side of each baked texture in texels.
        allow_root: Further folders from which the scene may load files.
        as_json: Print one JSON object instead of lines.
    """
    output_place(output, [scene])  # if a folder is named, its other files are inputs as well
    names = _work("package", scene, {"out": str(output), "bake": bake, "texels": texels}, allow_root)
    size = output.stat().st_size
    line = f"package {output}  {size / 1e6:.1f} MB, {len(names)} entries"
    return tell({"package": str(output), "bytes": size, "entries": len(names)}, [line], as_json)


def schemas(*, path: bool = False, as_json: AsJson = False) -> int:
    """Show the path of the schema plugin, for other USD hosts.

    Args:
        path: Print only the folder, for PXR_PLUGINPATH_NAME.
        as_json: Print one JSON object instead of a line.
    """
    from usd_schemas.registration import register_schemas

    folder = register_schemas()
    line = folder if path else f'export PXR_PLUGINPATH_NAME="{folder}"'
    return tell({"folder": folder}, [line], as_json)


SCENE_VERBS = {
    "info": info,
    "validate": validate,
    "diff": diff,
    "set": set_,
    "checkout": checkout,
    "import-edits": import_edits,
    "flatten": flatten,
    "package": package,
    "schemas": schemas,
}


def _looks(changed: dict[str, list[str]]) -> list[str]:
    """Describe each changed material in one line, with the prims that it is bound to."""
    bound: dict[str, list[str]] = {}
    for path, (before, after) in changed.items():
        line = after if before == after else f"{before or 'none'} -> {after or 'none'}"
        bound.setdefault(line, []).append(path.rpartition("/")[2])
    return [
        f"{line}: {', '.join(names[:_FEW])}" + (f" and {len(names) - _FEW} more" if len(names) > _FEW else "")
        for line, names in sorted(bound.items())
    ]


def _together(paths: list[str]) -> list[str]:
    """Write a line for each path; one for all of a parent that has more than a few: a world has hundreds."""
    below: dict[str, list[str]] = {}
    for path in paths:
        below.setdefault(path.rpartition("/")[0], []).append(path)
    lines = list[str]()
    for parent, own in below.items():
        names = ", ".join(path.rpartition("/")[2] for path in own[:_FEW])
        lines += own if len(own) <= _FEW else [f"{parent}: {names} and {len(own) - _FEW} more"]
    return lines


def _work(
    work: str, scene: Path, request: dict[str, Any], roots: Roots, *others: Path, progress: Progress | None = None
) -> Any:
    scene = stage_file(scene)
    stages = [str(stage) for stage in (scene, *others)]
    request = {**request, "work": work, "scene": str(scene), "stages": stages, "allow_roots": [str(r) for r in roots]}
    with nullcontext(progress) if progress else ConsoleProgress() as listener:
        if work in LONG_WORK:
            with reading(scene, *others):
                return run_child(WORKER, request, time_limit=TIME_LIMIT, memory_limit=MEMORY_LIMIT, progress=listener)
        return read_safely(WORKER, request, scene, listener)


def _say(line: str) -> None:
    sys.stdout.write(line + "\n")
