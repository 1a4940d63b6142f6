"""The orbital frame O of a heliocentric position."""

import jax.numpy as jnp

from esail_jax.array_types import Rotation, Vector


def orbital_frame(heliocentric: Vector) -> Rotation:
    """Orientation C_O^I of the orbital frame at a heliocentric position [m] ([PGV] Sec. 2.1, Eq. 44).

    Its columns are i_O, j_O, k_O: k_O points away from the Sun, i_O = k_H x k_O / |k_H x k_O|, and j_O
    completes the frame.
    """
    k = heliocentric / jnp.linalg.norm(heliocentric)
    i = jnp.cross(jnp.array([0.0, 0.0, 1.0]), k)
    i = i / jnp.linalg.norm(i)
    return jnp.stack([i, jnp.cross(k, i), k], axis=1)
