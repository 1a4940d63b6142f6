"""A stepper from outside the package: the example of CONTRIBUTING.md, run by both drivers."""

import inspect
from pathlib import Path
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.array_types import Array, Scalar
from esail_jax.simulation.schedule import switch_times
from esail_jax.steppers.consistent import consistent_motion, project
from esail_jax.steppers.log import Log
from esail_jax.steppers.results import RESULTS
from esail_jax.steppers.stepper import AbstractState, AbstractStepper, AbstractSteps, Point

SHORT = {"integrator.t_end": 8.0, "output.interval": 4.0, "tethers.elements": 2}


class EulerState(AbstractState):
    now: Point
    taken: Scalar
    rejected: Scalar
    result: RESULTS
    time = property(lambda self: self.now.time)


class EulerSteps(AbstractSteps):  # the first axis of all arrays is `attempt`
    before: Point
    after: Point
    taken: Array
    end = property(lambda self: self.after.time)
    log = property(lambda self: Log(self.taken, self.taken, self.end, self.end - self.before.time, {}))

    def pick(self, index):
        return jax.tree.map(lambda x: x[index], self)


def one_step(before, after):
    """The record of a block of one step."""
    both = jax.tree.map(lambda x: jnp.asarray(x)[None], (before, after))
    return EulerSteps(*both, jnp.ones(1, bool))


class Euler(AbstractStepper):
    """v1 = v0 + h vdot0, q1 = q0 + h v1, then the nearest state on the constraints."""

    step_size: Scalar
    name: ClassVar[str] = "euler"
    order: ClassVar[int] = 1
    steps_per_block: ClassVar[int] = 1

    def init(self, model, start, until):
        zero = jnp.zeros(())
        return EulerState(start, zero, zero, RESULTS.successful), one_step(start, start)

    def block(self, model, state):
        (time, q, v, work, _), h = state.now, self.step_size
        vdot, _, _, power = consistent_motion(model, time, q, v)
        v = v.axpy(h, vdot)
        q, v = project(model, time + h, q.axpy(h, v), v)
        work = jax.tree.map(lambda w, p: w + h * p, work, power)
        after = Point(time + h, q, v, work, jnp.asarray(True))
        result = RESULTS.where(jnp.isfinite(q.tether).all(), RESULTS.successful, RESULTS.nonfinite)
        new = EulerState(after, state.taken + 1.0, state.rejected, result)
        return new, one_step(state.now, after)

    def evaluate(self, model, step, time):
        start, end = step.before, step.after
        x = (time - start.time) / jnp.maximum(end.time - start.time, 1e-30)
        q, v, work = jax.tree.map(lambda a, b: a + x * (b - a), start[1:4], end[1:4])
        return Point(time, q, v, work, x == 1.0)

    def failure(self, model, state, log):
        return f"At t = {float(state.time):.6g} s. Ask for a shorter step."


def euler(step):
    return Euler(jnp.asarray(step))


def test_the_example_in_the_text_is_this_class():
    text = (Path(__file__).parents[2] / "CONTRIBUTING.md").read_text(encoding="utf-8")
    lines = {line.strip() for line in text.splitlines()}
    assert {line.strip() for line in inspect.getsource(Euler).splitlines()} <= lines


@pytest.mark.nightly
def test_error_is_of_first_order():
    exact = esail.simulate("single-tether", SHORT).final_state.q.tether
    runs = [esail.simulate("single-tether", SHORT, stepper=euler(h)) for h in (0.04, 0.02)]
    errors = [np.abs(run.final_state.q.tether - exact).max() for run in runs]
    # Halving the step halves the error, but for the next term of the expansion: h times a rate of 1/s.
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.05)


def test_failure_has_the_steppers_sentence():
    # Steps of 4 s exceed the period of the axial vibration: this explicit method diverges.
    late, saved = {"integrator.t_end": 4000.0}, ["tip_position_I"]  # one observable is soon compiled
    with pytest.raises(esail.SimulationError, match="Ask for a shorter step"):
        esail.simulate("single-tether", SHORT | late, stepper=euler(4.0), save=saved)


def test_voltage_of_a_chain_switches_nothing():
    assert switch_times(esail.load_scene("hanging-chain")) == ()
