"""Accelerations and multipliers that are consistent with a given state.

    [ M      Phi_q^T ] [ vdot ]   [ Q                          ]
    [ Phi_q  0       ] [ lam  ] = [ -d^2 Phi / dt^2 at vdot = 0 ]        ([PGV] Eq. 1-3)

They are computed for the start of a run and for every saved instant. Output therefore never interpolates
them.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from esail_jax import iteration_matrix
from esail_jax.array_types import Scalar
from esail_jax.coordinates import Coordinates, Multipliers
from esail_jax.iteration_matrix import FactoredMass
from esail_jax.numerics import structured
from esail_jax.system import Power, System


class ConsistentMotion(NamedTuple):
    """Accelerations and multipliers of a state, the forces without the reactions of the root joints
    (`system.Residual`), and the powers."""

    vdot: Coordinates
    lam: Multipliers
    forces: Coordinates
    power: Power


def consistent_motion(
    system: System,
    time: Scalar,
    q: Coordinates,
    v: Coordinates,
    mass: FactoredMass | None = None,
) -> ConsistentMotion:
    """accelerations, multipliers, forces and powers of the state (q, v), which must satisfy the
    constraints and their rates. mass: the factored mass matrix at q, if it is known."""
    assembly, system = system, system.at(time, q, v)
    rest = jax.tree.map(jnp.zeros_like, q)
    if system.hub is None:
        rest = system.place_roots(time, rest, derivative=2)
    if system.has_unknown_lengths:
        # The lengths' accelerations move the tethers, too: rows are linear in all of them.
        at_rest, moved = jax.linearize(
            lambda vdot, lam: assembly.rows(time, q, v, vdot, lam), rest, system.no_multipliers()
        )
        residual = at_rest[0]
    else:
        free = system.relative_to_free_fall(time, q, v, rest)
        commanded = system.with_commanded_loads(time, q, v)
        loads, power = commanded.member_forces(time, q, v, free)
        residual, _ = system.complete_residual(time, q, v, loads, system.no_multipliers(), power)
    phi_ddot = system.constraint_acceleration(time, q, v, rest)
    matrix, factors = iteration_matrix.factor_mass(assembly, time, q) if mass is None else mass
    rhs = iteration_matrix.to_vector(system, *jax.tree.map(jnp.negative, (residual.forces, phi_ddot)))
    vdot, lam = iteration_matrix.from_vector(system, structured.solve(matrix, factors, rhs))
    if system.has_unknown_lengths:
        residual, power = jax.tree.map(jnp.add, at_rest, moved(vdot, lam))
        vdot = jax.tree.map(jnp.add, rest, vdot)
        return ConsistentMotion(vdot, lam, residual.forces, power)
    moving = loads.axpy(1.0, system.member_inertia(vdot))
    residual, power = system.complete_residual(time, q, v, moving, lam, power)
    vdot = jax.tree.map(jnp.add, rest, vdot)
    if system.reels is not None:
        power, _ = system.of_winches(time, q, v, vdot, power)
    return ConsistentMotion(vdot, lam, residual.forces, power)


def consistent_acceleration(
    system: System, time: Scalar, q: Coordinates, v: Coordinates
) -> tuple[Coordinates, Multipliers]:
    """vdot and lam of the state (q, v), which must satisfy the constraints and their rates."""
    motion = consistent_motion(system, time, q, v)
    return motion.vdot, motion.lam


def project(
    system: System,
    time: Scalar,
    q: Coordinates,
    v: Coordinates,
    mass: FactoredMass | None = None,
) -> tuple[Coordinates, Coordinates]:
    """The nearest state in the mass metric that satisfies the constraints and their rates, by one
    Newton correction each. Interpolation errors are of fourth order, so that one correction reaches
    rounding. mass: as in `consistent_motion`."""
    q, v = system.place_roots(time, q), system.place_roots(time, v, derivative=1)
    if not system.has_constraints:
        return q, v
    matrix, factors = iteration_matrix.factor_mass(system, time, q) if mass is None else mass
    nothing = jax.tree.map(jnp.zeros_like, q)

    def corrected(x, defect):
        rhs = iteration_matrix.to_vector(system, nothing, jax.tree.map(jnp.negative, defect))
        step, _ = iteration_matrix.from_vector(system, structured.solve(matrix, factors, rhs))
        return jax.tree.map(jnp.add, x, step)

    q = corrected(q, system.constraints(time, q))
    _, rate = jax.jvp(lambda t, q: system.constraints(t, q), (time, q), (jnp.ones(()), v))
    return q, corrected(v, rate)
