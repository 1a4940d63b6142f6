"""The command `esail`: its parser, of which every command adds its part (`commands/`), and how it ends.
Errors are one line on stderr."""

import contextlib
import os
import select
import signal
import sys
import threading

from esail_jax.commands import (
    animate,
    bench,
    cache,
    completion,
    design,
    ensemble,
    export,
    fit,
    info,
    init,
    modes,
    plot,
    run,
    scenes,
    view,
)
from esail_jax.commands.command_line import ExitCode, Parser, ShowVersion, UsageError, in_options
from esail_jax.errors import InputError, NoSpaceError, SimulationError, sentence_of

COMMANDS = {
    "run": run,
    "scenes": scenes,
    "init": init,
    "info": info,
    "plot": plot,
    "export": export,
    "animate": animate,
    "view": view,
    "modes": modes,
    "design": design,
    "fit": fit,
    "ensemble": ensemble,
    "bench": bench,
    "cache": cache,
    "completion": completion,
}
"""The commands in the order of the help: modules with `add`, which adds the command to the parser, and
`run`."""


def parser() -> Parser:
    """The parser of the command line."""
    top = Parser(
        prog="esail",
        description="Simulates electric solar-wind sails and tethered satellites.",
        epilog="Exit codes: 0 done; 2 bad input (one line on stderr, nothing written); 3 the solver failed "
        "(the file holds everything before the failure); 130 interrupted (--resume continues); "
        "141 the reader of the output has ended.",
        allow_abbrev=False,
    )
    top.add_argument("--version", action=ShowVersion, nargs=0, help="show the version and exit")
    top.set_defaults(parser=top)
    commands = top.add_subparsers(dest="command", metavar="COMMAND")
    for command in COMMANDS.values():
        command.add(commands)
    return top


def complain(error: Exception | str) -> None:
    """Prints an error as one line on stderr."""
    print(" ".join(str(error).split()), file=sys.stderr)


def main(arguments: list[str] | None = None) -> ExitCode:
    """Runs a command line (None: that of the process). Returns the exit code. If the reader of the output
    has ended, so does the command, without a word."""
    try:
        try:
            return run_command(arguments)
        finally:
            sys.stdout.flush()
    except BrokenPipeError:
        with contextlib.suppress(OSError, ValueError):  # a stream that is no file
            # What is still in the buffer would fail again at the end of the process.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return ExitCode.CLOSED_PIPE
    except OSError as error:  # the rest of the output could not be written
        complain(error)
        return ExitCode.BAD_INPUT


def reader_has_ended() -> bool:
    """Tells whether the output goes to a pipe that nobody reads any more. Pipes of an ensemble between its
    processes may break, too."""
    if not hasattr(select, "poll"):
        return True
    poll = select.poll()
    poll.register(sys.stdout.fileno(), select.POLLOUT)
    return any(state & select.POLLERR for _, state in poll.poll(0))


def run_command(arguments: list[str] | None) -> ExitCode:
    """Runs a command line; errors are one line on stderr. Returns the exit code. Raises BrokenPipeError if
    the reader of the output has ended."""
    try:
        options = parser().parse_args(arguments)
        if options.command is None:
            raise UsageError("esail: COMMAND must be given (`esail --help` shows what there is)")
    except UsageError as error:
        complain(error)
        return ExitCode.BAD_INPUT
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        return COMMANDS[options.command].run(options)
    except NoSpaceError as error:
        if "resume" not in options:
            complain(error)
            return ExitCode.BAD_INPUT
        complain(f"{error}; make room and use --resume")
        return ExitCode.INTERRUPTED
    except (InputError, OSError) as error:
        if isinstance(error, BrokenPipeError) and reader_has_ended():
            raise
        complain(sentence_of(error) if isinstance(error, OSError) else in_options(error))
        return ExitCode.BAD_INPUT
    except SimulationError as error:
        complain(error)
        return ExitCode.FAILED
    except KeyboardInterrupt:
        return ExitCode.INTERRUPTED


if __name__ == "__main__":
    sys.exit(main())
