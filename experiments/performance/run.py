"""Measures the time per step of generalized-alpha: baseline, without single terms, larger sails.

    taskset -c 0 python experiments/performance/run.py [per_step] [leaving_out] [growth]

Bind the process to one core, so that measurements are comparable. Times are medians of interleaved
repetitions; compile times are separate, in seconds of processor time.
"""

import dataclasses
import sys
import time

import jax
import jax.numpy as jnp
import numpy as np

import esail_jax as esail
from esail_jax.compiler import COMPILER_OPTIONS
from esail_jax.simulation.entry import entry_data, step_entry
from esail_jax.simulation.march import March
from esail_jax.simulation.prepare import prepare
from esail_jax.steppers.generalized_alpha import GeneralizedAlpha

METHOD = {"integrator.method": "generalized-alpha"}
"""The method that is timed here; `experiments/work_precision` compares the methods."""


def without(scene: esail.Scene, table: str, *keys: str) -> esail.Scene:
    """Returns the scene without some keys of a table, or without the whole table."""
    content = getattr(scene, table)
    part = dataclasses.replace(content, **dict.fromkeys(keys)) if keys else None
    return dataclasses.replace(scene, **{table: part})


def started(scene: esail.Scene, seconds: float):
    """Returns a prepared scene, its state after some seconds, and the data of a full block of steps."""
    prepared = prepare(scene.replace({"integrator.t_end": seconds}))
    march = March(prepared)
    for _ in march.pieces():
        pass
    entry = next(entry for entry in prepared.plan.entries if entry.kind == "march")
    return prepared, march.carry, entry_data(entry, prepared.plan.rows_per_entry)


def seconds_of(call) -> float:
    """Returns the wall time [s] of one call, result included."""
    begin = time.perf_counter()
    jax.block_until_ready(call())
    return time.perf_counter() - begin


def median_of(program, *arguments) -> float:
    """Returns the median time [s] of nine calls of a compiled program."""
    return float(np.median([seconds_of(lambda: program(*arguments)) for _ in range(9)]))


def per_step() -> None:
    """Compares the time of a step of the baseline with that of a 400 x 400 matrix product."""
    prepared, carry, data = started(esail.load_scene("baseline", METHOD), 200.0)
    matrix = jnp.asarray(np.random.default_rng(0).normal(size=(400, 400)))
    product = jax.jit(lambda a: a @ a)
    steps = prepared.plan.steps_per_entry

    def step():
        return prepared.programs.step(prepared.problem, carry.state, data)

    info = step()[2]
    product(matrix).block_until_ready()
    pairs = [(seconds_of(step) / steps, seconds_of(lambda: product(matrix))) for _ in range(50)]
    ours, theirs = np.median(pairs, axis=0)
    rate = 2 * 400**3 / theirs / 1e9
    print(f"step {1e6 * ours:.1f} us, relative to the product {ours / theirs:.4f}")
    print(f"product {1e3 * theirs:.2f} ms ({rate:.0f} GFLOP/s)")
    iterations, increment = np.mean(info.iterations), np.max(info.increment)
    print(f"iterations per step {iterations:.3f}, last increment {increment:.1e} m")


def count_equations(jaxpr) -> int:
    """Returns the number of equations of a jaxpr, including nested ones."""
    total = 0
    for equation in jaxpr.eqns:
        total += 1
        for value in equation.params.values():
            for part in value if isinstance(value, (tuple, list)) else [value]:
                inner = getattr(part, "jaxpr", part)
                total += count_equations(inner) if hasattr(inner, "eqns") else 0
    return total


def equations_of_a_step(problem, state) -> int:
    """Returns the number of traced equations of one factorisation and one step."""
    stepper = GeneralizedAlpha(jnp.asarray(0.1), problem.spectral_radius)

    def one(problem, state):
        kept = stepper.factor(problem.system, jnp.zeros(()), state.q, state.v, state.lam)
        return stepper.step(problem.system, jnp.zeros(()), state, kept, jnp.asarray(jnp.inf))

    return count_equations(jax.make_jaxpr(one)(problem, state).jaxpr)


def leaving_out() -> None:
    """Measures equations, compile time and time per step of the baseline without single terms."""
    full = esail.load_scene("baseline", METHOD)
    scenes = {
        "everything": full,
        "no bending": full.replace({"tethers.bending": False}),
        "no damping": without(full, "tethers", "axial_damping_time", "bending_damping_time"),
        "no voltage": dataclasses.replace(full, voltage=None, solar_wind=None),
        "no hub": without(full, "hub"),
    }
    runs = {name: started(scene, 50.0) for name, scene in scenes.items()}

    def compile_once(prepared, carry, data):
        lowered = jax.jit(lambda p, s, d: step_entry(p, s, d, 200, 20, False)).lower(
            prepared.problem, carry.state, data
        )
        begin = time.process_time()
        compiled = lowered.compile(compiler_options=COMPILER_OPTIONS)
        return compiled, time.process_time() - begin

    compiled = {name: [compile_once(*run)] for name, run in runs.items()}
    for _ in range(8):
        for name, run in runs.items():
            compiled[name].append(compile_once(*run))
    times = {name: [] for name in runs}
    for _ in range(25):
        for name, (prepared, carry, data) in runs.items():
            step = compiled[name][0][0]
            times[name].append(
                seconds_of(lambda s=step, p=prepared, c=carry, d=data: s(p.problem, c.state, d)) / 200
            )
    for name, (prepared, carry, _) in runs.items():
        equations = equations_of_a_step(prepared.problem, carry.state)
        took = np.median([seconds for _, seconds in compiled[name]])
        step = 1e6 * np.median(times[name])
        print(f"{name:11s} {equations:5d} equations, compile {took:.2f} s, step {step:.1f} us")


def growth() -> None:
    """Measures the time per element and step, and of the observables, for several sizes of sail."""
    for tethers, elements in ((12, 5), (12, 10), (12, 20), (12, 50), (12, 100), (50, 5), (100, 5)):
        size = {"tethers.count": tethers, "tethers.elements": elements}
        prepared, carry, data = started(esail.load_scene("baseline", METHOD).replace(size), 6.0)
        steps, state = prepared.plan.steps_per_entry, carry.state
        stepped = prepared.programs.step(prepared.problem, state, data)
        step = median_of(prepared.programs.step, prepared.problem, state, data)
        look = median_of(prepared.programs.look, prepared.problem, carry, data, *stepped)
        step, look = 1e6 * step / steps, 1e6 * look / steps
        each = step / (tethers * elements)
        iterations = float(np.mean(stepped[2].iterations))
        print(
            f"{tethers:3d} x {elements:3d}: step {step:7.1f} us = {each:.2f} us per element, "
            f"{iterations:.2f} iterations; observables {look:.1f} us a step",
            flush=True,
        )


PARTS = {"per_step": per_step, "leaving_out": leaving_out, "growth": growth}

if __name__ == "__main__":
    for part in sys.argv[1:] or PARTS:
        PARTS[part]()
