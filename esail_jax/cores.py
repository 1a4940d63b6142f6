"""Number of processor cores and of threads per process.

XLA distributes the loops of a program over as many threads as the process may use cores. The loops of a
sail take microseconds, too little for several threads: with two threads the baseline takes 10 % more time
than with one, and nearly 50 % more processor time. Two such processes side by side take twice as long as
two processes with one thread each.
"""

import os
import platform
from pathlib import Path

PROCESSOR = Path("/proc/cpuinfo")
"""Linux describes the processor here, one property a line."""

THREADS = "NPROC"
"""Environment variable from which XLA reads its number of threads when JAX is first used."""


def cores() -> int:
    """The number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def processor(*names: str) -> str:
    """A property of the processor as Linux lists it, for example `model name`: the first of these
    names that is listed. Other systems give the name of the processor."""
    try:
        lines = PROCESSOR.read_text().splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    values = (line.partition(":")[2].strip() for name in names for line in lines if line.startswith(name))
    return next(values, platform.processor() or platform.machine())


def one_thread() -> None:
    """Limits JAX to one thread in this process, and in those that it starts, unless the environment already
    sets a number. Call it before JAX is used."""
    os.environ.setdefault(THREADS, "1")
