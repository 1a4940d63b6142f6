"""Jumps of what laws of users command, voltages and the tensions of motors: found while the run takes its
steps, and said.

A law may compare what it measures, as in `jnp.where(phase > 0, V, 0)`. Its value then jumps at instants
that the steps do not know. Error control makes the steps across them so short that the motion is right to
the tolerance. A derivative is not: it would need the derivative of each such instant, and the steps that
were taken give the derivative at fixed instants. The values of such laws are therefore looked at within
every step. The laws of the package cost nothing.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax.numpy as jnp
from jax import lax

from esail_jax.array_types import Array, Bool, Float, PerTether, Scalar
from esail_jax.coordinates import Coordinates
from esail_jax.loads.coulomb import CoulombThrust
from esail_jax.loads.electron_current import PowerLimited
from esail_jax.loads.own_law import ContinuousLaw
from esail_jax.loads.own_terms import OwnWinchLaw, SampledWinchLaw
from esail_jax.numerics.own_derivative import custom_jvp
from esail_jax.steppers.knots import near
from esail_jax.steppers.stepper import AbstractStepper, AbstractSteps
from esail_jax.system import System
from esail_jax.terms import find_term

PARTS = 8
"""Number of equal parts of a step between whose ends the values are compared."""

UNEVEN = 1e-6
"""Part of the largest value by which changes in neighbouring parts must differ to be looked at again."""

CLOSER, LEFT = 13, 0.1
"""Three parts about the most uneven change are divided again, as often as the first: to some microseconds.
The change is a jump if more than the second of it is left in one part. Of a kink, 1e-5 is left."""

STEEP, STEEP_AFTER = 0.05, 3
"""A change of more than the first of the largest value in one part, after the time was divided as often
as the second, counts as a jump, too: no step resolves it, so that a derivative would miss it."""


class Watched(NamedTuple):
    """What is looked at. values: those of a law at a time [s], positions and velocities, one per tether;
    knots: instants [s] at which steps end and the law may jump; None without any."""

    values: Callable[[Scalar, Coordinates, Coordinates], PerTether]
    knots: Float[Array, " knot"] | None


def watched(model: Any) -> tuple[Watched, ...]:
    """Laws of users that are evaluated at every state: a voltage law, and all that say together what
    motors hold."""
    if not isinstance(model, System):
        return ()
    laws: list[Watched] = []
    load = find_term(model.loads, CoulombThrust)
    if load is not None:
        law = load.voltage_law
        if isinstance(law.law if isinstance(law, PowerLimited) else law, ContinuousLaw):
            laws += [Watched(lambda t, q, v: load.commanded(model.measurements(t, q, v)), None)]
    if any(
        isinstance(law, OwnWinchLaw) and not isinstance(law, SampledWinchLaw) for law in model.winch_laws
    ):
        knots = [x for law in model.winch_laws for x in law.knots]
        laws += [Watched(model.motor_tension, jnp.concatenate(knots) if knots else None)]
    return tuple(laws)


def largest_jump(stepper: AbstractStepper, model: Any, steps: AbstractSteps) -> Scalar:
    """The largest jump of what laws command within the steps of a block, relative to the largest value
    there; zero without any."""
    log, shape = steps.log, steps.taken.shape

    def within(k, law):
        step = steps.pick(jnp.unravel_index(k, shape))

        def values(time):
            point = stepper.evaluate(model, step, time)
            return law.values(time, point.q, point.v)

        return jump_within(values, log.end[k] - log.size[k], log.size[k], law.knots)

    def of_step(k):
        jumps = [lax.cond(log.taken[k], partial(within, law=x), nothing, k) for x in watched(model)]
        return jnp.stack(jumps).max()

    def nothing(k):
        return jnp.zeros(())

    return lax.map(of_step, jnp.arange(log.taken.size)).max()


def jump_within(
    values: Callable[[Scalar], PerTether],
    begin: Scalar,
    length: Scalar,
    knots: Float[Array, " knot"] | None = None,
) -> Scalar:
    """The largest jump of the values of a law within a time, relative to the largest of them; zero without
    any. values: those at a time [s]; begin, length: of the time [s]; knots: instants whose jumps do not
    count, as steps end there."""

    def sampled(begin, length):
        times = begin + length * jnp.linspace(0.0, 1.0, PARTS + 1)
        return lax.map(values, times, batch_size=PARTS + 1)

    def known(begin, length):
        """Tells of every part whether a knot is in it."""
        if knots is None:
            return jnp.zeros((PARTS, 1), bool)
        ends = begin + length * jnp.linspace(0.0, 1.0, PARTS + 1)
        margin = 4.0 * near(ends)
        inside = (knots >= (ends - margin)[:-1, None]) & (knots <= (ends + margin)[1:, None])
        return inside.any(1)[:, None]

    whole = sampled(begin, length)
    largest = jnp.abs(whole).max()
    uneven = unevenness(whole, known(begin, length))
    place, tether = jnp.unravel_index(jnp.argmax(uneven), uneven.shape)
    first = uneven[place, tether]

    def closer(carry):
        level, begin, length, place, _, steep = carry
        begin = begin + jnp.clip(place - 1, 0, PARTS - 3) * length / PARTS
        length = 3.0 * length / PARTS
        one, passed = sampled(begin, length)[:, tether][:, None], known(begin, length)
        left = jnp.where(passed, 0.0, jnp.abs(jnp.diff(one, axis=0))).max()
        steep = jnp.where(level == STEEP_AFTER, left, steep)
        return level + 1, begin, length, jnp.argmax(unevenness(one, passed)), left, steep

    # A loop and no branch: a batch, which computes both branches, would look closer at every step.
    def unfinished(carry):
        return (carry[0] < CLOSER) & (first > UNEVEN * largest)

    none = jnp.zeros(())
    carry = (jnp.zeros((), int), begin, length, place, none, none)
    *_, left, steep = lax.while_loop(unfinished, closer, carry)
    steep = jnp.where(steep > STEEP * largest, steep, 0.0)
    jump = jnp.where(left > LEFT * first, left, steep)
    return jnp.where(jump > 0.0, jump / largest, 0.0)


def unevenness(
    values: Float[Array, "end tether"], known: Bool[Array, "part 1"]
) -> Float[Array, "part tether"]:
    """By how much the change in each part differs from what its neighbours make one expect: from
    their mean, and at the ends from the straight line through the next two. It is small of third order for
    smooth values. known: parts whose changes do not count, and are left out of all comparisons."""
    change = jnp.diff(values, axis=0)
    inner = change[1:-1] - 0.5 * (change[:-2] + change[2:])
    ends = [change[i] - 2.0 * change[j] + change[k] for i, j, k in ((0, 1, 2), (-1, -2, -3))]
    uneven = jnp.abs(jnp.concatenate([ends[0][None], inner, ends[1][None]]))
    beside = known[1:-1] | known[:-2] | known[2:]
    first, last = (known[i].any(0)[None] for i in (jnp.arange(3), jnp.arange(PARTS - 3, PARTS)))
    return jnp.where(jnp.concatenate([first, beside, last]), 0.0, uneven)


@custom_jvp
def without_derivative(x: Array, jumped: Array) -> Array:
    """x. Its derivative is NaN if a law has jumped."""
    return x


@without_derivative.defjvp
def _without_derivative_jvp(primals, tangents):
    (x, jumped), moved = primals, tangents[0]
    return without_derivative(x, jumped), jnp.where(jumped, jnp.nan, 1.0) * moved


DERIVATIVE = (
    "A law of your own jumps within a step: a derivative of this run is refused, because it lacks that of "
    "the instant of the jump (round the jump off, or give the law a `period`)."
)
"""The sentence that refuses a derivative."""


JUMPS = (
    "A law of your own jumps within steps: the motion is right to its tolerance with error control only, "
    "and derivatives of it are refused."
)
"""The warning about a run in which the voltage or the tension of a law jumped."""


def jump_warning(jump: float | None) -> str:
    """The warning about a run in which what a law commands jumped by this part of its largest value; empty
    if none did, or if none is looked for."""
    if jump is None or not jump > 0.0:
        return ""
    return JUMPS.replace("within steps", f"within steps, by up to {100.0 * jump:.2g} % of the largest", 1)
