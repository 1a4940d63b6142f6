"""Collocation at Radau points in acceleration form (Hairer & Wanner II, IV.5-IV.8 and VII.4).

On a step of length h the accelerations are a polynomial through s stages i = 1 ... s at t + c_i h:

    q_i = q + c_i h v + h^2 sum_j (A^2)_ij vdot_j,      v_i = v + h sum_j A_ij vdot_j
    M vdot_i + Phi_q^T lam_i = Q(t_i, q_i, v_i),        d^2 Phi / dt^2 = 0 at every stage

The last stage is the end of the step (c_s = 1). Order 2 s - 1 = 7 where generalized-alpha has 2. The
constraints enter by their second derivative, which makes the equations of index 1 and keeps that order;
position and velocity are put back on the constraints at the end of every step.

All stages are solved together by simplified Newton iterations. With A = T diag(mu) T^-1 the linear system
of all stages falls apart into one of the size of a single stage for each mu,

    M + (h mu)^2 K + h mu C    and the constraint gradients,

complex, with half of them the conjugates of the others. A block of up to `KEEP` steps of one length uses
one factorisation. Residuals are turned into the axes of the hub before a solve, the solution back after
it: inertia, elasticity and rigidity look the same from every direction. Accelerations of the last step,
seen from those axes, vary slowly and are extrapolated for the first guess.
"""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from esail_jax import newton_matrix
from esail_jax.array_types import Array, Bool, Float, Int, Rotation, Scalar, Vector
from esail_jax.coordinates import Coordinates, Multipliers
from esail_jax.dynamics.consistent import consistent_acceleration
from esail_jax.numerics import bordered
from esail_jax.numerics.angles import rotation_by
from esail_jax.numerics.radau import Radau
from esail_jax.system import Power, Residual, System

STAGES = 4
"""Order 7. With three (order 5) the steps of a sail are half as long, with five half as long again, at
the same cost per second of motion within a tenth."""

TABLE = Radau.of(STAGES)

KEEP = 6
"""Steps per factorisation, at most: refreshing it costs about two iterations and saves one per step when
a tether has turned by some degrees against the hub."""

MAX_ITERATIONS = 10
"""After which a step has failed: what converges so slowly is cheaper with half the step."""

LINEAR_ITERATIONS = 14
"""Of the linear equations of a derivative: each gains a factor of ten or more."""

DEGREE = 3
"""Of the polynomial extrapolated for the first guess."""

SOLVED = 0.05
"""Part of the tolerance to which the stages are solved."""

SAFETY, SHRINK, GROW, AS_IT_IS = 0.85, 0.2, 3.0, 1.15
"""Of the step control: part of the step that would just do, limits of a change, and the gain below which a
longer step is not worth a new factorisation."""


Attitudes = Float[Array, "stage 3 3"]


class Unknowns(NamedTuple):
    """What is solved for, one entry per stage (in a `History` one more, for the start of the step)."""

    vdot: Coordinates
    lam: Multipliers


class Point(NamedTuple):
    """An instant: what a step starts from and ends on. work [J] since the start of the run."""

    time: Scalar
    q: Coordinates
    v: Coordinates
    work: Power


class History(NamedTuple):
    """The last step's start and stages in the axes of the hub, for the next one's first guess; h [s] of
    that step, infinite when there was none."""

    values: Unknowns
    h: Scalar


class Progress(NamedTuple):
    """What a block of steps hands on. h: the step to try next; taken, rejected: steps so far."""

    now: Point
    history: History
    h: Scalar
    taken: Scalar
    rejected: Scalar


class StepInfo(NamedTuple):
    """How a step went. iterations; increment: what the last one left undone, over what is allowed; error:
    its estimate over the tolerance."""

    iterations: Int[Array, ""]
    increment: Scalar
    error: Scalar


