"""Jumps of the voltage of a law that a user wrote: found while the run takes its steps, and said.

A law may compare what it measures, as in `jnp.where(phase > 0, V, 0)`. Its voltage then jumps at instants
that the steps do not know. Error control makes the steps across them so short that the motion is right to
the tolerance. A derivative is not: it would need the derivative of each such instant, and the steps that
were taken give the derivative at fixed instants. The voltages of such a law are therefore looked at within
every step. The laws of the package cost nothing.
"""

from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
from jax import lax

from esail_jax.array_types import Array, Float, PerTether, Scalar
from esail_jax.loads.coulomb import CoulombThrust
from esail_jax.loads.electron_current import PowerLimited
from esail_jax.loads.own_law import ContinuousLaw
from esail_jax.numerics.own_derivative import custom_jvp
from esail_jax.steppers.stepper import AbstractStepper, AbstractSteps
from esail_jax.system import System
from esail_jax.terms import find_term

PARTS = 8
"""Number of equal parts of a step between whose ends the voltages are compared."""

UNEVEN = 1e-6
"""Part of the largest voltage by which changes in neighbouring parts must differ to be looked at again."""

CLOSER, LEFT = 13, 0.1
"""Three parts about the most uneven change are divided again, as often as the first: to some microseconds.
The change is a jump if more than the second of it is left in one part. Of a kink, 1e-5 is left."""

STEEP, STEEP_AFTER = 0.05, 3
"""A change of more than the first of the largest voltage in one part, after the time was divided as often
as the second, counts as a jump, too: no step resolves it, so that a derivative would miss it."""


def law_of(model: Any) -> tuple[CoulombThrust, ContinuousLaw] | None:
    """The load of a user's law that is evaluated at every state, and the law; None without one."""
    load = find_term(model.loads, CoulombThrust) if isinstance(model, System) else None
    if load is None:
        return None
    law = load.voltage_law
    law = law.law if isinstance(law, PowerLimited) else law
    return (load, law) if isinstance(law, ContinuousLaw) else None


def largest_jump(stepper: AbstractStepper, model: Any, steps: AbstractSteps) -> Scalar:
    """The largest jump of a voltage within the steps of a block, relative to the largest voltage
    there; zero without any."""
    load, _ = law_of(model)
    log, shape = steps.log, steps.taken.shape

    def within(k):
        step = steps.pick(jnp.unravel_index(k, shape))

        def volts(time):
            point = stepper.evaluate(model, step, time)
            return load.commanded(model.measurements(time, point.q, point.v))

        return jump_within(volts, log.end[k] - log.size[k], log.size[k])

    def of_step(k):
        return lax.cond(log.taken[k], within, lambda k: jnp.zeros(()), k)

    return lax.map(of_step, jnp.arange(log.taken.size)).max()


def jump_within(volts: Callable[[Scalar], PerTether], begin: Scalar, length: Scalar) -> Scalar:
    """The largest jump of voltages [V] within a time, relative to the largest of them; zero without
    any. volts: the voltages at a time [s]; begin, length: of the time [s]."""

    def sampled(begin, length):
        times = begin + length * jnp.linspace(0.0, 1.0, PARTS + 1)
        return lax.map(volts, times, batch_size=PARTS + 1)

    whole = sampled(begin, length)
    largest = jnp.abs(whole).max()
    uneven = unevenness(whole)
    place, tether = jnp.unravel_index(jnp.argmax(uneven), uneven.shape)
    first = uneven[place, tether]

    def closer(carry):
        level, begin, length, place, _, steep = carry
        begin = begin + jnp.clip(place - 1, 0, PARTS - 3) * length / PARTS
        length = 3.0 * length / PARTS
        one = sampled(begin, length)[:, tether][:, None]
        left = jnp.abs(jnp.diff(one, axis=0)).max()
        steep = jnp.where(level == STEEP_AFTER, left, steep)
        return level + 1, begin, length, jnp.argmax(unevenness(one)), left, steep

    # A loop and no branch: a batch, which computes both branches, would look closer at every step.
    def unfinished(carry):
        return (carry[0] < CLOSER) & (first > UNEVEN * largest)

    none = jnp.zeros(())
    carry = (jnp.zeros((), int), begin, length, place, none, none)
    *_, left, steep = lax.while_loop(unfinished, closer, carry)
    steep = jnp.where(steep > STEEP * largest, steep, 0.0)
    jump = jnp.where(left > LEFT * first, left, steep)
    return jnp.where(jump > 0.0, jump / largest, 0.0)


def unevenness(volts: Float[Array, "end tether"]) -> Float[Array, "part tether"]:
    """By how much the change in each part differs from what its neighbours make one expect: from
    their mean, and at the ends from the straight line through the next two. It is small of third order for
    smooth voltages."""
    change = jnp.diff(volts, axis=0)
    inner = change[1:-1] - 0.5 * (change[:-2] + change[2:])
    ends = [change[i] - 2.0 * change[j] + change[k] for i, j, k in ((0, 1, 2), (-1, -2, -3))]
    return jnp.abs(jnp.concatenate([ends[0][None], inner, ends[1][None]]))


@custom_jvp
def without_derivative(x: Array, jumped: Array) -> Array:
    """x. Its derivative is NaN if the voltage has jumped."""
    return x


@without_derivative.defjvp
def _without_derivative_jvp(primals, tangents):
    (x, jumped), moved = primals, tangents[0]
    return without_derivative(x, jumped), jnp.where(jumped, jnp.nan, 1.0) * moved


DERIVATIVE = (
    "The voltage of `voltage_law` jumps within a step: a derivative of this run is refused, because it "
    "lacks that of the instant of the jump (round the jump off, or give the law a `period`)."
)
"""The sentence that refuses a derivative."""


JUMPS = (
    "The voltage of `voltage_law` jumps within steps: the motion is right to its tolerance with error "
    "control only, and derivatives of it are refused."
)
"""The warning about a run in which a voltage jumped."""


def jump_warning(jump: float | None) -> str:
    """The warning about a run in which a voltage jumped by this part of the largest one; empty if
    none did, or if none is looked for."""
    if jump is None or not jump > 0.0:
        return ""
    return JUMPS.replace("within steps", f"within steps, by up to {100.0 * jump:.2g} % of the largest", 1)
