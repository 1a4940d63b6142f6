"""Explicit Runge-Kutta methods on equations with known solutions: single steps, dense output, step control,
and derivatives of runs."""

from typing import ClassVar

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

from esail_jax.rod_chain import RodChain
from esail_jax.simulation.advance import Window, move
from esail_jax.simulation.problem import Problem
from esail_jax.steppers.results import RESULTS, name_of
from esail_jax.steppers.runge_kutta import METHODS, Knot, RungeKutta, solver
from esail_jax.steppers.stepper import Motion, Point
from esail_jax.system import Power
from support.quick import jit


class State(eqx.Module):
    """One number, with a name that the method expects of a state: no work is added up."""

    x: jax.Array
    work: None = None


class Decay(RodChain):
    """The equation y' = cos t - k y, in place of that of a chain of rods."""

    k: jax.Array

    def __init__(self, k):
        self.system = self.hinges = self.mass = None
        self.k = k

    def __call__(self, time, y):
        return State(jnp.cos(time) - self.k * y.x)

    def coordinates(self, y):
        return y.x, y.x

    def state(self, q, v, work):
        return State(q)

    def exact(self, y0, t):
        forced = (self.k * jnp.cos(t) + jnp.sin(t)) / (1 + self.k**2)
        return forced + (y0 - self.k / (1 + self.k**2)) * jnp.exp(-self.k * t)


def method_of(name, step=None):
    if step is not None:
        return RungeKutta(jnp.asarray(step), None, None, name)
    return RungeKutta(None, jnp.asarray(1e-10), State(jnp.ones(())), name)


def motion_of(method, f, y0, until=np.inf):
    """The motion that begins at time 0."""
    zero = jnp.zeros(())
    begin = Point(zero, y0, y0, Power(zero, zero), jnp.asarray(True))
    return Motion(*method.init(f, begin, jnp.asarray(until)), jnp.zeros(2))


def problem_of(f, method):
    """What a run of the equation needs of a problem."""
    return Problem(f, method, None, None, None, None)


@pytest.mark.parametrize("name", METHODS)
def test_a_step_is_the_librarys(name):
    """New value, error estimate and first slope of the next step agree with those of diffrax, to
    rounding."""
    f, method, h = Decay(jnp.asarray(0.7)), method_of(name, 0.3), jnp.asarray(0.3)
    time, y = jnp.asarray(0.2), State(jnp.asarray(1.5))
    new, error = method.step(f, Knot(time, y, f(time, y)), h)
    terms = diffrax.ODETerm(lambda t, y, _: f(t, State(y)).x)
    theirs = solver(name)
    state = theirs.init(terms, 0.2, 0.5, jnp.asarray(1.5), None)
    exact, estimate, *_ = theirs.step(terms, 0.2, 0.5, jnp.asarray(1.5), None, state, False)
    np.testing.assert_allclose(new.y.x, exact, rtol=1e-14)
    np.testing.assert_allclose(error.x, estimate, rtol=0, atol=1e-15)
    np.testing.assert_allclose(new.slope.x, f(0.5, State(exact)).x, rtol=1e-13)
    np.testing.assert_allclose(new.time, 0.5, rtol=1e-15)


@pytest.mark.parametrize("name", METHODS)
def test_dense_output_is_a_step_to_the_instant(name):
    """Within a step the state has the accuracy of a shorter step: 1e-9 with steps of 0.05 (measured: 2e-10
    for order 5). At both ends it is the recorded state, to rounding."""
    f, method = Decay(jnp.asarray(0.7)), method_of(name, 0.05)
    begun = motion_of(method, f, jnp.asarray(1.5))
    _, steps = method.block(f, begun.state)
    step = jax.tree.map(lambda x: x[0], steps)
    for part in (0.0, 0.3, 0.9, 1.0):
        time = jnp.asarray(0.05 * part)
        point = method.evaluate(f, step, time)
        np.testing.assert_allclose(point.q, f.exact(1.5, time), rtol=1e-9)
        assert point.time == time and point.exact


def test_steps_of_given_size_end_at_multiples_of_it():
    """The end of step n is n h, not a sum of n rounded numbers."""
    f, method = Decay(jnp.asarray(0.7)), method_of("tsit5", 0.1)
    window = Window(jnp.asarray([100.0]), jnp.asarray(1))
    motion = motion_of(method, f, jnp.asarray(1.5))
    end, _, passed = jit(move)(problem_of(f, method), motion, window, jnp.asarray(jnp.inf))
    assert passed == 1 and end.state.taken in (1000, 1001)
    assert float(end.state.time) == float(end.state.taken) * 0.1


def test_rejected_steps_change_nothing_but_the_step():
    """An attempt whose error is too large leaves the time and the state; the next one is shorter.

    An accepted step has a local error of the order of the tolerance.
    """
    f, method = Decay(jnp.asarray(0.7)), method_of("dopri5")
    begun = motion_of(method, f, jnp.asarray(1.5))
    long = eqx.tree_at(lambda s: s.h, begun.state, jnp.asarray(1.0))
    state, steps = method.block(f, long)
    assert not steps.taken[0] and (state.taken, state.rejected) == (0.0, 1.0)
    assert state.time == 0.0 and state.now.y.x == 1.5 and 0.0 < state.h < 1.0
    for _ in range(20):
        state, _ = method.block(f, state)
    assert state.taken > 10 and name_of(state.result) == "successful"
    np.testing.assert_allclose(state.now.y.x, f.exact(1.5, state.time), rtol=1e-8)


