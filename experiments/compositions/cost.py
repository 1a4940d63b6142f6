"""Measures how long derivatives and batches of a run take, relative to the run.

python experiments/compositions/cost.py     # writes cost.csv

The function is the last coning angle of three trusses after 600 s, by three voltages [V]. Every program is
that of `esail.jit`, and its time the least of ten calls."""

import csv
import time
from pathlib import Path

import jax
import jax.numpy as jnp

import esail_jax as esail

SAIL = {
    "tethers.count": 3, "tethers.elements": 1, "tethers.element": "truss", "tethers.bending": False,
    "tethers.second_moment": None, "tethers.bending_damping_time": None, "integrator.t_end": 600.0,
    "output.interval": 600.0,
}  # fmt: skip

VOLTS = jnp.full(3, 20e3)

MEMBERS = VOLTS * jnp.linspace(0.9, 1.1, 8)[:, None]
"""The arguments of a batch of eight runs."""

REPETITIONS = 10


def f(volts):
    return esail.simulate("baseline", {**SAIL, "voltage.value": volts})["coning_angle"][-1, 0]


def along(g):
    """The derivative of a function along (1, 1, 1), in forward mode."""
    return lambda x: jax.jvp(g, (x,), (jnp.ones_like(x),))[1]


def mean(members):
    return jax.vmap(f)(members).mean()


PROGRAMS = {
    "f": (f, VOLTS),
    "jvp": (along(f), VOLTS),
    "jacfwd": (jax.jacfwd(f), VOLTS),
    "grad": (jax.grad(f), VOLTS),
    "grad of checkpoint": (jax.grad(jax.checkpoint(f)), VOLTS),
    "jvp of grad": (along(jax.grad(f)), VOLTS),
    "hessian": (jax.hessian(f), VOLTS),
    "vmap": (jax.vmap(f), MEMBERS),
    "vmap of grad": (jax.vmap(jax.grad(f)), MEMBERS),
    "grad of vmap": (jax.grad(mean), MEMBERS),
}
"""Programs by name, with their arguments."""


def main():
    rows, run = [], None
    for name, (program, argument) in PROGRAMS.items():
        compiled, times = esail.jit(program), []
        for _ in range(1 + REPETITIONS):
            begin = time.perf_counter()
            jax.block_until_ready(compiled(argument))
            times.append(time.perf_counter() - begin)
        least = min(times[1:])
        run = run or least
        rows.append([name, f"{1e3 * least:.3g}", f"{least / run:.3g}", f"{times[0]:.3g}"])
        print(*rows[-1], sep=", ", flush=True)
    with Path(__file__).with_name("cost.csv").open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows(
            [["program", "ms", "of_the_run", "first_call_s"], *rows]
        )


if __name__ == "__main__":
    main()
