"""`Floquet`: the multipliers of a sail's periodic orbit, which `floquet.py` computes."""

import dataclasses

import numpy as np

from esail_jax.array_types import Complex, Float

Host = np.ndarray

FASTEST = 40.0
"""Fastest motions, in radians per radian of spin, whose multipliers are given. Faster ones follow the slow
change of the load; the time steps do not resolve them."""

LEAST = 1e-8
"""Factor by which a motion must not decay in a map for its multiplier to be given: rounding changes the
eigenvalues of a map by about 1e-14, whatever their size."""


@dataclasses.dataclass(frozen=True)
class Floquet:
    """Multipliers of the periodic orbit, in the order of the modes of a table.

    multiplier: mu, of a whole turn; exponent: s [1/s]; NaN for modes that are faster than FASTEST, or that
        decay by more than LEAST in a map
    period: of a turn relative to the wind [s]; precession: of the spin axis about the wind, in a turn [rad]
    tilt_drift: change of the sailing angle in a turn [rad]; spin_drift: relative change of the spin in a
        turn; left: what else does not repeat itself in a map, relative to the largest coordinate
    neutral: largest distance from 1 of the two multipliers of turning on and of spinning faster, of which
        rounding makes the square root, because they are a double eigenvalue
    sailing_angle: between wind and angular momentum [rad]
    """

    multiplier: Complex[Host, " mode"]
    exponent: Complex[Host, " mode"]
    period: float
    precession: float
    tilt_drift: float
    spin_drift: float
    left: float
    neutral: float
    sailing_angle: float

    def first(self, count: int) -> "Floquet":
        """The multipliers of the first modes."""
        shorter = {name: getattr(self, name)[:count] for name in ("multiplier", "exponent")}
        return dataclasses.replace(self, **shorter)

    @property
    def growth(self) -> Float[Host, " mode"]:
        """Factor by which a motion grows in a turn, |mu|."""
        return np.abs(self.multiplier)
