"""Steady stretch of straight spinning tethers, the initial state of a run.

Each tether is straight, at a coning angle, and rotates rigidly about X_B through the hub centre; its
elements carry the centrifugal force of all mass further out. The solution is the equilibrium of the
discrete equations, so that a run without wind starts without axial vibration. The alternative is [PGV]
Eq. 79-80 as printed.
"""

import jax
import jax.numpy as jnp
from jax import lax

from esail_jax.array_types import Array, Float, Int, Nodal, PerTether, Scalar
from esail_jax.elements.tether import TetherBatch
from esail_jax.numerics import block_tridiagonal as chains
from esail_jax.point_fields import PointFields, add_fields
from esail_jax.terms import Energy

RAMP_STEPS, NEWTON_STEPS = 12, 20
"""Number of Newton steps in which the centrifugal force grows to its value, and number of all steps.
Without the growth Newton's method does not reach strains of order one from rest, because spin softening
exceeds the stiffness of the unstressed tether."""

Line = Float[Array, "coef node tether"]
"""Distance from the root along the straight tether [m] and stretch [-] of every node."""


def unstretched_line(tethers: TetherBatch) -> Line:
    """Returns distances and stretches of the undeformed tether."""
    steps = jnp.arange(tethers.elements + 1.0)[:, None] * tethers.element_length
    return jnp.stack([steps, jnp.ones_like(steps)][: tethers.coefs])


def along(line: Line, direction: Float[Array, "3 tether"]) -> Nodal:
    """Returns the nodal vectors of straight tethers, relative to their roots."""
    return line[:, None] * direction[None, :, None]


def steady_line(
    tethers: TetherBatch,
    energies: tuple[Energy, ...],
    radius: Scalar,
    spin: Scalar,
    coning: Scalar,
) -> tuple[Line, PerTether]:
    """Solves for the steady stretch of straight tethers under centrifugal force.

    Returns distances and stretches at which elastic forces balance omega^2 (R + s cos Lambda) cos Lambda
    per unit mass, and the largest remaining force [N] of each tether, which is infinite where elements
    folded back on themselves.

    radius: distance R [m] of the roots from the axis; spin: omega [rad/s]; coning: Lambda [rad].

    The result is differentiable: the last Newton step carries the derivative of the equilibrium (implicit
    function theorem), the steps before it carry none.
    """
    straight = [term for term in energies if term.depends_on == ("r_x",)]
    p = tethers.count
    x_axis = jnp.tile(jnp.array([[1.0], [0.0], [0.0]]), (1, p))
    cosine = jnp.cos(coning)

    def stress(fields: PointFields) -> PointFields:
        at_rest = jax.tree.map(jnp.zeros_like, fields)
        return add_fields([term.point_forces(jnp.zeros(()), fields, at_rest) for term in straight])

    def unbalanced(line: Line, spin_squared: Scalar) -> Line:
        fields = tethers.interpolate(along(line, x_axis))
        lever = along(line * cosine, x_axis) + radius * tethers.uniform(jnp.array([1.0, 0.0, 0.0]))
        forces = tethers.nodal_forces(stress(fields), -spin_squared * cosine * lever)
        return forces[:, 0]

    def matrix(line: Line, spin_squared: Scalar) -> tuple[Array, Array, Array]:
        fields = tethers.interpolate(along(line, x_axis))
        unit = jnp.zeros_like(fields.r_x).at[0].set(1.0)
        moved = jax.jvp(lambda r_x: stress(fields._replace(r_x=r_x)).r_x, (fields.r_x,), (unit,))[1]
        jacobian = {("r_x", "r_x"): moved[None, :1]}
        stiffness = tethers.tangent_elements(jacobian)
        mass = tethers.mass_elements()[::3, ::3]
        elements = stiffness - spin_squared * cosine**2 * mass
        diag, upper, lower = tethers.blocks(elements)
        tip = jnp.zeros_like(diag[-1]).at[0, 0].set(spin_squared * cosine**2 * tethers.tip_mass)
        return diag.at[-1].add(-tip), upper, lower

    def newton(line: Line, frozen: Line, spin_squared: Scalar) -> Line:
        fixed = lax.stop_gradient(spin_squared)
        factors, root = chains.factor(*matrix(frozen, fixed))
        blocks = jnp.moveaxis(to_metres(tethers, -unbalanced(line, spin_squared), -1), 1, 0)
        own, port = chains.reduce_to_port(factors, blocks)
        # The position of the root is fixed; its slope, if it has one, is free.
        port = jnp.stack([jnp.zeros_like(port[0]), port[-1] / root[-1, -1]])[: tethers.coefs]
        change = jnp.moveaxis(chains.substitute_from_port(factors, own, port), 0, 1)
        return line + to_metres(tethers, change, -1)

    def ramped(i: Int[Array, ""], line: Line) -> Line:
        part = jnp.minimum(1.0, (i + 1.0) / RAMP_STEPS)
        return newton(line, line, part * spin**2)

    start = lax.stop_gradient(unstretched_line(tethers))
    found = lax.stop_gradient(lax.fori_loop(0, NEWTON_STEPS, ramped, start))
    found = newton(found, found, spin**2)
    settled = lax.stop_gradient(found)
    left = jnp.abs(unbalanced(settled, spin**2).at[0, 0].set(0.0)[0]).max(0)
    # Above the largest spin that a tether can bear, elements folded back on themselves also balance.
    folded = (jnp.diff(settled[0], axis=0) <= 0.0).any(0) | (settled[1:] <= 0.0).any((0, 1))
    return found, jnp.where(folded, jnp.inf, left)


def to_metres(tethers: TetherBatch, line: Line, power: int) -> Line:
    """Multiplies slopes by l^power, so that the solver's unknowns are in metres and its rows in newtons."""
    if tethers.coefs == 1:
        return line
    return line.at[1].multiply(tethers.element_length**power)
