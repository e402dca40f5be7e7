"""The command line: one verb per task, one line for every error, and exit codes that scripts can rely on."""

import errno
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Literal

import tyro

from falsework.commands.answers import AsJson, answer, tell
from falsework.commands.cloud_verbs import export, reconstruct
from falsework.commands.console import ConsoleProgress
from falsework.commands.given_files import need_scenario
from falsework.commands.parsing import parse, parse_verb
from falsework.commands.render_verb import render
from falsework.stops import INTERRUPTED, INTERRUPTED_LINE, TERMINATED, catch_stops, stop_behind
from groundwork.errors import FalseworkError, InputError, MissingError, RejectedSceneError

PIPE_CLOSED = 141
ABOUT = (
    "Bridges as USD stages, inspection flights around them, and annotated point clouds. Start with: falsework demo. "
    "The version: falsework --version"
)

Output = Annotated[Path, tyro.conf.arg(aliases=["-o"])]
File = tyro.conf.Positional[Path]
Family = Literal["arch", "beam", "cable_stayed", "girder", "slab", "suspension"]  # a test holds it to the registry
World = Literal["countryside", "city", "lakeside", "hillside"]  # so, too
Look = Literal["weathered", "clean", "aged", "random"]  # so, too


def doctor(*, as_json: AsJson = False) -> int:
    """Check what works on this machine (Python, packages, EGL, GPU, memory, disk) and give a hint for what does not.

    Args:
        as_json: Print one JSON object instead of lines.
    """
    from falsework.doctor import examine

    checks = examine()
    if as_json:
        answer({"checks": [{"name": c.name, "verdict": c.verdict, "found": c.found, "hint": c.hint} for c in checks]})
    else:
        for check in checks:
            _say(f"{check.verdict:<4} {check.name:<18} {check.found}" + (f"  -> {check.hint}" if check.hint else ""))
    return int(any(check.verdict == "FAIL" for check in checks))


def author(scenario: File, output: Output, *, scene: int = 0, as_json: AsJson = False) -> int:
    """Author the layered USD stage of one scene into a plain folder.

    Args:
        scenario: TOML file.
        output: Folder to write: the scene folder itself.
        scene: Number of the scene.
        as_json: Print one JSON object instead of a line.
    """
    need_scenario(scenario)
    from falsework.commands.verbs import author_file
    from falsework.scenario import load_scenario, values_of

    loaded = load_scenario(scenario)
    with ConsoleProgress() as progress, values_of(scenario):
        author_file(loaded, output, scene, progress, [scenario])
    root = output / "scene.usda"
    return tell({"scene": str(root)}, [f"scene   {root}"], as_json)


def gallery(
    subject: tyro.conf.Positional[Literal["families", "worlds", "looks", "combinations"]],
    output: Output,
    *,
    count: int = 6,
    seed: int = 1,
    family: tuple[Family, ...] = (),
    world: tuple[World, ...] = (),
    look: tuple[Look, ...] = (),
    as_json: AsJson = False,
) -> int:
    """Render contact sheets of random bridges: one sheet for each family, for each world, or for all looks.

    Families: photograph, classes, close-up. Worlds: from eye height, under the deck, beside a pier and from the air,
    with varying look and light, and a table of measurements. Looks: one girder bridge in every look. Combinations:
    one bridge of each family in every world and look, one sheet for each world; 96 pictures, which take an hour or two.

    Args:
        subject: What to show.
        output: Folder to write: the sheets and an index.
        count: Bridges on each sheet of families and of worlds.
        seed: Seed of the first bridge; the others follow. A scenario with this `seed` makes the same bridge.
        family: Only these families.
        world: Only these worlds.
        look: Only these looks.
        as_json: Print one JSON object instead of a line.
    """
    _check_gallery(
        subject,
        count,
        {"--family": (family, "families"), "--world": (world, "worlds"), "--look": (look, "")},
    )
    from groundwork.output.folder import fresh_output

    def write(folder: Path) -> None:
        if subject == "worlds":
            from falsework.gallery.worlds import write_worlds

            write_worlds(folder, count, seed, world, progress)
        elif subject == "looks":
            from falsework.gallery.looks import write_looks

            write_looks(folder, seed, 2048, progress)
        elif subject == _COMBINATIONS:
            from falsework.gallery.combinations import write_combinations

            write_combinations(folder, seed, family, world, look, progress)
        else:
            from falsework.gallery.families import write_gallery

            write_gallery(folder, count, seed, family, progress)

    with ConsoleProgress() as progress:
        fresh_output(output, "gallery", write)
    index = output / "index.md"
    return tell({"gallery": str(index)}, [f"gallery {index}"], as_json)


