"""What a world changes on the site: surfaces of its ground, and what is visible; never shapes or labels."""

from collections.abc import Mapping
from dataclasses import dataclass

from authoring.shapes.component import Component
from authoring.site.covers import cover_name
from authoring.site.photo import surface_of
from authoring.site.site import Site


@dataclass(frozen=True)
class SiteChanges:
    """What a world changes on one site.

    Attributes:
        surfaces: New surface by the name of a piece of ground.
        hidden: Invisible rows, by the name of a run of repeats; no rows: the whole run, or a mesh, is invisible.
    """

    surfaces: Mapping[str, str]
    hidden: Mapping[str, tuple[int, ...]]

    def names(self) -> tuple[str, ...]:
        """List the new surfaces, sorted."""
        return tuple(sorted(set(self.surfaces.values())))


NO_CHANGES = SiteChanges({}, {})


def changes_on(site: Site, surfaces: Mapping[str, str], hidden: Mapping[str, tuple[int, ...]]) -> SiteChanges:
    """Find the pieces of a site that a world changes.

    Args:
        site: The site.
        surfaces: Surface by the name of the cover; other covers keep theirs.
        hidden: As in `SiteChanges`; pieces that the site lacks do not matter.
    """
    ground = [piece for piece in site.pieces if isinstance(piece, Component) and piece.group == "Ground"]
    wanted = {piece.name: (surface_of(piece.role)[0], surfaces.get(cover_name(piece.name), "")) for piece in ground}
    changed = {name: new for name, (old, new) in wanted.items() if new not in ("", old)}
    present = {piece.name for piece in site.pieces}
    return SiteChanges(changed, {name: rows for name, rows in sorted(hidden.items()) if name in present})
