"""Axial energy and dissipation of a slender member, cable or truss ([PGV] Eq. 23-24, 36)."""

from typing import ClassVar, Literal

import equinox as eqx
import jax.numpy as jnp

from esail_jax.array_types import PerElement, PerPoint, Scalar
from esail_jax.numerics.vectors import root
from esail_jax.terms import Dissipation, Energy, Shape

Strain = Literal["green-lagrange", "engineering"]


def axial_strain(stretch_squared: PerPoint, measure: Strain) -> PerPoint:
    """eps [-] of s = r_x . r_x: Green-Lagrange (s - 1)/2 ([PGV] Eq. 24), or engineering |r_x| - 1."""
    if measure == "engineering":
        return root(stretch_squared) - 1.0
    return 0.5 * (stretch_squared - 1.0)


class AbstractAxialEnergy(Energy):
    """An energy of the axial strain. Every system of tethers or rods has exactly one.

    stiffness: EA [N] of a taut member, per element; strain: the measure of strain.
    """

    stiffness: eqx.AbstractVar[PerElement]
    strain: eqx.AbstractVar[Strain]

    depends_on: ClassVar[tuple[str, ...]] = ("r_x",)

    def deformation(self, shape: Shape) -> PerPoint:
        return axial_strain(shape.stretch_squared, self.strain)


class AxialEnergy(AbstractAxialEnergy):
    """W = EA eps^2 / 2 ([PGV] Eq. 23). EA [N] per element."""

    stiffness: PerElement
    strain: Strain = eqx.field(static=True)

    name: ClassVar[str] = "axial"

    def stored(self, e: PerPoint) -> PerPoint:
        return 0.5 * self.stiffness * e**2


class TensionOnlyEnergy(AbstractAxialEnergy):
    """Axial energy of a member that cannot push: stiffness grows from 0 to EA within a strain w,

    d^2W/deps^2 = EA clip((eps + w/2)/w, 0, 1),

    so that W is twice differentiable (Newton's method needs that), no force is left below
    eps = -w/2, and above w/2 the force is EA eps exactly. EA [N] per element, width w [-].
    """

    stiffness: PerElement
    width: Scalar
    strain: Strain = eqx.field(static=True)

    name: ClassVar[str] = "tension only"

    def stored(self, e: PerPoint) -> PerPoint:
        w = self.width
        above_slack = e + 0.5 * w
        above_blend = above_slack - w
        blend = above_slack**3 / (6.0 * w)
        taut = w**2 / 6.0 + 0.5 * above_blend * (w + above_blend)
        # Each branch as a whole: where they meet, clip's derivative would be neither side's.
        pulled = jnp.where(above_blend > 0.0, taut, blend)
        return self.stiffness * jnp.where(above_slack > 0.0, pulled, 0.0)


class AxialDissipation(Dissipation):
    """R = gamma_x EA (deps/dt)^2 / 2 ([PGV] Eq. 36). gamma_x [s], EA [N] per element."""

    stiffness: PerElement
    time: PerElement
    strain: Strain = eqx.field(static=True)

    name: ClassVar[str] = "axial damping"
    depends_on: ClassVar[tuple[str, ...]] = ("r_x",)

    def deformation(self, shape: Shape) -> PerPoint:
        return axial_strain(shape.stretch_squared, self.strain)

    def lost(self, e: PerPoint, rate: PerPoint) -> PerPoint:
        return 0.5 * self.time * self.stiffness * rate**2
