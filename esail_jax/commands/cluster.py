"""A process of `esail ensemble --distributed`: one of many that a cluster has started."""

import jax

from esail_jax.commands.options import UsageError


def join_cluster(coordinator: str | None, processes: int | None, process: int | None) -> None:
    """Makes this process one of many. JAX recognises SLURM, Open MPI and Kubernetes by itself.

    coordinator: address of process 0, with a port; processes: their number; process: the number of this
    one. Raises UsageError if the others are not found."""
    try:
        jax.distributed.initialize(coordinator, processes, process)
    except (ValueError, RuntimeError) as error:
        raise UsageError(f"`--distributed` must find the other processes, but does not: {error}") from None
