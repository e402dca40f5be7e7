"""Defaults of the instance segmentation, in a module without imports."""

LINK = 0.3  # [m] side of the cubes by which points of a class are connected by default
FEWEST = 20  # least number of points of an instance: smaller parts are mostly errors
