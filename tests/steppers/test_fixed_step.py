"""Fixed steps: dense output between them, and steps that are halved where one cannot be solved."""

from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

import esail_jax as esail
from esail_jax.coordinates import Coordinates
from esail_jax.scenes.method_choice import with_method
from esail_jax.scenes.structure import split
from esail_jax.simulation.advance import Window, move
from esail_jax.simulation.problem import start
from esail_jax.steppers.fixed_step import STEPS_PER_FACTORISATION
from esail_jax.steppers.fixed_step_steps import Interval, Node
from esail_jax.steppers.generalized_alpha import GeneralizedAlpha
from esail_jax.steppers.results import name_of
from esail_jax.steppers.stepper import Motion, Point
from esail_jax.system import Power
from support.quick import jit

STEP = 0.5
"""Length of a step [s]."""

SAIL = {
    "tethers.count": 2, "tethers.elements": 2, "integrator.method": "generalized-alpha",
    "integrator.step": STEP, "integrator.t_end": 100.0, "integrator.spectral_radius": 0.9,
}  # fmt: skip


class Stubborn(GeneralizedAlpha):
    """Generalized-alpha, whose steps cannot be solved from 2.0 to 2.5 s unless they are a quarter of a
    whole step or shorter. A failed step ends at NaN, as one does whose iterations overflow."""

    fails: ClassVar[float] = 2.0

    def step(self, system, time, state, kept, rate):
        new, info = super().step(system, time, state, kept, rate)
        bad = (time >= self.fails) & (time < self.fails + STEP) & (self.step_size > 0.3 * STEP)
        new = jax.tree.map(lambda x: jnp.where(bad, jnp.nan, 1.0) * x, new)
        return new, info._replace(left=jnp.where(bad, jnp.inf, info.left))


class StubbornStart(Stubborn):
    """The same, from 0 to 0.5 s: whole trial steps and the first whole step fail."""

    fails = 0.0


@pytest.fixture(scope="module")
def begun():
    """The problem of a small sail of trusses, and its motion at the start."""
    return jit(start, static_argnums=0)(*split(with_method(esail.load_scene("truss", SAIL))))


def like(stepper, kind):
    """The method with the numbers of another one."""
    return kind(stepper.step_size, stepper.spectral_radius)


# ---- dense output -------------------------------------------------------------------------------


def cubic(time, seed):
    """Values and rates of random cubic polynomials at a time, as coordinates."""
    tether, hub = (np.random.default_rng(seed).normal(size=(4, *shape)) for shape in ((1, 3, 2, 2), (4, 3)))
    powers, rates = time ** np.arange(4), np.arange(4) * time ** np.maximum(np.arange(4) - 1, 0)
    return [
        Coordinates(*(jnp.asarray(np.tensordot(w, x, 1)) for x in (tether, hub))) for w in (powers, rates)
    ]


def node(time):
    """The end of a step in a motion whose q, v and work are cubics."""
    (q, v), (_, vdot) = cubic(time, 0), cubic(time, 1)
    work, power = 2.0 - time + 3.0 * time**3, -1.0 + 9.0 * time**2
    return Node(q, v, vdot, Power(*jnp.array([work, -work])), Power(*jnp.array([power, -power])))


def close(found, known):
    """Checks that numbers near one agree to rounding."""
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-12), found, known)


def test_cubics_are_reproduced_between_two_steps(begun):
    """Dense output is exact for cubic q and work, and for cubic v if q has its rates; to rounding.

    Here v at the ends is the rate of q, and vdot that of another cubic, which v must follow.
    """
    stepper = GeneralizedAlpha(jnp.asarray(0.7), jnp.asarray(0.9))
    begin, h = 1.3, 0.7
    before, after = node(begin), node(begin + h)
    interval = Interval(before, after, jnp.asarray(begin + h), jnp.asarray(h))
    for theta in (0.1, 0.37, 0.8):
        time = begin + theta * h
        point, exact = stepper.evaluate(begun.problem.model, interval, jnp.asarray(time)), node(time)
        assert not point.exact
        for found, known in ((point.q, exact.q), (point.work, exact.work)):
            jax.tree.map(
                lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-12), found, known
            )
    velocities = interval._replace(
        before=before._replace(v=cubic(begin, 1)[0]), after=after._replace(v=cubic(begin + h, 1)[0])
    )
    point = stepper.evaluate(begun.problem.model, velocities, jnp.asarray(begin + 0.37 * h))
    known = cubic(begin + 0.37 * h, 1)[0]
    close(point.v, known)


