"""Check the few system libraries that the wheels need, install what is missing, or name it in one line.

A library counts as present when it can be loaded; the package database is not queried. What is missing comes through
apt where this user may (root, or sudo without a password). Where not, OpenGL comes from the OSMesa wheel.

Pages are tested in a Chromium; where none can be had, those tests are skipped, and that is said here, too.

Usage: .venv/bin/python bootstrap/system_libraries.py core|dcc|browser
"""

import ctypes
import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]

# Shared object -> Debian and Ubuntu package: what open3d and glcontext load. Every other wheel brings its own.
CORE = {
    "libEGL.so.1": "libegl1",
    "libGL.so.1": "libgl1",
    "libX11.so.6": "libx11-6",
    "libidn2.so.0": "libidn2-0",
    "libudev.so.1": "libudev1",
}
# What Blender's bpy loads beyond that, though it never opens a window here.
DCC = {
    "libICE.so.6": "libice6",
    "libSM.so.6": "libsm6",
    "libXfixes.so.3": "libxfixes3",
    "libXi.so.6": "libxi6",
    "libXrender.so.1": "libxrender1",
    "libXxf86vm.so.1": "libxxf86vm1",
    "libxkbcommon.so.0": "libxkbcommon0",
}
# An EGL without a driver loads and draws nothing: only a context tells.
DRIVER = "an OpenGL 4.5 driver"
DRIVER_PACKAGE = "libgl1-mesa-dri"
CONTEXT = (
    "import glcontext; "
    "glcontext.get_backend_by_name('egl')(glversion=450, mode='standalone', libgl='libGL.so.1', libegl='libEGL.so.1')"
)
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
BROWSER_PACKAGE = "chromium"
APT = ["apt-get", "-qq", "-y", "-o", "DPkg::Lock::Timeout=300", "--no-install-recommends"]


def main(kind: str) -> int:
    """Bring the libraries of one kind of set-up.

    Args:
        kind: "core", "dcc" for the Blender tests, or "browser" for those of pages, without which one can do.

    Returns:
        0 when everything loads, else 2 after one line on stderr.
    """
    if kind == "browser":
        bring_browser()
        return 0
    wanted = CORE if kind == "core" else CORE | DCC
    missing = find_missing(wanted)
    if missing and (rights := apt_rights()) is not None:
        install(sorted(set(missing.values())), rights)
        missing = find_missing(wanted)
    if DRIVER in missing and install_osmesa():
        del missing[DRIVER]
    if missing:
        sys.stderr.write(
            f"falsework set-up: missing {', '.join(sorted(missing))}: "
            f"apt-get install {' '.join(sorted(set(missing.values())))}\n"
        )
    return 2 if missing else 0


def bring_browser() -> None:
    """Install a Chromium where none starts; say in a line where that cannot be done."""
    if not has_browser() and (rights := apt_rights()) is not None:
        install([BROWSER_PACKAGE], rights)
    if not has_browser():
        sys.stderr.write(
            f"falsework set-up: no Chromium, so the tests of pages in a browser are skipped: "
            f"apt-get install {BROWSER_PACKAGE}\n"
        )


def has_browser() -> bool:
    """Tell whether a Chromium starts; a stub that would install one does not count."""
    for name in BROWSERS:
        path = shutil.which(name)
        if path is not None:
            try:
                done = subprocess.run([path, "--version"], check=False, capture_output=True, text=True, timeout=60)
            except (OSError, subprocess.TimeoutExpired):
                continue
            if done.returncode == 0 and "Chrom" in done.stdout:
                return True
    return False


def find_missing(wanted: dict[str, str]) -> dict[str, str]:
    """Load each library and open an EGL context.

    Args:
        wanted: Shared object to package.

    Returns:
        The same mapping for what does not load; ``DRIVER`` stands for an EGL that gives no OpenGL 4.5 context.
    """
    missing = {name: package for name, package in wanted.items() if not loads(name)}
    context = [sys.executable, "-c", CONTEXT]
    if subprocess.run(context, check=False, capture_output=True).returncode != 0:
        missing[DRIVER] = DRIVER_PACKAGE
    return missing


def loads(name: str) -> bool:
    """Tell whether the dynamic loader finds a shared object."""
    try:
        ctypes.CDLL(name)
    except OSError:
        return False
    return True


def apt_rights() -> list[str] | None:
    """Give the prefix with which apt-get may install here: none for root, sudo without a password, or None."""
    if shutil.which("apt-get") is None:
        return None
    if os.geteuid() == 0:
        return []
    sudo = ["sudo", "-n"]
    allowed = shutil.which("sudo") and subprocess.run([*sudo, "true"], check=False, capture_output=True).returncode == 0
    return sudo if allowed else None


def install(packages: list[str], rights: list[str]) -> None:
    """Install packages through apt, reading the lists anew where they are too old; what fails is found afterwards."""
    sys.stderr.write(f"falsework set-up: apt-get install {' '.join(packages)}\n")
    environment = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
    prefix = [*rights, "env", "DEBIAN_FRONTEND=noninteractive"] if rights else []
    for verb in (["install", *packages], ["update"], ["install", *packages]):
        done = subprocess.run([*prefix, *APT, *verb], check=False, env=environment, capture_output=True)
        if verb[0] == "install" and done.returncode == 0:
            return


def install_osmesa() -> bool:
    """Install the wheel that carries a software OpenGL; without its dependencies, which are a notebook stack."""
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "-c", str(ROOT / "constraints.txt")]
    return subprocess.run([*pip, "lavavu-osmesa"], check=False).returncode == 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
