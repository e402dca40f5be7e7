"""What a figure of a planned flight is worth: the limits that the command line and the page judge by."""

ENOUGH_OVERLAP = 0.7  # of an image with the next: photogrammetrists ask for 70 to 80 % along a strip
ENOUGH_LINKED = 0.9  # of the images; the limit of the warning, too
WELL, PARTLY = 0.5, 0.25  # of a surface, faces that nothing can see among it: no member reaches all of it


def judged(share: float, enough: float) -> str:
    """Say whether a share is enough, and from where on it is.

    Args:
        share: What was found [1].
        enough: What is wanted [1].
    """
    return f"{'enough' if share >= enough else 'too little'} (from {100.0 * enough:.0f} %)"


def coverage_word(share: float) -> str:
    """Say how well a class is covered: well, partly or poorly.

    Args:
        share: Share of its surface that three cameras see at 60 degrees or less [1].
    """
    return "well" if share >= WELL else "partly" if share >= PARTLY else "poorly"
