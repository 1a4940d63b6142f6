"""Axial energy and dissipation of a slender member, cable or truss ([PGV] Eq. 23-24, 36)."""

from typing import ClassVar, Literal

import equinox as eqx
import jax.numpy as jnp

from esail_jax.array_types import PerElement, PerPoint, Scalar
from esail_jax.numerics.vectors import root
from esail_jax.point_fields import Invariants
from esail_jax.terms import Dissipation, Energy

Strain = Literal["green-lagrange", "engineering"]


def axial_strain(stretch_squared: PerPoint, measure: Strain) -> PerPoint:
    """Axial strain eps [-] as a function of s = r_x . r_x.

    The Green-Lagrange strain is (s - 1)/2 ([PGV] Eq. 24), the engineering strain |r_x| - 1.
    """
    if measure == "engineering":
        return root(stretch_squared) - 1.0
    return 0.5 * (stretch_squared - 1.0)


class AbstractAxialEnergy(Energy):
    """An energy of the axial strain. Every system of tethers or rods has exactly one.

    stiffness: EA [N] of every element when taut. strain: the measure of strain.
    """

    stiffness: eqx.AbstractVar[PerElement]
    strain: eqx.AbstractVar[Strain]

    depends_on: ClassVar[tuple[str, ...]] = ("r_x",)

    def deformation(self, invariants: Invariants) -> PerPoint:
        return axial_strain(invariants.stretch_squared, self.strain)


class AxialEnergy(AbstractAxialEnergy):
    """Axial energy W = EA eps^2 / 2 ([PGV] Eq. 23)."""

    stiffness: PerElement
    strain: Strain = eqx.field(static=True)

    name: ClassVar[str] = "axial"

    def energy_density(self, e: PerPoint) -> PerPoint:
        return 0.5 * self.stiffness * e**2


class TensionOnlyEnergy(AbstractAxialEnergy):
    """Axial energy of a member that cannot push. Its stiffness grows from 0 to EA within a strain w,

    d^2W/deps^2 = EA clip((eps + w/2)/w, 0, 1),

    so that W is twice differentiable, as Newton's method requires. The force is zero below eps = -w/2, and
    exactly EA eps above w/2.

    width: w [-], one for all or that of every element.
    """

    stiffness: PerElement
    width: Scalar | PerElement
    strain: Strain = eqx.field(static=True)

    name: ClassVar[str] = "tension only"

    def energy_density(self, e: PerPoint) -> PerPoint:
        w = self.width
        above_slack = e + 0.5 * w
        above_blend = above_slack - w
        blend = above_slack**3 / (6.0 * w)
        taut = w**2 / 6.0 + 0.5 * above_blend * (w + above_blend)
        # A choice between whole branches: at the joints, the derivative of `clip` is that of neither side.
        pulled = jnp.where(above_blend > 0.0, taut, blend)
        return self.stiffness * jnp.where(above_slack > 0.0, pulled, 0.0)


class AxialDissipation(Dissipation):
    """Axial Rayleigh density R = gamma_x EA (deps/dt)^2 / 2 ([PGV] Eq. 36).

    stiffness: EA [N]; time: gamma_x [s]; both of every element.
    """

    stiffness: PerElement
    time: PerElement
    strain: Strain = eqx.field(static=True)

    name: ClassVar[str] = "axial damping"
    depends_on: ClassVar[tuple[str, ...]] = ("r_x",)

    def deformation(self, invariants: Invariants) -> PerPoint:
        return axial_strain(invariants.stretch_squared, self.strain)

    def rayleigh_density(self, e: PerPoint, rate: PerPoint) -> PerPoint:
        return 0.5 * self.time * self.stiffness * rate**2
