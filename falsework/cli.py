"""The command line: one verb per room, one line for every error, and exit codes that scripts can rely on."""

import json
import os
import signal
import sys
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from falsework.commands.console import ConsoleProgress
from falsework.store_verbs import verify
from groundwork.errors import FalseworkError, MissingError, RejectedSceneError

INTERRUPTED = 130
TERMINATED = 143
PIPE_CLOSED = 141
SOME_SCENES_FAILED = 3
JSON_VERSION = 1
ABOUT = "Bridges as USD stages, inspection flights around them, and annotated point clouds. Start with: falsework demo"

Output = Annotated[Path, tyro.conf.arg(aliases=["-o"])]
File = tyro.conf.Positional[Path]


def doctor(*, as_json: Annotated[bool, tyro.conf.arg(name="json")] = False) -> int:
    """Check what works here (Python, packages, EGL, GPU, memory, disk) and say how to mend what does not.

    Args:
        as_json: Print one JSON object instead of lines.
    """
    from falsework.doctor import examine

    checks = examine()
    if as_json:
        _answer({"checks": [{"name": c.name, "verdict": c.verdict, "found": c.found, "mend": c.mend} for c in checks]})
    else:
        for check in checks:
            _say(f"{check.verdict:<4} {check.name:<18} {check.found}" + (f"  -> {check.mend}" if check.mend else ""))
    return int(any(check.verdict == "FAIL" for check in checks))


def demo(output: Output = Path("demo-out"), *, seed: int | None = None) -> int:
    """Make one small bridge from nothing to an annotated point cloud and a report.

    Args:
        output: Folder to write into.
        seed: Another bridge than the usual one.
    """
    from falsework.scenario import demo_scenario

    scenario = demo_scenario()
    return _run(scenario if seed is None else scenario.model_copy(update={"seed": seed}), output, None, False)


def run(
    scenario: File,
    output: Output,
    *,
    scenes: str | None = None,
    workers: int = 0,
    cluster: str | None = None,
    shard: str | None = None,
    retry_failed: bool = False,
    as_json: Annotated[bool, tyro.conf.arg(name="json")] = False,
) -> int:
    """Run the whole chain of a scenario; a second call makes only what is missing.

    Args:
        scenario: TOML file.
        output: Folder to write into.
        scenes: Part of the scenes, as `first:end`.
        workers: Worker processes that share the scenes; 0 runs them one after the other in this process.
        cluster: Address of a Dask scheduler (tcp://HOST:PORT) whose workers share the scenes.
        shard: Part of the scenes as i/n, i from 0 to n - 1: for arrays of jobs that share the output folder.
        retry_failed: Try again what failed in an earlier run.
        as_json: Print one JSON object at the end instead of lines.
    """
    from falsework.scenario import load_scenario, scene_range, shard_of, values_of
    from groundwork.errors import InputError

    if workers < 0 or (workers and cluster):
        raise InputError("no such number of workers", field="--workers", value=workers,
                         allowed="0 or more, and none beside --cluster")  # fmt: skip
    loaded = load_scenario(scenario)
    part = shard_of(scene_range(scenes, loaded.scenes), shard)
    with values_of(scenario):
        return _run(loaded, output, part, as_json, retry_failed=retry_failed, workers=workers, cluster=cluster)


def author(scenario: File, output: Output, *, scene: int = 0) -> int:
    """Author the layered USD stage of one scene into a plain folder.

    Args:
        scenario: TOML file.
        output: Folder to write: the scene folder itself.
        scene: Number of the scene.
    """
    from authoring.scenes.manifest import edits_since
    from falsework.scenario import given_files, load_scenario, scene_seed, values_of
    from falsework.stages import STAGES
    from groundwork.errors import InputError
    from groundwork.files import fresh_output

    loaded = load_scenario(scenario)
    if not 0 <= scene < loaded.scenes:
        raise InputError("no such scene", field="--scene", value=scene, allowed=f"0 to {loaded.scenes - 1}")
    if output.is_dir() and (changed := edits_since(output)):
        raise InputError(
            f"was changed since it was authored ({changed[0]})", where=output, mend="Author into another folder"
        )
    settings = {"seed": scene_seed(loaded.seed, scene), "authoring": loaded.authoring()}
    worlds = given_files(loaded)
    with ConsoleProgress() as progress, values_of(scenario):
        fresh_output(output, "scene", lambda folder: STAGES["stage"].run(settings, worlds, folder, progress))
    _say(f"scene   {output / 'scene.usda'}")
    return 0


