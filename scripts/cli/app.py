"""`baryscope`: the subcommands put together, and how errors reach the user."""

import os
import sys
import warnings
from collections.abc import Sequence
from typing import TextIO

from cyclopts import App, CycloptsError

from baryscope import __version__
from baryscope.models.errors import ComputationError, InputError
from baryscope.scripts.cli.bound import bound
from baryscope.scripts.cli.build import build
from baryscope.scripts.cli.campaign import campaign
from baryscope.scripts.cli.check import check
from baryscope.scripts.cli.compare import compare
from baryscope.scripts.cli.estimate import estimate_file
from baryscope.scripts.cli.figures import figures
from baryscope.scripts.cli.fly import fly
from baryscope.scripts.cli.joint import find_joint
from baryscope.scripts.cli.scenarios import scenarios
from baryscope.scripts.cli.simulate import simulate_scenario
from baryscope.scripts.cli.system import system
from baryscope.scripts.cli.track import track_images

BAD_INPUT, FAILED, INTERRUPTED = 2, 1, 130

app = App(
    name="baryscope",
    help="Find the centre of mass of a tumbling object from the tracks of features on its surface.\n\n"
    "Exit codes: 0 done, 1 cannot be computed, 2 wrong input, 3 files are written but the estimate is not to be "
    "trusted, 130 interrupted. Errors are one line on standard error.",
    version=__version__,
    exit_on_error=False,
    print_error=False,
    result_action="return_value",
    suppress_keyboard_interrupt=False,
)
app.register_install_completion_command()
app.command(compare)
app.command(build)
app.command(check)
app.command(system)
app.command(fly)
app.command(simulate_scenario, name="simulate")
app.command(track_images, name="track")
app.command(estimate_file, name="estimate")
app.command(find_joint, name="joint")
app.command(campaign)
app.command(bound)
app.command(figures)
app.command(scenarios)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; errors are one line on standard error.

    Returns:
        0 when done, 1 for what could not be computed, 2 for bad input, 3 where files were written but the result must
        not be trusted, 130 when interrupted.
    """
    warnings.showwarning = _show_warning
    try:
        code = app(arguments)
        sys.stdout.flush()
    except (InputError, CycloptsError) as error:
        return _complain(error, BAD_INPUT)
    except ComputationError as error:
        return _complain(error, FAILED)
    except KeyboardInterrupt as interrupt:
        usual = "interrupted; files that were not finished are not there"
        return _complain(interrupt if interrupt.args else usual, INTERRUPTED)
    except BrokenPipeError:  # the reader of our output has gone; it has seen what it wanted
        _drop_output()
        return FAILED
    except OSError as error:
        if error.filename is not None:
            return _complain(f"{error.filename}: {error.strerror}", FAILED)
        _drop_output()  # files have names
        return _complain(f"standard output: cannot be written ({error.strerror or error})", FAILED)
    except Exception as error:
        if os.environ.get("BARYSCOPE_DEBUG"):
            raise
        return _complain(f"internal error, {type(error).__name__}: {error} (BARYSCOPE_DEBUG=1 shows where)", FAILED)
    return code if isinstance(code, int) else 0


def _drop_output() -> None:
    """What is still to be printed goes nowhere."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _complain(error: object, code: int) -> int:
    print(f"baryscope: {' '.join(str(error).split())}", file=sys.stderr)
    return code


def _show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    """In the place of Python's own, which shows file and source line."""
    print(f"baryscope: warning: {' '.join(str(message).split())}", file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
