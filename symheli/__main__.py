"""`python -m symheli`: the command line."""

from __future__ import annotations

import sys
from importlib.metadata import entry_points


def main() -> int:
    """Run the installed command `symheli`; the exit status."""
    (command,) = set(entry_points(group="console_scripts", name="symheli"))
    return command.load()()


if __name__ == "__main__":
    sys.exit(main())
