"""Defaults of the instance segmentation, in a module without imports."""

LINK = 0.3  # [m] side of the cubes by which points of a class are connected at least
FEWEST = 20  # least number of points of an instance: smaller parts are mostly errors


def least_link(voxel: float) -> float:
    """Return the side of the cubes for points that were thinned: points of neighboring cubes are up to two apart.

    Args:
        voxel: Side of the cubes of the thinning [m]; 0 without thinning.

    Returns:
        The side [m].
    """
    return max(LINK, 2.0 * voxel)
