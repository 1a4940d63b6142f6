"""Collocation at damped Lobatto points in acceleration form (Hairer & Wanner II, IV.5-IV.8 and VII.4).

The accelerations of a step are a polynomial through points the first and last of which are the start and
the end of the step (`stages.py`). Order 2 s - 1 = 7 where generalized-alpha has 2. The constraints enter by
their second derivative, which makes the equations of index 1 and keeps that order; position and velocity
are put back on the constraints at the end of every step.

A block of up to `KEEP` steps of one length uses one factorisation. Accelerations of the last step, seen
from the axes of the hub, vary slowly and are extrapolated for the first guess. Of every step the error is
estimated, and the length of the next ones chosen.
"""

from types import ModuleType

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from esail_jax.array_types import Array, Float, Scalar, Vector
from esail_jax.coordinates import Coordinates
from esail_jax.numerics.angles import rotation_by
from esail_jax.numerics.lockstep import repeat
from esail_jax.numerics.small_matrices import matmul
from esail_jax.steppers.collocation_solution import MAX_ITERATIONS, solve_stages
from esail_jax.steppers.collocation_stages import (
    STAGES,
    TABLE,
    KeptFactors,
    Point,
    Unknowns,
    combined,
    factor,
    largest,
    lengths,
    on_constraints,
    rounding,
    stage_powers,
    stage_states,
)
from esail_jax.steppers.collocation_steps import History, Progress, Record, StepInfo, no_record
from esail_jax.steppers.consistent import consistent_motion
from esail_jax.system import Power, System

KEEP = 24
"""Steps per factorisation, at most. In axes that move with the sail the factors stay good much longer; this
is how often a step may become longer."""

REFRESH = 5
"""Iterations that fresh factors cost: when a block's steps together have taken as many more than its best
one would have, it ends."""

SOLVED = 0.01
"""Part of the tolerance to which the stages are solved."""

SEEN = 1.0 / 64.0
"""Part of an error estimate that counts: it is that of a polynomial of one degree less. With it a tolerance
of 1e-8 keeps every observable of the baseline within 1e-3 through three periods."""

EXACT = 5e-15
"""Part of the lengths to which they are where the step is given: its error is to be seen, not theirs."""

SAFETY, SHRINK, GROW, AS_IT_IS = 0.85, 0.2, 3.0, 1.15
"""Of the step control: part of the step that would just do, limits of a change, and the gain below which a
longer step is not worth a change."""

TOO_SHORT = 1.5
"""Possible gain of two steps in a row that ends a block before its time."""


