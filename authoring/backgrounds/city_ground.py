"""What a city's ground is made of, where open country has soil, gravel, fields and wild grass."""

import numpy as np

from authoring.backgrounds.river_quays import has_quays
from authoring.backgrounds.site_changes import SiteChanges, changes_on
from authoring.backgrounds.site_lots import covered_by, find_lots
from authoring.shapes.component import Scatter
from authoring.site.scatter import SHRUBS
from authoring.site.shape import Land
from authoring.site.site import Site

_WILD = ("Site_Tufts", "Site_Fringes", "Site_Stones")  # repeats that a city mows or clears
_SHRUBS, _HEDGES, _REEDS = "Site_Shrubs", "Site_Hedges", "Site_Reeds"
_FENCES = "Site_Fence_"  # prefix of the names of fences
_PLANTED = "lime"  # the shrubs that a city plants; scrub and willows are cleared
# Plots, whose borders curve like those of fields, become lawns: paved areas of a city have straight kerbs
# (`site_lots.py`).
_PLOTS = dict.fromkeys(("ploughed", "crop", "ripe", "hay", "lot_asphalt", "lot_paved", "lot_gravel"), "grass")


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
    """Choose what a city changes on the site: lawns for fields, no fences, only planted shrubs, none on car parks.

    Args:
        site: The site.
        rng: Random stream; not used, because the background must find the same car parks.
    """
    hidden: dict[str, tuple[int, ...]] = dict.fromkeys(_WILD, ())
    hidden |= {piece.name: () for piece in site.pieces if piece.name.startswith(_FENCES)}
    if has_quays(site.land):
        hidden[_REEDS] = ()
    lots = find_lots(site)
    for piece in site.pieces:
        if isinstance(piece, Scatter) and piece.name in (_SHRUBS, _HEDGES):
            lost = covered_by(lots, piece.positions[:, :2])
            if piece.name == _SHRUBS:
                lost |= piece.prototype % len(SHRUBS) != SHRUBS.index(_PLANTED)
            rows = tuple(np.flatnonzero(lost).tolist())
            if rows:
                hidden[piece.name] = rows
    return changes_on(site, city_surfaces(site.land) | _PLOTS, hidden)
