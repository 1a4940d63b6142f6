"""The classical explicit Runge-Kutta method for the same sail, with `consistent_acceleration`.

The method integrates v' = vdot, where M vdot + Phi_q^T lam = Q and d^2 Phi / dt^2 = 0, so no constraint
remains. Every evaluation factors the mass matrix; a code made for this method would keep the factors.
"""

import functools
import time

import jax
import jax.numpy as jnp
import numpy as np

import esail_jax as esail
from esail_jax.commands.benchmark import Run, with_method
from esail_jax.scenes.build import build
from esail_jax.scenes.structure import split
from esail_jax.simulation.host import compile_scene
from esail_jax.simulation.look import look
from esail_jax.steppers.consistent import consistent_acceleration
from esail_jax.steppers.stepper import Point
from esail_jax.system import Power

WORKS = ("external_work", "dissipated_energy", "energy_balance_error")
"""Observables that need integrals over time; this script does not compute these integrals."""


def moved(x, h, rate):
    """x + h rate."""
    return jax.tree.map(lambda a, b: a + h * b, x, rate)


def step(system, t, q, v, h):
    """q and v after one step of the classical method."""

    def vdot(c, q, v):
        return consistent_acceleration(system, t + c * h, q, v)[0]

    a1 = vdot(0.0, q, v)
    v2 = moved(v, h / 2, a1)
    a2 = vdot(0.5, moved(q, h / 2, v), v2)
    v3 = moved(v, h / 2, a2)
    a3 = vdot(0.5, moved(q, h / 2, v2), v3)
    v4 = moved(v, h, a3)
    a4 = vdot(1.0, moved(q, h, v3), v4)

    def mean(*k):
        return jax.tree.map(lambda a, b, c, d: (a + 2 * b + 2 * c + d) / 6, *k)

    return moved(q, h, mean(v, v2, v3, v4)), moved(v, h, mean(a1, a2, a3, a4))


@functools.partial(esail.jit, static_argnums=(4, 5))
def states(system, q, v, h, rows, per_row):
    """q and v at the saved instants, including the start."""

    def row(y, k):
        def one(j, y):
            return step(system, (k * per_row + j) * h, *y, h)

        y = jax.lax.fori_loop(0, per_row, one, y)
        return y, y

    _, found = jax.lax.scan(row, (q, v), jnp.arange(rows))
    return jax.tree.map(lambda a, b: jnp.concatenate([a[None], b]), (q, v), found)


def measure(scene: esail.Scene, h: float, span: float, runs: int = 2) -> Run:
    """Measures runs up to the last saved instant within `span` [s]; their times include the observables."""
    scene = with_method(scene, "collocation", "tolerance", 1e-9)
    compiled = compile_scene(scene)
    problem, start = compiled.problem, jax.jit(build, static_argnums=0)(*split(compiled.resolved))
    interval = scene.output.interval
    rows, per_row = int(span / interval + 1e-9), round(interval / h)
    nothing = Power(jnp.zeros(()), jnp.zeros(()))

    @esail.jit
    def observe(q, v):
        times = interval * jnp.arange(rows + 1)

        def one(x):
            point = Point(*x, nothing, jnp.asarray(True))
            return look(problem, point)[0]

        return jax.lax.map(one, (times, q, v), batch_size=32)

    def run():
        began, processor = time.perf_counter(), time.process_time()
        q, v = states(problem.system, start.q, start.v, jnp.asarray(h), rows, per_row)
        found = jax.tree.map(np.asarray, observe(q, v))
        return time.perf_counter() - began, time.process_time() - processor, found

    compiling, *_ = run()
    timed = [run() for _ in range(runs)]
    seconds, processor, (found, *_) = zip(*timed, strict=True)
    found = {name: x for name, x in found.items() if name not in WORKS}
    compiling -= min(seconds)
    return Run("rk4", "step", h, found, rows * per_row, compiling, seconds, processor)
