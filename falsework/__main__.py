"""`falsework` and `python -m falsework`."""

import sys

from falsework.stops import INTERRUPTED, INTERRUPTED_LINE, catch_stops


def main() -> None:
    """Run the command line and exit with its code; signals are caught before its imports, which take a while."""
    catch_stops()
    try:
        from falsework.cli import main as run

        run()
    except KeyboardInterrupt:  # before the command line began
        sys.stderr.write(INTERRUPTED_LINE)
        sys.exit(INTERRUPTED)


if __name__ == "__main__":
    main()
