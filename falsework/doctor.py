"""Checks of this machine: what works, found by trying it, and a hint for what does not."""

import os
import shutil
import sys
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import PackageNotFoundError, packages_distributions, version
from importlib.util import find_spec
from pathlib import Path
from typing import Literal

from groundwork.child import run_child
from groundwork.errors import FalseworkError

Verdict = Literal["OK", "WARN", "FAIL"]

ROOMS = ("groundwork", "usd_schemas", "authoring", "render", "recon", "learn", "falsework")
CORE = {
    "usd-core": "pxr.Usd",
    "numpy": "numpy",
    "scipy": "scipy",
    "numba": "numba",
    "trimesh": "trimesh",
    "moderngl": "moderngl",
    "glcontext": "glcontext",
    "opencv-python-headless": "cv2",
    "pycolmap": "pycolmap",
    "laspy": "laspy",
    "lazrs": "lazrs",
    "OpenEXR": "OpenEXR",
    "materialx": "MaterialX",
    "deflate": "deflate",
    "pydantic": "pydantic",
    "tyro": "tyro",
    "rich": "rich",
    "jinja2": "jinja2",
    "plotly": "plotly",
    "distributed": "distributed",
    "tomli-w": "tomli_w",
}
LEARN = {"torch": "torch", "lightning": "lightning", "safetensors": "safetensors", "scikit-learn": "sklearn"}
VIEW = {"viser": "viser"}
MEMORY_NEEDED = 4.0  # [GB] the demo's limit
DISK_NEEDED = 2.0  # [GB]
FRAME_TIME_LIMIT = 120.0  # [s]
FRAME_ROOMS = ("groundwork", "usd_schemas", "render")  # our packages that the check of the renderer imports


@dataclass(frozen=True)
class Check:
    """Result of one check.

    Attributes:
        name: Name of the check.
        verdict: OK, WARN (works with less) or FAIL (does not work).
        found: What was found.
        hint: What to do; empty if nothing.
    """

    name: str
    verdict: Verdict
    found: str
    hint: str = ""


def examine() -> list[Check]:
    """Check everything that the chain needs.

    Returns:
        One row per check, in a fixed order.
    """
    taken = _taken_names()
    checks = [
        _python(),
        *_packages(),
        _open3d(),
        learn_packages(),
        view_packages(),
        *_graphics(sorted(taken.keys() & set(FRAME_ROOMS))),
        _gpu(),
        _threads(),
        _memory(),
        _disk(),
        *package_names(taken),
    ]
    return [check for check in checks if check is not None]


def _python() -> Check:
    return Check("python", "OK", sys.version.split()[0])  # an older Python fails earlier


def _packages() -> list[Check]:
    checks = []
    for name, module in CORE.items():
        try:
            import_module(module)
            checks.append(Check(name, "OK", version(name)))
        except (ImportError, PackageNotFoundError) as error:
            checks.append(Check(name, "FAIL", str(error), f"pip install {name}"))
    return checks


def _open3d() -> Check:
    from usd_schemas.raycast import load_open3d

    try:
        return Check("open3d", "OK", str(load_open3d().__version__))
    except (ImportError, OSError, FalseworkError) as error:
        return Check(
            "open3d", "FAIL", str(error), "pip install open3d-cpu libusb-package, or apt-get install libusb-1.0-0"
        )


def learn_packages() -> Check:
    """Check the packages of the extra `learn`, without importing them.

    Returns:
        One row for all of it.
    """
    return _extra("learn", LEARN, "train, evaluate, compare and predict need")


def view_packages() -> Check:
    """Check the packages of the extra `view`, without importing them.

    Returns:
        One row for all of it.
    """
    return _extra("view", VIEW, "view without --save needs")


def _extra(extra: str, packages: dict[str, str], users: str) -> Check:
    found, missing = [], []
    for name, module in packages.items():
        try:
            there = find_spec(module) is not None
            (found if there else missing).append(f"{name} {version(name)}" if there else name)
        except PackageNotFoundError:
            missing.append(name)
    if missing:
        row = f"no {', '.join(missing)}: {users} {'it' if len(packages) == 1 else 'them'}"
        return Check(extra, "WARN", row, f"pip install 'falsework[{extra}]'")
    return Check(extra, "OK", ", ".join(found))


