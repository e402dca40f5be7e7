"""OpenGL in memory from the OSMesa wheel, for machines without any system OpenGL.

The wheel `lavavu-osmesa` contains libOSMesa and its own LLVM; nothing else of it is used.
"""

import ctypes
import importlib.util
import os
from pathlib import Path

# libOSMesa has no run path: its siblings are loaded first, in the order in which they need each other.
_SIBLINGS = ("pcre2", "selinux", "tinfo", "ffi", "zstd", "drm", "glapi", "LLVM")
_ATTRIBUTES = (
    0x22,
    0x1908,  # format: RGBA
    0x30,
    24,  # depth bits
    0x33,
    0x34,  # profile: core
    0x36,
    4,
    0x37,
    5,  # version 4.5
    0,
)
_MODE = os.RTLD_NOW | os.RTLD_LOCAL | os.RTLD_DEEPBIND  # no conflict with the symbols of a system Mesa
_UNSIGNED_BYTE = 0x1401
_SIDE = 16  # [px] its own surface is never drawn to


class OsmesaContext:
    """A context for moderngl: it loads functions, can be made current, and can be released."""

    def __init__(self, folder: Path) -> None:
        """Load the libraries and make the context current.

        Args:
            folder: Folder that holds libOSMesa and its siblings.

        Raises:
            OSError: A library does not load, or there is no OpenGL 4.5.
        """
        for name in _SIBLINGS:
            for library in sorted(folder.glob(f"lib{name}*.so*")):
                ctypes.CDLL(str(library), mode=_MODE)
        self._mesa = ctypes.CDLL(str(_library(folder)), mode=_MODE)
        create = self._mesa.OSMesaCreateContextAttribs
        create.restype, create.argtypes = ctypes.c_void_p, [ctypes.c_void_p, ctypes.c_void_p]
        self._mesa.OSMesaMakeCurrent.argtypes = [ctypes.c_void_p, ctypes.c_void_p, *[ctypes.c_int] * 3]
        self._mesa.OSMesaGetProcAddress.restype = ctypes.c_void_p
        self._mesa.OSMesaDestroyContext.argtypes = [ctypes.c_void_p]
        self._surface = ctypes.create_string_buffer(_SIDE * _SIDE * 4)
        self._context = create((ctypes.c_int * len(_ATTRIBUTES))(*_ATTRIBUTES), None)
        if not self._context:
            raise OSError("OSMesa gives no OpenGL 4.5 core context")
        self.__enter__()

    def load(self, name: str) -> int:
        """Return the address of an OpenGL function, 0 when absent.

        Args:
            name: Name of the function.
        """
        return self._mesa.OSMesaGetProcAddress(name.encode()) or 0

    def release(self) -> None:
        """Destroy the context."""
        if self._context:
            self._mesa.OSMesaDestroyContext(self._context)
            self._context = None

    def __enter__(self) -> "OsmesaContext":
        if not self._mesa.OSMesaMakeCurrent(self._context, self._surface, _UNSIGNED_BYTE, _SIDE, _SIDE):
            raise OSError("OSMesa cannot make its context current")
        return self

    def __exit__(self, *_: object) -> None:
        """Keep the context current: a process has only this one."""


def osmesa_folder() -> Path | None:
    """Find the libraries of the OSMesa wheel in this Python's packages.

    Returns:
        The folder that holds libOSMesa, or None.
    """
    package = importlib.util.find_spec("lavavu")
    if package is None or package.origin is None:
        return None
    folder = Path(package.origin).parents[1] / "lavavu_osmesa.libs"
    return folder if folder.is_dir() and _library(folder) is not None else None


def _library(folder: Path) -> Path | None:
    return next(iter(sorted(folder.glob("libOSMesa*.so*"))), None)
