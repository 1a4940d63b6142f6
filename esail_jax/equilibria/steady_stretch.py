"""Steady stretch of straight spinning tethers, the initial state of a run.

Each tether is straight, at a coning angle, and rotates rigidly about X_B through the hub centre; its
elements carry the centrifugal force of all mass further out. The solution is the equilibrium of the
discrete equations, so that a run without wind starts without axial vibration. The alternative is [PGV]
Eq. 79-80 as printed.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import lax

from esail_jax.array_types import Array, Float, Int, Nodal, PerTether, Scalar
from esail_jax.elements.tether import TetherBatch
from esail_jax.numerics import block_tridiagonal as chains
from esail_jax.numerics.known_solution import known_solution
from esail_jax.point_fields import PointFields, add_fields
from esail_jax.terms import Term

RAMP_STEPS, NEWTON_STEPS = 12, 20
"""Number of Newton steps in which the centrifugal force grows to its value, and number of all steps.
Without the growth Newton's method does not reach strains of order one from rest, because spin softening
exceeds the stiffness of the unstressed tether."""

Line = Float[Array, "coef node tether"]
"""Distance from the root along the straight tether [m] and stretch [-] of every node."""


def unstretched_line(tethers: TetherBatch) -> Line:
    """Distances and stretches of the undeformed tether."""
    steps = jnp.arange(tethers.elements + 1.0)[:, None] * tethers.element_length
    return jnp.stack([steps, jnp.ones_like(steps)][: tethers.coefs])


def along(line: Line, direction: Float[Array, "3 tether"]) -> Nodal:
    """The nodal vectors of straight tethers, relative to their roots."""
    return line[:, None] * direction[None, :, None]


class Straight(NamedTuple):
    """Straight tethers in the field of the centrifugal force.

    energies: those that depend on the stretch; radius: distance R of the roots from the axis [m];
    spin_squared: omega^2; cosine: cos Lambda of the coning angle."""

    tethers: TetherBatch
    energies: tuple[Term, ...]
    radius: Scalar | PerTether
    spin_squared: Scalar
    cosine: Scalar

    @property
    def x_axis(self) -> Float[Array, "3 tether"]:
        """The direction in which the tethers are laid out: only distances and stretches count."""
        return jnp.tile(jnp.array([[1.0], [0.0], [0.0]]), (1, self.tethers.count))

    def stress(self, fields: PointFields) -> PointFields:
        """The derivative of the energies with respect to the fields."""
        at_rest = jax.tree.map(jnp.zeros_like, fields)
        return add_fields([term.point_forces(jnp.zeros(()), fields, at_rest) for term in self.energies])

    def unbalanced(self, line: Line) -> Line:
        """The elastic forces without the centrifugal ones."""
        fields = self.tethers.interpolate(along(line, self.x_axis))
        root = self.radius * self.tethers.uniform(jnp.array([1.0, 0.0, 0.0]))
        lever = along(line * self.cosine, self.x_axis) + root
        forces = self.tethers.nodal_forces(self.stress(fields), -self.spin_squared * self.cosine * lever)
        return forces[:, 0]

    def matrix(self, line: Line) -> tuple[Array, Array, Array]:
        """The blocks of the derivative of `unbalanced`."""
        tethers = self.tethers
        fields = tethers.interpolate(along(line, self.x_axis))
        unit = jnp.zeros_like(fields.r_x).at[0].set(1.0)
        moved = jax.jvp(lambda r_x: self.stress(fields._replace(r_x=r_x)).r_x, (fields.r_x,), (unit,))[1]
        jacobian = {("r_x", "r_x"): moved[None, :1]}
        stiffness = tethers.tangent_elements(jacobian)
        mass = tethers.mass_elements()[::3, ::3]
        elements = stiffness - self.spin_squared * self.cosine**2 * mass
        diag, upper, lower = tethers.blocks(elements)
        tip = jnp.zeros_like(diag[-1]).at[0, 0].set(self.spin_squared * self.cosine**2 * tethers.tip_mass)
        return diag.at[-1].add(-tip), upper, lower

    def change(self, line: Line, forces: Line) -> Line:
        """The change of distances and stretches that changes `unbalanced` by these forces."""
        factors, root = chains.factor(*self.matrix(line))
        blocks = jnp.moveaxis(to_metres(self.tethers, forces, -1), 1, 0)
        own, port = chains.reduce_to_port(factors, blocks)
        # The position of the root is fixed; its slope, if it has one, is free.
        if self.tethers.coefs == 2:
            port = jnp.stack([jnp.zeros_like(port[0]), port[1] / root[1, 1]])
        else:
            port = jnp.zeros_like(port)
        change = jnp.moveaxis(chains.substitute_from_port(factors, own, port), 0, 1)
        return to_metres(self.tethers, change, -1)


def steady_line(
    tethers: TetherBatch,
    energies: tuple[Term, ...],
    radius: Scalar | PerTether,
    spin: Scalar,
    coning: Scalar,
) -> tuple[Line, PerTether]:
    """Solves for the steady stretch of straight tethers under centrifugal force.

    Returns distances and stretches at which elastic forces balance omega^2 (R + s cos Lambda) cos Lambda
    per unit mass, and the largest remaining force [N] of each tether, which is infinite where elements
    folded back on themselves.

    radius: distance R [m] of the roots from the axis; spin: omega [rad/s]; coning: Lambda [rad].

    The result has derivatives of any order (implicit function theorem); the iterations carry none.
    """
    axial = tuple(term for term in energies if term.depends_on == ("r_x",))
    balance = Straight(tethers, axial, radius, spin**2, jnp.cos(coning))
    fixed = lax.stop_gradient(balance)

    def ramped(i: Int[Array, ""], line: Line) -> Line:
        part = jnp.minimum(1.0, (i + 1.0) / RAMP_STEPS)
        now = fixed._replace(spin_squared=part * fixed.spin_squared)
        return line + now.change(line, -now.unbalanced(line))

    line = lax.fori_loop(0, NEWTON_STEPS + 1, ramped, unstretched_line(fixed.tethers))
    left = jnp.abs(fixed.unbalanced(line).at[0, 0].set(0.0)[0]).max(0)
    # Above the largest spin that a tether can bear, elements folded back on themselves also balance.
    folded = (jnp.diff(line[0], axis=0) <= 0.0).any(0) | (line[1:] <= 0.0).any((0, 1))
    line = known_solution(Straight.unbalanced, Straight.change, balance, line)
    return line, jnp.where(folded, jnp.inf, left)


def to_metres(tethers: TetherBatch, line: Line, power: int) -> Line:
    """Multiplies slopes by l^power, so that the solver's unknowns are in metres and its rows in newtons."""
    if tethers.coefs == 1:
        return line
    return line.at[1].multiply(tethers.element_length**power)
