"""What becomes of a point that was made: it stays, or why it does not."""

FATES = ("kept", "views", "reprojection", "deviation")
"""By number: it stays, or too few valid cameras saw it, it meets its keypoints badly, or it may be too far off."""
KEPT, FEW_VIEWS, REPROJECTION, DEVIATION = range(4)
