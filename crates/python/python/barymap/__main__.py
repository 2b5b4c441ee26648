"""``python -m barymap`` is the command line."""

from __future__ import annotations

import os
import sys


def main() -> int:
    """Runs the command line with the arguments of the process; returns its exit code."""
    if sys.platform.startswith("linux"):
        # Without it drivers that look for a display print a line for each try.
        os.environ.setdefault("XDG_RUNTIME_DIR", "/nonexistent")
    from ._barymap import program

    return program(["barymap", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
