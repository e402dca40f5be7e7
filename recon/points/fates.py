"""Fate of a reconstructed point: kept, or the reason why it is removed."""

FATES = ("kept", "views", "reprojection", "deviation")
"""By number: it stays, or too few valid cameras saw it, it meets its keypoints badly, or it may be too far off."""
KEPT, FEW_VIEWS, REPROJECTION, DEVIATION = range(4)