_COMBINATIONS = "combinations"


def _check_gallery(subject: str, count: int, given: dict[str, tuple[tuple[str, ...], str]]) -> None:
    """Refuse what the sheets of this subject do not know, before anything heavy is loaded."""
    if count < 1:
        raise InputError("no bridge to show", field="--count", value=count, allowed="1 or more")
    for field, (names, own) in given.items():
        if names and subject not in (own, _COMBINATIONS):
            allowed = " or ".join(filter(None, (own, _COMBINATIONS)))
            raise InputError(f"not with {subject}", field=field, value=" ".join(names), allowed=f"only with {allowed}")


def completion(shell: tyro.conf.Positional[Literal["bash", "zsh", "fish"]]) -> int:
    """Print the script for the completion of verbs, options and their values in a shell.

    Write it to `~/.local/share/bash-completion/completions/falsework` for bash, to a file `_falsework` in a folder of
    `fpath` for zsh, to `~/.config/fish/completions/falsework.fish` for fish; then start a new shell.

    Args:
        shell: Name of the shell.
    """
    from falsework.commands.completion import completion_script

    sys.stdout.write(completion_script(all_verbs(), shell))
    return 0


# Groups of verbs, each in a module that is loaded only when needed.
GROUPS = {
    "scene": "Inspect a scene, choose its look and light, compare, copy, package: falsework scene --help.",
    "background": "Import a city model as a background for scenes: falsework background --help.",
    "survey": "Plan flights, and score them before rendering: falsework survey --help.",
    "sample": "Make a cloud from a stage without images: falsework sample --help.",
    "dataset": "Make training sets from clouds: falsework dataset --help.",
}
# Verbs in modules of their own: the module, and the help text.
SINGLE = {
    "demo": ("run_verbs", "Run the whole chain on one small bridge, up to an annotated dense cloud and a report."),
    "run": ("run_verbs", "Run the whole chain of a scenario; a second call makes only what is missing."),
    "preview": ("preview_verb", "Preview a scenario: render one picture of its bridge in its surroundings."),
    "plan": ("plan_verbs", "Show what a run would do, how long it takes and what disk space it needs."),
    "report": ("report_verb", "Write a page of a scene, a run, a data set, a training or a comparison."),
    "view": ("view_verb", "Look at a scene in the browser: stage, cameras, pictures and cloud together."),
    "verify": ("store_verbs", "Find changed, missing and foreign files in a run's folder: falsework verify --help."),
    "clean": ("store_verbs", "Remove leftovers of killed runs and, on request, unused results from a run's folder."),
    "train": ("train_verbs", "Train a network on a data set: falsework train --help."),
    "evaluate": ("train_verbs", "Score a model on a data set: falsework evaluate --help."),
    "compare": ("compare_verbs", "Compare methods of making training clouds: falsework compare --help."),
    "predict": ("predict_verbs", "Label a scan with a trained model: falsework predict --help."),
}
ELSEWHERE = {**GROUPS, **{name: about for name, (_, about) in SINGLE.items()}}


def _elsewhere(about: str) -> Callable[[], int]:
    """Make a placeholder with the help text of a verb in another module."""

    def verb() -> int:
        return 0

    verb.__doc__ = about
    return verb


HELP = {"-h", "--help"}
_UNUSABLE = {
    errno.ENAMETOOLONG: "a name or path that is too long",
    errno.EACCES: "no permission",
    errno.EISDIR: "is a folder, and a file belongs here",
    errno.ELOOP: "is a link that leads to itself",
}
EXTRAS = {  # package that may be missing → extra that installs it
    **dict.fromkeys(("torch", "lightning", "safetensors", "sklearn"), "learn"),
    "viser": "view",
}
_HERE = {verb.__name__: verb for verb in (doctor, author, gallery, render, reconstruct, export, completion)}
_ORDER = (
    *("doctor", "demo", "preview", "plan", "run", "verify", "clean", "report", "view"),
    *("author", "scene", "background", "survey", "gallery", "render", "reconstruct", "sample", "export"),
    *("dataset", "train", "evaluate", "compare", "predict", "completion"),
)
VERBS = {name: _HERE[name] if name in _HERE else _elsewhere(ELSEWHERE[name]) for name in _ORDER}


