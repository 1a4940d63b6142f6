"""Axial energy of a member that expands with its temperature.

The elastic strain is what is left of the strain after free expansion,

    W = EA (eps - eps_T)^2 / 2,      eps_T = a (T - T_0),

with the coefficient of expansion a (Boley & Weiner 1960, Sec. 1.2, for one dimension). W changes with the
temperature, too: heating supplies dW/dt = -EA (eps - eps_T) eps_T' at constant strain, so that a taut member
gives off energy when it is heated. Damping is that of the whole strain's rate; it does not see eps_T.
"""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from esail_jax.array_types import Array, Float, Instants, PerElement, PerPoint, Scalar
from esail_jax.elements.axial import AbstractAxialEnergy, Strain
from esail_jax.environment.temperature import SteadyTemperature, TemperatureSeries
from esail_jax.terms import PointFields, invariants_of


class NaturalStrainEnergy(AbstractAxialEnergy):
    """Axial energy W = EA (eps - eps_T)^2 / 2 about a natural strain eps_T.

    stiffness: EA [N] and natural: eps_T [-] of every element, the latter also at several instants.
    """

    stiffness: PerElement
    natural: Float[Array, "*instant #element"]
    strain: Strain = eqx.field(static=True)

    name: ClassVar[str] = "axial about a natural strain"

    def energy_density(self, e: PerPoint) -> PerPoint:
        return 0.5 * self.stiffness * (e - self.natural) ** 2


class ThermalEnergy(AbstractAxialEnergy):
    """The energy at the head of this module, whose natural strain follows the temperature.

    stiffness: EA [N] of every element. expansion: a [1/K]. reference: T_0 [K]. temperature: T of every
    tether as a function of time. elements: number of elements of a tether.
    """

    stiffness: PerElement
    expansion: Scalar
    reference: Scalar
    temperature: SteadyTemperature | TemperatureSeries
    strain: Strain = eqx.field(static=True)
    elements: int = eqx.field(static=True)

    name: ClassVar[str] = "axial, thermal strain"

    def at(self, time: Instants) -> NaturalStrainEnergy:
        """The energy at one or several instants."""
        natural = self.expansion * (self.temperature.at(time) - self.reference)
        return NaturalStrainEnergy(self.stiffness, jnp.tile(natural, self.elements), self.strain)

    def energy_density(self, e: PerPoint) -> PerPoint:
        """Raises TypeError: the energy has a value at an instant only (`at`)."""
        raise TypeError("the energy of a heated tether must be taken at an instant")

    def heating(self, time: Instants, fields: PointFields) -> PerPoint | None:
        """dW/dt = -EA (eps - eps_T) eps_T' [W/m] at constant strain."""
        rate = self.temperature.rate(time)
        if rate is None:
            return None
        now = self.at(time)
        elastic = self.deformation(invariants_of(PointFields(None, fields.r_x))) - now.natural
        return -self.stiffness * elastic * jnp.tile(self.expansion * rate, self.elements)

    def in_segment(self, start: Scalar | np.ndarray, until: Scalar | np.ndarray) -> "ThermalEnergy":
        """The energy as a segment of a run sees it."""
        within = self.temperature.in_segment(start, until)
        return eqx.tree_at(lambda energy: energy.temperature, self, within)