class Record(NamedTuple):
    """A step as it was taken (`taken` False: there was none), and what its polynomials are made of."""

    start: Point
    h: Scalar
    vdot: Coordinates
    power: Power
    info: StepInfo
    taken: Bool[Array, ""]

    @property
    def end(self) -> Float[Array, "*step"]:
        """Time [s] at the end of the step, or of several."""
        return self.start.time + self.h

    def at(self, time: Scalar) -> tuple[Coordinates, Coordinates, Power]:
        """q, v and work within the step, from the polynomial of the accelerations and of the powers."""
        h, x = self.h, (time - self.start.time) / self.h
        powers = x ** jnp.arange(STAGES)
        once, twice = (x**n * (powers @ TABLE.integrals(n)) for n in (1, 2))
        q = jax.tree.map(
            lambda q, v, a: q + h * x * v + h**2 * jnp.tensordot(twice, a, 1),
            self.start.q, self.start.v, self.vdot,
        )  # fmt: skip
        v = jax.tree.map(lambda v, a: v + h * jnp.tensordot(once, a, 1), self.start.v, self.vdot)
        work = jax.tree.map(lambda w, p: w + h * once @ p, self.start.work, self.power)
        return q, v, work


class KeptFactors(NamedTuple):
    """Factors for every mu (leading axis), of the mass matrix for the projection, and the attitude they
    were made at. shape: a matrix of theirs, read for its layout."""

    stages: bordered.Factors
    mass: bordered.Factors
    shape: bordered.Bordered
    rotation: Rotation


