"""Nonlinear bending energy and dissipation of a cable ([PGV] Eq. 23-24, 36).

The curvature kappa = |r_x x r_xx| / |r_x|^3 has a kink where the cable is straight, but kappa^2 has none:
energy and dissipation are built from kappa^2. The dissipation needs the rate of the curvature, which is 0/0
on a straight cable as [PGV] prints it (Eq. 113-124). Instead,

    R = gamma_b EI (kappa kappa')^2 / (2 (kappa^2 + kappa_0^2)),   kappa kappa' = (kappa^2)'/2,

which is smooth, is a function of the deformation alone (so rigid motion dissipates nothing) and equals Eq.
36 up to a relative error of (kappa_0/kappa)^2. By default kappa_0 = 1e-4 / L: the bending of a tether whose
ends differ in direction by less than 1e-4 rad is not damped.
"""

from typing import ClassVar

from esail_jax.array_types import PerElement, PerPoint
from esail_jax.numerics.vectors import reciprocal
from esail_jax.point_fields import Invariants
from esail_jax.terms import Dissipation, Energy

STRAIGHT_TURN = 1e-4
"""Default of `tethers.straight_turn`, kappa_0 L [rad]: the bending dissipation fades out for a tether whose
ends differ in direction by less than this angle."""


def curvature_squared(invariants: Invariants) -> PerPoint:
    """kappa^2 [1/m^2] = (|r_x|^2 |r_xx|^2 - (r_x . r_xx)^2) / |r_x|^6 = m / s^2 ([PGV] Eq. 24, 97, 101)."""
    return invariants.normal_squared * reciprocal(invariants.stretch_squared) ** 2


class BendingEnergy(Energy):
    """Bending energy W = EI kappa^2 / 2 ([PGV] Eq. 23).

    stiffness: EI [N m^2] of every element.
    """

    stiffness: PerElement

    name: ClassVar[str] = "bending"
    depends_on: ClassVar[tuple[str, ...]] = ("r_x", "r_xx")

    def deformation(self, invariants: Invariants) -> PerPoint:
        return curvature_squared(invariants)

    def energy_density(self, e: PerPoint) -> PerPoint:
        return 0.5 * self.stiffness * e


class BendingDissipation(Dissipation):
    """The regularised Rayleigh density R at the head of this module.

    stiffness: EI [N m^2]; time: gamma_b [s]; straight_curvature: kappa_0 [1/m]; each of every element.
    """

    stiffness: PerElement
    time: PerElement
    straight_curvature: PerElement

    name: ClassVar[str] = "bending damping"
    depends_on: ClassVar[tuple[str, ...]] = ("r_x", "r_xx")

    def deformation(self, invariants: Invariants) -> PerPoint:
        return curvature_squared(invariants)

    def rayleigh_density(self, e: PerPoint, rate: PerPoint) -> PerPoint:
        rate_squared = 0.25 * rate**2 * reciprocal(e + self.straight_curvature**2)
        return 0.5 * self.time * self.stiffness * rate_squared
