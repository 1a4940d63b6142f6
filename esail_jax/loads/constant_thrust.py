"""The voltage law that keeps the size of a sail's thrust as asked."""

from typing import ClassVar

import jax.numpy as jnp

from esail_jax.array_types import PerTether, Scalar
from esail_jax.environment.solar_wind import Wind
from esail_jax.loads.voltage import VoltageLaw
from esail_jax.loads.voltage_limits import Limits
from esail_jax.measurements import Measurements


class ConstantThrust(VoltageLaw):
    """One voltage for all tethers, with which straight tethers along the measured chords have a thrust of
    the size F:

    sigma = F / |sum_i L_i (e - (e . d_i) d_i)|,    V = V(sigma, wind)

    e: direction of the wind; d_i: chord of tether i. V(sigma, wind) is the inverse of the law of thrust for
    the wind of the moment, so that gusts do not change the thrust. The bow of the tethers remains as an
    error, of second order in the angles between tether and chord. A wind series replaces a measurement of
    density and speed on board (compare Niccolai et al., Aerosp. Sci. Technol. 82 (2018) 38).

    thrust: F [N]. length: L_i [m].
    """

    thrust: Scalar
    length: PerTether
    wind: Wind
    limits: Limits

    name: ClassVar[str] = "constant thrust"

    def commanded(self, measurements: Measurements) -> PerTether:
        wind = self.wind.at_sail(measurements.time, measurements.position)
        along, chords = measurements.wind, measurements.chords
        across = along[:, None] - chords * (along @ chords)
        whole = (self.length * across).sum(1)
        load = self.thrust / jnp.sqrt(whole @ whole)
        return jnp.broadcast_to(wind.voltage(load / wind.speed), self.length.shape)
