"""Errors to expect of a model's scale, tilt, heading and position, as 95 % limits."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recon.placing.gps_fit import Fit

F64 = NDArray[np.float64]

SHARE = 0.95
_SCALE_LIMIT, _TILT_LIMIT, _HEADING_LIMIT = 25.0, 20.0, 30.0  # [%] [deg] [deg]: beyond, the frame is not fixed


@dataclass(frozen=True)
class PlaceErrors:
    """95 % limits of the errors of a placed model; NaN where nothing is known.

    Attributes:
        scale: Error of the scale [%].
        tilt: Angle between the model's up and the world's [deg].
        heading: Angle about up [deg].
        place: Distance of the centroid of what was fitted from its true position: of the cameras that have a fix, or of
            the control points [m].
        twofold: Whether a very different rotation fits equally well; then the limits are invalid.
        heightless: Whether no height was measured; then `place` is horizontal, and the height is unknown.
    """

    scale: float
    tilt: float
    heading: float
    place: float
    twofold: bool = False
    heightless: bool = False

    def unfixed(self) -> str:
        """Describe in words what is too uncertain for the model to be placed; empty if nothing is."""
        wide = [
            f"{name} ±{value:.0f}{unit}"
            for name, value, limit, unit in (
                ("scale", self.scale, _SCALE_LIMIT, " %"),
                ("tilt", self.tilt, _TILT_LIMIT, "°"),
                ("heading", self.heading, _HEADING_LIMIT, "°"),
            )
            if not value <= limit
        ]
        if self.twofold and not wide:
            wide = ["two orientations fit equally well"]
        return ", ".join(wide)

    def in_words(self) -> str:
        """Describe the four limits in one clause."""
        known = [
            f"{name} ±{_short(value)}{unit}"
            for name, value, unit in (
                ("scale", self.scale, " %"),
                ("tilt", self.tilt, "°"),
                ("heading", self.heading, "°"),
                ("place", self.place, " m"),
            )
            if np.isfinite(value)
        ]
        if self.heightless:
            known.append("height unknown")
        return f"{', '.join(known)} (95 %)"

    def facts(self) -> dict[str, Any]:
        """Return the limits as JSON; None where nothing is known."""
        values = {
            "scale_percent": self.scale,
            "tilt_deg": self.tilt,
            "heading_deg": self.heading,
            "place_m": self.place,
        }
        known = {key: value if np.isfinite(value) else None for key, value in values.items()}
        return {"share": SHARE} | known | ({"height": "unknown"} if self.heightless else {})


def expected_errors(fit: Fit, bias: F64) -> PlaceErrors:
    """Compute the limits of a fit's errors from its residuals, its geometry and the shared error of its fixes.

    Args:
        fit: The fit.
        bias: Standard deviation along x, y, z of the error that all positions share [m], shape (3,), float64.
    """
    freedom = fit.freedom
    shared = np.diag(np.asarray(bias, np.float64) ** 2)
    scale = _limit(fit.covariances[:, :1, :1], freedom)
    place = np.concatenate([fit.covariances[:, 4:, 4:], shared[None]])
    if fit.heightless:
        place = place[:, :2, :2]
    return PlaceErrors(
        100.0 * float(np.expm1(min(scale, 50.0))),
        float(np.degrees(_limit(fit.covariances[:, 1:3, 1:3], freedom) + fit.tilted)),
        float(np.degrees(_limit(fit.covariances[:, 3:4, 3:4], freedom))),
        _limit(place, np.append(freedom, 1e6)),
        fit.twofold,
        fit.heightless,
    )


def _limit(parts: F64, freedom: F64) -> float:
    """Find the 95 % limit of the length of a normal vector whose covariance is a sum of estimated parts.

    Its square is approximated by a multiple of F with the degrees of freedom that match its mean and variance.
    Source: Satterthwaite (1946), both for the sum and for the square of the vector.
    """
    from scipy.stats import f as fisher  # half of the time to import the room

    total = parts.sum(axis=0)
    values = np.maximum(np.linalg.eigvalsh(total), 0.0)
    if not values.sum() > 0.0:
        return 0.0
    degrees = values.sum() ** 2 / (values**2).sum()
    shares = np.array([max(np.trace(part), 0.0) for part in parts])
    known = shares.sum() ** 2 / np.maximum((shares**2 / freedom).sum(), 1e-300)
    return float(np.sqrt(values.sum() * fisher.ppf(SHARE, degrees, known)))


def _short(value: float) -> str:
    return f"{value:.1f}" if value >= 1.0 else f"{value:.2g}"