def all_verbs() -> dict[str, Callable[..., int]]:
    """Collect every verb and the function behind it.

    Returns:
        Name as typed, two words for a verb of a group, and the function.
    """
    found = {name: verb for name, verb in VERBS.items() if name not in ELSEWHERE}
    for name, (module, _) in SINGLE.items():
        found[name] = getattr(import_module(f"falsework.commands.{module}"), name)
    for group in GROUPS:
        module = import_module(f"falsework.commands.{group}_verbs")
        found |= {f"{group} {name}": verb for name, verb in getattr(module, f"{group.upper()}_VERBS").items()}
    return found


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and exit with its code.

    Args:
        arguments: Words after the program's name; those of the process when None.
    """
    catch_stops()
    words = sys.argv[1:] if arguments is None else arguments
    try:
        _check_here()
        if words[:1] == ["--version"]:
            _say(version("falsework"))
            code = 0
        else:
            code = _run(words)
    except SystemExit as left:
        if not left.code and not HELP.isdisjoint(words):
            with suppress(BrokenPipeError):  # `… --help | head`
                _show_examples(words)
                sys.stdout.flush()
        if left.code == TERMINATED:
            sys.stderr.write(INTERRUPTED_LINE)
        raise
    except FalseworkError as error:
        reason = f"{error.reason}: " if isinstance(error, RejectedSceneError) else ""
        sys.stderr.write(f"falsework: {reason}{error}\n")
        code = error.exit_code
    except ModuleNotFoundError as error:
        extra = EXTRAS.get((error.name or "").partition(".")[0])
        if extra is None:
            raise
        sys.stderr.write(
            f"falsework: this command needs the package {error.name}. Install it: make .venv/.stamp-{extra}, "
            f"or pip install 'falsework[{extra}]'\n"
        )
        code = InputError.exit_code
    except BrokenPipeError:  # `falsework scene info SCENE | head`: the reader has closed the pipe
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = PIPE_CLOSED
    except OSError as error:
        refusal = _path_error(error)
        if refusal is None:
            raise
        sys.stderr.write(f"falsework: {refusal}\n")
        code = refusal.exit_code
    except KeyboardInterrupt:
        sys.stderr.write(INTERRUPTED_LINE)
        code = INTERRUPTED
    sys.exit(code)


def _run(words: list[str]) -> int:
    """Run a verb; a stop that a native library made an error of its own is a stop again."""
    try:
        return _call(words)()
    except Exception as error:
        if stop := stop_behind(error):
            raise stop from None
        raise


def _path_error(error: OSError) -> InputError | None:
    """Describe a path that cannot be used, which the user or a file of theirs named; None for any other error."""
    about = _UNUSABLE.get(error.errno or 0)
    if about is None or error.filename is None:
        return None
    return InputError(about, where=os.fsdecode(error.filename), hint="Check the path")


def _show_examples(words: list[str]) -> None:
    from falsework.commands.examples import examples_for

    found = examples_for(words)
    if found:
        _say("\n".join([f"Example{'s'[: len(found) - 1]}:", *(f"  {line}" for line in found)]))


def _check_here() -> None:
    try:
        Path.cwd()
    except FileNotFoundError:
        raise MissingError(
            "the current folder does not exist any more", where=Path(), hint="Change to an existing folder"
        ) from None


def _call(words: list[str]) -> Callable[[], int]:
    """Find the verb, load its module, and parse its arguments."""
    name, *rest = words or [""]
    if name in GROUPS:
        module = import_module(f"falsework.commands.{name}_verbs")
        return parse_verb(getattr(module, f"{name.upper()}_VERBS"), f"falsework {name}", rest, module.__doc__ or "")
    if name in SINGLE:
        return parse(getattr(import_module(f"falsework.commands.{SINGLE[name][0]}"), name), f"falsework {name}", rest)
    return parse_verb(VERBS, "falsework", words, ABOUT)


def _say(line: str) -> None:
    sys.stdout.write(line + "\n")
