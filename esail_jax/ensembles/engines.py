"""Engines: what computes the members of an ensemble. An engine is opened only when there is something to
compute, and gives an executor."""

import contextlib
import json
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path

import jax

from esail_jax.cores import cores
from esail_jax.ensembles.processes import ProcessExecutor
from esail_jax.errors import InputError

Engine = Callable[[], AbstractContextManager[Executor]]
"""Opens an engine."""

NAMES = "local, dask:ADDRESS or mpi"
"""How engines are named on the command line."""

CONNECT_SECONDS = 20.0
"""Longest wait for a scheduler of Dask [s]."""


def engine_of(name: str, processes: int | None = None) -> Engine:
    """The engine of a name. processes: of this machine, for `local`. Raises InputError."""
    kind, _, address = name.partition(":")
    if name == "local":
        return partial(local, processes)
    if processes is not None:
        raise InputError(f"`--processes` must come with `--engine local`, but comes with {name}")
    if kind == "dask" and address:
        return partial(dask, address)
    if name == "mpi":
        check_mpi()
        return mpi
    raise InputError(f"`--engine` must be {NAMES}, but is {name!r}")


@contextlib.contextmanager
def local(processes: int | None = None) -> Iterator[Executor]:
    """Processes of this machine, each with one thread; a thread of this process if there is to be one only.
    They end with this process.

    processes: their number; None is one per core, or one in all if JAX's devices are no CPUs."""
    if processes is None:
        processes = cores() if jax.default_backend() == "cpu" else 1
    if processes == 1:
        thread = ThreadPoolExecutor(1)
        try:
            yield thread
        finally:
            thread.shutdown(wait=False, cancel_futures=True)
        return
    executor = ProcessExecutor(processes)
    try:
        yield executor
    finally:
        executor.kill()


@contextlib.contextmanager
def dask(address: str) -> Iterator[Executor]:
    """The workers of a Dask cluster. address: of its scheduler, or the path of a scheduler file."""
    try:
        from distributed import Client
    except ImportError:
        raise missing("dask:ADDRESS", "distributed", "dask") from None
    try:
        client = Client(address_of(address), timeout=CONNECT_SECONDS)
    except (OSError, ValueError) as error:
        reason = f"{address} is none: {error}"
        raise InputError(f"`--engine` must name a scheduler of Dask, but {reason}") from None
    with client:
        yield client.get_executor()


def address_of(place: str) -> str:
    """The address of a scheduler, from its file if the place ends in `.json`; a scheduler that has just
    been started writes it after a while. Raises OSError and ValueError."""
    if not place.endswith(".json"):
        return place
    path, end = Path(place), time.monotonic() + CONNECT_SECONDS
    while not path.exists() and time.monotonic() < end:
        time.sleep(0.1)
    found = json.loads(path.read_text())
    if not isinstance(found, dict) or "address" not in found:
        raise ValueError("it has no address")
    return found["address"]


@contextlib.contextmanager
def mpi() -> Iterator[Executor]:
    """The other ranks of an MPI job, which waits for work in `python -m mpi4py.futures`."""
    try:
        from mpi4py.futures import MPIPoolExecutor
    except ImportError:
        raise missing("mpi", "mpi4py", "mpi") from None
    with MPIPoolExecutor() as executor:
        yield executor


def check_mpi() -> None:
    """Raises InputError unless other ranks wait for work: they do so only in mpi4py's own module."""
    ranks = 1
    if "mpi4py.futures" in sys.orig_argv:
        from mpi4py import MPI

        ranks = MPI.COMM_WORLD.size
    if ranks < 2:
        must = "be started by `mpiexec -n P python -m mpi4py.futures -m esail_jax ensemble ...` with P > 1"
        raise InputError(f"`--engine` mpi must {must}, but is not")


def missing(engine: str, library: str, extra: str) -> InputError:
    """The error for an engine whose library is not installed."""
    install = f"pip install 'esail_jax[{extra}]'"
    return InputError(f"`--engine` {engine} must find {library}, but it is not installed: {install}")
