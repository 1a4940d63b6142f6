"""Number of members that one call of a program computes."""

from collections.abc import Callable

import jax
import numpy as np

from esail_jax.compilation.options import COMPILER_OPTIONS, compiled

HOST_BYTES = 2**28
"""Memory for the results of one call on a CPU [B]."""

MEMBERS_PER_CORE = 8
"""Largest number of members per core in one call on a CPU: some seconds, after which the host may stop."""

PROBE_BATCH = 8
"""Members per GPU in the program whose memory is measured."""

MOST_ON_GPU = 1024
"""Largest number of members per GPU in one call. Collocation is fastest with this number: 424 baseline
sails per second on an H200, and 358 and 341 with half and twice as many (`experiments/ensembles`)."""

GPU_SHARE = 0.4
"""Part of a GPU's memory that one call may take."""


def batch_on_cores(result_bytes: int, cores: int) -> int:
    """Members in one call on a CPU. result_bytes: size of one member's observables."""
    return int(np.clip(HOST_BYTES // result_bytes, 1, MEMBERS_PER_CORE * cores))


def batch_in_lockstep(result_bytes: int, members: int, lower: Callable[[int], jax.stages.Lowered]) -> int:
    """Members in one call on all local devices: all `members`, or as many as the memory holds.

    result_bytes: size of one member's observables; lower(count): the program of so many members. It is
    compiled once, for PROBE_BATCH members per device, to measure its memory; not if the ensemble has no
    more members than that and their results fit."""
    devices = jax.local_devices()
    room = (devices[0].memory_stats() or {}).get("bytes_limit", HOST_BYTES)
    if members <= PROBE_BATCH * len(devices) and members * result_bytes <= GPU_SHARE * room:
        return members
    # The analysis counts the memory of one device's share of the program.
    memory = compiled(lower(PROBE_BATCH * len(devices)), COMPILER_OPTIONS).memory_analysis()
    measured = (memory.temp_size_in_bytes + memory.output_size_in_bytes) / PROBE_BATCH
    each = max(result_bytes, measured)
    return min(members, int(np.clip(GPU_SHARE * room / each, 1, MOST_ON_GPU)) * len(devices))
