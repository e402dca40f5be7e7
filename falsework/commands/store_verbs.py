"""The verbs that look after a run's folder."""

import sys
from pathlib import Path

import tyro

from falsework.commands.console import ConsoleProgress
from groundwork.errors import MissingError


def verify(output: tyro.conf.Positional[Path], *, repair: bool = False) -> int:
    """Find everything in a run's folder that is not as it was written: changed, missing, misplaced, foreign.

    Args:
        output: Output folder of a run.
        repair: Make it whole: what is damaged, what was made from it, and what those need, with the former bytes.
    """
    from falsework.store.store import Store

    if not (output / "store").is_dir():
        raise MissingError("no store in this folder", where=output, mend="Name the output folder of a run")
    if repair:
        from falsework.commands.repair import repair as make_whole

        with ConsoleProgress() as progress:
            wrong = make_whole(output, progress)
    else:
        wrong = Store(output).verify()
    for line in wrong:
        sys.stdout.write(line + "\n")
    said = f"{len(wrong)} things are not as they were written" if wrong else "all stored results are whole"
    sys.stdout.write(said + "\n")
    return int(bool(wrong))
