"""What COLMAP says: nothing but fatal errors, and no files."""

import pycolmap

_FATAL = 3  # glog's level for fatal errors only


def silence() -> None:
    """Keep COLMAP from printing, and from leaving log files in the folder for temporary files.

    Without this each process that adjusts a bundle leaves a file there, with the names of user and computer.
    """
    pycolmap.logging.minloglevel = _FATAL
    for level in pycolmap.logging.Level.__members__.values():
        pycolmap.logging.set_log_destination(level, "")
