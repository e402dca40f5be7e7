"""Fate of a reconstructed point: kept, or the reason why it is removed."""

FATES = ("kept", "views", "reprojection", "deviation")
"""Fates by number: kept; seen by too few valid cameras; reprojection error too large; or position too uncertain."""
KEPT, FEW_VIEWS, REPROJECTION, DEVIATION = range(4)
