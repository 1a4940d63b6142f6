"""Measurements of a sail's state: the input of its control laws.

The phase phi of a tether is its angle about the spin axis. It grows in the sense of the spin: about X_B for
a positive spin rate, the other way round for a negative one. It is counted from the azimuth at which the
wind's component in the spin plane points outward along the tether. That azimuth is undefined if the wind
blows along the spin axis: cos phi and sin phi fade to zero there, and laws of the phase to their mean.
Without spin the phase has no sense: sin phi fades to zero (`Measurements.sense`).
"""

from typing import NamedTuple

import jax.numpy as jnp

from esail_jax.array_types import Array, Float, Maybe, PerTether, Rotation, Scalar, Vector
from esail_jax.constants import SLOW_SPIN
from esail_jax.numerics.smooth_step import smooth_step

FADE = 1e-4
"""Sine of the angle between wind and spin axis at which cos phi and sin phi fade by 1/sqrt(2)."""


class Measurements(NamedTuple):
    """What a control law may measure at an instant: time [s], and unit vectors in the inertial frame I.

    spin_axis: X_B. radial_directions: from the spin axis through every root. chords: from every root to its
    tip. position: heliocentric position of the hub [m], for a sail on an orbit only. wind: direction of the
    solar wind at the origin of I, on an orbit at the hub; the load that knows the wind adds it.
    momentum_axis: direction of the angular momentum about the centre of mass, released tethers included,
    for sails with a hub only. spin_rate: of the hub, or of the turning frame, about X_B [rad/s].

    The others are for laws that users write (`sensors.with_motion`), and None for those of the package.
    rotation: attitude C_B^I of the hub, or of the turning frame. angular_velocity: of B, in B [rad/s].
    tip_position: of every tip relative to the hub centre, in B [m]. tip_velocity: the rate of tip_position
    [m/s]. root_tension: axial force in the first element of every tether [N]. voltage: of every tether, as
    applied since the last sample [V]; zero at the first sample, None for laws that are not sampled.
    current: the electron current of every tether [A], for terms that users write (`physics.py`) in scenes
    that describe the wires; None for laws, whose voltages it follows from. deployed_length [m] and
    payout_rate [m/s] of every tether, while tethers are paid out.
    """

    time: Scalar
    spin_axis: Vector
    radial_directions: Float[Array, "3 tether"]
    chords: Float[Array, "3 tether"]
    wind: Maybe[Vector] = None
    position: Maybe[Vector] = None
    momentum_axis: Maybe[Vector] = None
    spin_rate: Maybe[Scalar] = None
    rotation: Maybe[Rotation] = None
    angular_velocity: Maybe[Vector] = None
    tip_position: Maybe[Float[Array, "3 tether"]] = None
    tip_velocity: Maybe[Float[Array, "3 tether"]] = None
    root_tension: Maybe[PerTether] = None
    voltage: Maybe[PerTether] = None
    current: Maybe[PerTether] = None
    deployed_length: Maybe[PerTether] = None
    payout_rate: Maybe[PerTether] = None

    @property
    def sun(self) -> Vector:
        """Direction towards the Sun, from which the wind blows."""
        return -self.wind

    @property
    def sense(self) -> Scalar:
        """The sense of the spin: 1 if the sail turns about X_B in the right-handed sense, -1 in the other
        one. It fades to 0 below the spin rate SLOW_SPIN: a law would otherwise jump whenever the hub of a
        sail without spin swings through its rest."""
        return 2.0 * smooth_step(0.5 + self.spin_rate / (2.0 * SLOW_SPIN)) - 1.0

    def outward_from(self, axis: Vector) -> Float[Array, "3 tether"]:
        """Unit vectors along the parts of the chords that are normal to an axis."""
        flat = self.chords - axis[:, None] * (axis @ self.chords)
        return flat / jnp.linalg.norm(flat, axis=0)

    @property
    def root_phase(self) -> Float[Array, "2 tether"]:
        """cos phi and sin phi of the roots."""
        return self.phase(self.radial_directions)

    @property
    def tether_phase(self) -> Float[Array, "2 tether"]:
        """cos phi and sin phi of the tethers' chords."""
        return self.phase(self.outward_from(self.spin_axis))

    def phase(self, directions: Float[Array, "3 tether"]) -> Float[Array, "2 tether"]:
        """cos phi and sin phi of unit vectors in the spin plane."""
        across = self.wind - self.spin_axis * (self.spin_axis @ self.wind)
        toward = across / jnp.sqrt(across @ across + FADE**2)
        ahead = self.sense * jnp.cross(self.spin_axis, toward)
        return jnp.stack([toward @ directions, ahead @ directions])
