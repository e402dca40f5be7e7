"""What a row of proof speaks of: the modules that its test reaches, and a hash of what they do.

A row of ``docs/proof.json`` carries the hash. When a module that the test reaches does something else, the row is
stale; when a module only moves, or its text is put in better words, the row is not.
"""

from __future__ import annotations

import ast
import hashlib
from functools import cache
from pathlib import Path

from groundwork.canonical import digest, source_digest

ROOT = Path(__file__).resolve().parents[1]
ROOMS = ("groundwork", "usd_schemas", "authoring", "render", "recon", "learn", "falsework")
HASHED = (*ROOMS, "tests", "benchmarks")

# Reached by everything that starts a verb, and of no weight for what a proof measures.
_NOT_FOLLOWED = frozenset({"falsework.cli"})

_ALWAYS = "*"  # stands for a fixture that every test gets, asked for or not


def reached(files: list[Path], root: Path = ROOT) -> list[Path]:
    """List the modules that some files reach by imports, inside functions too, and by names of modules in strings.

    Strings count because children are started as `python -m name`.

    Args:
        files: Python files below `root`.
        root: Folder of the repository.

    Returns:
        The files themselves and every module of the house that they reach, sorted.
    """
    found: set[Path] = set()
    waiting = list(files)
    while waiting:
        file = waiting.pop()
        if file not in found:
            found.add(file)
            waiting += [target for name in _named(file, file.stat().st_mtime_ns) if (target := _file_of(name, root))]
    return sorted(found)


def digest_of(file: Path, root: Path = ROOT) -> str:
    """Hash what a test, or a benchmark, speaks of: the modules that it reaches, and the data files beside them.

    Args:
        file: The module of the test.
        root: Folder of the repository.

    Returns:
        16 hexadecimal digits.
    """
    modules = reached([file, *_conftests(file, root)], root)
    folders = {module.parent for module in modules if module.relative_to(root).parts[0] in ROOMS}
    data = sorted(path for folder in folders for path in _data_files(folder))
    hashes = {path.relative_to(root).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest() for path in data}
    behavior = sorted(_behavior(module, module.stat().st_mtime_ns) for module in modules)
    return digest([behavior, sorted(hashes.values())])[:16]


def _data_files(folder: Path) -> list[Path]:
    """List shaders, tables and templates in a package, and in its folders that are no packages."""
    found = [path for path in folder.iterdir() if path.is_file() and path.suffix not in (".py", ".pyc", ".typed", "")]
    plain = [path for path in folder.iterdir() if path.is_dir() and not (path / "__init__.py").exists()]
    return found + [path for inner in plain if inner.name != "__pycache__" for path in _data_files(inner)]


def _conftests(file: Path, root: Path) -> list[Path]:
    """List the conftest files whose fixtures a test asks for, the common one left out: it only counts and writes."""
    folders = [folder for folder in file.parents if folder != root / "tests" and root in folder.parents]
    found: list[Path] = []
    asked, _ = _fixtures(file)
    for conftest in (folder / "conftest.py" for folder in folders):  # the nearest first: it may ask for those above
        if conftest.is_file():
            asks, gives = _fixtures(conftest)
            if _ALWAYS in gives or asked & gives:
                found.append(conftest)
                asked |= asks
    return found


def _fixtures(file: Path) -> tuple[set[str], set[str]]:
    """Name the fixtures that the functions of a file may ask for, and those that it gives; `_ALWAYS` where unasked."""
    asks: set[str] = set()
    gives: set[str] = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef):
            asks |= {argument.arg for argument in (*node.args.args, *node.args.kwonlyargs)}
            for decorator in node.decorator_list:
                words = ast.unparse(decorator)
                if words.startswith("pytest.fixture"):
                    gives |= {node.name, *([_ALWAYS] if "autouse" in words else [])}
                if "usefixtures" in words:
                    # Names of fixtures are strings.
                    asks |= {part.value for part in ast.walk(decorator) if isinstance(part, ast.Constant)}  # pyright: ignore
    return asks, gives


@cache
def _behavior(file: Path, changed: int) -> str:
    """Hash what one module does; `changed` is the time of its last change."""
    return source_digest([file])


@cache
def _named(file: Path, changed: int) -> frozenset[str]:
    """Name what a module imports, and the modules that its strings name; `changed` is the time of its last change."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and "." in node.value[:80]:
            names |= {node.value} if node.value.replace(".", "_").isidentifier() else set()
    return frozenset(name for name in names if name.split(".")[0] in HASHED)


def _file_of(name: str, root: Path) -> Path | None:
    """Find the module that a dotted name lies in: itself, or the module that it is a name of."""
    parts = name.split(".")
    for count in range(len(parts), 0, -1):
        module = root.joinpath(*parts[:count])
        if ".".join(parts[:count]) in _NOT_FOLLOWED:
            return None
        if (file := module.with_suffix(".py")).is_file():
            return file
    return None
