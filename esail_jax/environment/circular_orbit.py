"""Gravity seen from a circular orbit: Hill's equations.

Axes turn with the orbit: x away from the centre of attraction, y along the motion, z normal to the
orbit. Relative to a satellite at the origin, to first order in distance over orbital radius
(Hill 1878; Clohessy & Wiltshire 1960),

    a_x = 2 n v_y + 3 n^2 x,    a_y = -2 n v_x,    a_z = -n^2 z
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from esail_jax.array_types import Array, Float, Scalar, VectorPerPoint

TIDE = np.diag([3.0, 0.0, -1.0])
"""Gravity gradient and centrifugal force, in n^2."""

CORIOLIS = np.array([[0.0, 2.0, 0.0], [-2.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
"""-2 times the cross product with the orbit normal, in n."""


class CircularOrbit(eqx.Module):
    """mean_motion n [rad/s]. Its field is linear in position and velocity."""

    mean_motion: Scalar

    @property
    def gradients(self) -> tuple[Float[Array, "3 3"], Float[Array, "3 3"]]:
        """da/dr [1/s^2] and da/dv [1/s]."""
        return self.mean_motion**2 * TIDE, self.mean_motion * CORIOLIS

    def acceleration(self, r: VectorPerPoint, v: VectorPerPoint) -> VectorPerPoint:
        """a [m/s^2] at positions r [m] for velocities v [m/s]."""
        position, velocity = self.gradients
        return jnp.tensordot(position, r, 1) + jnp.tensordot(velocity, v, 1)
