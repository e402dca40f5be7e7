"""The chunks of a PNG file: a decoder sets memory aside for each before it reads it."""

SIGNATURE = b"\x89PNG\r\n\x1a\n"
_AROUND = 12  # bytes of a chunk beside its data: length, kind, check sum


def is_whole_png(data: bytes) -> bool:
    """Tell whether every chunk of a PNG lies within the file, up to the chunk that ends it.

    OpenCV sets aside, and clears, as many bytes as a chunk states: one flipped byte in a file of 1 kB costs 4 GB and
    seconds. Behind the end chunk anything may follow.

    Args:
        data: The file's bytes.

    Returns:
        False also for a file that is no PNG.

    Source: PNG, W3C Recommendation, 3rd edition, section 5.3.
    """
    place = len(SIGNATURE)
    while data.startswith(SIGNATURE) and place + _AROUND <= len(data):
        behind = place + _AROUND + int.from_bytes(data[place : place + 4])
        if behind > len(data):
            return False
        if data[place + 4 : place + 8] == b"IEND":
            return True
        place = behind
    return False