def render(
    stage: File,
    output: Output,
    *,
    survey: str | None = None,
    quality: Literal["fast", "standard", "fine"] = "standard",
    noise: bool = True,
    seed: int = 7,
    workers: int = 1,
    allow_root: tuple[Path, ...] = (),
) -> int:
    """Render any USD stage into captures: one folder for each RenderProduct, or for each camera where there is none.

    Killed at any moment, the same command goes on where it stopped.

    Args:
        stage: USD file.
        output: Folder to write into.
        survey: Only this product or camera.
        quality: How much shading.
        noise: The sensor's noise is in the images; `--no-noise` leaves it out.
        seed: Seed of the sensor's noise.
        workers: Processes that share the frames of a survey; the bytes do not depend on them.
        allow_root: Folders beside that of the stage from which it may take layers and textures.
    """
    from falsework.commands.verbs import render_file

    settings = {"quality": quality, "sensor": {"noise": noise}, "workers": workers}
    with ConsoleProgress() as progress:
        names = render_file(stage, output, survey, settings, seed, progress, allow_root)
    for name in names:
        _say(f"capture {output / name}")
    return 0


def reconstruct(capture: File, output: Output, *, settings: Path | None = None) -> int:
    """Reconstruct a capture, or a folder of photographs, into a cloud, annotated where the capture carries its truth.

    Killed at any moment, the same command goes on where it stopped.

    Args:
        capture: Capture folder, or a folder of JPEG or PNG files.
        output: Folder to write.
        settings: Scenario whose `[recon]` section applies.
    """
    from falsework.commands.verbs import reconstruct_folder

    with ConsoleProgress() as progress:
        reconstruct_folder(capture, output, settings, progress)
    _say(f"cloud   {output}")
    return 0


def export(
    source: File,
    output: Output,
    *,
    to: Literal["laz", "las", "ply", "hdf5", "pointcept", "s3dis", "colmap", "nerfstudio", "video"],
    photographs: Path | None = None,
) -> int:
    """Write a cloud or a capture for another program.

    Of a capture: its true cameras (colmap, nerfstudio), or a film of the flight (video). Of a cloud: its points (laz,
    las, ply, hdf5, pointcept, s3dis), or the reconstructed cameras with them (colmap, nerfstudio).

    Args:
        source: Cloud or capture folder.
        output: Folder to write.
        to: Format.
        photographs: Capture of a cloud: its photographs are copied beside the cameras (colmap, nerfstudio).
    """
    from falsework.commands.verbs import export_folder

    with ConsoleProgress() as progress:
        files = export_folder(source, to, output, progress, photographs)
    for file in files:
        _say(f"export  {file}")
    return 0


def report(scene: File, output: Output) -> int:
    """Write the report page of one finished scene anew.

    Args:
        scene: Folder such as `OUT/scenes/0000`.
        output: HTML file to write.
    """
    from falsework.commands.verbs import report_scene

    report_scene(scene, output)
    _say(f"report  {output}")
    return 0


def gallery(
    subject: tyro.conf.Positional[Literal["families", "worlds", "looks"]],
    output: Output,
    *,
    count: int = 6,
    seed: int = 1,
    family: tuple[str, ...] = (),
    world: tuple[str, ...] = (),
) -> int:
    """Show random bridges on contact sheets, one sheet for each family, for each world, or for all looks.

    Families: photograph, classes, close-up. Worlds: from eye height, under the deck, beside a pier and the air, look
    and light in turn, with a table of what was measured. Looks: one girder bridge in every look.

    Args:
        subject: What to show.
        output: Folder to write: the sheets, and an index.
        count: Bridges on each sheet.
        seed: Seed of the first bridge; the others follow.
        family: Only these families.
        world: Only these worlds.
    """
    from groundwork.files import fresh_output

    def write(folder: Path) -> None:
        if subject == "worlds":
            from falsework.gallery.worlds import write_worlds

            write_worlds(folder, count, seed, world, progress)
        elif subject == "looks":
            from falsework.gallery.looks import write_looks

            write_looks(folder, seed, 2048, progress)
        else:
            from falsework.gallery.families import write_gallery

            write_gallery(folder, count, seed, family, progress)

    with ConsoleProgress() as progress:
        fresh_output(output, "gallery", write)
    _say(f"gallery {output / 'index.md'}")
    return 0