def test_the_end_of_a_step_is_taken_as_it_is(begun):
    """At both ends, and where a time misses one of them by rounding, the recorded motion has not a bit
    changed and is not projected."""
    stepper = GeneralizedAlpha(jnp.asarray(0.7), jnp.asarray(0.9))
    before, after = node(1.3), node(2.0)
    interval = Interval(before, after, jnp.asarray(2.0), jnp.asarray(0.7))
    for time, known in ((1.3, before), (1.3 + 1e-12, before), (2.0, after), (2.0 - 1e-12, after)):
        point = stepper.evaluate(begun.problem.model, interval, jnp.asarray(time))
        assert point.exact and point.time == time
        same = jax.tree.map(np.array_equal, (point.q, point.v, point.work), (known.q, known.v, known.work))
        assert all(jax.tree.leaves(same))


# ---- trial steps --------------------------------------------------------------------------------


@pytest.mark.nightly
def test_trial_steps_precede_the_first_block_only_also_in_a_replay(begun):
    """The end of the first two blocks equals that of two trial steps and 40 steps, taken one by one, and
    that of the replayed blocks, up to rounding. A start without trials differs by 2e-8 of the
    accelerations, a second block with trials by 1e-9. In a batch of a member before its first block and a
    member after it, each member equals its block alone."""
    stepper, model, motion = begun.problem.stepper, begun.problem.model, begun.motion
    found, again = jit(lambda stepper: blocks_and_replay(stepper, begun, 2))(stepper)
    first, second, found, again = *found, found[-1].now, again.now
    both = jax.tree.map(lambda *x: jnp.stack(x), motion.state, first)
    batch = jit(jax.vmap(lambda state: stepper.block(model, state)[0]))(both)
    for k, alone in enumerate((first, second)):
        member = jax.tree.map(lambda x, k=k: x[k], batch)
        found_alone = np.asarray(alone.now.a.tether)
        size = np.abs(found_alone).max()  # rounding is that of the largest acceleration
        np.testing.assert_allclose(member.now.a.tether, found_alone, rtol=0, atol=1e-12 * size)
        assert member.taken == alone.taken
    known, without, always = (
        jit(lambda stepper, trials=trials: one_by_one(stepper, begun, trials, STEPS_PER_FACTORISATION))(
            stepper
        )
        for trials in ((2, 0), (0, 0), (2, 2))
    )
    size = np.abs(known.a.tether).max()

    def gap(other):
        return np.abs(known.a.tether - other.a.tether).max() / size

    # Rounding of 80 steps: up to 6e-13, by how a processor's program contracts products and sums.
    assert max(gap(found), gap(again)) < 1e-11
    assert min(gap(without), gap(always)) > 1e-10


@pytest.mark.nightly
def test_a_trial_step_that_fails_improves_nothing(begun):
    """After a block without a step the start has its accelerations as auxiliary ones. Then half a step
    fails, too, and two trial steps of a quarter of a whole step give the jerk."""
    stepper, start = like(begun.problem.stepper, StubbornStart), begun.motion.state.now
    (first, _, third), again = jit(lambda stepper: blocks_and_replay(stepper, begun, 3))(stepper)
    assert (first.taken, third.taken) == (0, 4)
    assert (first.now.a.tether == start.vdot.tether).all()
    np.testing.assert_allclose(again.now.a.tether, third.now.a.tether, rtol=0, atol=1e-13)

    quarter = GeneralizedAlpha(0.25 * stepper.step_size, stepper.spectral_radius)
    known = jit(lambda stepper: one_by_one(stepper, begun, (2,), 4))(quarter)
    size = np.abs(known.vdot.tether).max()
    np.testing.assert_allclose(third.now.vdot.tether, known.vdot.tether, rtol=0, atol=1e-13 * size)


def one_by_one(stepper, begun, trials, steps):
    """The state after blocks of a number of steps. trials: number of trial steps before each."""
    model, time, now = begun.problem.model, begun.motion.state.time, begun.motion.state.now
    infinite = jnp.asarray(jnp.inf)
    for block, count in enumerate(trials):
        begin = time + block * steps * stepper.step_size
        factors = stepper.factor(model, begin, now.q, now.v, now.lam)
        for _ in range(count):
            now = stepper.after_trial(now, stepper.step(model, begin, now, factors, infinite)[0])

        def step(carry, index, factors=factors):
            now, info = stepper.step(model, time + index * stepper.step_size, carry[0], factors, carry[1])
            return (now, info.rate), None

        (now, _), _ = lax.scan(step, (now, infinite), block * steps + jnp.arange(steps))
    return now


def blocks_and_replay(stepper, begun, count):
    """The states after each of the first blocks, and the state after the replay of these blocks."""
    model, motion = begun.problem.model, begun.motion
    found, states, tapes = motion, [], []
    for _ in range(count):
        found = Motion(*stepper.block(model, found.state), found.earlier)
        states.append(found.state)
        tapes.append(stepper.tape(found.last))
    rest = stepper.blocks_per_window - count
    tapes = jax.tree.map(lambda *x: jnp.stack([*x, *[jnp.zeros_like(x[0])] * rest]), *tapes)
    times = jnp.asarray([found.state.time])
    again, _ = stepper.replay(model, motion, found, tapes, jnp.asarray(count), times)
    return states, again.state


