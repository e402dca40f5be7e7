"""An OpenGL 4.5 context without a window: EGL on a GPU or on Mesa, else the OSMesa wheel, else an error with a hint."""

import ctypes
import re
from dataclasses import dataclass
from typing import Any

import moderngl

from groundwork.errors import InputError
from render.gpu.gl_functions import GlFunctions
from render.gpu.osmesa import OsmesaContext, osmesa_folder

INSTALL_HINT = "apt-get install libegl1 libgl1 libgl1-mesa-dri, or pip install --no-deps lavavu-osmesa"
_GL_VERSION = 450
_LIBRARIES = {"libgl": "libGL.so.1", "libegl": "libEGL.so.1"}
_EGL_EXTENSIONS = 0x3055
_ANISOTROPY_SINCE = (24, 0)  # older llvmpipe needs minutes for one frame with it


@dataclass(frozen=True)
class Driver:
    """The OpenGL driver.

    Attributes:
        backend: `egl` or `osmesa`.
        renderer: GL_RENDERER.
        version: GL_VERSION.
        vendor: GL_VENDOR.
        software: Whether it renders on the CPU.
    """

    backend: str
    renderer: str
    version: str
    vendor: str
    software: bool

    def anisotropy(self) -> float:
        """Return the degree of anisotropic filtering for this driver [1]."""
        if not self.software:
            return 8.0
        mesa = re.search(r"Mesa (\d+)\.(\d+)", self.version)
        return 4.0 if mesa and (int(mesa[1]), int(mesa[2])) >= _ANISOTROPY_SINCE else 1.0


@dataclass(frozen=True)
class Gl:
    """An open context.

    Attributes:
        context: The context of moderngl.
        functions: OpenGL functions that moderngl lacks.
        driver: The driver.
    """

    context: moderngl.Context
    functions: GlFunctions
    driver: Driver

    def close(self) -> None:
        """Release the context."""
        self.context.release()


def open_context(device: str = "auto") -> Gl:
    """Open the context; a process needs only one.

    Args:
        device: `auto` uses a GPU if there is one, `gpu` requires one, `software` uses Mesa on the CPU, `osmesa` the
            OSMesa wheel, a number that EGL device.

    Returns:
        The open context.

    Raises:
        InputError: There is no OpenGL 4.5, or not on the requested device; the message names the packages to install.
    """
    if device != "osmesa":
        for index in _candidates(device):
            raw = _open_egl(index)
            if raw is not None:
                return _finish(raw, "egl", device)
        if device not in ("auto", "software"):
            raise InputError("no OpenGL 4.5 on this device", field="device", value=device, hint="Set device = 'auto'")
    folder = osmesa_folder()
    if folder is None:
        raise InputError("no OpenGL 4.5: neither EGL nor the OSMesa wheel is available", hint=INSTALL_HINT)
    try:
        return _finish(OsmesaContext(folder), "osmesa", device)
    except OSError as error:
        raise InputError(f"the OSMesa wheel does not work: {error}", where=folder, hint=INSTALL_HINT) from None


def egl_devices() -> tuple[bool, ...]:
    """List the EGL devices in the driver's order.

    Returns:
        For each device, whether it is a software device; empty where EGL is absent or cannot list them.
    """
    try:
        egl = ctypes.CDLL(_LIBRARIES["libegl"])
    except OSError:
        return ()
    egl.eglGetProcAddress.restype, egl.eglGetProcAddress.argtypes = ctypes.c_void_p, [ctypes.c_char_p]
    query, describe = egl.eglGetProcAddress(b"eglQueryDevicesEXT"), egl.eglGetProcAddress(b"eglQueryDeviceStringEXT")
    if not query or not describe:
        return ()
    devices, count = (ctypes.c_void_p * 64)(), ctypes.c_int()
    list_devices = ctypes.CFUNCTYPE(ctypes.c_uint, ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)(query)
    extensions = ctypes.CFUNCTYPE(ctypes.c_char_p, ctypes.c_void_p, ctypes.c_int)(describe)
    if not list_devices(len(devices), devices, ctypes.byref(count)):
        return ()
    return tuple(b"software" in (extensions(devices[row], _EGL_EXTENSIONS) or b"") for row in range(count.value))


def _candidates(device: str) -> list[int]:
    software = egl_devices()
    hardware = [index for index, slow in enumerate(software) if not slow]
    cpu = [index for index, slow in enumerate(software) if slow]
    named = {"auto": hardware + cpu, "gpu": hardware, "software": cpu}
    if device in named:
        return named[device]
    if device.isdecimal() and int(device) < len(software):
        return [int(device)]
    raise InputError(
        "no such device",
        field="device",
        value=device,
        allowed=f"auto, gpu, software, osmesa, 0 to {len(software) - 1}" if software else "auto, software, osmesa",
    )


def _open_egl(index: int) -> Any:
    import glcontext

    try:
        return glcontext.get_backend_by_name("egl")(
            glversion=_GL_VERSION, mode="standalone", device_index=index, **_LIBRARIES
        )
    except Exception:  # glcontext raises a plain Exception for any error of EGL
        return None


def _finish(raw: Any, backend: str, device: str) -> Gl:
    context = moderngl.create_context(context=raw)
    info = {key: str(context.info[key]) for key in ("GL_RENDERER", "GL_VERSION", "GL_VENDOR")}
    software = backend == "osmesa" or any(
        name in info["GL_RENDERER"].lower() for name in ("llvmpipe", "softpipe", "swrast", "software")
    )
    driver = Driver(backend, info["GL_RENDERER"], info["GL_VERSION"], info["GL_VENDOR"], software)
    if device == "gpu" and software:
        raise InputError(
            "only a software device is available", field="device", value=device, hint="Set device = 'auto'"
        )
    functions = GlFunctions(raw.load)
    functions.clip_depth_zero_to_one()
    return Gl(context, functions, driver)
