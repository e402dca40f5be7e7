"""`python -m falsework` is the same as `falsework`."""

from falsework.cli import main

if __name__ == "__main__":
    main()
