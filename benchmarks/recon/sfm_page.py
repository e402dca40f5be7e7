"""The page `docs/benchmarks/recon.md`: one row a way and count, and what was promised beside what was found."""

from dataclasses import dataclass

import numpy as np

from benchmarks.recon.colmap_defaults import STEPS

OURS, GLOBAL, EVERY_PAIR, DEFAULTS, OPENMVG = "spatial", "global", "exhaustive", "defaults", "openmvg"
PEERS = (DEFAULTS, OPENMVG)
MARK = " †"  # behind a row of earlier code
FASTER = {200: 3.0, 400: 5.0}  # images to how many times faster than every pair ours must be
EXPONENT = 1.2  # of processor time over images
FAR = 10_000  # images; where lines meet beyond, they are as good as parallel
LIMIT = 0.5  # [m] a camera farther off does not count as right
_FEWER, _WORSE, _MORE = 0.01, 1.1, 0.001  # equal accuracy: registered [1], median center error as a factor, and [m]
_NOTHING, _MISSED = "not measured", "**missed**"


@dataclass(frozen=True)
class Row:
    """One line of the table.

    Attributes:
        way: Name of the way.
        title: What it does.
        images: Number of photographs.
        seconds: Processor time of each step [s].
        pairs: Image pairs tried, or why there is no model.
        points: Number of points.
        registered: Share of the photographs in the largest model [1].
        right: Share of them within `LIMIT` of the truth [1].
        median: Median distance of right camera centers to the truth [m]; None without one.
        p95: Their 95 % quantile [m].
        thrice: Share of the points that three or more images saw [1]; None where not counted.
        code: Hash of the code that measured it; empty for a peer, whose version is part of the row's file name.
    """

    way: str
    title: str
    images: int
    seconds: dict[str, float]
    pairs: str
    points: int
    registered: float
    right: float
    median: float | None
    p95: float | None
    thrice: float | None = None
    code: str = ""

    @property
    def total(self) -> float:
        """Processor time of all steps [s]."""
        return sum(self.seconds.values())


def of_earlier_code(row: Row, code: str) -> bool:
    """Tell whether a row was measured by other code of ours than that of today.

    Args:
        row: The row.
        code: Hash of today's code.
    """
    return row.way not in PEERS and row.code != code


def render_page(rows: list[Row], source: str, processor: str, code: str = "") -> str:
    """Write the page.

    Args:
        rows: What was measured so far.
        source: The photographs, in words.
        processor: Name of the processor.
        code: Hash of today's code: rows of earlier code get a mark.
    """
    earlier = [row for row in rows if of_earlier_code(row, code)]
    titles = [f"{row.title}{MARK if row in earlier else ''}" for row in rows]
    counted = any(row.thrice is not None for row in rows)
    lines = [
        "# Structure from motion, several ways",
        "",
        f"Written by `python -m benchmarks.recon.sfm`. {source} Processor time, all threads together, of {processor}; "
        "the same photographs for all, the same keypoints for all but the defaults and openmvg-rs. The time of each "
        "way includes its keypoints. By GPS, from 100 images on, every fourth image is also paired with those 32, 64, "
        "128 … later. "
        f"Center errors after alignment to the truth, of cameras within {LIMIT} m (*right*).",
        "",
        "| way | images | pairs | features [s] | matching [s] | mapping [s] | all [s] | registered | right "
        f"| center error, median [mm] | 95 % [mm] | points |{' of three views and more |' if counted else ''}",
        "|---|---|---|---|---|---|---|---|---|---|---|---|" + "---|" * counted,
        *(_line(row, title, counted) for row, title in zip(rows, titles, strict=True)),
        *(["", f"{MARK.strip()} measured by earlier code."] if earlier else []),
        "",
        "| compared | images | wanted | found | |",
        "|---|---|---|---|---|",
        *_speed(rows),
        *_mappers(rows),
        *_exponents(rows),
        "",
        f"Equal accuracy: at most {_FEWER:.0%} fewer cameras right, and a median center error of at most {_WORSE:g} "
        f"times that of every pair, or {1000 * _MORE:g} mm more. The exponent is the slope of a straight line through "
        "the logarithms of time and images.",
        "",
    ]
    return "\n".join(lines)


def _line(row: Row, title: str, counted: bool) -> str:
    share = f" {'' if row.thrice is None else f'{row.thrice:.0%}'} |" if counted else ""
    times = " | ".join(f"{row.seconds[step]:.0f}" if step in row.seconds else "" for step in STEPS)
    return (
        f"| {title} | {row.images} | {row.pairs} | {times} | {row.total:.0f} | {row.registered:.0%} | "
        f"{row.right:.0%} | {_millimeters(row.median)} | {_millimeters(row.p95)} | {row.points:,} |{share}"
    )


def _millimeters(value: float | None) -> str:
    return "" if value is None else f"{1000 * value:.1f}"


