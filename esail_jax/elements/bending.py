"""Nonlinear bending energy and dissipation of a cable ([PGV] Eq. 23-24, 36).

The curvature kappa = |r_x x r_xx| / |r_x|^3 has a kink where the cable is straight, its square does
not: everything here is built from kappa^2. The rate of the curvature, which the dissipation needs,
is 0/0 on a straight cable as [PGV] prints it (Eq. 113-124). Here

    R = gamma_b EI (kappa kappa')^2 / (2 (kappa^2 + kappa_0^2)),   kappa kappa' = (kappa^2)'/2,

which is smooth, depends on the shape only (so rigid motion costs nothing) and equals Eq. 36 to
relative order (kappa_0/kappa)^2. kappa_0 = 1e-4 / L by default: a tether whose ends differ in direction by
less than 1e-4 rad is not damped in bending.
"""

from typing import ClassVar

from esail_jax.array_types import PerElement, PerPoint
from esail_jax.numerics.vectors import reciprocal
from esail_jax.terms import Dissipation, Energy, Shape

STRAIGHT_TURN = 1e-4
"""Default of `tethers.straight_turn`, kappa_0 L [rad]: the bending dissipation fades out for a tether whose
ends differ in direction by less than this angle."""


def curvature_squared(shape: Shape) -> PerPoint:
    """kappa^2 [1/m^2] = (|r_x|^2 |r_xx|^2 - (r_x . r_xx)^2) / |r_x|^6 = m / s^2 ([PGV] Eq. 24, 97, 101)."""
    return shape.normal_squared * reciprocal(shape.stretch_squared) ** 2


class BendingEnergy(Energy):
    """W = EI kappa^2 / 2 ([PGV] Eq. 23). EI [N m^2] per element."""

    stiffness: PerElement

    name: ClassVar[str] = "bending"
    depends_on: ClassVar[tuple[str, ...]] = ("r_x", "r_xx")

    def deformation(self, shape: Shape) -> PerPoint:
        return curvature_squared(shape)

    def stored(self, e: PerPoint) -> PerPoint:
        return 0.5 * self.stiffness * e


class BendingDissipation(Dissipation):
    """R of this file's head. gamma_b [s], EI [N m^2], kappa_0 [1/m] per element."""

    stiffness: PerElement
    time: PerElement
    straight_curvature: PerElement

    name: ClassVar[str] = "bending damping"
    depends_on: ClassVar[tuple[str, ...]] = ("r_x", "r_xx")

    def deformation(self, shape: Shape) -> PerPoint:
        return curvature_squared(shape)

    def lost(self, e: PerPoint, rate: PerPoint) -> PerPoint:
        rate_squared = 0.25 * rate**2 * reciprocal(e + self.straight_curvature**2)
        return 0.5 * self.time * self.stiffness * rate_squared
