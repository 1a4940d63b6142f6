"""A worker process of `esail ensemble`. It computes pieces of the task in a folder until no piece is
left, a signal tells it to stop after its piece, or the process that started it has ended."""

import os
import sys
from pathlib import Path

from esail_jax.commands.command_line import ExitCode
from esail_jax.commands.ensemble_work import NO_SPACE, Work, end_process, wait_for
from esail_jax.commands.progress import Interrupts
from esail_jax.errors import NoSpaceError


def main() -> None:
    """Works on the folder that is the only argument."""
    parent = os.getppid()

    def end_with_parent() -> None:
        if os.getppid() != parent:
            end_process(ExitCode.INTERRUPTED)

    try:
        with Interrupts() as interrupts:
            wait_for(Work(Path(sys.argv[1]), lambda: interrupts.asked), each=end_with_parent)
    except NoSpaceError:
        end_process(NO_SPACE)


if __name__ == "__main__":
    main()
