"""Measures what limits members in lockstep on one core: operations, memory traffic and their rates.

taskset -c 0 python experiments/ensembles/roofline.py       # roofline.csv; two minutes on one core

The script runs one iteration of a collocation step of the baseline (`collocation_solution.py`) for 1 to 32
members at once. It reports the time, the operations and the memory traffic that the compiler counts for the
compiled program, and the rate at which the same core adds arrays of the size of the program's data. In
lockstep a fast member waits for a slow one; in this single iteration no member waits.
"""

import csv
import statistics
import time
from pathlib import Path

import jax
import jax.numpy as jnp

import esail_jax as esail
from esail_jax.compilation import options
from esail_jax.simulation.host import compile_scene
from esail_jax.steppers.collocation import first_guess
from esail_jax.steppers.collocation_solution import reshaped, stage_residuals
from esail_jax.steppers.collocation_stages import correction, factor, turns_to

BATCHES = (1, 2, 4, 8, 16, 32)
REPEATS = 15
LOOPS = 100
STEP = 5.0
"""Step [s] of the iteration that is timed."""


def seconds(loop, *arguments) -> float:
    """The median time [s] per iteration of a compiled loop of LOOPS iterations."""
    jax.block_until_ready(loop(*arguments))
    times = []
    for _ in range(REPEATS):
        began = time.perf_counter()
        jax.block_until_ready(loop(*arguments))
        times.append(time.perf_counter() - began)
    return statistics.median(times) / LOOPS


def iteration(system, now, h, kept, nodes, like):
    """Makes one simplified Newton iteration.

    nodes: the unknowns with all nodes along one axis, as in the package's loop; like: the unknowns with
    their usual shapes."""
    residual, axes = stage_residuals(system, now, h, jax.tree.map(reshaped, nodes, like))
    change = correction(system, residual, turns_to(axes, kept), kept)
    return jax.tree.map(lambda x, y: x + reshaped(y, x), nodes, change)


def measure_batch(size: int) -> tuple:
    """Time [s], operations, traffic [B] and size of the data [B] of an iteration of `size`
    members."""
    scene = esail.load_scene("baseline", {"integrator.t_end": 100.0})
    compiled = compile_scene(scene)
    system, state = compiled.problem.system, compiled.motion.state
    now, h = state.now, jnp.asarray(STEP)
    lam = jax.tree.map(lambda x: x[-1], state.history.values.lam)
    kept, guess = factor(system, now, h, lam), first_guess(system, state)

    tether = guess.vdot.tether
    nodes = guess._replace(vdot=guess.vdot._replace(tether=tether.reshape(*tether.shape[:-2], -1)))

    def once(now, kept, nodes):
        return iteration(system, now, h, kept, nodes, guess)

    def repeated(x):
        return jax.tree.map(lambda x: jnp.broadcast_to(x, (size, *x.shape)) + 0.0, x)

    if size > 1:
        now, kept, nodes = repeated((now, kept, nodes))
        once = jax.vmap(once)
    program = options.compiled(jax.jit(once).lower(now, kept, nodes), options.COMPILER_OPTIONS)
    counted, memory = program.cost_analysis(), program.memory_analysis()
    works_on = memory.argument_size_in_bytes + memory.output_size_in_bytes + memory.temp_size_in_bytes
    many = jax.jit(lambda *x: jax.lax.fori_loop(0, LOOPS, lambda _, y: once(*x[:2], y), x[2]))
    loop = options.compiled(many.lower(now, kept, nodes), options.COMPILER_OPTIONS)
    return seconds(loop, now, kept, nodes), counted["flops"], counted["bytes accessed"], works_on


def stream(size: float) -> float:
    """The rate [B/s] of a <- a + s b, which moves three arrays; a and b together take `size`
    bytes."""
    n = max(int(size / 16), 64)
    a, b = jnp.ones(n), jnp.full(n, 1e-9)
    add = jax.jit(lambda a, b: jax.lax.fori_loop(0, LOOPS, lambda i, a: a + i * b, a))
    return 24.0 * n / seconds(add, a, b)


def main() -> None:
    """Measures all batches, prints and writes roofline.csv."""
    with open(Path(__file__).with_name("roofline.csv"), "w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(
            ("members", "us_per_member", "kflop_per_member", "kB_traffic_per_member", "kB_worked_on",
             "GFLOP_per_s", "GB_per_s", "GB_per_s_of_adding")
        )  # fmt: skip
        for size in BATCHES:
            took, flops, traffic, works_on = measure_batch(size)
            speed = stream(works_on)
            row = (size, took / size * 1e6, flops / size / 1e3, traffic / size / 1e3, works_on / 1e3,
                   flops / took / 1e9, traffic / took / 1e9, speed / 1e9)  # fmt: skip
            table.writerow([f"{x:.4g}" for x in row])
            print(*(f"{x:.4g}" for x in row), flush=True)


if __name__ == "__main__":
    main()
