"""A worker process of `esail ensemble`. It computes pieces of the task in a folder until no piece is
left, a signal tells it to stop, or the process that started it has ended."""

import os
import sys
from pathlib import Path

from esail_jax.commands.ensemble import work
from esail_jax.commands.interrupts import Interrupts


def main() -> None:
    """Works on the folder that is the only argument."""
    parent = os.getppid()
    with Interrupts() as interrupts:
        work(Path(sys.argv[1]), lambda: interrupts.asked or os.getppid() != parent)


if __name__ == "__main__":
    main()