class Collocation(eqx.Module):
    """step_size [s]: of every step, or None; then tolerance is the largest local error of a position,
    relative to the length of the tethers (of the hub: to its size). Iterations go on to a small part of
    the tolerance in either case."""

    step_size: Scalar | None
    tolerance: Scalar

    # ---- a run ------------------------------------------------------------------------------------

    def start(self, system: System, time: Scalar, q: Coordinates, v: Coordinates) -> Progress:
        """Where a run begins, and where it goes on after a load was switched."""
        vdot, lam = consistent_acceleration(system, time, q, v)
        zero = jnp.zeros(())
        now = Unknowns(vdot.rotate(system.rotation(time, q).T), lam)
        constant = jax.tree.map(lambda x: jnp.broadcast_to(x, (STAGES + 1, *x.shape)), now)
        h = self.step_size
        if h is None:
            h = first_step(system, vdot, self.tolerance)
        history = History(constant, jnp.asarray(jnp.inf))
        return Progress(Point(time, q, v, Power(zero, zero)), history, h, zero, zero)

    def block(self, system: System, state: Progress) -> tuple[Progress, Record]:
        """Up to KEEP steps with one factorisation, fewer where the step size changes; of each its record.

        It depends on nothing but `state`: a run that stops after a block and goes on later is the same."""
        kept = lax.stop_gradient(factor(*lax.stop_gradient((system, state))))
        h = state.h

        def go(carry):
            state, _ = carry
            return self.attempt(system, state, kept)

        def attempt(carry, _):
            state, going = carry
            none = jax.eval_shape(go, carry)[2]
            stay = (state, going, jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), none))
            state, going, record = lax.cond(going, go, lambda carry: stay, carry)
            return (state, going & (state.h == h)), record

        (state, _), records = lax.scan(attempt, (state, jnp.asarray(True)), length=KEEP)
        if self.step_size is None:
            state = state._replace(h=self.longer(state, records, h))
        return state, records

    def attempt(self, system: System, state: Progress, kept: KeptFactors) -> tuple[Progress, Array, Record]:
        """One step, kept or not; whether the block goes on."""
        now, h = state.now, lax.stop_gradient(state.h)
        guess = lax.stop_gradient(first_guess(*lax.stop_gradient((system, state))))
        enough = SOLVED * lax.stop_gradient(self.tolerance) * lengths(system)
        unknowns, power, iterations, increment = solve_stages(system, now, h, guess, kept, enough)
        solved = increment <= 1.0
        times, q, v = stage_states(now, h, unknowns.vdot)
        axes = jax.vmap(system.rotation)(times, q)
        body = jax.vmap(lambda a, r: a.rotate(r.T))(unknowns.vdot, axes)
        values = jax.tree.map(
            lambda old, new: jnp.concatenate([old[-1:], new]),
            state.history.values, Unknowns(body, unknowns.lam),
        )  # fmt: skip
        values = lax.stop_gradient(values)
        error = self.error(system, h, values.vdot)
        good = solved & jnp.isfinite(error)
        error = lax.stop_gradient(error)
        if self.step_size is None:
            good &= error <= 1.0
        weights = jnp.asarray(TABLE.matrix[-1])
        work = jax.tree.map(lambda w, p: w + h * weights @ p, now.work, power)
        end = on_constraints(system, kept, times[-1], *(jax.tree.map(lambda x: x[-1], c) for c in (q, v)))
        taken = state.taken + 1.0
        later = now.time + h if self.step_size is None else taken * h  # not a sum of rounded steps
        done = Progress(Point(later, *end, work), History(values, h), h, taken, state.rejected)
        shorter = jnp.where(solved, jnp.maximum(SAFETY * error ** (-1 / (STAGES + 2)), SHRINK), 0.5)
        shorter = h * jnp.where(jnp.isfinite(error), jnp.minimum(shorter, 0.9), 0.5)
        if self.step_size is not None:
            shorter = jnp.zeros(())  # nothing to try: the run is stuck
        again = state._replace(h=shorter, rejected=state.rejected + 1.0)
        after = jax.tree.map(lambda a, b: jnp.where(good, a, b), done, again)
        info = StepInfo(iterations, increment, error)
        return after, good, Record(now, h, unknowns.vdot, power, info, good)

    def longer(self, state: Progress, records: Record, h: Scalar) -> Scalar:
        """The next block's step."""
        worst = jnp.where(records.taken, records.info.error, 0.0).max()
        factor = jnp.clip(SAFETY * jnp.maximum(worst, 1e-30) ** (-1 / (STAGES + 2)), SHRINK, GROW)
        factor = jnp.where((factor > 1.0 / AS_IT_IS) & (factor < AS_IT_IS), 1.0, factor)
        return jnp.where(state.h == h, h * factor, state.h)

    def error(self, system: System, h: Scalar, body: Coordinates) -> Scalar:
        """Estimate of a step's error over the tolerance: by how much positions within the step change
        when the polynomial of the accelerations passes through the start of the step too."""
        scale = TABLE.between() * h**2
        beyond = jax.tree.map(lambda x: scale * jnp.tensordot(TABLE.difference(), x, 1), body)
        return largest(system, beyond, self.tolerance * lengths(system))

    def stuck(self, state: Progress) -> Array:
        """Has the state become infinite, or the step too small to change the time?"""
        finite = jnp.stack([jnp.isfinite(x).all() for x in jax.tree.leaves(state.now)]).all()
        return ~finite | ~(state.now.time + 0.25 * state.h > state.now.time)


# ---- one step -----------------------------------------------------------------------------------


def stage_states(
    start: Point, h: Scalar, vdot: Coordinates
) -> tuple[Float[Array, " stage"], Coordinates, Coordinates]:
    """Times, q and v of the stages."""

    def along(x):
        return TABLE.nodes.reshape(-1, *(1,) * x.ndim) * (h * x)

    q = jax.tree.map(
        lambda q, v, a: q + along(v) + h**2 * jnp.tensordot(TABLE.squared, a, 1), start.q, start.v, vdot
    )
    v = jax.tree.map(lambda v, a: v + h * jnp.tensordot(TABLE.matrix, a, 1), start.v, vdot)
    return start.time + h * TABLE.nodes, q, v


