"""`python -m baryscope` is the command `baryscope`."""

import sys


def run() -> int:
    """Run the command line; an interrupt while it is loaded is one line, too.

    Returns:
        The exit code.
    """
    try:
        from baryscope.scripts.cli.app import main
    except KeyboardInterrupt:
        print("baryscope: interrupted", file=sys.stderr)
        return 130
    return main()


if __name__ == "__main__":
    sys.exit(run())
