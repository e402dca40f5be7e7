"""Compare statistics of our photographs with those of real ones, and write the page.

Usage: python -m benchmarks.render.photo_statistics --real NAME=FOLDER ... --ours NAME=FOLDER ...

A folder holds JPEG or PNG files. Real photographs are reduced to the width of ours first.
"""

import argparse
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.page import write_page

U8 = NDArray[np.uint8]
F32 = NDArray[np.float32]

PAGE = Path(__file__).resolve().parents[2] / "docs" / "benchmarks" / "photo_statistics.md"
WIDTH = 1280  # [px] that wider photographs are reduced to
_BAND = (0.02, 0.30)  # [cycles/px] of the spectrum's slope
_SUFFIXES = (".jpg", ".jpeg", ".png")
_MARGIN = 0.1  # of the width of a range of real photographs by which ours may leave it [1]


@dataclass(frozen=True)
class Measure:
    """A statistic of a photograph.

    Attributes:
        name: What the page calls it.
        digits: Digits after the point.
    """

    name: str
    digits: int


MEASURES = (
    Measure("slope of the power spectrum", 2),
    Measure("gradient, median [codes/px]", 1),
    Measure("gradient, 90 in 100", 1),
    Measure("gradient, 99 in 100", 1),
    Measure("saturation, 10 in 100 [1]", 2),
    Measure("saturation, median", 2),
    Measure("saturation, 90 in 100", 2),
    Measure("luma, mean [codes]", 0),
    Measure("luma, standard deviation", 0),
)


def statistics_of(image: U8) -> list[float]:
    """Measure a photograph in the order of `MEASURES`.

    Args:
        image: Colors in OpenCV's order, shape (H, W, 3), uint8.
    """
    luma = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY).astype(np.float32)
    across, down = cv2.Scharr(luma, cv2.CV_32F, 1, 0) / 32, cv2.Scharr(luma, cv2.CV_32F, 0, 1) / 32
    gradient = np.hypot(across, down)[1:-1, 1:-1]
    low, high = image.min(axis=2).astype(np.float32), image.max(axis=2).astype(np.float32)
    saturation = (high - low) / np.maximum(high, 1)
    return [
        spectrum_slope(luma),
        *(float(value) for value in np.percentile(gradient, (50, 90, 99))),
        *(float(value) for value in np.percentile(saturation, (10, 50, 90))),
        float(luma.mean()),
        float(luma.std()),
    ]


def spectrum_slope(luma: F32) -> float:
    """Fit the exponent of the power spectrum over frequency; natural photographs have about -2 [1].

    Args:
        luma: Codes, shape (H, W), float32.

    Source: Field, Relations between the statistics of natural images and the response properties of cortical cells,
    JOSA A 1987.
    """
    height, width = luma.shape
    window = np.outer(np.hanning(height), np.hanning(width))
    power = np.abs(np.fft.rfft2((luma - luma.mean()) * window)) ** 2
    radius = np.hypot(np.fft.fftfreq(height)[:, None], np.fft.rfftfreq(width)[None])
    edges = np.geomspace(*_BAND, 25)
    ring = np.digitize(radius, edges)
    inside = (ring > 0) & (ring < len(edges))
    count = np.bincount(ring[inside], minlength=len(edges))[1:]
    mean = np.bincount(ring[inside], power[inside], minlength=len(edges))[1:] / np.maximum(count, 1)
    middle, good = np.sqrt(edges[1:] * edges[:-1]), (count > 0) & (mean > 0)
    if good.sum() < 2:
        return 0.0  # a picture of one color
    return float(np.polyfit(np.log(middle[good]), np.log(mean[good]), 1)[0])


def read_photograph(path: Path) -> U8:
    """Read a photograph, reduced to `WIDTH` if it is wider; shape (H, W, 3), uint8.

    Args:
        path: The file.
    """
    image = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if image is None:
        raise SystemExit(f"{path}: not a photograph")
    height, width = image.shape[:2]
    if width > WIDTH:
        image = cv2.resize(image, (WIDTH, round(height * WIDTH / width)), interpolation=cv2.INTER_AREA)
    return image.astype(np.uint8)


def measured(folder: Path) -> NDArray[np.float64]:
    """Measure the photographs of a folder, shape (N, statistics), float64.

    Args:
        folder: The folder.
    """
    files = sorted(path for path in folder.iterdir() if path.suffix.lower() in _SUFFIXES)
    if not files:
        raise SystemExit(f"{folder}: no photographs")
    return np.array([statistics_of(read_photograph(path)) for path in files])


def main() -> None:
    """Measure all folders, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--real", nargs="+", required=True)
    parser.add_argument("--ours", nargs="+", required=True)
    arguments = parser.parse_args()
    real, ours = (_folders(named) for named in (arguments.real, arguments.ours))
    write_page(PAGE, _page(real, ours), __file__)


def _folders(named: list[str]) -> dict[str, NDArray[np.float64]]:
    return {name: measured(Path(folder)) for name, _, folder in (text.partition("=") for text in named)}


def _page(real: dict[str, NDArray[np.float64]], ours: dict[str, NDArray[np.float64]]) -> str:
    every = np.concatenate(list(real.values()))
    low, high = every.min(axis=0), every.max(axis=0)
    slack = _MARGIN * (high - low)
    head = [f"{name} ({len(rows)})" for name, rows in (real | ours).items()]
    lines, outside, total = [], 0, len(MEASURES) * len(ours)
    for column, measure in enumerate(MEASURES):
        cells = [f"{rows[:, column].mean():.{measure.digits}f}" for rows in real.values()]
        spread = f"{low[column]:.{measure.digits}f} to {high[column]:.{measure.digits}f}"
        for rows in ours.values():
            mean = rows[:, column].mean()
            inside = low[column] - slack[column] <= mean <= high[column] + slack[column]
            outside += not inside
            cells.append(f"{mean:.{measure.digits}f}" if inside else f"**{mean:.{measure.digits}f}**")
        lines.append(f"| {measure.name} | {spread} | " + " | ".join(cells) + " |")
    return f"""# Statistics of photographs

Written by `python -m benchmarks.render.photo_statistics`. Photographs of {len(real)} public sets, reduced to {WIDTH} px
of width, and ours: the mean of each folder (number of photographs in brackets), and the spread of all real ones.
**Bold**: a mean of ours that lies outside of that spread by more than a tenth of its width: {outside} of {total}.

| statistic | spread of the real | {" | ".join(head)} |
|---|---|{"---|" * len(head)}
{chr(10).join(lines)}

The slope is fitted to the rings of the power spectrum between {_BAND[0]} and {_BAND[1]} cycles a pixel. Gradients are
Scharr's, of luma. Saturation is that of HSV.
"""


if __name__ == "__main__":
    main()
