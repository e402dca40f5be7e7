"""What may stand in the repository, and how the rooms write their files."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from tests.house.house import ROOMS, ROOT, Rule, assert_clean, tracked_files
from tests.house.trees import parsed

# The caller makes the folder appear whole, with its files; or another reason why a reader may see a part of this file.
EXCUSE = re.compile(r"# (?:inside an atomic folder|not atomic: \w)")
WRITER = ROOT / "groundwork" / "files.py"
WRITING_METHODS = {
    "write_text",
    "write_bytes",
    "imwrite",
    "imwritemulti",
    "Save",
    "Export",
    "tofile",
    "savez",
    "savez_compressed",
}
WRITING_CALLS = {"np.save", "numpy.save", "np.savetxt", "shutil.copyfile", "shutil.copy", "shutil.copytree"}
WRITING = re.compile(rf"\b(?:open|{'|'.join(name.rpartition('.')[2] for name in WRITING_METHODS | WRITING_CALLS)})\b")
WRITING_ENDS = {name.rpartition(".")[2] for name in WRITING_CALLS}  # what a call is sorted out by

OPEN_WORK = re.compile(r"\b(?:TO" r"DO|FIX" r"ME|XX" r"X)\b")
MACHINE_PATH = re.compile(r"(?<![\w./-])/(?:work|home|root|Users|opt/(?:wheels|pypi))/")
HOST = re.compile(r"https?://([\w.-]+)|(?<![\w.])((?:[a-z0-9-]+\.)+(?:org|com))(?![\w.(])")
HOSTS = {"www.apache.org", "openusd.org", "doi.org", "www.w3.org", "github.com"}  # a license, standards, papers, peers
TEXT = {".py", ".pyi", ".md", ".toml", ".txt", ".usda", ".glsl", ".json", ".html", ".j2", ".sh", ".yaml", ""}


def raw_writes(source: str) -> list[str]:
    """Find writes that go round groundwork.files, unless the line says that the folder is atomic."""
    if not WRITING.search(source):
        return []
    lines = source.splitlines()
    found = []
    for node in ast.walk(parsed(source)):
        if isinstance(node, ast.Call) and _writes(node):
            written = lines[max(node.lineno - 2, 0) : node.end_lineno]
            if not any(EXCUSE.search(line) for line in written):
                found.append(f"{node.lineno}: {ast.unparse(node.func)} writes a file; use groundwork.files")
    return found


def _writes(call: ast.Call) -> bool:
    """Tell whether a call writes a file by itself."""
    last = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
    if last == "open":
        modes = [argument.value for argument in ast.walk(call) if isinstance(argument, ast.Constant)]
        return any(isinstance(mode, str) and re.fullmatch(r"[rbt]*[wax+][bt+]*", mode) for mode in modes)
    if isinstance(call.func, ast.Attribute) and last in WRITING_METHODS:
        return not ast.unparse(call.func).startswith("files.")
    return last in WRITING_ENDS and ast.unparse(call.func) in WRITING_CALLS


def open_work(source: str) -> list[str]:
    """Find notes about work that is left."""
    return [f"{i}: {line.strip()}" for i, line in enumerate(source.splitlines(), 1) if OPEN_WORK.search(line)]


def machine_traces(source: str) -> list[str]:
    """Find absolute paths of one machine, and hosts beyond the few that the project cites."""
    found = []
    for number, line in enumerate(source.splitlines(), 1):
        found += [f"{number}: path {match.group()}" for match in MACHINE_PATH.finditer(line)]
        found += [f"{number}: host {a or b}" for a, b in HOST.findall(line) if (a or b) not in HOSTS]
    return found


def text_files() -> list[Path]:
    """List the text files of the repository but these rules, which hold bad samples."""
    here = Path(__file__).parent
    return [path for path in tracked_files() if path.suffix in TEXT and path.parent != here]


@pytest.mark.parametrize("rule", [open_work, machine_traces])
def test_the_repository_holds_no_traces(rule: Rule) -> None:
    """No file names work that is left, a path of one machine, or an unknown host."""
    assert_clean(rule, text_files())


@pytest.mark.parametrize("room", ROOMS)
def test_rooms_are_typed_and_begin_empty(room: str) -> None:
    """Each room carries py.typed; its __init__.py is empty, the door's aside."""
    assert (ROOT / room / "py.typed").is_file()
    assert room == "falsework" or (ROOT / room / "__init__.py").read_bytes() == b""


@pytest.mark.parametrize(
    ("source", "count"),
    [
        ("open(path, 'w')", 1),
        ("path.open('wb')", 1),
        ("path.open(mode='a')", 1),
        ("open(path)", 0),
        ("path.open('rb')", 0),
        ("path.write_text('x')", 1),
        ("files.write_text(path, 'x')", 0),
        ("write_text(path, 'x')", 0),
        ("np.save(path, points)", 1),
        ("np.save(path, points)  # inside an atomic folder", 0),
        ("log.open('a')  # not atomic: a log grows line by line", 0),
        ("log.open('a')  # not atomic:", 1),
        ("# inside an atomic folder\nnp.save(path, points)", 0),
        ("np.save(\n    path,\n    points,\n)  # inside an atomic folder", 0),
        ("cv2.imwrite(str(path), image)", 1),
        ("stage.GetRootLayer().Save()", 1),
        ("layer.Export(str(path))", 1),
    ],
)
def test_a_raw_write_is_found(source: str, count: int) -> None:
    """Every way to write a file is found, unless the folder is said to be atomic."""
    assert len(raw_writes(source)) == count


@pytest.mark.parametrize(
    ("source", "count"),
    [("# TO" + "DO later", 1), ("x = 1  # FIX" + "ME", 1), ("the method to do it", 0), ("XX" + "XL", 0)],
)
def test_open_work_is_found(source: str, count: int) -> None:
    """A note about work that is left is found."""
    assert len(open_work(source)) == count


@pytest.mark.parametrize(
    ("source", "count"),
    [
        ("path = '/work/main/x'", 1),
        ("see /home/someone/x", 1),
        ("/World/Bridge and ./work/key/ and docs/work/", 0),
        ("fetch https://example.com/x", 1),
        ("see https://doi.org/10.1000/1", 0),
        ("mirror.example.org", 1),
        ("net = self.net(x); scipy.io.loadmat(y)", 0),
    ],
)
def test_a_machine_trace_is_found(source: str, count: int) -> None:
    """Absolute paths and unknown hosts are found; prim paths and relative paths are not."""
    assert len(machine_traces(source)) == count
