"""Limits by which the command line and the page rate a planned flight."""

ENOUGH_OVERLAP = 0.7  # overlap of consecutive images: photogrammetry recommends 70 to 80 % along a strip
ENOUGH_LINKED = 0.9  # share of registered images; also the limit of the warning
WELL, PARTLY = 0.5, 0.25  # coverage of a surface, hidden faces included: no member reaches 100 %


def judged(share: float, enough: float) -> str:
    """Rate a share against a limit, in words.

    Args:
        share: The share [1].
        enough: The limit [1].
    """
    return f"{'enough' if share >= enough else 'too little'} (from {100.0 * enough:.0f} %)"


def coverage_word(share: float) -> str:
    """Rate the coverage of a class: well, partly or poorly.

    Args:
        share: Share of its surface that three cameras see at 60 degrees or less [1].
    """
    return "well" if share >= WELL else "partly" if share >= PARTLY else "poorly"
