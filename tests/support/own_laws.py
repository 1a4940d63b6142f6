"""Voltage laws as users write them, for tests. `esail run --voltage-law` reads this file, too."""

import equinox as eqx
import jax.numpy as jnp

SAIL = {
    "tethers.count": 3,
    "tethers.elements": 1,
    "tethers.bending": False,
    "tethers.second_moment": None,
    "tethers.bending_damping_time": None,
    "integrator.t_end": 120.0,
    "output.interval": 10.0,
}
"""A small sail; with laws of `PERIOD` it has three sampling instants after the start within 120 s."""

PERIOD = 35.0
"""Control period [s]: no multiple of the interval, so that saved instants lie between samples."""


class Waves(eqx.Module):
    """One harmonic of the root's phase, as the law "harmonic" of the package."""

    volts: float = 20e3
    depth: float = 0.1

    def commanded(self, measurements):
        return self.volts * (1.0 + self.depth * measurements.root_phase[0])


class Swinging(eqx.Module):
    """Feedback of the phase's cosine, of its change since the last sample, and of the tension. The memory
    is that cosine and the number of samples."""

    gain: float = 0.1
    rate: float = 0.05
    period: float = eqx.field(static=True, default=PERIOD)

    def init(self, measurements):
        return {"before": measurements.root_phase[0], "count": 0}

    def update(self, measurements, memory):
        cosine = measurements.root_phase[0]
        pull = measurements.root_tension / 0.3 - 1.0
        volts = 20e3 * (1.0 + self.gain * cosine + self.rate * (cosine - memory["before"] + 0.1 * pull))
        return volts, {"before": cosine, "count": memory["count"] + 1}


class Clock(eqx.Module):
    """A law of the time alone: V = 20 kV + slope t, with a sample in every period."""

    slope: float = 10.0
    period: float = eqx.field(static=True, default=PERIOD)

    def commanded(self, measurements):
        return 20e3 + self.slope * measurements.time * jnp.arange(1.0, 4.0)
