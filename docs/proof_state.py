"""Tell which rows of docs/proof.json speak of the code as it is.

Usage: python -m docs.proof_state [--all]
"""

import sys
from collections import Counter
from pathlib import Path

from tests.proof_rows import read_rows, state_of

ROOT = Path(__file__).resolve().parents[1]
_MEANING = {
    "stale": "the code that they speak of has changed: make proof measures them anew",
    "unknown": "written before rows said which code they speak of: make proof measures them anew",
    "gone": "their test is not there any more: remove them",
}


_SHOWN = 5


def main(arguments: list[str]) -> int:
    """Print the counts, and the rows that are not fresh.

    Args:
        arguments: Words of the command line: `--all` names every row.

    Returns:
        Exit code: 0; a stale row is a fact, not a fault.
    """
    codes: dict[str, str] = {}
    rows = read_rows(ROOT / "docs" / "proof.json")
    states = {row["name"]: state_of(row, ROOT, codes) for row in rows}
    counts = Counter(states.values())
    sys.stdout.write(f"docs/proof.json: {counts['fresh']} of {len(rows)} rows speak of the code as it is\n")
    for state, meaning in _MEANING.items():
        if names := [name for name, its in states.items() if its == state]:
            shown = names if "--all" in arguments else names[:_SHOWN]
            more = f"    … and {len(names) - len(shown)} more (--all)\n" if len(names) > len(shown) else ""
            lines = "".join(f"    {name}\n" for name in shown)
            sys.stdout.write(f"  {len(names)} {state} ({meaning}):\n{lines}{more}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
