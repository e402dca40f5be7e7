"""Renew the rows of docs/proof.json that are stale by names alone.

Usage: python -m tests.renamed NEW=OLD…   (a name, or the words of a message)

Undoes the renaming in a copy of the repository. Where the copy's code hashes to what a row speaks of, the row speaks of
the code as it is, but for its names, and gets today's hash. A row that any other change made stale stays stale.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from tests.proof_rows import read_rows, state_of, write_proof
from tests.provenance import HASHED, ROOT


def undo(names: dict[str, str], root: Path, copy: Path) -> None:
    """Copy the code of a repository with other names in it, those of its files included.

    Args:
        names: Name of old of each new one; whole words.
        root: Folder of the repository.
        copy: Folder to fill.
    """
    words = re.compile(r"(?<!\w)(" + "|".join(map(re.escape, names)) + r")(?!\w)")
    listed = subprocess.run(["git", "ls-files", *HASHED], cwd=root, check=True, capture_output=True, text=True).stdout
    for file in map(Path, listed.splitlines()):
        target = copy.joinpath(*(words.sub(lambda match: names[match[0]], part) for part in file.parts))
        target.parent.mkdir(parents=True, exist_ok=True)
        if (root / file).is_dir():  # a link
            shutil.copytree(root / file, target)
        elif b"\0" in (data := (root / file).read_bytes()):
            target.write_bytes(data)
        else:
            target.write_bytes(words.sub(lambda match: names[match[0]], data.decode()).encode())


def renew(proof: Path, names: dict[str, str], root: Path = ROOT) -> tuple[int, int]:
    """Give the rows that are stale by names alone the hash of the code as it is.

    Args:
        proof: The proof file.
        names: Name of old of each new one; whole words.
        root: Folder of the repository.

    Returns:
        How many rows were renewed, and how many were stale.
    """
    now: dict[str, str] = {}
    rows = [row for row in read_rows(proof) if state_of(row, root, now) == "stale"]
    with tempfile.TemporaryDirectory() as folder:
        undo(names, root, Path(folder))
        before: dict[str, str] = {}
        same = [row for row in rows if state_of(row, Path(folder), before) == "fresh"]
    for row in same:
        row["code"] = now[row["test"].partition("::")[0]]
    write_proof(proof, same)
    return len(same), len(rows)


if __name__ == "__main__":
    given = dict(pair.split("=") for pair in sys.argv[1:])
    renewed, stale = renew(ROOT / "docs" / "proof.json", given)
    sys.stdout.write(f"{renewed} of {stale} stale rows renewed\n")
