"""Which points are one instance unless a user says otherwise: numbers alone, which cost nothing to import."""

LINK = 0.3  # [m] side of the cubes by which points of a class are connected by default
FEWEST = 20  # points without which a connected part is no instance: fewer are mostly single errors