def test_the_first_step_does_not_pass_the_next_event():
    f, method = Decay(jnp.asarray(0.7)), method_of("tsit5")
    free, bound = (motion_of(method, f, jnp.asarray(1.5), until).state.h for until in (np.inf, 1e-6))
    assert free > 1e-3 and bound == 1e-6


@pytest.mark.nightly
@pytest.mark.parametrize("step", [None, 0.05], ids=["controlled", "fixed"])
def test_derivative_of_a_run(step):
    """dy/dk and dy/dy_0 of y' = cos t - k y agree with the closed form in forward and reverse mode.

    The instants lie within steps.
    """
    times = (0.31, 0.93, 2.0)

    def run(k, y0):
        f, method = Decay(k), method_of("tsit5", step)
        problem = problem_of(f, method)

        def to(motion, time):
            window = Window(time[None], jnp.asarray(1))
            motion, point, passed = move(problem, motion, window, jnp.asarray(jnp.inf))
            return motion, jnp.where(passed == 1, point.q[0], jnp.nan)

        # A scan, as in a traced run: one copy of the window's program instead of three.
        return lax.scan(to, motion_of(method, f, y0), jnp.asarray(times))[1]

    at = (jnp.asarray(0.7), jnp.asarray(1.5))

    def exact(k, y0):
        return Decay(k).exact(y0, jnp.asarray(times))

    np.testing.assert_allclose(jit(run)(*at), exact(*at), rtol=1e-7)
    forward, reverse = (jit(mode(run, (0, 1)))(*at) for mode in (jax.jacfwd, jax.jacrev))
    for one, other, known in zip(forward, reverse, jax.jacfwd(exact, (0, 1))(*at), strict=True):
        np.testing.assert_allclose(one, known, rtol=1e-7)
        np.testing.assert_allclose(one, other, rtol=1e-12)


def test_steps_beyond_the_bound_end_the_run():
    """A run with at most ten steps ends after them, and says so; instants that were not passed are NaN."""
    f, method = Decay(jnp.asarray(0.7)), method_of("tsit5", 0.05)
    window = Window(jnp.asarray([0.31, 0.49, 0.93]), jnp.asarray(3))
    motion, points, passed = move(
        problem_of(f, method), motion_of(method, f, jnp.asarray(1.5)), window, jnp.asarray(10.0)
    )
    assert passed == 2 and motion.state.taken == 10
    assert RESULTS[motion.state.result] == RESULTS[RESULTS.too_many_steps]
    assert np.isfinite(points.q).tolist() == [True, True, False]


def test_a_bound_of_steps_counts_those_before_and_holds_within_a_batch():
    """A run with five earlier steps and a bound of eight takes three, fewer than a batch has."""
    f, method = Decay(jnp.asarray(0.7)), method_of("tsit5", 0.1)
    motion = motion_of(method, f, jnp.asarray(1.5))._replace(earlier=jnp.array([5.0, 0.0]))
    window = Window(jnp.array([10.0]), jnp.asarray(1))
    ended, _, passed = jit(move)(problem_of(f, method), motion, window, jnp.asarray(8.0))
    assert int(ended.state.taken) == 3 and int(ended.counts[0]) == 8 and int(passed) == 0
    assert name_of(ended.state.result) == "too_many_steps"


def test_a_differentiated_window_without_room_for_its_steps_says_so():
    """A derivative records the steps of a window. If they need more batches of blocks than it has room for,
    the run has failed; the same run without a derivative has no such limit."""

    class Short(RungeKutta):
        """A method with room for eight batches of eight steps."""

        blocks_per_window: ClassVar[int] = 8

    method = Short(jnp.asarray(0.1), None, None, "tsit5")

    def ended(k, until):
        f = Decay(k)
        window = Window(until[None], jnp.asarray(1))
        motion = motion_of(method, f, jnp.asarray(1.5))
        motion, points, passed = move(problem_of(f, method), motion, window, jnp.asarray(jnp.inf))
        return points.q[0], (motion.state.result, passed)

    k = jnp.asarray(0.7)
    differentiated = jit(jax.value_and_grad(ended, has_aux=True))
    for until, result, passed in ((6.35, "successful", 1), (6.55, "too_many_steps", 0)):
        (value, (found, count)), _ = differentiated(k, jnp.asarray(until))
        assert name_of(found) == result and int(count) == passed
        assert np.isfinite(value) == bool(passed)
        plain, (found, count) = jit(ended)(k, jnp.asarray(until))
        assert name_of(found) == "successful" and int(count) == 1
        np.testing.assert_allclose(plain, Decay(k).exact(1.5, until), rtol=1e-6)
