"""Winches whose motors hold a tension: the length of every tether is an unknown.

Drum and motor have the inertia m_d [kg] (over the square of the radius) and are turned by the winch force
F_w, which is conjugate to the deployed length l (`deployment.py`), by the stored tether, which moves with
the drum, and by the motor, which resists with the tension F:

    (m_d + rho (L - l)) l'' = F_w + rho l'^2/2 - F

F_w contains the accelerations of the tether and l'': in the mass matrix of (q, l) the length is coupled to
all nodes of its tether. For a constant F the sum of the energy of the sail and of (m_d + rho (L - l))
l'^2/2 + F l over the tethers is constant without loads and damping."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from esail_jax.array_types import Array, Bool, PerTether, Scalar
from esail_jax.elements.deployment import AbstractPayout, Deployed, PerInstant
from esail_jax.numerics.lines_in_time import LinesInTime

LEAST_PART = 1.0 / 20.0
"""Least deployed length over that of the start, at which a run ends: the tether is reeled in."""

END_GAP = 1e-6
"""A step that would pass an end is halved until tethers move by less than this part of their length."""


class Winches(AbstractPayout):
    """The winches of all tethers.

    start: l at t = 0 [m]; drum: m_d [kg]; tension: F [N] of every tether, linear in time between instants;
    None if laws of a user alone say what the motors hold (`terms.WinchLaw`)."""

    total: PerTether
    start: PerTether
    drum: PerTether
    tension: LinesInTime | None

    unknown: ClassVar[bool] = True

    def at_start(self) -> Deployed:
        rest = jnp.zeros_like(self.start)
        return Deployed(self.start, rest, rest)

    def in_segment(self, start: Scalar | np.ndarray, until: Scalar | np.ndarray) -> "Winches":
        if self.tension is None:
            return self
        return eqx.tree_at(lambda x: x.tension, self, self.tension.in_segment(start, until))

    def rows(
        self, now: Deployed, winch_force: PerInstant, motor_tension: PerInstant, density: PerTether
    ) -> PerInstant:
        """The left-hand sides [N] of the equations of the lengths. winch_force: F_w [N]; motor_tension: F
        [N]; density: rho [kg/m]."""
        inertia = self.drum + density * (self.total - now.length)
        return inertia * now.acceleration - winch_force - 0.5 * density * now.rate**2 + motor_tension

    def within(self, length: PerTether) -> Bool[Array, " tether"]:
        """Tells which tethers are neither paid out to their end nor reeled in."""
        return (length < self.total) & (length > LEAST_PART * self.start)

    def ends(self, length: PerTether, rate: PerTether, step: Scalar) -> Bool[Array, ""]:
        """Tells whether a tether comes to an end within two steps [s]."""
        return ~self.within(length + 2.0 * step * rate).all()

    def is_short(self, rate: PerTether, step: Scalar) -> Bool[Array, ""]:
        """Tells whether no tether moves by more than END_GAP of its length in a step [s]."""
        return (jnp.abs(step * rate) < END_GAP * self.total).all()

    def ended(self, length: PerTether) -> str:
        """What is deployed of the tether that is nearest to an end."""
        total, least, now = (np.asarray(x) for x in (self.total, LEAST_PART * self.start, length))
        i = np.argmin(np.minimum(1.0 - now / total, now / least - 1.0))
        return f"tether {i + 1} has {now[i]:.6g} m deployed, of {least[i]:.6g} to {total[i]:.6g} m."