# ---- halved steps -------------------------------------------------------------------------------


def test_history_of_shorter_steps(begun):
    """With steps half as long the first differences of the accelerations are halved and the second ones
    quartered; a belongs to the instant t + (alpha_m - alpha_f) h."""
    stepper, now = begun.problem.stepper, begun.motion.state.now
    first, second = (jax.tree.map(lambda x, s=s: s + 0.0 * x, now.vdot) for s in (3.0, 5.0))
    state = now._replace(vdot_difference=first, vdot_second_difference=second)
    found, c = stepper.rescaled(state, jnp.asarray(0.5)), stepper.parameters
    assert (found.vdot_difference.hub == 1.5).all() and (found.vdot_second_difference.hub == 1.25).all()
    expected = now.vdot.hub + (c.alpha_m - c.alpha_f) * 1.5
    np.testing.assert_allclose(found.a.hub, expected, rtol=1e-14)


@pytest.mark.nightly
def test_a_step_that_fails_is_halved_and_doubled_again(begun):
    """A block ends before a step that fails. The next one begins there with fresh factors; if its first
    step fails, the step is halved, and after a whole step doubled. Ends of steps are exact multiples."""
    problem, motion = begun.problem, begun.motion
    stepper = like(problem.stepper, Stubborn)
    block = jit(lambda model, state: stepper.block(model, state))
    state, logs, halvings = motion.state, [], []
    while state.time < 12.0:
        state, steps = block(problem.model, state)
        logs.append(steps.log)
        halvings.append(int(state.halvings))
    assert [int(log.taken.sum()) for log in logs] == [4, 0, 0, 4, 2, STEPS_PER_FACTORISATION]
    assert halvings == [0, 1, 2, 1, 0, 0]
    ends = np.concatenate([log.end[log.taken] for log in logs])
    sizes = np.concatenate([log.size[log.taken] for log in logs])
    expected = [*[STEP] * 4, *[STEP / 4] * 4, *[STEP / 2] * 2, *[STEP] * STEPS_PER_FACTORISATION]
    assert sizes.tolist() == expected and ends.tolist() == np.cumsum(expected).tolist()
    assert state.taken == len(ends) and state.rejected == 3
    assert name_of(state.result) == "successful"


@pytest.mark.nightly
@pytest.mark.parametrize("kind", [Stubborn, StubbornStart])
def test_halved_steps_are_as_accurate_and_have_the_same_derivative(begun, kind):
    """The motion with halved steps differs from that with whole ones by less than the error of these. Its
    derivative by the initial spin agrees with the difference quotient, and in reverse mode with forward
    mode."""
    problem, motion = begun.problem, begun.motion
    now, window = motion.state.now, Window(jnp.asarray([2.2, 3.3]), jnp.asarray(2))
    zero = jnp.zeros(())

    def tips(stepper, x):
        v = jax.tree.map(lambda v: (1.0 + x) * v, now.v)
        point = Point(zero, now.q, v, Power(zero, zero), jnp.asarray(True))
        begin = Motion(*stepper.init(problem.model, point, jnp.asarray(jnp.inf)), jnp.zeros(2))
        end, points, _ = move(problem._replace(stepper=stepper), begin, window, jnp.asarray(jnp.inf))
        velocity, work = points.v.tether[:, 0, :, -1, 0].ravel(), points.work.dissipated
        return jnp.concatenate(
            [points.q.tether[:, 0, :, -1, 0].ravel(), velocity, work, end.state.now.v.hub[0]]
        )

    usual, halved = problem.stepper, like(problem.stepper, kind)
    run = jit(lambda x: tips(halved, x))
    value, whole = run(0.0), jit(lambda x: tips(usual, x))(0.0)
    assert 0.0 < np.abs(value - whole)[:6].max() < 1e-3
    e = 1e-4
    quotient = (8.0 * (run(e) - run(-e)) - (run(2 * e) - run(-2 * e))) / (12.0 * e)
    _, forward = jit(lambda x: jax.jvp(lambda x: tips(halved, x), (x,), (1.0,)))(0.0)
    size = np.abs(quotient).max()
    np.testing.assert_allclose(forward, quotient, rtol=1e-6, atol=1e-9 * size)
    weights = 1.0 / np.maximum(np.abs(forward), 1e-6 * size)
    reverse = jit(jax.grad(lambda x: weights @ tips(halved, x)))(0.0)
    np.testing.assert_allclose(reverse, weights @ forward, rtol=1e-9)