def _speed(rows: list[Row]) -> list[str]:
    """How many times faster ours is than every pair, and than the defaults; and whether it is as accurate."""
    lines = []
    for count in sorted({row.images for row in rows} | set(FASTER)):
        ours, every, defaults = (_found(rows, way, count) for way in (OURS, EVERY_PAIR, DEFAULTS))
        wanted = FASTER.get(count)
        ratio = every.total / ours.total if ours and every else None
        smaller = [row for row in rows if row.way == EVERY_PAIR and row.images < count and row.median is not None]
        if ours and not every and smaller:
            ratio = every_pair_estimated(ours, smaller[-1]) / ours.total
            title = f"times faster than every pair, estimated by the cost of a pair of {smaller[-1].images} images"
            lines.append(_verdict(title, count, wanted, ratio, least=True, held="expected"))
        else:
            lines.append(_verdict("times faster than every pair", count, wanted, ratio, least=True))
        if ours and every:
            same, held = ("equal", "held") if equally_accurate(ours, every) else ("not equal", _MISSED)
            lines.append(f"| accuracy beside every pair | {count} | equal | {same} | {held} |")
        if ours and defaults:
            ratio = defaults.total / ours.total
            lines.append(_verdict("times faster than pycolmap's defaults", count, None, ratio, least=True))
    return lines


def every_pair_estimated(ours: Row, smaller: Row) -> float:
    """Estimate what every pair would have cost: by the cost of a pair, with the features and the mapping of ours.

    Args:
        ours: Our way, with more images.
        smaller: Every pair, with fewer.

    Returns:
        Processor time [s].
    """
    pairs = [count * (count - 1) / 2 for count in (ours.images, smaller.images)]
    matching = [row.seconds.get("matching", 0.0) for row in (ours, smaller)]
    return ours.total - matching[0] + matching[1] * pairs[0] / pairs[1]


def equally_accurate(ours: Row, other: Row) -> bool:
    """Check whether one method is as accurate as another.

    Args:
        ours: The one.
        other: The other.
    """
    if ours.median is None or other.median is None:
        return ours.median is not None
    near = ours.median <= max(_WORSE * other.median, other.median + _MORE)
    return near and ours.right >= other.right - _FEWER


def _mappers(rows: list[Row]) -> list[str]:
    """Compare the mappers at each count, and find from how many images on `auto` should map globally."""
    lines, pays, pairs = [], "", list[tuple[Row, Row]]()
    for count in sorted({row.images for row in rows}):
        one, all_at_once = _found(rows, OURS, count), _found(rows, GLOBAL, count)
        if one and all_at_once and all_at_once.seconds.get("mapping"):
            ratio = one.seconds["mapping"] / all_at_once.seconds["mapping"]
            lines.append(_verdict("mapping time, incremental over global mapper", count, None, ratio, least=True))
            pairs.append((one, all_at_once))
            better = ratio > 1.0 and equally_accurate(all_at_once, one)
            pays = (pays or f"from {count} images on") if better else ""
    if lines:
        lines.append(f"| global mapper faster at equal accuracy | | | {pays or 'not yet'} | |")
    if len(pairs) > 1:
        meet = crossing(pairs)
        found = "never, or far away" if meet is None or meet > FAR else f"about {float(f'{meet:.2g}'):.0f} images"
        lines.append(f"| global mapper as fast, by the lines through the mapping times of both | | | {found} | |")
    return lines


def crossing(pairs: list[tuple[Row, Row]]) -> float | None:
    """Estimate from how many images on one method is faster than another, by extrapolation of both.

    Args:
        pairs: The way that is faster with few images and the other, at two counts or more.

    Returns:
        Number of images; None where the other's time grows no slower.
    """
    counts = np.log([one.images for one, _ in pairs])
    first, second = (
        np.polyfit(counts, np.log([pair[kind].seconds["mapping"] for pair in pairs]), 1) for kind in (0, 1)
    )
    return float(np.exp((second[1] - first[1]) / (first[0] - second[0]))) if first[0] > second[0] else None


def _exponents(rows: list[Row]) -> list[str]:
    """The slope for each way that went through two counts or more; ours is held against the limit."""
    lines = []
    for way in dict.fromkeys([OURS, *(row.way for row in rows)]):
        mine = [row for row in rows if row.way == way and row.total > 0 and row.median is not None]
        wanted = EXPONENT if way == OURS else None
        title = f"exponent: {mine[0].title if mine else 'ours'}"
        if len(mine) < 2:
            if wanted:
                lines.append(_verdict(title, "", wanted, None, least=False))
            continue
        span = f"{min(row.images for row in mine)} to {max(row.images for row in mine)}"
        lines.append(_verdict(title, span, wanted, exponent(mine), least=False))
    return lines


def exponent(rows: list[Row]) -> float:
    """Fit time = constant x images ^ exponent.

    Args:
        rows: Two counts or more of one way.
    """
    return float(np.polyfit(np.log([row.images for row in rows]), np.log([row.total for row in rows]), 1)[0])


def _found(rows: list[Row], way: str, count: int) -> Row | None:
    return next((r for r in rows if r.way == way and r.images == count and r.median is not None), None)


def _verdict(
    title: str, images: object, wanted: float | None, found: float | None, *, least: bool, held: str = "held"
) -> str:
    """Write a line; a figure that is missed is in bold."""
    asked = "" if wanted is None else f"{'at least' if least else 'at most'} {wanted:g}"
    if found is None:
        return f"| {title} | {images} | {asked} | {_NOTHING} | |"
    enough = found >= wanted if wanted is not None and least else wanted is None or found <= wanted
    return f"| {title} | {images} | {asked} | {found:.2f} | {'' if wanted is None else held if enough else _MISSED} |"
