"""Measures the time of one acceleration of a chain of rods for many numbers of rods.

    python experiments/mw_rods/acceleration.py    # acceleration.csv, bandwidth.csv, figures/ (a minute)

The right-hand side is `RodChain`: tensions, force on every joint, two sweeps with the factors of the mass
matrix, differences. It is timed as single calls from Python and inside a compiled loop, where every call
uses the result of the one before (with an addition and a multiplication per coordinate, fused into the last
pass). For comparison:

dense:     the same with the full mass matrix of the paper's Eq. 8 and `jnp.linalg.solve` in every call;
one loop:  the least time to read x and the factors and to write x'', 24 + 16 + 24 bytes per rod;
copies:    NumPy's copy of arrays of that many bytes, and of as many as XLA counts for the compiled call.

All use one thread. Times are medians, and the least time in the loop; every timing waits for its result
(`block_until_ready`).
"""

import os

os.environ |= dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), "1")
os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false"  # one core for everything

import time
from collections.abc import Callable
from functools import partial

import figures
import jax
import jax.numpy as jnp
import numpy as np
from common import write
from jax import lax

import esail_jax  # noqa: F401, for double precision
from esail_jax.compilation.options import CHAIN_OPTIONS
from esail_jax.elements.axial import AxialEnergy
from esail_jax.elements.tether import TetherBatch
from esail_jax.joints.roots import FrameRoots
from esail_jax.loads.fields import UniformGravity
from esail_jax.rod_chain import RodChain, RodState
from esail_jax.system import System

RODS = (2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10**4, 10**5, 10**6)
DENSE = 1000  # largest number of rods for the dense solve
MASS, LENGTH, STIFFNESS, GRAVITY = 0.1, 1.0, 1000.0, (9.81, 0.0, 0.0)  # kg, m, N, m/s^2: first experiment
STREAM = 24 + 16 + 24  # bytes per rod: x and two factors read, x'' written
CALLS, LOOPS = 31, 7  # number of timings of a median


def chain_of(rods: int) -> RodChain:
    """The chain of the first experiment with another number of rods."""
    ones = jnp.ones((rods, 1))
    tethers = TetherBatch(ones * LENGTH, ones * MASS / LENGTH, jnp.zeros(1), rods, "rod", ("r_x",))
    roots = FrameRoots(jnp.eye(3), jnp.zeros(()), jnp.zeros((3, 1)), None)
    axial = AxialEnergy(ones[:, 0] * STIFFNESS, "engineering")
    return RodChain.of(
        System(tethers, roots, None, (axial,), (), (), (UniformGravity(jnp.array(GRAVITY)),))
    )


def state_of(rods: int) -> RodState:
    """Rods of about 1 m in random directions [m, m/s]."""
    x = np.random.default_rng(0).normal(size=(3, rods))
    return RodState(jnp.asarray(x / np.linalg.norm(x, axis=0) * 1.01), jnp.asarray(0.1 * x), None)


def dense_rate(rods: int) -> Callable[[RodState], RodState]:
    """The function d(x, v)/dt that solves with the mass matrix in rod coordinates (Eq. 8) in every
    call."""
    k = np.arange(rods)
    beyond = MASS * (rods - 1 - np.maximum.outer(k, k))
    matrix = jnp.asarray(beyond + MASS / 2 - np.eye(rods) * MASS / 6)
    weight = jnp.asarray(MASS * (rods - 0.5 - k))[:, None] * jnp.array(GRAVITY)

    def rate(state):
        norm = jnp.sqrt((state.x**2).sum(0))
        force = weight - (STIFFNESS * (1.0 / LENGTH - 1.0 / norm) * state.x).T
        return RodState(state.v, jnp.linalg.solve(matrix, force).T, None)

    return rate


jit = partial(jax.jit, compiler_options=CHAIN_OPTIONS)
"""`jax.jit` with the compiler options of a run."""


def seconds_of(call: Callable) -> float:
    """The time [s] of one call, result included."""
    begin = time.perf_counter()
    jax.block_until_ready(call())
    return time.perf_counter() - begin


def times_of(call: Callable, times: int) -> np.ndarray:
    """The median and the least time [s] of a call, after a first call that compiles."""
    jax.block_until_ready(call())
    found = [seconds_of(call) for _ in range(times)]
    return np.array([np.median(found), np.min(found)])


