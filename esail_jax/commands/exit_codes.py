"""Exit codes of `esail`."""

import enum


class ExitCode(enum.IntEnum):
    """How a command ended."""

    DONE = 0
    BAD_INPUT = 2
    """The input was refused: one line on stderr, nothing written."""
    FAILED = 3
    """The solver failed; the file holds everything before the failure."""
    CLOSED_PIPE = 141
    """The reader of the output has ended, as in `esail scenes | head`: the code of a shell for SIGPIPE."""
    INTERRUPTED = 130
    """Ctrl-C or SIGTERM; `--resume` continues."""
