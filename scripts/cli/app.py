"""`baryscope`: the subcommands put together, and how errors reach the user."""

import ast
import os
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Literal, TextIO, get_args, get_origin

from cyclopts import App, Argument, CoercionError, CycloptsError, MissingArgumentError, Token, UnusedCliTokensError

from baryscope import __version__
from baryscope.models.errors import ComputationError, InputError
from baryscope.scripts.cli.ending import Ending, ending_by_signal
from baryscope.streams import drop_output, prepare_streams

BAD_INPUT, FAILED, INTERRUPTED = 2, 1, 130
STOPPED = "interrupted; files that were not finished are not there"

# Module and function of each command, imported when it is run or described: all of them together need every library.
COMMANDS = {
    "compare": "compare:compare",
    "build": "build:build",
    "check": "check:check",
    "system": "system:system",
    "fly": "fly:fly",
    "simulate": "simulate:simulate_scenario",
    "track": "track:track_images",
    "estimate": "estimate:estimate_file",
    "joint": "joint:find_joint",
    "campaign": "campaign:campaign",
    "bound": "bound:bound",
    "figures": "figures:figures",
    "scenarios": "scenarios:scenarios",
}


def _app(*, listing: bool = False) -> App:
    """All commands; for their list with what each does, which none of them has to be imported for."""
    made = App(
        name="baryscope",
        help="Find the centre of mass of a tumbling object from the tracks of features on its surface.\n\n"
        "Exit codes: 0 done, 1 cannot be computed, 2 wrong input, 3 files are written but the estimate is not to be "
        "trusted, 130 interrupted, 143 terminated. Errors are one line on standard error.",
        version=__version__,
        exit_on_error=False,
        print_error=False,
        result_action="return_value",
        suppress_keyboard_interrupt=False,
    )
    made.register_install_completion_command()
    for name, place in COMMANDS.items():
        made.command(f"{__package__}.{place}", name=name, help=_purpose(place) if listing else None)
    return made


def _purpose(place: str) -> str:
    """The first paragraph of a command's docstring, read from its source; that of an app is its default's."""
    module, _, command = place.partition(":")
    body = ast.parse(Path(__file__).with_name(f"{module}.py").read_bytes()).body
    (text,) = (
        ast.get_docstring(node) or ""
        for node in body
        if isinstance(node, ast.FunctionDef)
        and command in {node.name, *(ast.unparse(one).removesuffix(".default") for one in node.decorator_list)}
    )
    return text.partition("\n\n")[0]


app = _app()


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; errors are one line on standard error.

    Returns:
        0 when done, 1 for what could not be computed, 2 for bad input, 3 where files were written but the result must
        not be trusted, 130 when interrupted, 143 when terminated.
    """
    warnings.showwarning = _show_warning
    prepare_streams()
    with ending_by_signal() as ending:
        code = _run(sys.argv[1:] if arguments is None else list(arguments), ending)
    return ending.code or code if code == INTERRUPTED else code


def _run(arguments: list[str], ending: Ending) -> int:
    """Run a command; its exit code."""
    try:
        code = (_app(listing=True) if arguments[:1] in ([], ["-h"], ["--help"]) else app)(arguments)
        sys.stdout.flush()
    except CycloptsError as error:
        return _complain(_words(error), BAD_INPUT)
    except InputError as error:
        return _complain(error, BAD_INPUT)
    except ComputationError as error:
        return _complain(error, FAILED)
    except KeyboardInterrupt as interrupt:
        return _complain(interrupt if interrupt.args else STOPPED, INTERRUPTED)
    except BrokenPipeError:  # the reader of our output has gone; it has seen what it wanted
        drop_output()
        return FAILED
    except OSError as error:
        if error.filename is not None:
            return _complain(f"{error.filename}: {error.strerror}", FAILED)
        if isinstance(error, FileNotFoundError):
            return _complain("the current folder: is not there any more, expected one that is", FAILED)
        drop_output()  # files have names
        return _complain(f"standard output: cannot be written ({error.strerror or error})", FAILED)
    except Exception as error:
        if ending.number is not None:  # a library has made this of the interrupt
            return _complain(STOPPED, INTERRUPTED)
        if os.environ.get("BARYSCOPE_DEBUG"):
            raise
        return _complain(f"internal error, {type(error).__name__}: {error} (BARYSCOPE_DEBUG=1 shows where)", FAILED)
    return code if isinstance(code, int) else 0


def _words(error: CycloptsError) -> str:
    """What is wrong with the arguments, in our words where those of cyclopts speak of Python or tell too little."""
    command = " ".join(error.command_chain or ())
    match error:
        case MissingArgumentError(argument=Argument() as argument, keyword=None) if not error.unused_tokens:
            return f"{command}: {argument.name} is missing, expected this argument"
        case UnusedCliTokensError(unused_tokens=[first, *_]):
            return f"{command}: found {first!r} too many, expected quotes around names with blanks, commas within lists"
        case CoercionError(token=Token(keyword=str() as option, value=found), target_type=kind) if _is_number(kind):
            words = [f"{word}," for other in get_args(kind) if get_origin(other) is Literal for word in get_args(other)]
            number = "a whole number" if kind in (int, int | None) else "a number"
            return f"{option}: found {found!r}, expected {' '.join([*words, 'or ' * bool(words) + number])}"
    return str(error)


def _is_number(kind: object) -> bool:
    return bool({int, float} & {kind, *get_args(kind)})


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