def _graphics(taken: list[str]) -> list[Check]:
    """Render a frame in a child process, unless foreign code shadows ours: its error would say nothing of drivers."""
    if taken:
        row = f"not tried: the Python package {', '.join(taken)} is not that of Falsework"
        return [Check("gl", "WARN", row, "First correct the failures under package names")]
    try:
        answer = run_child(
            "render.views.probe", {"frame": True}, time_limit=FRAME_TIME_LIMIT, memory_limit=MEMORY_NEEDED
        )
    except FalseworkError as error:
        return [
            Check("gl", "FAIL", str(error), "apt-get install --no-install-recommends libegl1 libgl1 libgl1-mesa-dri")
        ]
    wrong = int(answer["wrong_pixels"])
    verdict: Verdict = "FAIL" if wrong else "OK"
    hint = "Update or replace the graphics driver" if wrong else ""
    return [
        Check("gl", "OK", f"{answer['renderer']}, {answer['version']}, by {answer['backend']}"),
        Check("frame", verdict, f"64x64 frame, {wrong} wrong pixels", hint),
    ]


def _gpu() -> Check:
    devices = sorted(Path("/dev").glob("nvidia[0-9]*"))
    if devices:
        return Check("gpu", "OK", f"{len(devices)} NVIDIA device(s)")
    return Check("gpu", "WARN", "none; everything runs on the processor")


def _threads() -> Check:
    count = len(os.sched_getaffinity(0))
    return Check("threads", "OK" if count > 1 else "WARN", f"{count}")


def _memory() -> Check:
    free = _available_memory()
    short = free < MEMORY_NEEDED
    hint = "Close other programs, or use fewer images" if short else ""
    return Check("memory", "WARN" if short else "OK", f"{free:.1f} GB available", hint)


def _disk() -> Check:
    free = shutil.disk_usage(Path.cwd()).free / 1e9
    short = free < DISK_NEEDED
    hint = "Free some space, or choose another folder with -o" if short else ""
    return Check("disk", "WARN" if short else "OK", f"{free:.1f} GB free in this folder", hint)


def package_names(taken: dict[str, list[Check]] | None = None) -> list[Check]:
    """Check that `import` finds our packages, and not foreign ones of the same names.

    Args:
        taken: Checks of each name that is taken by another package; None: find them.

    Returns:
        One or two rows for each such name, or one row if there is none.
    """
    rows = [row for found in (_taken_names() if taken is None else taken).values() for row in found]
    return rows or [Check("package names", "OK", "no other package or folder hides those of Falsework")]


def _taken_names() -> dict[str, list[Check]]:
    """Find the names of our packages that another package takes, with a hint."""
    owners, home = packages_distributions(), Path(__file__).resolve().parents[1]
    rows: dict[str, list[Check]] = {room: [] for room in ROOMS}
    for room, found in rows.items():
        if names := sorted({owner for owner in owners.get(room, []) if owner.lower() != "falsework"}):
            hint = f"pip uninstall {' '.join(names)}"
            found.append(Check("package names", "FAIL", f"{room} is also in the package {', '.join(names)}", hint))
        place = _file_of(room)
        if Path(place).resolve() != home / room / "__init__.py":
            hint = "Start Python in another folder, or rename this one"
            found.append(Check("package names", "FAIL", f"{room} is imported from {place}", hint))
    return {room: found for room, found in rows.items() if found}


def _file_of(room: str) -> str:
    """Find the file that `import` would load for a package, without running it: foreign code may do anything."""
    if room in sys.modules:
        return str(sys.modules[room].__file__)
    spec = find_spec(room)
    return str(spec.origin if spec else None)


def _available_memory() -> float:
    for line in Path("/proc/meminfo").read_text(encoding="ascii").splitlines():
        if line.startswith("MemAvailable:"):
            return int(line.split()[1]) * 1024 / 1e9
    return 0.0
