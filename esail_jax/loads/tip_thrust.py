"""Thrust at the tips of the tethers: cold gas, or photonic blades, on the remote units."""

from typing import ClassVar, Literal

import equinox as eqx
import jax.numpy as jnp

from esail_jax.array_types import Array, Float, PerTether, Scalar
from esail_jax.measurements import Measurements
from esail_jax.numerics.smooth_step import knots_of_pulse, pulse
from esail_jax.terms import TipLoad

DirectionName = Literal["tangential", "axial", "radial"]


class Switching(eqx.Module):
    """The instants `on` and `off` [s] from which a force rises and falls along the smooth step of fifth
    order, and the duration of both, rise_time [s]."""

    on: PerTether
    off: PerTether
    rise_time: Scalar


class TipThrust(TipLoad):
    """A force on every remote unit, F = F_i s(t) e with a unit vector e that follows the motion.

    Let d be the unit vector along the part of the chord from root to tip that is normal to the spin axis
    X_B. e is X_B x d if the direction is "tangential", X_B if it is "axial", and d if it is "radial". For a
    tether that does not lag behind its root, a tangential force has the moment F_i times the distance of
    the tip from the spin axis.

    size: F_i [N]; a negative one has the opposite direction. switching: s(t) rises from 0 to 1 and falls
    again; None for a force that always acts, s = 1. The iteration matrix leaves the derivative of this
    force out: F/L is far smaller than the stiffness of a tether under tension, and than its inertia.
    """

    size: PerTether
    switching: Switching | None
    direction: DirectionName = eqx.field(static=True)

    name: ClassVar[str] = "tip thrust"

    @property
    def knots(self) -> tuple[Array, ...]:
        if self.switching is None:
            return ()
        return knots_of_pulse(self.switching.on, self.switching.off, self.switching.rise_time, ())

    def force(self, measurements: Measurements) -> Float[Array, "3 tether"]:
        axis, chords = measurements.spin_axis, measurements.chords
        if self.direction == "axial":
            along = jnp.broadcast_to(axis[:, None], chords.shape)
        else:
            flat = chords - axis[:, None] * (axis @ chords)
            along = flat / jnp.linalg.norm(flat, axis=0)
            if self.direction == "tangential":
                along = jnp.cross(axis[:, None], along, axis=0)
        size = self.size
        if self.switching is not None:
            on, off, rise = self.switching.on, self.switching.off, self.switching.rise_time
            size = size * pulse(measurements.time, on, off, rise)
        return size * along