class Collocation(eqx.Module):
    """step_size [s]: of every step, or None; then tolerance is the largest local error of a position,
    relative to the length of the tethers (of the hub: to its size). Iterations go on to a small part of
    it, to rounding where the step is given."""

    step_size: Scalar | None
    tolerance: Scalar

    # ---- a run ------------------------------------------------------------------------------------

    def start(self, system: System, time: Scalar, q: Coordinates, v: Coordinates) -> Progress:
        """Where a run begins."""
        vdot, lam, _, power = consistent_motion(system, time, q, v)
        zero = jnp.zeros(())
        now = Unknowns(vdot.rotate(system.rotation(time, q).T), lam)
        constant = jax.tree.map(lambda x: jnp.broadcast_to(x, (STAGES + 1, *x.shape)), now)
        h = self.step_size
        if h is None:
            h = first_step(system, vdot, self.tolerance)
        history = History(constant, jnp.asarray(jnp.inf))
        start = Point(time, q, v, vdot, Power(zero, zero), power)
        return Progress(start, history, h, zero, zero, time)

    def start_again(
        self, system: System, at: Point, taken: Scalar, rejected: Scalar, until: Scalar
    ) -> Progress:
        """Where a run goes on from a point at which something was switched: accelerations before it say
        nothing about those after. taken, rejected: steps until then; until: when something is switched
        again. A first step that went beyond would look at what comes after that only."""
        fresh = self.start(system, at.time, at.q, at.v)
        at = fresh.now._replace(work=at.work)
        if self.step_size is None:
            fresh = fresh._replace(h=jnp.minimum(fresh.h, until - at.time))
        origin = at.time if self.step_size is None else at.time - taken * self.step_size
        return fresh._replace(now=at, taken=taken, rejected=rejected, origin=origin)

    def block(self, system: System, state: Progress) -> tuple[Progress, Record]:
        """Up to KEEP steps with one factorisation, fewer where a step fails, is too short, or the factors
        are no longer good; of each its record.

        It depends on nothing but `state`: a run that stops after a block and goes on later is the same."""
        lam = jax.tree.map(lambda x: x[-1], state.history.values.lam)
        kept, h = factor(system, state.now, state.h, lam), state.h

        def step(carry):
            state, fewest, steps, spent, error_before = carry
            state, good, record = self.attempt(system, state, kept)
            error, count = record.info.error, record.info.iterations
            fewest, steps, spent = jnp.minimum(fewest, count), steps + 1, spent + count
            going = good & (spent - steps * fewest < REFRESH)
            if self.step_size is None:
                going &= change_of_step(jnp.maximum(error, error_before)) < TOO_SHORT
            return (state, fewest, steps, spent, error), going, record

        none = jnp.zeros((), int)
        carry = (state, jnp.asarray(MAX_ITERATIONS), none, none, jnp.asarray(jnp.inf))
        (state, *_), records = repeat(step, carry, KEEP, no_record(state))
        if self.step_size is None:
            state = state._replace(h=next_step(state, records, h))
        return state, records

    def attempt(self, system: System, state: Progress, kept: KeptFactors) -> tuple[Progress, Array, Record]:
        """One step, taken or to be tried again with a shorter length; whether it was taken."""
        now, h = state.now, state.h
        guess = first_guess(system, state)
        part = EXACT if self.step_size is not None else SOLVED * self.tolerance
        enough = jnp.maximum(part * lengths(system), rounding(now.q))
        unknowns, iterations, left = solve_stages(system, now, h, guess, kept, enough)
        solved = left <= 1.0
        times, q, _ = stage_states(now, h, unknowns.vdot)
        values = seen_from_hub(system, state.history, times, q, unknowns)
        error = self.error(system, now, h, unknowns.vdot)
        good = solved & jnp.isfinite(error)
        if self.step_size is None:
            good &= error <= 1.0

        end = end_of_step(system, now, h, unknowns, kept)
        power = stage_powers(system, now, h, unknowns)
        work = jax.tree.map(jnp.add, now.work, work_of_step(h, now.power, power))
        taken = state.taken + 1.0
        # Not a sum of rounded steps, where they are given.
        later = now.time + h if self.step_size is None else state.origin + taken * h
        last_vdot, last_power = jax.tree.map(lambda x: x[-1], (unknowns.vdot, power))
        end = Point(later, *end, last_vdot, work, last_power)
        done = state._replace(now=end, history=History(values, h), h=h, taken=taken)

        shorter = jnp.zeros(())  # nothing to try: the run is stuck
        if self.step_size is None:
            by_error = jnp.where(solved & jnp.isfinite(error), change_of_step(error), 0.5)
            shorter = h * jnp.minimum(by_error, 0.9)
        again = state._replace(h=shorter, rejected=state.rejected + 1.0)
        after = jax.tree.map(lambda a, b: jnp.where(good, a, b), done, again)
        info = StepInfo(iterations, left, error)
        return after, good, Record(now, h, unknowns, power, info, good)

    def error(self, system: System, now: Point, h: Scalar, vdot: Coordinates) -> Scalar:
        """Estimate of a step's error over the tolerance: by how much positions within the step change
        when the polynomial of the accelerations leaves out the start of the step."""
        scale = SEEN * TABLE.between() * h**2
        first, *others = TABLE.difference()

        def beyond(before, stages):
            return scale * (first * before + jnp.tensordot(np.array(others), stages, 1))

        beyond = jax.tree.map(beyond, now.vdot, vdot)
        return largest(system, beyond, self.tolerance * lengths(system))

    def stuck(self, state: Progress, xp: ModuleType = jnp) -> Array | np.bool:
        """Has the state become infinite, or the step too small to change the time? xp: NumPy on the host,
        where every operation of JAX costs more than all of these."""
        finite = xp.stack([xp.isfinite(x).all() for x in jax.tree.leaves(state.now)]).all()
        return ~finite | ~(state.now.time + 0.25 * state.h > state.now.time)


