"""Which driver draws: what is chosen, what is refused, and that two drivers agree to the bit."""

from pathlib import Path

import numpy as np
import pytest

from groundwork.canonical import folder_digest
from groundwork.errors import InputError
from groundwork.progress import SILENT
from render.frames import render_scene
from render.gpu import context
from render.gpu.context import Driver, egl_devices, open_context
from render.gpu.osmesa import osmesa_folder
from render.settings import RenderSettings
from tests.render.scenes import random_scene


def test_a_software_device_is_refused_when_a_gpu_was_asked_for() -> None:
    """Where every EGL device is software, `gpu` is bad input, not a slow surprise."""
    if not all(egl_devices()):
        pytest.skip("this machine has a GPU")
    with pytest.raises(InputError, match=r"device.*gpu.*auto"):
        open_context("gpu")


@pytest.mark.parametrize("device", ["fast", "99", "-1"])
def test_an_unknown_device_names_the_known_ones(device: str) -> None:
    """One line with what is allowed."""
    with pytest.raises(InputError, match=r"no such device.*allowed: auto"):
        open_context(device)


def test_without_any_driver_the_packages_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither EGL nor the wheel: the line to type."""
    monkeypatch.setattr(context, "_LIBRARIES", {"libgl": "libNoGL.so.1", "libegl": "libNoEGL.so.1"})
    monkeypatch.setattr(context, "osmesa_folder", lambda: None)
    assert egl_devices() == ()
    with pytest.raises(InputError, match=r"apt-get install libegl1 libgl1 libgl1-mesa-dri"):
        open_context("auto")


@pytest.mark.parametrize(
    ("version", "software", "expected"),
    [
        ("4.5 (Core Profile) Mesa 22.3.6", True, 1.0),
        ("4.5 (Core Profile) Mesa 25.0.7-2", True, 4.0),
        ("4.5 (Core Profile) something else", True, 1.0),
        ("4.6.0 NVIDIA 550.54", False, 8.0),
    ],
)
def test_anisotropy_only_where_the_driver_can(version: str, software: bool, expected: float) -> None:
    """Old llvmpipe hangs with it."""
    assert Driver("egl", "", version, "", software).anisotropy() == expected


@pytest.mark.skipif(
    osmesa_folder() is None or True not in egl_devices(), reason="needs the OSMesa wheel and Mesa's EGL"
)
def test_the_wheel_draws_the_same_bytes(tmp_path: Path, small: RenderSettings) -> None:
    """Photographs and truth of OSMesa equal those of the system's Mesa."""
    scene = random_scene(4, np.zeros(3))
    for device in ("software", "osmesa"):
        (tmp_path / device).mkdir()
        render_scene(scene, tmp_path / device, small.model_copy(update={"device": device}), 1, SILENT)
    for part in ("images", "truth/depth", "truth/instance", "truth/semantic", "truth/normal"):
        assert folder_digest(tmp_path / "software" / part) == folder_digest(tmp_path / "osmesa" / part)
