"""Accelerations and multipliers that fit a given state.

    [ M      Phi_q^T ] [ vdot ]   [ Q                          ]
    [ Phi_q  0       ] [ lam  ] = [ -d^2 Phi / dt^2 at vdot = 0 ]        ([PGV] Eq. 1-3)

Used for the start of a run and for every saved instant, so that output never interpolates them.
"""

import jax
import jax.numpy as jnp

from esail_jax import newton_matrix
from esail_jax.array_types import Scalar
from esail_jax.coordinates import Coordinates, Multipliers
from esail_jax.numerics import bordered
from esail_jax.system import System


def consistent_acceleration(
    system: System, time: Scalar, q: Coordinates, v: Coordinates
) -> tuple[Coordinates, Multipliers]:
    """vdot and lam of the state (q, v), which must satisfy the constraints and their rates."""
    rest = jax.tree.map(jnp.zeros_like, q)
    if system.hub is None:
        rest = system.place_roots(time, rest, derivative=2)
    residual, _ = system.residual(time, q, v, rest, system.no_multipliers())
    bend = system.constraint_acceleration(time, q, v, rest)
    matrix = newton_matrix.mass(system, time, q)
    rhs = newton_matrix.to_vector(system, *jax.tree.map(jnp.negative, (residual.forces, bend)))
    solution = bordered.solve(matrix, bordered.factor(matrix), rhs)
    vdot, lam = newton_matrix.from_vector(system, solution)
    return jax.tree.map(jnp.add, rest, vdot), lam


def project(
    system: System, time: Scalar, q: Coordinates, v: Coordinates
) -> tuple[Coordinates, Coordinates]:
    """The nearest state (in the mass metric, one Newton correction) on the constraints and their
    rates. Interpolation errors are of fourth order, so one correction reaches rounding."""
    q, v = system.place_roots(time, q), system.place_roots(time, v, derivative=1)
    if not system.has_constraints:
        return q, v
    matrix = newton_matrix.mass(system, time, q)
    factors = bordered.factor(matrix)
    nothing = jax.tree.map(jnp.zeros_like, q)

    def corrected(x, defect):
        rhs = newton_matrix.to_vector(system, nothing, jax.tree.map(jnp.negative, defect))
        step, _ = newton_matrix.from_vector(system, bordered.solve(matrix, factors, rhs))
        return jax.tree.map(jnp.add, x, step)

    q = corrected(q, system.constraints(time, q))
    _, rate = jax.jvp(lambda t, q: system.constraints(t, q), (time, q), (jnp.ones(()), v))
    return q, corrected(v, rate)
