"""What a capture or a cloud depends on besides its settings: package versions, the processor, the GL renderer."""

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
    """List what a capture's bytes depend on; opens a GL context in a child once.

    Args:
        device: Which device draws, as in `render.settings`.

    Returns:
        Package name to version, `cpu`, and `gl_renderer` and `gl_version`.

    Raises:
        InputError: No GL driver works here; the text holds the mend.
    """
    request = {"device": device}
    driver = run_child("render.views.probe", request, time_limit=PROBE_TIME_LIMIT, memory_limit=PROBE_MEMORY_LIMIT)
    strings = {f"gl_{key}": str(driver[key]) for key in ("renderer", "version")}
    packages = {name: version(name) for name in RENDER_PACKAGES}
    return {**packages, "cpu": processor(), **strings}


@cache
def recon_platform() -> dict[str, str]:
    """List what a cloud's bytes depend on.

    Returns:
        Package name to version, and `cpu`.
    """
    return {**{name: version(name) for name in RECON_PACKAGES}, "cpu": processor()}


@cache
def sample_platform() -> dict[str, str]:
    """List what a sampled cloud's bytes depend on.

    Returns:
        Package name to version, `open3d` (which casts the rays) under whichever name it is installed, and `cpu`.
    """
    caster = next((found for found in map(_version, ("open3d-cpu", "open3d")) if found), "none")
    return {**{name: version(name) for name in SAMPLE_PACKAGES}, "open3d": caster, "cpu": processor()}


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return ""


def processor() -> str:
    """Name the processor; libraries choose their kernels by it, and kernels differ in the last bits."""
    for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
        if line.startswith("model name"):
            return line.partition(":")[2].strip()
    return "unknown"
