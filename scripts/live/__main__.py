"""`python -m baryscope.live FILE.html` writes the page in which the units run in a browser."""

import argparse
import sys
from pathlib import Path

from baryscope.live.page import write_live_page
from baryscope.models.errors import ComputationError, InputError


def main(arguments: list[str] | None = None) -> int:
    """The command: 0 if the page is written."""
    parser = argparse.ArgumentParser(prog="python -m baryscope.live", description=__doc__)
    parser.add_argument("file", type=Path, metavar="FILE.html", help="the page to write")
    options = parser.parse_args(arguments)
    try:
        path = write_live_page(options.file, lambda unit: print(f"compiling {unit} to WebAssembly"))
    except (InputError, ComputationError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2 if isinstance(error, InputError) else 1
    print(f"{path}: {path.stat().st_size / 1000:.0f} kB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
