"""List which rows of docs/proof.json, and which pages of benchmarks, describe the current code.

Usage: python -m docs.proof_state [--all]
"""

import sys
from collections import Counter
from pathlib import Path

from benchmarks.page import state_of_page
from tests.proof_rows import read_rows, state_of

ROOT = Path(__file__).resolve().parents[1]
_MEANING = {
    "stale": "the code that they speak of has changed",
    "unknown": "written before they said which code they speak of",
    "gone": "what measured them is not there any more: remove them",
}


_SHOWN = 5
_FOLDERS = ("benchmarks", "experiments")  # of docs/: their pages are written by commands


def page_states(root: Path = ROOT) -> dict[str, str]:
    """Compute the state of every page that a benchmark writes.

    Args:
        root: Folder of the repository.

    Returns:
        Path of each page below docs/, such as `benchmarks/gps.md`, to its state, as `state_of_page` gives it.
    """
    docs = root / "docs"
    pages = (page for folder in _FOLDERS for page in sorted((docs / folder).glob("*.md")))
    return {page.relative_to(docs).as_posix(): state_of_page(page, root) for page in pages}


def main(arguments: list[str]) -> int:
    """Print the counts, and the rows and pages that are not fresh.

    Args:
        arguments: Words of the command line: `--all` names every one.

    Returns:
        Exit code: 0; a stale row is a fact, not a fault.
    """
    codes: dict[str, str] = {}
    rows = {row["name"]: state_of(row, ROOT, codes) for row in read_rows(ROOT / "docs" / "proof.json")}
    for what, renewed, states in (
        ("docs/proof.json: rows", "make proof", rows),
        ("docs: pages of benchmarks", "the command in its first lines", page_states()),
    ):
        counts = Counter(states.values())
        sys.stdout.write(f"{what} that speak of the code as it is: {counts['fresh']} of {len(states)}\n")
        for state, meaning in _MEANING.items():
            if names := [name for name, its in states.items() if its == state]:
                shown = names if "--all" in arguments else names[:_SHOWN]
                more = f"    … and {len(names) - len(shown)} more (--all)\n" if len(names) > len(shown) else ""
                lines = "".join(f"    {name}\n" for name in shown)
                sys.stdout.write(f"  {len(names)} {state} ({meaning}; {renewed} measures anew):\n{lines}{more}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
