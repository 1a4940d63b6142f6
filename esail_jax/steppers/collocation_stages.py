"""The equations of all stages of a collocation step, and the linear equations of their iterations.

In a step of length h the accelerations are a polynomial through the acceleration at its start and those of
s stages i = 1 ... s at t + c_i h (`numerics/lobatto.py`):

    q_i = q + c_i h v + h^2 [(A b)_i vdot + sum_j (A^2)_ij vdot_j]
    v_i = v + h [b_i vdot + sum_j A_ij vdot_j]
    M vdot_i + Phi_q^T lam_i = Q(t_i, q_i, v_i),        d^2 Phi / dt^2 = 0 at every stage

All stages are solved together by simplified Newton iterations. With A = T diag(mu) T^-1 the linear system
of all stages separates into one complex system of the size of a single stage for each mu,

    M + (h mu)^2 K + h mu C    and the constraint gradients,

where half of these systems are the conjugates of the others. The factors are used for many steps: residuals
are rotated to the corotational axes of the factors, and solutions back to those of the stage
(`corotational_axes.py`). While tethers are taut, the first iteration reduces the error by several hundred,
the next ones by 20 to 60.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from esail_jax import iteration_matrix
from esail_jax.array_types import Array, Complex, Float, Scalar
from esail_jax.coordinates import Coordinates, Multipliers
from esail_jax.numerics import bordered, structured
from esail_jax.numerics.lobatto import Lobatto
from esail_jax.numerics.lockstep import per_member_table
from esail_jax.numerics.small_matrices import matmul
from esail_jax.numerics.vectors import greatest
from esail_jax.steppers.corotational_axes import Axes, Turn, axes_of, turn
from esail_jax.system import Power, Residual, System

STAGES = 4
"""Number of stages s; the order is 2 s - 1 = 7. Five stages need 44 % fewer steps for 1e-3 accuracy on the
baseline, but 33 % more time."""

SPECTRAL_RADIUS = 0.5
"""Amplification of infinitely stiff modes. With 0.8 the number of steps is the same, but a sail 1e5 times
stiffer has twice as many rejections."""

TABLE = Lobatto.of(STAGES, SPECTRAL_RADIUS)

LEAST_SIZE_FOR_GEMM = 36
"""Least size of a stage's array for which a product uses the matrix library (GEMM)."""

LAST_PLACES = 2e-15
"""Rounding error of a coordinate: ten units in the last place, relative to the largest coordinate."""

HUB_SHARE = 0.1
"""Allowed error of the hub's points relative to that of tether nodes. An error of the hub's attitude
rotates the whole sail."""


class StageUnknowns(NamedTuple):
    """Accelerations and multipliers, one entry per stage; in a `History` one more, for the start of the
    step."""

    vdot: Coordinates
    lam: Multipliers


class StepEnd(NamedTuple):
    """The motion at the start or the end of a step. time [s]; work since the start of the run [J]; power
    [W]."""

    time: Scalar
    q: Coordinates
    v: Coordinates
    vdot: Coordinates
    work: Power
    power: Power


class FrozenFactors(NamedTuple):
    """The factors that serve for several steps: those of every mu (leading axis), those of the mass matrix
    for the projection, and the axes in which they were made. shape: one of the matrices, for its layout."""

    stages: structured.Factors
    mass: structured.Factors
    shape: bordered.Bordered
    axes: Axes


def combined(
    table: Float[Array | np.ndarray, "row stage"],
    stages: Float[Array, "stage *x"],
    like: Array | None = None,
) -> Float[Array, "row *x"]:
    """The product of a table and the stages. The small product of the hub is written out, because a
    call of the matrix library would take longer."""
    if stages[0].size > LEAST_SIZE_FOR_GEMM:
        return jnp.tensordot(per_member_table(table, stages if like is None else like), stages, 1)
    return (table.reshape(*table.shape, *(1,) * (stages.ndim - 1)) * stages).sum(1)


# ---- equations ----------------------------------------------------------------------------------