def stage_residuals(
    system: System, start: Point, h: Scalar, unknowns: Unknowns
) -> tuple[Residual, Power, Attitudes]:
    """Of every stage: what the equations of motion and the constraints' second derivatives [m/s^2] are
    short of, the power, and the attitude."""

    def residual(stage):
        time, q, v, vdot, lam = stage
        found, power = system.residual(time, q, v, vdot, lam)
        bend = system.constraint_acceleration(time, q, v, vdot)
        return Residual(found.forces, bend), power, system.rotation(time, q)

    # Stage by stage: one stage fits into the first cache, which makes the four a third faster.
    return lax.map(residual, (*stage_states(start, h, unknowns.vdot), *unknowns))


def correction(system: System, residual: Residual, axes: Attitudes, kept: KeptFactors) -> Unknowns:
    """Change of the unknowns that a simplified Newton step asks for."""
    turned = axes @ kept.rotation.T

    def to_rhs(residual, turned):
        forces = residual.forces.rotate(-turned.T)
        constraints = jax.tree.map(jnp.negative, residual.constraints)
        return newton_matrix.to_vector(system, forces, constraints)

    rhs = jax.tree.map(lambda x: jnp.tensordot(TABLE.split, x, 1), jax.vmap(to_rhs)(residual, turned))
    solution = jax.vmap(lambda factors, rhs: bordered.solve(kept.shape, factors, rhs))(kept.stages, rhs)
    solution = jax.tree.map(lambda x: jnp.tensordot(TABLE.mix, x, 1).real, solution)

    def from_solution(solution, turned):
        vdot, lam = newton_matrix.from_vector(system, solution)
        return Unknowns(vdot.rotate(turned), lam)

    return jax.vmap(from_solution)(solution, turned)


@jax.custom_jvp
def solve_stages(
    system: System,
    start: Point,
    h: Scalar,
    guess: Unknowns,
    kept: KeptFactors,
    enough: Float[Array, "2"],
) -> tuple[Unknowns, Power, Int[Array, ""], Scalar]:
    """Simplified Newton iterations, until what is left, judged by the last two increments of the
    positions, is `enough` [m] (of tethers and hub): unknowns, power, iterations, and what is left over
    that. Guess and factors decide how fast, not where to: they carry no derivative."""

    def iterate(carry):
        unknowns, _, count, before, _ = carry
        residual, power, axes = stage_residuals(system, start, h, unknowns)
        change = correction(system, residual, axes, kept)
        unknowns = jax.tree.map(jnp.add, unknowns, change)
        moved = jax.tree.map(lambda x: h**2 * jnp.tensordot(TABLE.squared, x, 1), change.vdot)
        increment = jax.vmap(lambda x: largest(system, x, enough))(moved).max()
        rate = jnp.where(count > 0, increment / before, 0.5)
        left = increment * jnp.where(rate < 1.0, rate / (1.0 - rate), jnp.inf)
        return unknowns, power, count + 1, increment, left

    def unfinished(carry):
        *_, count, _, left = carry
        return ~(left <= 1.0) & (count < MAX_ITERATIONS) & (jnp.isfinite(left) | (count < 2))

    none = jnp.zeros(STAGES)
    infinite = jnp.asarray(jnp.inf)
    carry = (guess, Power(none, none), jnp.zeros((), int), infinite, infinite)
    unknowns, power, count, _, left = lax.while_loop(unfinished, iterate, carry)
    return unknowns, power, count, left


@solve_stages.defjvp
def _solve_stages_jvp(primals, tangents):
    """d(unknowns) = -J^-1 d(residual): implicit function theorem, J being that of all stages together."""
    system, start, h, _, kept, _ = primals
    unknowns, power, count, left = solve_stages(*primals)
    axes = jax.vmap(system.rotation)(*stage_states(start, h, unknowns.vdot)[:2])

    def residuals(system, start, h, unknowns):
        return stage_residuals(system, start, h, unknowns)[:2]

    def along(change):
        return jax.jvp(lambda x: residuals(*primals[:3], x)[0], (unknowns,), (change,))[1]

    _, (given, _) = jax.jvp(lambda *x: residuals(*x, unknowns), primals[:3], tangents[:3])
    moved = linear_solution(system, along, given, axes, kept)
    _, (_, power_dot) = jax.jvp(residuals, (*primals[:3], unknowns), (*tangents[:3], moved))
    none = np.zeros((), jax.dtypes.float0)
    return (unknowns, power, count, left), (moved, power_dot, none, jnp.zeros(()))


