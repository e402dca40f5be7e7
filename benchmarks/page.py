"""Pages of benchmarks: their text, and the code that they describe."""

import re
import subprocess
from pathlib import Path

from groundwork.files import write_text
from tests.provenance import ROOT, digest_of

_STAMP = "Written by `{module}` and what it reaches: code `{code}`, commit `{commit}`.\n"
_READ = re.compile(_STAMP.format(module="(?P<module>[^`]+)", code="(?P<code>[0-9a-f]{16})", commit="[^`]+") + r"\Z")


def write_page(page: Path, text: str, module: str, root: Path = ROOT) -> None:
    """Write a page that ends with the hash of the code that it describes, and the commit.

    Args:
        page: The file.
        text: Text of the page.
        module: File of the benchmark, its `__file__`.
        root: Folder of the repository.
    """
    file = Path(module).resolve()
    stamp = _STAMP.format(module=file.relative_to(root).as_posix(), code=digest_of(file, root), commit=_commit(root))
    write_text(page, f"{text.rstrip()}\n\n{stamp}")


def words_of(page: Path) -> str:
    """Read the text of a page, without the lines about its code: to write it again with other rows.

    Args:
        page: The file.
    """
    return _READ.sub("", page.read_text(encoding="utf-8"))


def state_of_page(page: Path, root: Path = ROOT) -> str:
    """Compute the state of a page: fresh, stale or unknown.

    Args:
        page: The file.
        root: Folder of the repository.

    Returns:
        As for rows of proof: "fresh", "stale", "gone" where its benchmark is not there any more, or "unknown" where it
        was written before pages said their code.
    """
    found = _READ.search(page.read_text(encoding="utf-8"))
    if not found:
        return "unknown"
    module = root / found["module"]
    if not module.is_file():
        return "gone"
    return "fresh" if digest_of(module, root) == found["code"] else "stale"


def _commit(root: Path) -> str:
    """Name the commit, and the files that differ from it."""
    command = ["git", "describe", "--always", "--dirty", "--abbrev=12", "--exclude=*"]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False)
    return done.stdout.strip() if not done.returncode else "none"