def stage_states(
    start: StepEnd, h: Scalar, vdot: Coordinates
) -> tuple[Float[Array, " stage"], Coordinates, Coordinates]:
    """Times [s], positions and velocities of the stages for given accelerations."""

    def along(weights, x):
        return weights.reshape(-1, *(1,) * x.ndim) * x

    # Both integrals in one product.
    tables = jnp.concatenate([h**2 * TABLE.squared, h * TABLE.matrix])
    integrals = jax.tree.map(lambda a: combined(tables, a), vdot)

    def positions(q, v, first, a):
        return q + along(TABLE.nodes, h * v) + h**2 * along(TABLE.start_squared, first) + a[:STAGES]

    def velocities(v, first, a):
        return v + h * along(TABLE.start, first) + a[STAGES:]

    q = jax.tree.map(positions, start.q, start.v, start.vdot, integrals)
    v = jax.tree.map(velocities, start.v, start.vdot, integrals)
    return start.time + h * TABLE.nodes, q, v


def stage_residuals(
    system: System, start: StepEnd, h: Scalar, unknowns: StageUnknowns
) -> tuple[Residual, Axes]:
    """The residuals of all stages (equations of motion, and second derivatives of the constraints
    [m/s^2]) and the corotational axes of the stages."""
    times, q, v = stage_states(start, h, unknowns.vdot)
    axes = jax.vmap(lambda time, q: axes_of(system, time, q))(times, q)
    return residuals_at(system, times, q, v, unknowns), axes


def residuals_at(
    system: System, times: Float[Array, " stage"], q: Coordinates, v: Coordinates, unknowns: StageUnknowns
) -> Residual:
    """The residuals of `stage_residuals` at given states of the stages."""
    rows, _ = system.residuals(times, q, v, *unknowns)
    phi_ddot = jax.vmap(system.constraint_acceleration)(times, q, v, unknowns.vdot)
    return Residual(rows.forces, phi_ddot)


def stage_powers(system: System, start: StepEnd, h: Scalar, unknowns: StageUnknowns) -> Power:
    """The powers [W] at every stage."""
    return system.residuals(*stage_states(start, h, unknowns.vdot), *unknowns)[1]


def factor(system: System, start: StepEnd, h: Scalar, lam: Multipliers) -> FrozenFactors:
    """The factors of the iteration matrices of a step of length h, assembled at its start."""
    now = (start.time, start.q)
    inert = iteration_matrix.mass(system, *now)

    def tangent(rate):
        return iteration_matrix.tangent(system, *now, start.v, lam, jnp.ones(()), rate)

    layout = {"weights": inert.weights, "released": inert.released}
    # A loop, not `vmap`: under vmap XLA would transpose the arrays around the table of shape functions.
    both = lax.map(tangent, jnp.array([0.0, 1.0]))
    stiff, moving = (jax.tree.map(lambda x, i=i: x[i], both) for i in (0, 1))

    def of_rate(mu):
        s = h * mu

        def combined(m, mk, mkc):
            return m + s**2 * (mk - m) + s * (mkc - mk)

        matrices = (x._replace(weights=None, released=None) for x in (inert, stiff, moving))
        return structured.factor(jax.tree.map(combined, *matrices)._replace(**layout))

    # The mass matrix is that of mu = 0.
    factors = jax.vmap(of_rate)(jnp.asarray(np.append(TABLE.rates, 0.0)))
    stages = jax.tree.map(lambda x: x[:-1], factors)
    mass = jax.tree.map(lambda x: x[-1].real, factors)
    return FrozenFactors(stages, mass, inert, axes_of(system, *now))


# ---- linear equations ---------------------------------------------------------------------------


def correction(system: System, residual: Residual, turns: Turn, factors: FrozenFactors) -> StageUnknowns:
    """The change of the unknowns in a simplified Newton iteration. turns: for every stage, the
    rotation from the axes of the factors."""

    def to_rhs(residual, turn):
        forces, constraints = jax.tree.map(jnp.negative, (residual.forces, residual.constraints))
        return iteration_matrix.to_vector(system, turn.to_reference(forces), constraints)

    member = factors.axes.hub
    rhs = jax.tree.map(lambda x: split(x, member), jax.vmap(to_rhs)(residual, turns))
    solution = jax.vmap(lambda one, rhs: structured.solve(factors.shape, one, rhs))(factors.stages, rhs)
    solution = jax.tree.map(lambda z: mix(z, member), solution)

    def from_solution(solution, turn):
        vdot, lam = iteration_matrix.from_vector(system, solution)
        return StageUnknowns(turn.to_current(vdot), lam)

    return jax.vmap(from_solution)(solution, turns)