def end_of_step(
    system: System, now: Point, h: Scalar, unknowns: Unknowns, kept: KeptFactors
) -> tuple[Coordinates, Coordinates]:
    """q and v at the end of a step whose stages are solved, on the constraints."""
    times, q, v = stage_states(now, h, unknowns.vdot)
    return on_constraints(system, kept, times[-1], *(jax.tree.map(lambda x: x[-1], c) for c in (q, v)))


def work_of_step(h: Scalar, first: Power, power: Power) -> Power:
    """Work [J] over a step of the powers at its start and of the stages."""
    weights = jnp.asarray(TABLE.matrix[-1])
    return jax.tree.map(lambda p0, p: h * (TABLE.start[-1] * p0 + weights @ p), first, power)


# ---- length of the steps ------------------------------------------------------------------------


def change_of_step(error: Scalar) -> Scalar:
    """Factor to a length whose error would be the tolerance, with a margin."""
    return jnp.clip(SAFETY * jnp.maximum(error, 1e-30) ** (-1 / (STAGES + 2)), SHRINK, GROW)


def next_step(state: Progress, records: Record, h: Scalar) -> Scalar:
    """Length of the next block's steps, from the largest error of a block of length h; a step that failed
    has chosen already."""
    factor = change_of_step(jnp.where(records.taken, records.info.error, 0.0).max())
    factor = jnp.where((factor > 1.0 / AS_IT_IS) & (factor < AS_IT_IS), 1.0, factor)
    return jnp.where(state.h == h, h * factor, state.h)


def first_step(system: System, vdot: Coordinates, tolerance: Scalar) -> Scalar:
    """A guess [s]: the time to fall a tether's length at the largest acceleration, times what a step may
    be of the time scale of the motion at that tolerance."""
    fastest = jnp.abs(vdot.tether[0]).max()
    scale = jnp.sqrt(lengths(system)[0] / jnp.maximum(fastest, 1e-30))
    return tolerance ** (1.0 / (STAGES + 2)) * scale


# ---- first guess --------------------------------------------------------------------------------


def first_guess(system: System, state: Progress) -> Unknowns:
    """The last step's accelerations and multipliers, extrapolated in the axes of the hub, which go on
    turning as they do now."""
    now, h = state.now, state.h
    x = 1.0 + TABLE.nodes * (h / state.history.h)
    weights = matmul(jnp.vander(x, STAGES + 1, increasing=True), TABLE.extrapolation())
    values = jax.tree.map(lambda old: combined(weights, old), state.history.values)
    spin, attitude = angular_velocity(system, now), system.rotation(now.time, now.q)
    times = now.time + h * TABLE.nodes

    def outward(time, vdot):
        turned = vdot.rotate(matmul(rotation_by(spin * (time - now.time)), attitude))
        return system.place_roots(time, turned, derivative=2)

    return Unknowns(jax.vmap(outward)(times, values.vdot), values.lam)


def seen_from_hub(
    system: System,
    history: History,
    times: Float[Array, " stage"],
    q: Coordinates,
    unknowns: Unknowns,
) -> Unknowns:
    """The stages in the axes of the hub, after the step's start, which is the last one's end."""
    axes = jax.vmap(system.rotation)(times, q)
    body = jax.vmap(lambda a, r: a.rotate(r.T))(unknowns.vdot, axes)
    return jax.tree.map(
        lambda old, new: jnp.concatenate([old[-1:], new]), history.values, Unknowns(body, unknowns.lam)
    )


def angular_velocity(system: System, now: Point) -> Vector:
    """omega [rad/s] of the hub or of the turning frame, in I."""

    def attitude(tau):
        q = now.q if now.q.hub is None else now.q.axpy(tau, now.v)
        return system.rotation(now.time + tau, q)

    axes, rate = jax.jvp(attitude, (jnp.zeros(()),), (jnp.ones(()),))
    skew = matmul(rate, axes.T)
    return 0.5 * jnp.stack([skew[2, 1] - skew[1, 2], skew[0, 2] - skew[2, 0], skew[1, 0] - skew[0, 1]])
