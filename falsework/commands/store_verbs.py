"""The verbs that maintain a run's folder."""

import sys
from pathlib import Path

import tyro

from falsework.commands.answers import AsJson, answer
from falsework.commands.console import ConsoleProgress
from falsework.commands.given_files import need_folder
from groundwork.errors import InputError, MissingError

OF_A_RUN = "the output folder of a run"


def verify(output: tyro.conf.Positional[Path], *, repair: bool = False, as_json: AsJson = False) -> int:
    """Verify a run's folder: find files that are changed, missing, misplaced or foreign, and scenes without results.

    Args:
        output: Output folder of a run.
        repair: Remake damaged results, results made from them, and their inputs, with the same bytes.
        as_json: Print one JSON object instead of lines.
    """
    from falsework.store.store import Store

    need_folder(output, OF_A_RUN)
    if not (output / "store").is_dir():
        raise MissingError("this folder has no store", where=output, hint=f"Name {OF_A_RUN}")
    if repair:
        from falsework.commands.repair import repair as make_whole

        with ConsoleProgress() as progress:
            wrong = make_whole(output, progress)
    else:
        wrong = Store(output).verify()
    from falsework.commands.unfinished import unfinished_scenes

    left: list[str] = []
    with ConsoleProgress() as progress:
        try:
            left = unfinished_scenes(output, progress)
        except InputError as error:
            wrong.append(str(error).removeprefix(f"{output}/"))
    if as_json:
        answer({"whole": not wrong and not left, "wrong": wrong, "unfinished": left})
        return int(bool(wrong or (left and not repair)))
    for line in (*wrong, *left):
        sys.stdout.write(line + "\n")
    said = f"{len(wrong)} fault{'s'[: len(wrong) != 1]}" if wrong else "all stored results are complete and unchanged"
    lacking = f"; {len(left)} scene{'s lack' if len(left) != 1 else ' lacks'} results" if left else ""
    sys.stdout.write(f"{said}{lacking}\n")
    return int(bool(wrong or (left and not repair)))


def clean(
    output: tyro.conf.Positional[Path],
    *,
    unused: bool = False,
    dry_run: bool = False,
    as_json: AsJson = False,
) -> int:
    """Remove leftovers of killed runs in a run's folder, and show how much space that frees.

    Unfinished results are removed too, so that the next run starts them again. Files of running processes and files
    that Falsework did not write are kept.

    Args:
        output: Output folder of a run.
        unused: Also remove results that no scene of its scenario.toml uses, or that an earlier version made in
            another way.
        dry_run: Only show what would be removed.
        as_json: Print one JSON object instead of lines.
    """
    from groundwork.marks import MARK, read_listing
    from groundwork.output.place import RUN

    need_folder(output, OF_A_RUN)
    if not (output / MARK).is_file() or read_listing(output / MARK).kind != RUN:
        raise MissingError(
            "not the output folder of a run", where=output, hint="Name the folder that was given to falsework run -o"
        )
    from falsework.commands.clean import clean as free

    with ConsoleProgress() as progress:
        done = free(output, progress, unused=unused, dry_run=dry_run)
    paths = [(one.about, str(one.paths[0].relative_to(output))) for one in done.removed]
    if as_json:
        removed = [{"what": about, "path": path} for about, path in paths]
        return answer({"dry_run": dry_run, "removed": removed, "left": done.left, "freed_bytes": done.freed})
    for about, path in paths:
        sys.stdout.write(f"{path}: {about}\n")
    for line in done.left:
        sys.stdout.write(f"kept: {line}\n")
    would = "would be " if dry_run else ""
    sys.stdout.write(f"{len(paths)} items {would}removed, {done.freed / 1e6:.1f} MB {would}freed\n")
    return 0
