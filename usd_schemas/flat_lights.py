"""Lights of a flat scene."""

from dataclasses import dataclass

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class Sun:
    """A DistantLight.

    Attributes:
        direction: Unit vector from the scene towards the light [1], world axes.
        radiance: Linear irradiance of a surface that faces it [1].
        angle: Angular diameter [deg].
    """

    direction: tuple[float, float, float]
    radiance: tuple[float, float, float]
    angle: float = 0.53


@dataclass(frozen=True)
class Dome:
    """A DomeLight.

    Attributes:
        radiance: Linear color times intensity [1].
        file: Latitude-longitude texture, or empty.
        rotation: dome to world, shape (3, 3), row-major nested tuples [1].
    """

    radiance: tuple[float, float, float]
    file: str = ""
    rotation: tuple[tuple[float, float, float], ...] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True)
class SphereLight:
    """A SphereLight; or, with `sides`, a panel: a RectLight, or a DiskLight as a square of the same area.

    Attributes:
        position: Center in the world [m].
        radius: Radius [m]; 0 for a point; for a panel, that of a disc of the same area.
        intensity: Linear radiant intensity [m2]: radiance of its surface times pi times radius squared. At distance d
            from the center a facing surface receives intensity / d^2, in the same unit as `Sun.radiance`; for a panel
            this holds for a surface far away, straight in front of it.
        sides: From the center of a panel to the middles of two of its edges [m], world axes; it shines along the cross
            product of the second and the first. None for a sphere.
    """

    position: Triple
    radius: float
    intensity: Triple
    sides: tuple[Triple, Triple] | None = None