def median_of(call: Callable, times: int) -> float:
    """The median time [s] of a call."""
    return float(times_of(call, times)[0])


def looped(rate: Callable, count: int) -> Callable:
    """A compiled loop of `count` calls; each call depends on the one before."""

    def body(_, state):
        return RodState(1.0 + 1e-6 * rate(state).v, state.v, None)

    return jit(lambda state: lax.fori_loop(0, count, body, state))


def loop_time(rate: Callable, state: RodState) -> np.ndarray:
    """The median and the least time [s] per call inside a loop of at least some 30 ms."""
    few = looped(rate, 3)
    once = median_of(lambda: few(state), 3) / 3
    count = int(np.clip(0.03 / once, 20, 30000))
    program = looped(rate, count)
    return times_of(lambda: program(state), LOOPS) / count


def copy_time(total: float) -> float:
    """The time [s] in which NumPy moves `total` bytes: half of them read, half written."""
    source = np.ones(max(1, int(total / 16)))
    target = np.zeros_like(source)
    count = int(np.clip(2e7 / max(total, 1.0), 3, 5000))

    def some():
        for _ in range(count):
            np.copyto(target, source)

    return median_of(some, LOOPS) / count


def line(rods: int) -> dict:
    """A row of acceleration.csv."""
    chain, state, none = chain_of(rods), state_of(rods), jnp.zeros(())
    program = jit(lambda chain, state: chain(none, state))
    counted = program.lower(chain, state).compile().cost_analysis()
    counted = counted[0] if isinstance(counted, list) else counted
    moved = float(counted["bytes accessed"])
    call = median_of(lambda: program(chain, state), CALLS)
    loop, least = loop_time(lambda state: chain(none, state), state)
    row = {
        "rods": rods,
        "call_us": 1e6 * call,
        "loop_us": float(1e6 * loop),
        "loop_ns_per_rod": float(1e9 * loop / rods),
        "loop_least_ns_per_rod": float(1e9 * least / rods),
        "dense_us": "",
        "dense_difference": "",
        "bytes_per_rod": moved / rods,
        "copy_ns_per_rod": 1e9 * copy_time(moved) / rods,
        "least_ns_per_rod": 1e9 * copy_time(STREAM * rods) / rods,
    }
    if rods <= DENSE:
        rate = dense_rate(rods)
        one, other = program(chain, state).v, jax.jit(rate)(state).v
        row["dense_us"] = float(1e6 * loop_time(rate, state)[0])
        row["dense_difference"] = float(jnp.abs(one - other).max() / jnp.abs(one).max())
    return row


def bandwidth() -> list[dict]:
    """The rate of NumPy's copy (bytes read plus written) for arrays in the caches and in memory."""
    return [
        {"array_bytes": size, "GB_per_s": 2e-9 * size / copy_time(2 * size)}
        for size in (2**14, 2**17, 2**20, 2**23, 2**26, 2**28)
    ]


def crossing(rows: list[dict]) -> str:
    """A sentence with the number of rods from which on the sweeps are faster than the dense
    solve."""
    pairs = [(r["rods"], np.log(r["dense_us"] / r["loop_us"])) for r in rows if r["dense_us"] != ""]
    rods, gain = np.array(pairs).T
    if gain[0] > 0:
        return f"the sweeps are faster from the smallest chain on ({rods[0]:.0f} rods)"
    after = np.argmax(gain > 0)
    log = np.interp(0.0, gain[after - 1 : after + 1], np.log(rods[after - 1 : after + 1]))
    return f"the sweeps are faster from about {np.exp(log):.0f} rods on"


def main() -> None:
    """Measures all sizes; writes the tables and the figure."""
    empty = jax.jit(lambda chain, state: state.x[:, 0])
    chain, state = chain_of(10), state_of(10)
    fixed = median_of(lambda: empty(chain, state), 301)
    rows = [line(rods) for rods in RODS]
    write("acceleration.csv", rows)
    write("bandwidth.csv", bandwidth())
    print(f"an empty call with the same arguments: {1e6 * fixed:.1f} us; {crossing(rows)}")
    figures.acceleration(rows)


if __name__ == "__main__":
    main()
