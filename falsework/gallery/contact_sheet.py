"""A contact sheet: rows of pictures with a caption each, as one JPEG."""

from collections.abc import Iterable, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

U8 = NDArray[np.uint8]

_CHARACTER, _MARGIN, _BAR, _BASELINE = 20.0, 28.0, 52.0, 37.0  # [px] at letters of size 1


def contact_sheet(rows: Iterable[tuple[str | Sequence[str], Sequence[U8]]], *, letters: float, quality: int) -> bytes:
    """Arrange pictures in rows, with a caption in the corner of the first ones.

    Args:
        rows: Caption of the first picture, or captions of the first ones, and pictures of each row, at least one;
            every picture shape (H, W, 3), uint8, RGB.
        letters: Size of the captions in OpenCV's scale [1].
        quality: Of the JPEG [1], 1 to 100.
    """
    lines = []
    for captions, pictures in rows:
        line = np.concatenate(pictures, axis=1)[..., ::-1].copy()
        left = 0
        for caption, picture in zip([captions] if isinstance(captions, str) else captions, pictures, strict=False):
            width = round((_MARGIN + _CHARACTER * len(caption)) * letters)
            line[: round(_BAR * letters), left : left + width] //= 3
            corner = left + round(0.5 * _MARGIN * letters), round(_BASELINE * letters)
            cv2.putText(line, caption, corner, cv2.FONT_HERSHEY_SIMPLEX, letters, (255, 255, 255), 1, cv2.LINE_AA)
            left += picture.shape[1]
        lines.append(line)
    done, data = cv2.imencode(".jpg", np.concatenate(lines), [cv2.IMWRITE_JPEG_QUALITY, quality])
    if not done:
        raise RuntimeError("OpenCV cannot write JPEG")
    return data.tobytes()
