"""Which scale is nearest the truth, and how often the stated limits of a GPS alignment hold.

Usage: python -m benchmarks.recon.gps_scale [--flights N] [--first SEED]

Flights are those of `benchmarks.recon.gps_flights`: camera centers, the level of photographs, noisy fixes, and no
pixel. `docs/benchmarks/gps.md` shows the two tables. A minute for a thousand flights.
"""

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.page import write_page
from benchmarks.recon.gps_flights import KINDS, Flight, draw_flight, place_flight, true_errors
from recon.placing.gps_fit import Fit
from recon.placing.similarity import fit_similarity

F64 = NDArray[np.float64]

PAGE = Path(__file__).resolve().parents[2] / "docs" / "benchmarks" / "gps.md"
LIMITS = ("scale", "tilt", "heading", "place")
_TURN = np.radians(20.0)
_UNSEEN = 100_000  # the first seed; the allowances of `recon.placing.place_errors` were chosen on flights 0 to 999


def main() -> None:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--flights", type=int, default=1000)
    parser.add_argument("--first", type=int, default=_UNSEEN)
    told = parser.parse_args()
    write_page(PAGE, gps_page(told.flights, told.first), __file__)


def scales_of(flight: Flight, fit: Fit) -> dict[str, float]:
    """Find the scale of a flight in several ways, over the same fixes.

    Args:
        flight: The flight.
        fit: Its fit.

    Returns:
        Scale over the true one [1], by way.
    """
    source, goal = flight.source[fit.agreeing], flight.gps[fit.agreeing]
    source, goal = source - source.mean(axis=0), goal - goal.mean(axis=0)
    noise = ((goal - fit.similarity.scale * source @ fit.similarity.rotation.T) ** 2).sum()
    noise *= 3 * len(goal) / max(3 * len(goal) - 7, 1)
    tilted = fit.similarity.rotation @ _about_x(_TURN)
    square = (source**2).sum()
    found = {
        "ratio of spreads": float(np.sqrt((goal**2).sum() / square)),
        "ratio of spreads, freed of its noise": float(np.sqrt(max((goal**2).sum() - noise, 0.0) / square)),
        "least squares of centers": float(fit_similarity(source, goal)[0]),
        "least squares, the rotation 20° off": float((goal * (source @ tilted.T)).sum() / square),
        "fixes and gravity together": fit.similarity.scale,
    }
    return {way: scale / flight.known.scale for way, scale in found.items()}


def gps_page(flights: int, first: int = _UNSEEN) -> str:
    """Simulate, and write the tables.

    Args:
        flights: How many to draw.
        first: Seed of the first; each has the next one.
    """
    ways: dict[str, list[float]] = {}
    kept: dict[str, list[list[bool]]] = {kind: [] for kind in KINDS}
    wide: dict[str, list[list[float]]] = {kind: [] for kind in KINDS}
    drawn: dict[str, int] = {kind: 0 for kind in KINDS}
    for seed in range(first, first + flights):
        flight = draw_flight(np.random.default_rng(seed))
        drawn[flight.kind] += 1
        placed = place_flight(flight, np.random.default_rng(seed))
        if placed is None:
            continue
        fit, limits = placed
        off = true_errors(flight, fit)
        kept[flight.kind].append([getattr(off, name) <= getattr(limits, name) for name in LIMITS])
        wide[flight.kind].append([getattr(limits, name) for name in LIMITS])
        for way, scale in scales_of(flight, fit).items():
            ways.setdefault(way, []).append(100.0 * (scale - 1.0))
    rows = [(kind, drawn[kind], kept[kind], wide[kind]) for kind in KINDS]
    rows.append(
        ("all", flights, [row for kind in KINDS for row in kept[kind]], [row for kind in KINDS for row in wide[kind]])
    )
    return _written(flights, first, ways, rows)


def _written(
    flights: int,
    first: int,
    ways: dict[str, list[float]],
    rows: list[tuple[str, int, list[list[bool]], list[list[float]]]],
) -> str:
    lines = [
        "# GPS: the scale, and the limits that are stated",
        "",
        f"Written by `python -m benchmarks.recon.gps_scale`: {flights:,} flights of 6 to 80 photographs, 15 to 200 m",
        "long, of which only camera centers, the level of the photographs and the fixes are simulated. A receiver",
        "states 2 m along the ground and 3 m in height, its noise is 0.1 to 1.5 times that; in half of the flights",
        "the error of a fix repeats half or more of the one before it, in three of ten every eighth fix is an outlier.",
        "All fixes of a flight share an error as large as what is stated. Their seeds begin at "
        f"{first:,}; the limits were chosen on flights 0 to 999.",
        "",
        "## Scale",
        "Over the fixes that agree; error of the scale in per cent.",
        "",
        "| way | mean | median of the amount | 95 % of the amounts below |",
        "|---|---|---|---|",
        *(
            f"| {way} | {np.mean(off):+.2f} | {np.median(np.abs(off)):.2f} | {np.quantile(np.abs(off), 0.95):.1f} |"
            for way, off in ways.items()
        ),
        "",
        "The ratio of the spreads of fixes and cameras overestimates the scale, because noise adds to the spread of",
        "the fixes. After subtracting the noise, estimated from residuals, it is as good as least squares, but needs",
        "that fit first. Least squares with a given rotation underestimates the scale by the cosine of the rotation",
        "error; estimated together with the rotation, as in `reconstruct`, it has no bias.",
        "",
        "## Limits",
        "Share of flights whose true error keeps to the stated limit of 95 %, and the median of that limit. Flights",
        "whose limits exceed 25 % of scale, 20° of tilt or 30° of heading have no frame, and the cloud says so.",
        "",
        "| flight | placed | scale | tilt | heading | place |",
        "|---|---|---|---|---|---|",
        *(_row(kind, number, held, limit) for kind, number, held, limit in rows if held),
        "",
    ]
    return "\n".join(lines)


def _row(kind: str, drawn: int, held: list[list[bool]], limits: list[list[float]]) -> str:
    share, middle = np.mean(held, axis=0), np.median(limits, axis=0)
    units = (" %", "°", "°", " m")
    cells = [f"{one:.1%} of ±{two:.1f}{unit}" for one, two, unit in zip(share, middle, units, strict=True)]
    return f"| {kind} | {len(held)} of {drawn} | {' | '.join(cells)} |"


def _about_x(angle: float) -> F64:
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, cosine, -sine], [0.0, sine, cosine]])


if __name__ == "__main__":
    main()
