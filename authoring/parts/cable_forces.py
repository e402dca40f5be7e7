"""Loads of decks that hang from cables, and the diameters of main cables, hangers and stays that carry them.

Source: working stresses by common practice for cables of parallel wires (main cables 600 to 800 MPa), for ropes (a
third of their strength) and for stays (0.45 of 1770 MPa, as PTI and Eurocode 3 part 1-11 allow).
"""

from dataclasses import dataclass

import numpy as np

_CONCRETE = 25.0  # [kN/m3] slab and surfacing
_STEEL, _TRAFFIC = 3.0, 3.5  # [kN/m2] girders and parapets; a queue of vehicles
_CABLE_STEEL = 78.5  # [kN/m3]
_MAIN_STRESS, _HANGER_STRESS, _STAY_STRESS = 680e3, 600e3, 795e3  # [kN/m2] under dead load and traffic
_MAIN_FILL, _HANGER_FILL, _STAY_FILL = 0.80, 0.62, 0.55  # steel in the round section [1]; a stay's has a sheath
_STEP = 0.005  # [m] diameters are rounded up to it


@dataclass(frozen=True)
class MainCable:
    """One of two main cables.

    Attributes:
        pull: Horizontal force [kN].
        diameter: Over the wrapping [m].
    """

    pull: float
    diameter: float


def deck_load(width: float, slab: float, surfacing: float) -> float:
    """Estimate the weight of a deck with a queue of vehicles on it [kN/m].

    Args:
        width: Overall [m].
        slab: Thickness of the slab [m].
        surfacing: Thickness of the surfacing, or of the track bed [m].
    """
    return width * (_CONCRETE * (slab + surfacing) + _STEEL + _TRAFFIC)


def main_cable(load: float, span: float, sag: float, slope: float, least: float) -> MainCable:
    """Size a main cable for its tension at the towers; its own weight counts.

    The horizontal force of a parabola is H = w L^2 / (8 f), its tension where the slope is s is H sqrt(1 + s^2).

    Args:
        load: Weight and traffic that it carries [kN/m].
        span: Main span [m].
        sag: In the middle of the main span [m].
        slope: Steepest slope of the cable in both spans [1].
        least: Least diameter [m].
    """
    reach = span**2 / (8.0 * sag)  # [m] horizontal force over load
    steep = float(np.hypot(1.0, slope))
    area = load * reach * steep / (_MAIN_STRESS - _CABLE_STEEL * reach * steep)
    diameter = max(least, _rounded(area / _MAIN_FILL))
    own = _CABLE_STEEL * _MAIN_FILL * 0.25 * np.pi * diameter**2
    return MainCable(round(float((load + own) * reach), 1), diameter)


def hanger_diameter(load: float, pitch: float) -> float:
    """Size a hanger [m].

    Args:
        load: Weight and traffic that its plane carries [kN/m].
        pitch: Distance between hangers [m].
    """
    return _rounded(load * pitch / (_HANGER_STRESS * _HANGER_FILL))


def stay_diameter(load: float, pitch: float, slope: float) -> float:
    """Size a stay with its sheath [m].

    Args:
        load: Weight and traffic that its plane carries [kN/m].
        pitch: Length of deck that it carries [m].
        slope: Rise over run of the stay [1].
    """
    tension = load * pitch * float(np.hypot(1.0, slope)) / slope
    return _rounded(tension / (_STAY_STRESS * _STAY_FILL))


def _rounded(section: float) -> float:
    """Find the diameter of a round section [m2], rounded up [m]."""
    steps = np.ceil(np.sqrt(4.0 * section / np.pi) / _STEP - 1e-9)
    return round(float(steps) * _STEP, 3)
