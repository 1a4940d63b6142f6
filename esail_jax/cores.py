"""The cores of this machine, and how many runs share them.

XLA hands the loops of a program to as many threads as a process may use cores. Those of a sail take
microseconds: the baseline takes a tenth more time on two threads than on one, and nearly half as much again
of the cores. Beside another such process it takes twice as long as two processes of one thread each.
"""

import os

THREADS = "NPROC"
"""Environment variable from which XLA takes the number of threads, when JAX is first used."""


def cores() -> int:
    """Of this machine, as far as this process may use them."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def share_cores(processes: int | None) -> None:
    """Give this process, before it uses JAX, and those it starts their share of the cores in threads, of so
    many side by side (None: one per core). A number that is set already stays."""
    os.environ.setdefault(THREADS, str(max(1, cores() // (processes or cores()))))
