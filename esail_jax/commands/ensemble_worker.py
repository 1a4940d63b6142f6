"""A process that `esail ensemble` starts: works on the task of the folder it is given, until that is done,
it is told to stop, or the process that started it is gone."""

import os
import sys
from pathlib import Path

from esail_jax.commands.ensemble import work
from esail_jax.commands.run import Interrupts


def main() -> None:
    """The folder is the only argument."""
    parent = os.getppid()
    with Interrupts() as interrupts:
        work(Path(sys.argv[1]), lambda: interrupts.asked or os.getppid() != parent)


if __name__ == "__main__":
    main()
