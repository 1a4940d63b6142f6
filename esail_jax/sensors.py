"""Sensors: the measurements of rates, positions and tensions that laws of users may read."""

import jax.numpy as jnp

from esail_jax.array_types import PerTether, Scalar, Vector
from esail_jax.assembly import Assembly
from esail_jax.coordinates import Coordinates
from esail_jax.measurements import Measurements
from esail_jax.numerics.small_matrices import matmul
from esail_jax.numerics.vectors import dot, norm
from esail_jax.terms import inner_terms_of


def with_motion(
    sail: Assembly, time: Scalar, q: Coordinates, v: Coordinates, measured: Measurements
) -> Measurements:
    """The measurements of a sail with attitude, rates, tips and tensions, and with the deployed lengths.
    sail: at that instant."""
    rotation, omega = sail.rotation(time, q), angular_velocity(sail, q, v)
    tips, velocities = q.tether[0, :, -1], v.tether[0, :, -1]
    if sail.hub is not None:
        tips = tips - sail.hub.centre(q.hub)[:, None]
        velocities = velocities - sail.hub.centre(v.hub)[:, None]
    tips, velocities = matmul(rotation.T, tips), matmul(rotation.T, velocities)
    return measured._replace(
        rotation=rotation,
        angular_velocity=omega,
        tip_position=tips,
        tip_velocity=velocities - jnp.cross(omega[:, None], tips, axis=0),
        root_tension=root_tension(sail, time, q, v),
        deployed_length=None if sail.reels is None else sail.reels.now.length,
        payout_rate=None if sail.reels is None else sail.reels.now.rate,
    )


def angular_velocity(sail: Assembly, q: Coordinates, v: Coordinates) -> Vector:
    """Angular velocity [rad/s] of the hub, or of the turning frame, in B."""
    if sail.hub is not None:
        return sail.hub.angular_velocity(q.hub, v.hub)
    return sail.roots.rate * jnp.array([1.0, 0.0, 0.0])


def root_tension(sail: Assembly, time: Scalar, q: Coordinates, v: Coordinates) -> PerTether:
    """Axial force [N] in the first element of every tether, its mean over the undeformed length of the
    element, with the dissipative part. It is negative in compression."""
    tethers = sail.tethers
    fields, rates = tethers.interpolate_motion(q.tether, v.tether)
    terms = inner_terms_of(
        *(
            tuple(x for x in part if x.depends_on == ("r_x",))
            for part in (sail.acting_energies, sail.acting_dissipations)
        )
    )
    stress = [term.point_forces(time, fields, rates).r_x for term in terms]
    along = dot(sum(stress[1:], stress[0]), fields.r_x) / norm(fields.r_x)
    return tethers.of_tethers(jnp.tensordot(tethers.weights, along, 1))[0]
