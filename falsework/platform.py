"""The platform, on which results depend: package versions, the processor, the GL renderer."""

from contextlib import suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from groundwork.child import run_child

PROBE_TIME_LIMIT = 120.0  # [s]
PROBE_MEMORY_LIMIT = 4.0  # [GB]

# Packages whose version can change the bytes of a result: all that its code imports, except those that only check
# values, open a context or read what they cannot change (`tests/falsework/test_platform.py` has the list).
AUTHOR_PACKAGES = ("numpy", "open3d", "opencv-python-headless", "openexr", "scipy", "usd-core")
RENDER_PACKAGES = (*AUTHOR_PACKAGES, "deflate", "materialx", "moderngl", "numba")
RECON_PACKAGES = (
    "laspy",
    "lazrs",
    "numba",
    "numpy",
    "open3d",
    "opencv-python-headless",
    "pycolmap",
    "scipy",
)
SAMPLE_PACKAGES = ("laspy", "lazrs", "materialx", "numpy", "open3d", "opencv-python-headless", "usd-core")
REPORT_PACKAGES = ("jinja2", "numpy", "opencv-python-headless", "plotly", "scipy")
LEARN_PACKAGES = ("lightning", "numba", "numpy", "safetensors", "scikit-learn", "scipy", "torch")

MACHINE = ("cpu", "gl_renderer", "gl_version")  # the facts of a platform that are no packages
_NAMES = {"open3d": ("open3d-cpu", "open3d")}  # a build for processors alone has a name of its own


@cache
def author_platform() -> dict[str, str]:
    """List the facts of the platform that an authored stage depends on; it is the same on every processor.

    Returns:
        Package name to version.
    """
    return _versions(AUTHOR_PACKAGES)


@cache
def render_platform(device: str = "auto") -> dict[str, str]:
    """List the facts of the platform that a capture depends on; opens a GL context in a child process once.

    Args:
        device: Device of the renderer, as in `render.settings`.

    Returns:
        Package name to version, `cpu`, and `gl_renderer` and `gl_version`.

    Raises:
        InputError: No GL driver works here; the message says what to do.
    """
    request = {"device": device}
    driver = run_child("render.views.probe", request, time_limit=PROBE_TIME_LIMIT, memory_limit=PROBE_MEMORY_LIMIT)
    strings = {f"gl_{key}": str(driver[key]) for key in ("renderer", "version")}
    return {**_versions(RENDER_PACKAGES), "cpu": processor(), **strings}


@cache
def recon_platform() -> dict[str, str]:
    """List the facts of the platform that a cloud depends on.

    Returns:
        Package name to version, and `cpu`.
    """
    return {**_versions(RECON_PACKAGES), "cpu": processor()}


@cache
def sample_platform() -> dict[str, str]:
    """List the facts of the platform that a sampled cloud depends on.

    Returns:
        Package name to version, and `cpu`.
    """
    return {**_versions(SAMPLE_PACKAGES), "cpu": processor()}


@cache
def report_platform() -> dict[str, str]:
    """List the facts of the platform that the report of a scene depends on.

    Returns:
        Package name to version.
    """
    return _versions(REPORT_PACKAGES)


@cache
def learn_platform() -> dict[str, str]:
    """List the facts of the platform that the results of an experiment depend on.

    Returns:
        Package name to version, and `cpu`.
    """
    return {**_versions(LEARN_PACKAGES), "cpu": processor()}


def _versions(packages: tuple[str, ...]) -> dict[str, str]:
    return {name: _version(_NAMES.get(name, (name,))) for name in packages}


def _version(names: tuple[str, ...]) -> str:
    """Read the version of a package that has one of several names; `none` if none of several is installed."""
    if len(names) == 1:
        return version(names[0])
    for name in names:
        with suppress(PackageNotFoundError):
            return version(name)
    return "none"


def processor() -> str:
    """Name the processor: libraries choose their kernels by it, and results differ in the last bits."""
    for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
        if line.startswith("model name"):
            return line.partition(":")[2].strip()
    return "unknown"
