"""Flexural rigidity of a rod chain, lumped at its joints.

[MW] Sec. 4 proposes to derive it from "the second derivative of spatial vectors". But these vectors are the
rods themselves, x_i = l_i dr/dx: the curvature is the *first* difference of their directions, that is, the
second difference of the joints' positions.
"""

import equinox as eqx
import jax.numpy as jnp

from esail_jax.array_types import Array, Float, Scalar, Vector


class Hinges(eqx.Module):
    """Rotational springs between neighbouring rods,

        U = sum_i c_i |t_{i+1} - t_i|^2 / 2,    t_i = x_i / l_i,
        1/c_i = l_i/(2 EI_i) + l_{i+1}/(2 EI_{i+1}).

    |t_{i+1} - t_i| = 2 sin(turn/2) is the angle between the rods up to third order, and smooth and bounded
    for any angle; the discretisation error of the chain is of second order as well. Stretch enters only by
    its difference between neighbours, with an energy of (thickness/l)^2 of the axial one.

    stiffness: c [N m] of every joint with a spring: those between rods, preceded by c_0 = 2 EI_1/l_1 if the
    first end is clamped. length: l [m] of every rod. direction: unit vector of the clamp; None if the first
    end is pinned.
    """

    stiffness: Float[Array, " hinge"]
    length: Float[Array, " rod"]
    direction: Vector | None

    @classmethod
    def of(
        cls,
        bending: Float[Array, " rod"],
        length: Float[Array, " rod"],
        direction: Vector | None,
    ) -> "Hinges":
        """The springs of rods with given bending stiffness EI [N m^2] and undeformed length [m]."""
        flexibility = 0.5 * length / bending
        inner = 1.0 / (flexibility[:-1] + flexibility[1:])
        if direction is not None:
            inner = jnp.concatenate([1.0 / flexibility[:1], inner])
        return cls(inner, length, direction)

    def energy(self, rods: Float[Array, "3 rod"]) -> Scalar:
        """Energy U [J] of rod vectors x [m]."""
        tangents = rods / self.length
        if self.direction is not None:
            tangents = jnp.concatenate([self.direction[:, None], tangents], axis=1)
        turn = jnp.diff(tangents, axis=1)
        return 0.5 * (self.stiffness * (turn * turn).sum(0)).sum()
