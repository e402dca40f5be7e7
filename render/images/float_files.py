"""Floating-point images: OpenEXR, and the Radiance HDR files that OpenCV reads."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from groundwork.errors import InputError
from groundwork.foreign_file import check_regular
from render.images import image_files

F32 = NDArray[np.float32]
_BRIGHTEST = 65504.0  # [any unit] largest 16-bit float: programs write +inf in OpenEXR for what is brighter


def decode_exr(path: Path) -> F32:
    """Decode red, green and blue of an OpenEXR picture.

    Args:
        path: The file.

    Returns:
        Linear values [any unit], shape (H, W, 3), float32.

    Raises:
        InputError: Not such a picture, without colors, or too large.
    """
    import OpenEXR

    try:
        check_regular(path)
        with OpenEXR.File(str(path), header_only=True) as file:
            low, high = file.header()["dataWindow"]
        if (int(high[0]) - int(low[0]) + 1) * (int(high[1]) - int(low[1]) + 1) > image_files.MOST_PIXELS:
            raise ValueError("too large")
        with OpenEXR.File(str(path)) as file:
            channels = file.channels()
            name = next(name for name in ("RGB", "RGBA") if name in channels)
            return np.array(channels[name].pixels[..., :3], np.float32)
    except (RuntimeError, OSError, StopIteration, ValueError, KeyError, TypeError) as error:
        raise InputError(f"not readable as an RGB OpenEXR image: {error}", where=path) from None


def decode_float(path: Path) -> F32:
    """Decode a floating-point picture; NaN and -inf become 0, +inf 65504 or the largest finite value if that is more.

    Args:
        path: `.exr` or `.hdr`.

    Returns:
        Linear values [any unit], shape (H, W, 3), float32.

    Raises:
        InputError: Not readable as one.
    """
    pixels = decode_exr(path) if path.suffix.lower() == ".exr" else image_files.decode(path)
    if pixels.ndim != 3 or pixels.dtype != np.float32:
        raise InputError("not a floating-point color picture", where=path)
    colors = pixels[..., :3]
    brightest = float(colors.max(where=np.isfinite(colors), initial=_BRIGHTEST))
    return np.nan_to_num(colors, nan=0.0, posinf=brightest, neginf=0.0)
