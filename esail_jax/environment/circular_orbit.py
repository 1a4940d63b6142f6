"""Acceleration field in the axes of a circular orbit: Hill's equations.

The axes rotate with the orbit: x points away from the centre of attraction, y along the motion, z is normal
to the orbit. Relative to a satellite at the origin, and to first order in distance over orbital radius
(Hill 1878; Clohessy & Wiltshire 1960),

    a_x = 2 n v_y + 3 n^2 x,    a_y = -2 n v_x,    a_z = -n^2 z
"""

import equinox as eqx
import numpy as np

from esail_jax.array_types import Array, Float, Scalar

TIDE = np.diag([3.0, 0.0, -1.0])
"""Gradient of gravity and centrifugal acceleration, in units of n^2."""

CORIOLIS = np.array([[0.0, 2.0, 0.0], [-2.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
"""Matrix of the Coriolis acceleration -2 e_z x v, in units of n."""


class CircularOrbit(eqx.Module):
    """Circular orbit with the mean motion n [rad/s]. Its field is linear in position and velocity."""

    mean_motion: Scalar

    @property
    def gradients(self) -> tuple[Float[Array, "3 3"], Float[Array, "3 3"]]:
        """Gradients da/dr [1/s^2] and da/dv [1/s] of the field."""
        return self.mean_motion**2 * TIDE, self.mean_motion * CORIOLIS
