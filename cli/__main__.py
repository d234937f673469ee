"""Runs the program: ``python -m closedrooms.cli``."""

import sys

from closedrooms.cli.commands import main

if __name__ == "__main__":
    sys.exit(main())