def linear_solution(
    system: System,
    along: Callable[[Unknowns], Residual],
    given: Residual,
    axes: Attitudes,
    kept: KeptFactors,
) -> Unknowns:
    """x with along(x) + given = 0, by the same iterations, and their transpose for reverse mode.

    Roots move with the hub: in the square system that is solved, their rows are added to the hub's and
    their columns are taken out."""
    axes, kept = lax.stop_gradient((axes, kept))

    def with_roots(x):
        return x._replace(vdot=jax.vmap(lambda a: on_roots(system, a))(x.vdot))

    def without_roots(x):
        if system.roots is None:
            return x
        return x._replace(vdot=x.vdot._replace(tether=x.vdot.tether.at[:, 0, :, 0].set(0.0)))

    nothing = jax.tree.map(jnp.zeros_like, Unknowns(given.forces, given.constraints))
    fold = jax.linear_transpose(with_roots, nothing)

    def equations(residual):
        return fold(Unknowns(residual.forces, residual.constraints))[0]

    def matrix(x):
        apart = jax.tree.map(jnp.subtract, x, without_roots(x))
        return jax.tree.map(jnp.add, equations(along(with_roots(x))), apart)

    def precondition(residual):
        residual = without_roots(residual)
        return without_roots(correction(system, Residual(residual.vdot, residual.lam), axes, kept))

    def solve(matrix, rhs, precondition=precondition):
        def improve(_, x):
            short = jax.tree.map(jnp.subtract, matrix(x), rhs)
            return jax.tree.map(jnp.add, x, precondition(short))

        return lax.fori_loop(0, LINEAR_ITERATIONS, improve, jax.tree.map(jnp.zeros_like, rhs))

    def solve_transposed(transposed, rhs):
        backwards = jax.linear_transpose(precondition, rhs)
        return solve(transposed, rhs, lambda x: backwards(x)[0])

    rhs = jax.tree.map(jnp.negative, equations(given))
    return with_roots(lax.custom_linear_solve(matrix, rhs, solve, solve_transposed))


def on_roots(system: System, vdot: Coordinates) -> Coordinates:
    """A change of the accelerations with the roots where the hub's takes them; a frame's do not change."""
    if system.roots is None:
        return vdot
    root = jnp.zeros_like(vdot.tether[0, :, 0])
    if system.hub is not None:
        root = system.roots.positions(vdot.hub)
    return vdot._replace(tether=vdot.tether.at[0, :, 0].set(root))


def factor(system: System, state: Progress) -> KeptFactors:
    """Iteration matrices of a block at its start, and their factors."""
    zero, one, now, h = jnp.zeros(()), jnp.ones(()), state.now, state.h
    lam = jax.tree.map(lambda x: x[-1], state.history.values.lam)

    def tangent(stiffness, rate):
        return newton_matrix.tangent(system, now.time, now.q, now.v, lam, stiffness, rate)

    inert = newton_matrix.mass(system, now.time, now.q)
    stiff, moving = tangent(one, zero), tangent(one, one)

    def of_rate(mu):
        s = h * mu

        def combined(m, mk, mkc):
            return m + s**2 * (mk - m) + s * (mkc - mk)

        return bordered.factor(jax.tree.map(combined, inert, stiff, moving)._replace(weights=inert.weights))

    stages = jax.vmap(of_rate)(jnp.asarray(TABLE.rates))
    return KeptFactors(stages, bordered.factor(inert), inert, system.rotation(now.time, now.q))


