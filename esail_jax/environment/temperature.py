"""A temperature of the tethers that is constant in time; one that is not is `numerics/lines_in_time.py`."""

import equinox as eqx
import numpy as np

from esail_jax.array_types import Instants, PerTether, Scalar


class SteadyTemperature(eqx.Module):
    """A constant temperature T [K] of every tether."""

    value: PerTether

    def at(self, time: Instants) -> PerTether:
        """T [K]: the same at all instants."""
        return self.value

    def in_segment(self, start: Scalar | np.ndarray, until: Scalar | np.ndarray) -> "SteadyTemperature":
        """The same temperature."""
        return self
