"""The platform, on which captures and clouds depend: package versions, the processor, the GL renderer."""

from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from groundwork.child import run_child

PROBE_TIME_LIMIT = 120.0  # [s]
PROBE_MEMORY_LIMIT = 4.0  # [GB]

RENDER_PACKAGES = ("deflate", "moderngl", "numpy", "opencv-python-headless", "usd-core")
RECON_PACKAGES = ("numpy", "opencv-python-headless", "pycolmap")
SAMPLE_PACKAGES = ("numpy", "opencv-python-headless", "usd-core")


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
    packages = {name: version(name) for name in RENDER_PACKAGES}
    return {**packages, "cpu": processor(), **strings}


@cache
def recon_platform() -> dict[str, str]:
    """List the facts of the platform that a cloud depends on.

    Returns:
        Package name to version, and `cpu`.
    """
    return {**{name: version(name) for name in RECON_PACKAGES}, "cpu": processor()}


@cache
def sample_platform() -> dict[str, str]:
    """List the facts of the platform that a sampled cloud depends on.

    Returns:
        Package name to version, `open3d` (which casts the rays) under either package name, and `cpu`.
    """
    caster = next((found for found in map(_version, ("open3d-cpu", "open3d")) if found), "none")
    return {**{name: version(name) for name in SAMPLE_PACKAGES}, "open3d": caster, "cpu": processor()}


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return ""


def processor() -> str:
    """Name the processor: libraries choose their kernels by it, and results differ in the last bits."""
    for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
        if line.startswith("model name"):
            return line.partition(":")[2].strip()
    return "unknown"
