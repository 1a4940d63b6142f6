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
from jax import lax

import esail_jax as esail
from esail_jax.compilation.options import COMPILER_OPTIONS
from esail_jax.compilation.size import count_equations
from esail_jax.simulation.advance import Window
from esail_jax.simulation.host import HostRun, compile_scene
from esail_jax.steppers.log import Log

METHOD = {"integrator.method": "generalized-alpha"}
"""The method that is timed here; `experiments/work_precision` compares the methods."""

BLOCKS = 20
"""Number of blocks of steps in one timed call of the program that takes steps."""


def without(scene: esail.Scene, table: str, *keys: str) -> esail.Scene:
    """The scene without some keys of a table, or without the whole table."""
    content = getattr(scene, table)
    part = dataclasses.replace(content, **dict.fromkeys(keys)) if keys else None
    return dataclasses.replace(scene, **{table: part})


class Started:
    """A compiled scene after some seconds of motion."""

    def __init__(self, scene: esail.Scene, seconds: float):
        self.compiled = compile_scene(scene.replace({"integrator.t_end": seconds}))
        run = HostRun(self.compiled)
        for _ in run.chunks():
            pass
        self.problem = self.compiled.problem.under(self.compiled.carried)
        self.motion = run.checkpoint.motion
        self.interval = self.compiled.scene.output.interval

    @property
    def steps(self) -> int:
        """Number of steps in one timed call."""
        return BLOCKS * self.problem.stepper.steps_per_block

    def statistics(self, done) -> dict[str, np.ndarray]:
        """The statistics of the blocks of one timed call, by name."""
        return Log.from_table(np.asarray(done.kept), self.compiled.programs.statistics).statistics

    def advance(self, instants: bool = False):
        """Takes BLOCKS blocks of steps; instants: with dense output at saved instants."""
        programs, count = self.compiled.programs, np.arange(1.0, self.compiled.programs.instants + 1.0)
        ahead = count * (self.interval if instants else 1e9)
        window = Window(float(self.motion.state.time) + ahead, np.asarray(len(count)))
        return programs.advance(self.problem, self.motion, window, np.inf, np.asarray(BLOCKS))


def seconds_of(call) -> float:
    """The wall time [s] of one call, result included."""
    begin = time.perf_counter()
    jax.block_until_ready(call())
    return time.perf_counter() - begin


def median_of(program, *arguments) -> float:
    """The median time [s] of nine calls of a compiled program."""
    return float(np.median([seconds_of(lambda: program(*arguments)) for _ in range(9)]))


def per_step() -> None:
    """Compares the time of a step of the baseline with that of a 400 x 400 matrix product."""
    run = Started(esail.load_scene("baseline", METHOD), 200.0)
    matrix = jnp.asarray(np.random.default_rng(0).normal(size=(400, 400)))
    product = jax.jit(lambda a: a @ a)
    statistics = run.statistics(run.advance())
    product(matrix).block_until_ready()
    pairs = [(seconds_of(run.advance) / run.steps, seconds_of(lambda: product(matrix))) for _ in range(50)]
    ours, theirs = np.median(pairs, axis=0)
    rate = 2 * 400**3 / theirs / 1e9
    print(f"step {1e6 * ours:.1f} us, relative to the product {ours / theirs:.4f}")
    print(f"product {1e3 * theirs:.2f} ms ({rate:.0f} GFLOP/s)")
    iterations = np.mean(statistics["iterations_per_step"][:BLOCKS])
    increment = np.max(statistics["last_increment"][:BLOCKS])
    print(f"iterations per step {iterations:.3f}, last increment {increment:.1e} m")


def equations_of_a_step(problem, state) -> int:
    """The number of traced equations of one factorisation and one step."""

    def one(problem, state):
        stepper, zero = problem.stepper, jnp.zeros(())
        kept = stepper.factor(problem.model, zero, state.q, state.v, state.lam)
        return stepper.step(problem.model, zero, state, kept, jnp.asarray(jnp.inf))

    return count_equations(jax.make_jaxpr(one)(problem, state))


def ten_blocks(problem, state):
    """The state after ten blocks of steps."""
    return lax.fori_loop(0, 10, lambda _, state: problem.stepper.block(problem.model, state)[0], state)


def leaving_out() -> None:
    """Measures equations, compile time and time per step of the baseline without single terms."""
    full = esail.load_scene("baseline", METHOD)
    scenes = {
        "full model": full,
        "without bending": full.replace({"tethers.bending": False}),
        "without damping": without(full, "tethers", "axial_damping_time", "bending_damping_time"),
        "without voltage": dataclasses.replace(full, voltage=None, solar_wind=None),
        "without hub": without(full, "hub"),
    }
    runs = {name: Started(scene, 50.0) for name, scene in scenes.items()}

    def compile_once(run):
        lowered = jax.jit(ten_blocks).lower(run.problem, run.motion.state)
        begin = time.process_time()
        compiled = lowered.compile(compiler_options=COMPILER_OPTIONS)
        return compiled, time.process_time() - begin

    compiled = {name: [compile_once(run)] for name, run in runs.items()}
    for _ in range(8):
        for name, run in runs.items():
            compiled[name].append(compile_once(run))
    times = {name: [] for name in runs}
    for _ in range(25):
        for name, run in runs.items():
            step, steps = compiled[name][0][0], 10 * run.problem.stepper.steps_per_block
            times[name].append(seconds_of(lambda s=step, r=run: s(r.problem, r.motion.state)) / steps)
    for name, run in runs.items():
        equations = equations_of_a_step(run.problem, run.motion.state.now)
        took = np.median([seconds for _, seconds in compiled[name]])
        step = 1e6 * np.median(times[name])
        print(f"{name:16s} {equations:5d} equations, compile {took:.2f} s, step {step:.1f} us")


def growth() -> None:
    """Measures the time per element and step, and of the observables, for several sizes of sail."""
    for tethers, elements in ((12, 5), (12, 10), (12, 20), (12, 50), (12, 100), (50, 5), (100, 5)):
        size = {"tethers.count": tethers, "tethers.elements": elements}
        run = Started(esail.load_scene("baseline", METHOD).replace(size), 6.0)
        done = run.advance(instants=True)
        count, look = done.passed, run.compiled.programs.look
        per_instant = run.interval / float(run.problem.stepper.step_size)
        step = 1e6 * median_of(run.advance) / run.steps
        look = 1e6 * median_of(look, run.problem, done.points, count) / (int(count) * per_instant)
        each = step / (tethers * elements)
        iterations = float(np.mean(run.statistics(done)["iterations_per_step"][:BLOCKS]))
        print(
            f"{tethers:3d} x {elements:3d}: step {step:7.1f} us = {each:.2f} us per element, "
            f"{iterations:.2f} iterations; observables {look:.1f} us per step",
            flush=True,
        )


PARTS = {"per_step": per_step, "leaving_out": leaving_out, "growth": growth}

if __name__ == "__main__":
    for part in sys.argv[1:] or PARTS:
        PARTS[part]()