def on_constraints(
    system: System, kept: KeptFactors, time: Scalar, q: Coordinates, v: Coordinates
) -> tuple[Coordinates, Coordinates]:
    """The nearest state on the constraints and their rates, by one Newton correction in the mass metric
    each: the stages miss them by the local error."""
    if system.has_constraints:
        turned = lax.stop_gradient(system.rotation(time, q)) @ kept.rotation.T
        nothing = jax.tree.map(jnp.zeros_like, q)

        def corrected(x, defect):
            rhs = newton_matrix.to_vector(system, nothing, jax.tree.map(jnp.negative, defect))
            change, _ = newton_matrix.from_vector(system, bordered.solve(kept.shape, kept.mass, rhs))
            return jax.tree.map(jnp.add, x, change.rotate(turned))

        q = corrected(q, system.constraints(time, q))
        _, rate = jax.jvp(lambda t, q: system.constraints(t, q), (time, q), (jnp.ones(()), v))
        v = corrected(v, rate)
    return system.place_roots(time, q), system.place_roots(time, v, derivative=1)


# ---- first guess --------------------------------------------------------------------------------


def first_guess(system: System, state: Progress) -> Unknowns:
    """The last step's accelerations and multipliers, extrapolated in the axes of the hub, which go on
    turning as they do now."""
    now, h = state.now, state.h
    x = 1.0 + TABLE.nodes * (h / state.history.h)
    weights = jnp.vander(x, DEGREE + 1, increasing=True) @ TABLE.extrapolation(DEGREE)
    values = jax.tree.map(lambda old: jnp.tensordot(weights, old, 1), state.history.values)
    spin, attitude = angular_velocity(system, now), system.rotation(now.time, now.q)
    times = now.time + h * TABLE.nodes

    def outward(time, vdot):
        turned = vdot.rotate(rotation_by(spin * (time - now.time)) @ attitude)
        return system.place_roots(time, turned, derivative=2)

    return Unknowns(jax.vmap(outward)(times, values.vdot), values.lam)


def angular_velocity(system: System, now: Point) -> Vector:
    """omega [rad/s] of the hub or of the turning frame, in I."""

    def attitude(tau):
        q = now.q if now.q.hub is None else now.q.axpy(tau, now.v)
        return system.rotation(now.time + tau, q)

    axes, rate = jax.jvp(attitude, (jnp.zeros(()),), (jnp.ones(()),))
    skew = rate @ axes.T
    return 0.5 * jnp.stack([skew[2, 1] - skew[1, 2], skew[0, 2] - skew[2, 0], skew[1, 0] - skew[0, 1]])


# ---- sizes --------------------------------------------------------------------------------------


def lengths(system: System) -> Float[Array, "2"]:
    """What errors are measured by [m]: the shortest tether's length, and the hub's size."""
    tethers = system.tethers
    total = jnp.broadcast_to(tethers.element_length, (tethers.elements, tethers.count)).sum(0).min()
    hub = total if system.hub is None else HUB_SHARE * system.hub.radius
    return lax.stop_gradient(jnp.stack([total, hub]))


HUB_SHARE = 0.1
"""Errors of the hub's points count ten times: they turn everything."""


def largest(system: System, change: Coordinates, unit: Float[Array, "2"]) -> Scalar:
    """Largest change of a position (slopes times l) in units of tether's and hub's."""
    size = jnp.abs(system.tethers.scale_slopes(change.tether)).max() / unit[0]
    return size if change.hub is None else jnp.maximum(size, jnp.abs(change.hub).max() / unit[1])


def first_step(system: System, vdot: Coordinates, tolerance: Scalar) -> Scalar:
    """A guess [s]: the time to fall a tether's length at the largest acceleration, times what a step may
    be of the time scale of the motion at that tolerance."""
    fastest = jnp.abs(vdot.tether[0]).max()
    scale = jnp.sqrt(lengths(system)[0] / jnp.maximum(fastest, 1e-30))
    return tolerance ** (1.0 / (STAGES + 2)) * scale
