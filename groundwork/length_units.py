"""Units of length of coordinates that others measured.

Source: EPSG registry for the two feet.
"""

METERS: dict[str, float] = {
    "m": 1.0,
    "km": 1000.0,
    "cm": 0.01,
    "mm": 0.001,
    "ft": 0.3048,
    "us-ft": 1200.0 / 3937.0,
}
"""Length of each by its name in PROJ [m]."""
