"""Imports point one way through the house, and the door opens without the heavy packages."""

from __future__ import annotations

import ast
import json
import os
import subprocess
import sys
from functools import cache
from graphlib import CycleError, TopologicalSorter

import pytest

from tests.house.house import ROOMS, ROOT
from tests.house.trees import statements

# What each room may import of the house; a dotted name opens one module of a room and no other.
ALLOWED: dict[str, set[str]] = {
    "groundwork": {"groundwork"},
    "usd_schemas": {"groundwork", "usd_schemas"},
    "authoring": {"groundwork", "usd_schemas", "authoring"},
    "render": {"groundwork", "usd_schemas", "render"},
    "recon": {"groundwork", "usd_schemas", "render.capture", "recon"},
    "learn": {"groundwork", "usd_schemas", "recon.cloud", "recon.formats.scan", "learn"},
    "falsework": set(ROOMS),
}
# The two lowest rooms are read by everything, so what they pull in is a closed list.
OUTSIDE: dict[str, set[str]] = {
    "groundwork": {"pydantic", "pydantic_core"},
    "usd_schemas": {"pxr", "numpy", "pydantic", "open3d", "libusb_package", "MaterialX"},
}
HEAVY = {"torch", "open3d", "pycolmap", "moderngl", "lightning", "dask", "distributed", "cv2", "plotly", "sklearn"}


@cache
def imported_names(source: str) -> tuple[tuple[int, str], ...]:
    """List what a module imports, inside functions too: (line, dotted name); a relative import is a lone dot."""
    names: list[tuple[int, str]] = []
    for node in statements(source):
        if isinstance(node, ast.Import):
            names += [(node.lineno, alias.name) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names += [(node.lineno, "." if node.level else f"{node.module}.{alias.name}") for alias in node.names]
    return tuple(names)


def wrong_imports(room: str, source: str) -> list[str]:
    """Name the imports that the room may not make."""
    found = []
    for line, name in imported_names(source):
        first = name.split(".")[0]
        if name == ".":
            found.append(f"{line}: relative import")
        elif first in ROOMS:
            if not any(f"{name}.".startswith(f"{allowed}.") for allowed in ALLOWED[room]):
                found.append(f"{line}: {room} may not import {name}")
        elif room in OUTSIDE and first not in OUTSIDE[room] | set(sys.stdlib_module_names):
            found.append(f"{line}: {room} may not import {first}")
    return found


@pytest.mark.parametrize(
    ("room", "source"),
    [
        ("groundwork", "import usd_schemas.tokens"),
        ("groundwork", "import numpy as np"),
        ("usd_schemas", "from authoring import scene"),
        ("authoring", "def f():\n    from render.capture import read_capture"),
        ("render", "import authoring"),
        ("recon", "from render import passes"),
        ("recon", "from render.gpu.context import open_context"),
        ("recon", "import render"),
        ("learn", "from recon.sparse import mapper"),
        ("learn", "import falsework.cli"),
        ("render", "from .capture import read_capture"),
    ],
)
def test_a_wrong_import_is_found(room: str, source: str) -> None:
    """Each arrow drawn the wrong way is one finding."""
    assert len(wrong_imports(room, source)) == 1


@pytest.mark.parametrize(
    ("room", "source"),
    [
        ("recon", "from render.capture import read_capture"),
        ("recon", "from render import capture"),
        ("recon", "import render.capture"),
        ("learn", "from recon.cloud import read_cloud"),
        ("render", "from usd_schemas.flat_scene import FlatScene"),
        ("falsework", "import learn.training, render.frames"),
        ("groundwork", "import tomllib, pydantic"),
    ],
)
def test_a_right_import_passes(room: str, source: str) -> None:
    """The arrows of the design are no findings."""
    assert wrong_imports(room, source) == []


def a_cycle(sources: dict[str, str]) -> list[str]:
    """Name the modules of one circle of imports, inside functions and for types too; none where there is none.

    Args:
        sources: Dotted name of each module to its text.
    """
    graph: dict[str, set[str]] = {}
    for module, source in sources.items():
        ends = {end for _, name in imported_names(source) for end in (name, name.rpartition(".")[0])}
        graph[module] = ends & sources.keys() - {module}
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


def test_a_circle_is_found() -> None:
    """Over three modules, through a function and through a name that is imported out of a module."""
    sources = {"a.x": "import a.y", "a.y": "def f():\n    from a import z", "a.z": "from a.x import g", "a": ""}
    assert set(a_cycle(sources)) == {"a.x", "a.y", "a.z"}
    assert a_cycle(sources | {"a.z": "from b.x import g"}) == []


def loaded_by(statement: str) -> set[str]:
    """Run a statement in a fresh interpreter and name the top-level modules that it loaded."""
    program = f"import json, sys; {statement}; print(json.dumps(sorted({{m.split('.')[0] for m in sys.modules}})))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    return set(json.loads(done.stdout))


@pytest.mark.parametrize("module", ["falsework", "falsework.cli"])
def test_the_door_opens_without_heavy_packages(module: str) -> None:
    """A fresh import of the public API, and of the command line, loads none of the heavy packages."""
    assert loaded_by(f"import {module}") & HEAVY == set()


def test_a_heavy_package_would_be_seen() -> None:
    """The probe reports what is loaded."""
    assert "moderngl" in loaded_by("import moderngl") & HEAVY


def forgetful_kernels(source: str) -> list[str]:
    """Name the functions that numba compiles anew in every process."""
    return [
        f"{node.lineno}: {node.name} is compiled in every process: njit(cache=True)"
        for node in (statements(source) if "njit" in source else ())
        if isinstance(node, ast.FunctionDef)
        for decorator in node.decorator_list
        if "njit" in (words := ast.unparse(decorator)) and "cache=True" not in words
    ]


def test_a_forgetful_kernel_is_found() -> None:
    """Rooms work in many short-lived processes: what numba compiles takes them seconds, and is kept beside the code."""
    assert forgetful_kernels("@njit(nogil=True)\ndef f(): pass") == [
        "2: f is compiled in every process: njit(cache=True)"
    ]


def test_what_python_compiles_is_kept_by_make() -> None:
    """Tests start hundreds of processes: none compiles the house anew because the shell forbids byte code."""
    asked = "said: ; @printenv PYTHONDONTWRITEBYTECODE"
    command = ["make", "-s", "--no-print-directory", "--eval", asked, "said"]
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
    said = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=True).stdout
    assert said.strip() == ""
