"""The rows of docs/proof.json: read, merge, and tell which speak of the code as it is."""

from __future__ import annotations

import json
import os
import tempfile
from pathlib import Path
from typing import Any

from tests.provenance import digest_of

FORMAT_VERSION = 2

Row = dict[str, Any]


def read_rows(path: Path) -> list[Row]:
    """Read the rows of a proof file; none where there is no file.

    Args:
        path: The JSON file.
    """
    return json.loads(path.read_text())["rows"] if path.exists() else []


def write_proof(path: Path, rows: list[Row]) -> None:
    """Merge rows into a proof file by name, sorted, with one rename.

    Args:
        path: The JSON file; it need not exist.
        rows: New rows; each replaces the row of the same name.
    """
    known = {row["name"]: row for row in [*read_rows(path), *rows]}
    merged = {"format_version": FORMAT_VERSION, "rows": [known[name] for name in sorted(known)]}
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, partial = tempfile.mkstemp(dir=path.parent, prefix=path.name, suffix=".partial")
    with os.fdopen(handle, "w") as stream:
        json.dump(merged, stream, indent=1, sort_keys=True)
        stream.write("\n")
    Path(partial).chmod(0o644)
    Path(partial).replace(path)


def state_of(row: Row, root: Path, codes: dict[str, str]) -> str:
    """Tell what a row is worth today.

    Args:
        row: A row of the proof file.
        root: Folder of the repository.
        codes: Hashes found so far, by the file of the test; filled here.

    Returns:
        "fresh"; "stale", where the code does something else now; "gone", where its test is not there any more;
        "unknown", where it was written before rows said which code they speak of.
    """
    if "test" not in row:
        return "unknown"
    file, _, name = row["test"].partition("::")
    name = name.split("[")[0].split("::")[-1]
    if not (root / file).is_file() or f"def {name}(" not in (root / file).read_text(encoding="utf-8"):
        return "gone"
    if file not in codes:
        codes[file] = digest_of(root / file, root)
    return "fresh" if codes[file] == row["code"] else "stale"


def fresh_tests(rows: list[Row], root: Path) -> set[str]:
    """Name the tests all of whose rows speak of the code as it is.

    Args:
        rows: Rows of the proof file.
        root: Folder of the repository.
    """
    codes: dict[str, str] = {}
    states = [(row.get("test", ""), state_of(row, root, codes) == "fresh") for row in rows]
    return {test for test, _ in states} - {test for test, fresh in states if not fresh}
