"""Axial energy of a member that expands with its temperature.

The elastic strain is what is left of the strain after free expansion,

    W = EA (eps - eps_T)^2 / 2,      eps_T = a (T - T_0),

with the coefficient of expansion a (Boley & Weiner 1960, Sec. 1.12, in one dimension). Damping is that of
the whole strain's rate; it does not see eps_T. Heating supplies power at constant strain,

    dW/dt = -EA (eps - eps_T) eps_T' = EA eps_T eps' + d/dt [EA eps_T (eps_T/2 - eps)],

so that a taut member gives off energy when it is heated. dW/dt jumps where the temperature has a kink. The
first term on the right, the power of the thermal stress, does not: steppers integrate that one. The
bracket, the thermal energy, is a function of the state. It is added where the work is reported.
"""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from esail_jax.array_types import Array, Float, Instants, PerElement, PerPoint, PerTether, Scalar
from esail_jax.elements.axial import AbstractAxialEnergy, Strain, axial_strain
from esail_jax.numerics.lines_in_time import LinesInTime
from esail_jax.point_fields import Invariants, PointFields, invariants_of
from esail_jax.terms import Energy

PerInstant = Float[Array, "*instant #element"]
"""One number per element, at one or several instants."""


class SteadyTemperature(eqx.Module):
    """A constant temperature T [K] of every tether."""

    value: PerTether

    def at(self, time: Instants) -> PerTether:
        """T [K]: the same at all instants."""
        return self.value

    def in_segment(self, start: Scalar | np.ndarray, until: Scalar | np.ndarray) -> "SteadyTemperature":
        """The same temperature."""
        return self


class NaturalStrainEnergy(AbstractAxialEnergy):
    """Axial energy W = EA (eps - eps_T)^2 / 2 about a natural strain eps_T.

    stiffness: EA [N] and natural: eps_T [-] of every element.
    """

    stiffness: PerElement
    natural: PerInstant
    strain: Strain = eqx.field(static=True)

    name: ClassVar[str] = "axial about a natural strain"

    def energy_density(self, e: PerPoint) -> PerPoint:
        return 0.5 * self.stiffness * (e - self.natural) ** 2


class ThermalStress(Energy):
    """The part -N_T eps of the energy, with a thermal stress resultant N_T = EA eps_T that is given.

    resultant: N_T [N] of every element.
    """

    resultant: PerInstant
    strain: Strain = eqx.field(static=True)

    name: ClassVar[str] = "thermal stress"
    depends_on: ClassVar[tuple[str, ...]] = ("r_x",)

    def deformation(self, invariants: Invariants) -> PerPoint:
        return axial_strain(invariants.stretch_squared, self.strain)

    def energy_density(self, e: PerPoint) -> PerPoint:
        return -self.resultant * e


class ThermalEnergy(AbstractAxialEnergy):
    """The energy at the head of this module, whose natural strain follows the temperature.

    stiffness: EA [N] of every element. expansion: a [1/K]. reference: T_0 [K]. temperature: T of every
    tether as a function of time. elements: number of elements of a tether.
    """

    stiffness: PerElement
    expansion: Scalar
    reference: Scalar
    temperature: SteadyTemperature | LinesInTime
    strain: Strain = eqx.field(static=True)
    elements: int = eqx.field(static=True)

    name: ClassVar[str] = "axial, thermal strain"

    def natural(self, time: Instants) -> PerInstant:
        """eps_T [-] of every element at one or several instants."""
        return jnp.tile(self.expansion * (self.temperature.at(time) - self.reference), self.elements)

    def at(self, time: Instants) -> NaturalStrainEnergy:
        """The energy at one or several instants."""
        return NaturalStrainEnergy(self.stiffness, natural=self.natural(time), strain=self.strain)

    def energy_density(self, e: PerPoint) -> PerPoint:
        """Raises TypeError: the energy has a value at an instant only (`at`)."""
        raise TypeError("the energy of a heated tether must be taken at an instant")

    def thermal_part(self, time: Instants) -> ThermalStress:
        """The thermal stress at one or several instants."""
        return ThermalStress(self.stiffness * self.natural(time), self.strain)

    def thermal_energy(self, time: Instants, fields: PointFields) -> PerPoint:
        """EA eps_T (eps_T/2 - eps) [J/m]."""
        natural = self.natural(time)
        strain = self.deformation(invariants_of(PointFields(None, fields.r_x)))
        return self.stiffness * natural * (0.5 * natural - strain)

    def in_segment(self, start: Scalar | np.ndarray, until: Scalar | np.ndarray) -> "ThermalEnergy":
        """The energy as a segment of a run sees it."""
        within = self.temperature.in_segment(start, until)
        return eqx.tree_at(lambda energy: energy.temperature, self, within)
