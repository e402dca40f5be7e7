"""What a city's ground is made of, where open country has soil, gravel, fields and wild grass."""

import numpy as np

from authoring.backgrounds.river_quays import has_quays
from authoring.backgrounds.site_changes import SiteChanges, changes_on
from authoring.shapes.component import Scatter
from authoring.site.land import no_hills
from authoring.site.scatter import SHRUBS
from authoring.site.shape import Land
from authoring.site.site import Site
from authoring.streams import weighted_choice

_WILD = ("Site_Tufts", "Site_Stones")  # repeats that a city mows or clears
_SHRUBS, _REEDS = "Site_Shrubs", "Site_Reeds"
_PLANTED = "lime"  # the shrubs that a city plants; scrub and willows are cleared
_PLOTS = {  # surfaces of the plots of a site by their cover, with weights
    "ploughed": {"asphalt": 0.6, "pavement": 0.4},
    "crop": {"grass": 0.6, "asphalt": 0.4},
    "ripe": {"pavement": 0.6, "asphalt": 0.4},
    "hay": {"grass": 0.4, "pavement": 0.3, "asphalt": 0.3},
}
_PAVED = ("pavement", "asphalt")
_BUSH = 0.25  # from a paved plot to the middle of a shrub [m]; beyond 0.3, a cover's field is no distance


def city_surfaces(land: Land) -> dict[str, str]:
    """Choose the surface of covers: mown grass, flags, and pitched stone on banks between quays.

    Tracks keep their gravel, and the sides of valleys their soil.

    Args:
        land: The land, on a site or beyond it.

    Returns:
        Surface by the name of the cover; other covers keep theirs.
    """
    surfaces = {"patch": "grass"}
    if land.crossing.kind == "road":
        surfaces["verge"] = "pavement"
    if land.layout.carriageway > 0.0:
        surfaces["shoulder"] = "pavement"
    if land.valley is None and land.crossing.kind != "rail":
        surfaces["worn"] = "pavement"
    if has_quays(land):
        surfaces |= {"shore": "masonry", "bank": "masonry"}
    return surfaces


def change_site(site: Site, rng: np.random.Generator) -> SiteChanges:
    """Choose what a city changes on the site: lawns and paved lots for fields, planted shrubs alone.

    Args:
        site: The site.
        rng: Random stream.
    """
    plots = {cover: weighted_choice(weights, rng.random()) for cover, weights in _PLOTS.items()}
    hidden: dict[str, tuple[int, ...]] = dict.fromkeys(_WILD, ())
    if has_quays(site.land):
        hidden[_REEDS] = ()
    rows = _unplanted(site, tuple(cover for cover, surface in plots.items() if surface in _PAVED))
    if rows:
        hidden[_SHRUBS] = rows
    return changes_on(site, city_surfaces(site.land) | plots, hidden)


def _unplanted(site: Site, paved: tuple[str, ...]) -> tuple[int, ...]:
    """Find the rows of shrubs that grew wild, or stand on paved plots."""
    shrubs = [piece for piece in site.pieces if isinstance(piece, Scatter) and piece.name == _SHRUBS]
    if not shrubs:
        return ()
    covers = site.land.shape(*site.land.layout.alignment.locate(shrubs[0].positions), no_hills).covers
    lost = shrubs[0].prototype % len(SHRUBS) != SHRUBS.index(_PLANTED)
    for cover in paved:
        if cover in covers:
            lost |= covers[cover] > -_BUSH
    return tuple(np.flatnonzero(lost).tolist())
