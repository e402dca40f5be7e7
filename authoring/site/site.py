"""The site: the strip of ground that bridge and surveys depend on, with its crossing, fills, roads and plants."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from authoring.axis.alignment import Layout
from authoring.axis.clearance import refuse_hill
from authoring.shapes.component import FIRST_SITE_ID, Component, Mesh, Scatter
from authoring.site.covers import Soup, chunked, covered, drape, strip_atlas
from authoring.site.crossing import CrossingKind, told_crossings
from authoring.site.extent import Box, keep_out, strip_corners, strip_edge
from authoring.site.fences import BESIDE_ROADS, fence_offsets, fence_pieces, fenced
from authoring.site.fields import DRAWN_LAND, LandUse, draw_plots
from authoring.site.grid import HeightField
from authoring.site.guardrails import guardrail_pieces
from authoring.site.land import draw_land, strip_ground, strip_lines
from authoring.site.photo import PhotoSquare, by_square, photo_role, photo_squares
from authoring.site.river_piers import SHARE
from authoring.site.roads import way_pieces
from authoring.site.scatter import ScatterSettings, scatter_plants
from authoring.site.shape import Land
from authoring.streams import told_shares
from groundwork.settings import Settings

F64 = NDArray[np.float64]


LONG = 250.0  # [m] length of bridge from which on the fine mesh becomes coarser


class SiteSettings(Settings):
    """Appearance of the site."""

    crossing: CrossingKind | None = Field(
        default=None,
        description="What the bridge crosses; drawn by these weights among those that suit its longest span and "
        f"height: {told_crossings()}. The land rises towards the abutments of decks higher than 9 m",
    )
    river_piers: bool | None = Field(
        default=None,
        description="Make a river so wide that one pier, or two of a bridge of five spans or more, stand in the water, "
        f"where there is room; drawn {told_shares({True: SHARE, False: 1.0 - SHARE})}. Only for bridges of at least "
        "three spans of the families slab, beam and girder, not in profile `paper`; other rivers lie between supports",
    )
    land: LandUse | None = Field(
        default=None,
        description="Land use beside the bridge: fields with hedges, a common of long and short grass, or the paved "
        f"and grassed lots of a town; drawn {told_shares(DRAWN_LAND)}, always town beside a harbour. In the world "
        "`city`, fields and hay are lawns and paved lots",
    )
    fences: bool | None = Field(
        default=None,
        description="Fence both approaches off from the land, along the toes of their fills and up to the wing walls, "
        "or to the anchor blocks of a suspension bridge; "
        f"always along railways, drawn {told_shares(BESIDE_ROADS)} along roads, and none in a town",
    )
    half_width: float = Field(
        default=80.0, ge=40.0, le=200.0, description="Distance that the site reaches to each side of the axis [m]"
    )
    run_out: float = Field(
        default=60.0, ge=30.0, le=200.0, description="Distance that the site reaches beyond the abutments [m]"
    )
    fine_reach: float = Field(
        default=30.0, ge=5.0, le=60.0, description="Distance from the bridge that the fine ground mesh reaches [m]"
    )
    fine_spacing: float = Field(
        default=0.5,
        ge=0.2,
        le=2.0,
        description="Spacing of the fine ground mesh; larger for bridges longer than 250 m [m]",
    )
    coarse_spacing: float = Field(default=4.0, ge=0.5, le=8.0, description="Largest spacing of the ground mesh [m]")
    photo_reach: float = Field(
        default=30.0,
        ge=5.0,
        le=38.0,
        description="Distance from the bridge within which the ground has its own texture, 4 cm per texel [m]",
    )
    relief: float = Field(
        default=1.0, ge=0.0, le=1.5, description="Factor for the natural relief of the ground; 1 is about 0.5 m [1]"
    )
    scatter: ScatterSettings = Field(default_factory=ScatterSettings, description="Stones, shrubs and tufts")

    @model_validator(mode="after")
    def _values_that_have_an_effect(self) -> "SiteSettings":
        if self.river_piers and self.crossing not in (None, "river"):
            raise ValueError(
                f"river_piers has no effect, because crossing is {self.crossing!r}; "
                "allowed: crossing = 'river', or one of both left out"
            )
        if self.coarse_spacing < self.fine_spacing:
            raise ValueError(
                f"coarse_spacing {self.coarse_spacing:g} is less than fine_spacing {self.fine_spacing:g}; "
                f"allowed: coarse_spacing at least {self.fine_spacing:g} m here"
            )
        return self


@dataclass(frozen=True, eq=False, repr=False)
class Site:
    """The ground strip and everything on it.

    Attributes:
        land: The shape of the ground, on and beyond the strip.
        field: The ground of the strip before any bridge part.
        pieces: Its components and scatters, ids from `FIRST_SITE_ID`.
        extent: Corners of the strip in plan, counter-clockwise [m], shape (4, 2), float64.
        edge: Ground nodes along the strip's border, counter-clockwise from the first corner [m], shape (B, 3), float64.
        keep_out: Boxes that backgrounds leave empty.
        squares: Squares of ground near the bridge with separate images.
    """

    land: Land
    field: HeightField
    pieces: tuple[Component | Scatter, ...]
    extent: F64
    edge: F64
    keep_out: tuple[Box, ...]
    squares: tuple[PhotoSquare, ...] = ()

    @property
    def waterline(self) -> float | None:
        """Height of the river around the piers that stand in it [m]; None where none does."""
        return self.land.crossing.level if self.land.crossing.piers else None

    def ground(self, xy: F64) -> F64:
        """Find the height of the ground mesh; beyond the strip, the height of its edge.

        Args:
            xy: World positions in plan [m], shape (N, 2), float64.

        Returns:
            World heights [m], shape (N,), float64.
        """
        return self.field(*self.land.layout.alignment.locate(xy))


def draw_site(settings: SiteSettings, layout: Layout, rng: np.random.Generator) -> Site:
    """Draw a site for a bridge.

    Args:
        settings: Appearance of the site.
        layout: The bridge's axis, supports, width and depth.
        rng: Random stream `site`.

    Returns:
        The site.
    """
    land = draw_land(settings.crossing, settings.relief, layout, settings.run_out, rng, settings.river_piers)
    reach = (settings.run_out, settings.half_width)
    used = rng.spawn(1)[0]  # a separate stream: the use of the land changes nothing else
    land = replace(land, plots=draw_plots(settings.land, land.crossing.kind, layout, reach, used))
    if fenced(settings.fences, land, used.spawn(1)[0]):
        land = replace(land, fences=fence_offsets(replace(land, plots=None), reach))
    length = layout.supports[-1] - layout.supports[0]
    coarse = settings.coarse_spacing
    fine = (settings.fine_reach, min(settings.fine_spacing * max(length / LONG, 1.0), coarse), coarse)
    stations, lefts = strip_lines(land, settings.run_out, settings.half_width, fine)
    ground, soup = strip_ground(land, stations, lefts)
    _check_deck(layout, ground)
    ends = (land.approaches[0].back, land.approaches[1].back)
    squares = photo_squares(ground, layout.width / 2, ends, settings.photo_reach)
    parts = _ground(soup, ground, squares, layout)
    parts += [(prim, kind, role, "Ways", mesh) for prim, kind, role, mesh in way_pieces(land, ground)]
    parts += [(prim, kind, role, "Ways", mesh) for prim, kind, role, mesh in guardrail_pieces(land)]
    parts += [(prim, kind, role, "Ways", mesh) for prim, kind, role, mesh in fence_pieces(land, ground)]
    components = [
        Component(f"Site_{prim}", kind, role, group, mesh, FIRST_SITE_ID + number)
        for number, (prim, kind, role, group, mesh) in enumerate(parts)
    ]
    plants = scatter_plants(settings.scatter, land, ground, rng, FIRST_SITE_ID + len(components))
    axis = layout.alignment
    return Site(
        land,
        ground,
        (*components, *plants),
        strip_corners(axis, ground),
        strip_edge(axis, ground),
        (keep_out(axis, ground),),
        squares,
    )


def _ground(
    soup: Soup, field: HeightField, squares: tuple[PhotoSquare, ...], layout: Layout
) -> list[tuple[str, str, str, str, Mesh]]:
    """Cut the ground into pieces: name, component kind, material recipe, group and mesh of each."""
    parts = []
    for cover, whole in covered(soup):
        for square, piece in by_square(whole, squares):
            prim = cover.prim if square is None else f"{cover.prim}_Near{square.number}"
            role = cover.role if square is None else photo_role(cover.role, square)
            for name, chunk in chunked(prim, piece):
                atlas = strip_atlas(chunk, field) if square is None else square.atlas(chunk)
                parts.append((name, cover.kind, role, "Ground", drape(chunk, layout.alignment, atlas)))
    return parts


def _check_deck(layout: Layout, ground: HeightField) -> None:
    """Refuse ground that reaches the road between the abutments."""
    inside = (ground.stations > layout.supports[0] + 1.0) & (ground.stations < layout.supports[-1] - 1.0)
    under = np.abs(ground.lefts) < layout.width / 2
    refuse_hill(layout, ground.stations[inside], ground.lefts[under], ground.heights[np.ix_(inside, under)])