def split(stages: Float[Array, "stage *x"], like: Array) -> Complex[Array, "rate *x"]:
    """T^-1 times the stages, for one of each pair of conjugate rates, by fast real products."""
    rates = len(TABLE.split)
    parts = combined(np.concatenate([TABLE.split.real, TABLE.split.imag]), stages, like)
    return lax.complex(parts[:rates], parts[rates:])


def mix(z: Complex[Array, "rate *x"], like: Array) -> Float[Array, "stage *x"]:
    """T z, summed over both rates of each conjugate pair."""
    table = np.concatenate([TABLE.mix.real, -TABLE.mix.imag], axis=1)
    return combined(table, jnp.concatenate([z.real, z.imag]), like)


def turns_to(axes: Axes, factors: FrozenFactors) -> Turn:
    """The rotations from the axes of the factors to those of every stage."""
    return jax.vmap(lambda axes: turn(factors.axes, axes))(axes)


def on_constraints(
    system: System, factors: FrozenFactors, time: Scalar, q: Coordinates, v: Coordinates
) -> tuple[Coordinates, Coordinates]:
    """The nearest state that satisfies the constraints and their rates, by one Newton correction
    each in the mass metric. The stages violate the constraints by the local error."""
    if system.has_constraints:
        turned = matmul(lax.stop_gradient(system.rotation(time, q)), factors.axes.hub.T)
        nothing = jax.tree.map(jnp.zeros_like, q)

        def corrected(x, defect):
            rhs = iteration_matrix.to_vector(system, nothing, jax.tree.map(jnp.negative, defect))
            solution = structured.solve(factors.shape, factors.mass, rhs)
            change, _ = iteration_matrix.from_vector(system, solution)
            return jax.tree.map(jnp.add, x, change.rotate(turned))

        q = corrected(q, system.constraints(time, q))
        _, rate = jax.jvp(lambda t, q: system.constraints(t, q), (time, q), (jnp.ones(()), v))
        v = corrected(v, rate)
    return system.place_roots(time, q), system.place_roots(time, v, derivative=1)


def end_of_step(
    system: System, now: StepEnd, h: Scalar, unknowns: StageUnknowns, factors: FrozenFactors
) -> tuple[Coordinates, Coordinates]:
    """q and v at the end of a step whose stages are known, projected on the constraints."""
    times, q, v = stage_states(now, h, unknowns.vdot)
    return on_constraints(system, factors, times[-1], *(jax.tree.map(lambda x: x[-1], c) for c in (q, v)))


def work_of_step(h: Scalar, first: Power, power: Power) -> Power:
    """The work [J] of a step from the powers at its start and at the stages."""
    weights = jnp.asarray(TABLE.matrix[-1])
    return jax.tree.map(lambda p0, p: h * (TABLE.start[-1] * p0 + weights @ p), first, power)


# ---- sizes --------------------------------------------------------------------------------------


def lengths(system: System, time: Scalar, q: Coordinates) -> Float[Array, "2"]:
    """The scales of errors [m] at an instant: the length of the shortest tether, of what is deployed of it,
    and HUB_SHARE times the hub's radius."""
    tethers = system.tethers
    if system.payout is None:
        total = jnp.broadcast_to(tethers.element_length, (tethers.elements, tethers.count)).sum(0).min()
    else:
        total = system.lengths(time, q).length.min()
    hub = total if system.hub is None else HUB_SHARE * system.hub.radius
    return lax.stop_gradient(jnp.stack([total, hub]))


def rounding(q: Coordinates) -> Float[Array, "2"]:
    """The rounding errors of coordinates [m] of tethers and hub, which limit the iterations."""
    parts = [q.tether[0], q.tether[0] if q.hub is None else q.hub]
    return lax.stop_gradient(LAST_PLACES * jnp.stack([jnp.abs(x).max() for x in parts]))


def largest(system: System, change: Coordinates, unit: Float[Array, "2"]) -> Scalar:
    """The largest change of a position (slopes times l), in units for tethers and for the hub."""
    nodes = greatest(greatest(system.tethers.scale_slopes(change.tether)))
    size = nodes.max()
    if change.ring is not None:
        size = jnp.maximum(size, jnp.abs(change.ring).max())
    if change.reel is not None:
        size = jnp.maximum(size, jnp.abs(change.reel).max())
    size = size / unit[0]
    return size if change.hub is None else jnp.maximum(size, jnp.abs(change.hub).max() / unit[1])
