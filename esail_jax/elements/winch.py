"""Winches whose motors hold a tension: the length of every tether is an unknown.

Drum and motor have the inertia m_d [kg] (over the square of the radius) and are turned by the winch force
F_w, which is conjugate to the deployed length l (`deployment.py`), by the stored tether, which moves with
the drum, and by the motor, which resists with the tension F:

    (m_d + rho (L - l)) l'' = F_w + rho l'^2/2 - F

F_w contains the accelerations of the tether and l'': in the mass matrix of (q, l) the length is coupled to
all nodes of its tether. For a constant F the sum of the energy of the sail and of (m_d + rho (L - l)) l'^2/2
+ F l over the tethers is constant without loads and damping."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from esail_jax.array_types import PerTether, Scalar
from esail_jax.elements.deployment import AbstractPayout, Deployed
from esail_jax.numerics.lines_in_time import LinesInTime

LEAST_PART = 1.0 / 20.0
"""Least deployed length over that of the start, at which a run ends: the tether is reeled in."""


class Winches(AbstractPayout):
    """The winches of all tethers.

    start: l at t = 0 [m]; drum: m_d [kg]; tension: F [N] of every tether, linear in time between instants.
    """

    total: PerTether
    start: PerTether
    drum: PerTether
    tension: LinesInTime

    unknown: ClassVar[bool] = True

    def at_start(self) -> Deployed:
        rest = jnp.zeros_like(self.start)
        return Deployed(self.start, rest, rest)

    def in_segment(self, start: Scalar | np.ndarray, until: Scalar | np.ndarray) -> "Winches":
        return eqx.tree_at(lambda x: x.tension, self, self.tension.in_segment(start, until))

    def rows(self, time: Scalar, now: Deployed, winch_force: PerTether, density: PerTether) -> PerTether:
        """The left-hand sides [N] of the equations of the lengths. winch_force: F_w; density: rho [kg/m]."""
        inertia = self.drum + density * (self.total - now.length)
        passing = 0.5 * density * now.rate**2
        return inertia * now.acceleration - winch_force - passing + self.tension.at(time)

    def within(self, length: PerTether) -> Scalar:
        """Tells whether every tether is neither paid out to its end nor reeled in."""
        return ((length < self.total) & (length > LEAST_PART * self.start)).all()