def scene() -> int:
    """Look into a scene, choose its look, background and light, compare, copy, package: falsework scene --help."""
    return _group("scene", ["--help"])  # with further words, `main` asks for the group's own verbs


def background() -> int:
    """Turn a city model into surroundings for scenes: falsework background --help."""
    return _group("background", ["--help"])


def survey() -> int:
    """Plan flights, and judge them before they are rendered: falsework survey --help."""
    return _group("survey", ["--help"])


def sample() -> int:
    """Make a cloud from a stage without any image: falsework sample --help."""
    return _group("sample", ["--help"])


VERBS = {
    "doctor": doctor,
    "demo": demo,
    "run": run,
    "author": author,
    "render": render,
    "reconstruct": reconstruct,
    "export": export,
    "report": report,
    "verify": verify,
    "gallery": gallery,
    "scene": scene,
    "background": background,
    "survey": survey,
    "sample": sample,
}


GROUPS = ("scene", "background", "survey", "sample")  # verbs that have verbs of their own


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and exit with its code.

    Args:
        arguments: Words after the program's name; those of the process when None.
    """
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(TERMINATED))
    try:
        _check_here()
        words = sys.argv[1:] if arguments is None else arguments
        if words[:1] and words[0] in GROUPS:
            code = _group(words[0], words[1:])
        else:
            code = tyro.extras.subcommand_cli_from_dict(
                VERBS, prog="falsework", description=ABOUT, args=words, config=(tyro.conf.FlagCreatePairsOff,)
            )
    except FalseworkError as error:
        reason = f"{error.reason}: " if isinstance(error, RejectedSceneError) else ""
        sys.stderr.write(f"falsework: {reason}{error}\n")
        code = error.exit_code
    except BrokenPipeError:  # `falsework scene info SCENE | head`: whoever read has gone
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = PIPE_CLOSED
    except KeyboardInterrupt:
        sys.stderr.write("falsework: interrupted; the same command goes on where it stopped\n")
        code = INTERRUPTED
    sys.exit(code)


def _check_here() -> None:
    try:
        Path.cwd()
    except FileNotFoundError:
        raise MissingError(
            "the folder that you are in is no longer there", where=Path(), mend="Change to one that is"
        ) from None


def _group(name: str, words: list[str]) -> int:
    """Hand the words on to a group of verbs, whose module is loaded only then."""
    module = import_module(f"falsework.commands.{name}_verbs")
    verbs = getattr(module, f"{name.upper()}_VERBS")
    return tyro.extras.subcommand_cli_from_dict(verbs, prog=f"falsework {name}", description=module.__doc__, args=words)


def _run(scenario: object, output: Path, scenes: list[int] | None, as_json: bool, **how: Any) -> int:
    from falsework.execution.interrupts import prompt_ending
    from falsework.pipeline import run_scenario
    from falsework.scenario import Scenario

    assert isinstance(scenario, Scenario)
    with prompt_ending(), ConsoleProgress() as progress:
        outcome = run_scenario(scenario, output, progress, scenes, **how)
    if as_json:
        paths = {"reports": [str(p) for p in outcome.reports], "clouds": [str(p) for p in outcome.clouds]}
        counts = {"made": outcome.made, "reused": outcome.reused}
        _answer({**counts, **paths, "rejected": outcome.rejected, "failed": outcome.failed})
        return SOME_SCENES_FAILED if outcome.failed else 0
    for name, reason in outcome.rejected.items():
        _say(f"scene {name} rejected: {reason}")
    for name, reason in outcome.failed.items():
        _say(f"scene {name} failed: {reason}")
    _say(f"{outcome.made} results made, {outcome.reused} were there already" if outcome.made else
         f"nothing to do: all {outcome.reused} results were there already")  # fmt: skip
    for cloud in outcome.clouds:
        _say(f"cloud   {cloud}")
    for page in outcome.reports:
        _say(f"report  {page}")
    return SOME_SCENES_FAILED if outcome.failed else 0


def _say(line: str) -> None:
    sys.stdout.write(line + "\n")


def _answer(value: dict[str, object]) -> None:
    sys.stdout.write(json.dumps({"version": JSON_VERSION, **value}) + "\n")
