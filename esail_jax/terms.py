"""The kinds of term a system is the sum of, and the point quantities they are written in.

    M q'' + Phi_q(q)^T lam = Q(t, q, q'),      Q = -dU/dq - dR/dq' + Q_load

An energy is a density W [J/m] with U = integral of W dx, a dissipation a Rayleigh density [W/m], a
load a force per undeformed length [N/m]. Each is written once, for one point; arrays are component
first with any batch behind, so the same text acts on all quadrature points at once. Forces and
tangents are derivatives of that text (`jax.grad`, `jax.jvp`): nothing else is ever written down.
"""

from abc import abstractmethod
from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax

from esail_jax.array_types import PerPoint, Scalar, VectorPerPoint


class PointFields(NamedTuple):
    """What terms may depend on at a material point; also the quantities conjugate to it.

    r: position [m]; conjugate: force per length [N/m]
    r_x: slope dr/dx [-]; conjugate: axial force vector [N]
    r_xx: second derivative [1/m]; conjugate: [N m]. Present only if a term uses curvature
    """

    r: VectorPerPoint | None
    r_x: VectorPerPoint | None
    r_xx: VectorPerPoint | None = None


class Term(eqx.Module):
    """Anything with forces at material points.

    depends_on: fields it reads (for a dissipation, with their rates); acts_on: fields whose
    conjugates it contributes.
    """

    name: eqx.AbstractClassVar[str]
    depends_on: eqx.AbstractClassVar[tuple[str, ...]]

    @property
    def acts_on(self) -> tuple[str, ...]:
        return self.depends_on

    @abstractmethod
    def point_forces(self, time: Scalar, fields: PointFields, rates: PointFields) -> PointFields:
        """Contribution to the left-hand side of the equations of motion, conjugate to the fields;
        None where there is none."""


class Energy(Term):
    """Elastic energy per undeformed length."""

    @abstractmethod
    def density(self, fields: PointFields) -> PerPoint:
        """W [J/m]."""

    def point_forces(self, time: Scalar, fields: PointFields, rates: PointFields) -> PointFields:
        """dW/d(fields): the stress resultants, by reverse mode on the density."""
        return only(self.depends_on, fields, lambda f: self.density(f).sum())


class Dissipation(Term):
    """Rayleigh dissipation function per undeformed length; the power lost is 2 R."""

    @abstractmethod
    def density(self, fields: PointFields, rates: PointFields) -> PerPoint:
        """R [W/m], quadratic in the rates."""

    def point_forces(self, time: Scalar, fields: PointFields, rates: PointFields) -> PointFields:
        """dR/d(rates): the viscous stress resultants."""
        return only(self.depends_on, rates, lambda v: self.density(fields, v).sum())


class Load(Term):
    """External force per undeformed length."""

    @property
    def acts_on(self) -> tuple[str, ...]:
        return ("r",)

    @abstractmethod
    def force(self, time: Scalar, fields: PointFields, rates: PointFields) -> VectorPerPoint:
        """f [N/m]."""

    def point_forces(self, time: Scalar, fields: PointFields, rates: PointFields) -> PointFields:
        """-f, conjugate to the position."""
        return PointFields(-self.force(time, fields, rates), None)


def only(names: tuple[str, ...], at: PointFields, function: Callable) -> PointFields:
    """Gradient of a function of fields with respect to the named ones; None for the others."""
    values = tuple(getattr(at, name) for name in names)
    gradient = jax.grad(lambda x: function(at._replace(**dict(zip(names, x, strict=True)))))(values)
    return PointFields(None, None)._replace(**dict(zip(names, gradient, strict=True)))
