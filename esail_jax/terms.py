"""The kinds of term a system is the sum of, and the point quantities they are written in.

    M q'' + Phi_q(q)^T lam = Q(t, q, q'),      Q = -dU/dq - dR/dq' + Q_load

An energy is a density W(e) [J/m] with U = integral of W dx, a dissipation a Rayleigh density R(e, e')
[W/m], where e is a measure of deformation such as a strain; a load is a force per undeformed length
[N/m]. Each is written once, for one point; arrays are component
first with any batch behind, so the same text acts on all quadrature points at once. Forces and
tangents are derivatives of that text (`jax.grad`, `jax.jvp`): nothing else is ever written down.
"""

from abc import abstractmethod
from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from esail_jax.array_types import Instants, PerPoint, VectorPerPoint
from esail_jax.numerics.vectors import dot


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
    def point_forces(self, time: Instants, fields: PointFields, rates: PointFields) -> PointFields:
        """Contribution to the left-hand side of the equations of motion, conjugate to the fields;
        None where there is none."""

    def pull_back(
        self, time: Instants, fields: PointFields, rates: PointFields, w: PointFields
    ) -> tuple[PointFields, PointFields]:
        """(dF/dx)^T w and (dF/dx')^T w of the forces F(x, x') at every point, conjugate to fields and
        rates; None where nothing depends on them."""
        w = PointFields(*(x if name in self.acts_on else None for name, x in w._asdict().items()))
        _, transposed = jax.vjp(lambda *x: self.point_forces(time, *x), fields, rates)
        return transposed(w)


class Energy(Term):
    """Elastic energy per undeformed length, a function of one scalar measure of deformation."""

    @abstractmethod
    def deformation(self, fields: PointFields) -> PerPoint:
        """e: a strain, a curvature."""

    @abstractmethod
    def stored(self, e: PerPoint) -> PerPoint:
        """W(e) [J/m]."""

    def density(self, fields: PointFields) -> PerPoint:
        """W [J/m]."""
        return self.stored(self.deformation(fields))

    def point_forces(self, time: Instants, fields: PointFields, rates: PointFields) -> PointFields:
        """dW/d(fields) = W'(e) grad e: the stress resultants."""
        e, gradient = with_gradient(self.deformation, self.depends_on, fields)
        stress = jax.grad(lambda e: self.stored(e).sum())(e)
        return jax.tree.map(lambda g: stress * g, gradient)

    def pull_back(
        self, time: Instants, fields: PointFields, rates: PointFields, w: PointFields
    ) -> tuple[PointFields, PointFields]:
        """The Hessian of W is symmetric: what a change of the fields by w does to the forces."""
        w = among(fields, self.depends_on, w)
        _, moved = jax.jvp(lambda x: self.point_forces(time, x, rates), (fields,), (w,))
        return among(fields, self.depends_on, moved), PointFields(None, None)


class Dissipation(Term):
    """Rayleigh dissipation function per undeformed length; the power lost is 2 R."""

    @abstractmethod
    def deformation(self, fields: PointFields) -> PerPoint:
        """e: what it costs power to change."""

    @abstractmethod
    def lost(self, e: PerPoint, rate: PerPoint) -> PerPoint:
        """R(e, e') [W/m], quadratic in the rate."""

    def along(self, gradient: PointFields, rates: PointFields) -> PerPoint:
        """g . x': the rate of e, or its change along any other vectors."""
        return sum(dot(getattr(gradient, name), getattr(rates, name)) for name in self.depends_on)

    def density(self, fields: PointFields, rates: PointFields) -> PerPoint:
        """R [W/m]."""
        return self.lost(*jax.jvp(self.deformation, (fields,), (rates,)))

    def point_forces(self, time: Instants, fields: PointFields, rates: PointFields) -> PointFields:
        """dR/d(rates) = (dR/de') grad e: the viscous stress resultants. The gradient is that of the
        energy in the same measure, and computed once for both."""
        e, gradient = with_gradient(self.deformation, self.depends_on, fields)
        rate = self.along(gradient, rates)
        stress = jax.grad(lambda rate: self.lost(e, rate).sum())(rate)
        return jax.tree.map(lambda g: stress * g, gradient)

    def pull_back(
        self, time: Instants, fields: PointFields, rates: PointFields, w: PointFields
    ) -> tuple[PointFields, PointFields]:
        """Of F = S(e, e') g with S = dR/de', g = grad e and H = grad g, which is symmetric:

        (dF/dx)^T w = (g.w) dS/de g + H (S w + (g.w) dS/de' x'),      (dF/dx')^T w = (g.w) dS/de' g
        """
        w = among(fields, self.depends_on, w)
        e, g = with_gradient(self.deformation, self.depends_on, fields)
        rate, along = (self.along(g, x) for x in (rates, w))

        def stress(e, rate):
            return jax.grad(lambda rate: self.lost(e, rate).sum())(rate)

        ones, none = jnp.ones_like(e), jnp.zeros_like(e)
        s, by_e = jax.jvp(stress, (e, rate), (ones, none))
        _, by_rate = jax.jvp(stress, (e, rate), (none, ones))
        turn = jax.tree.map(lambda w, v: s * w + along * by_rate * v, w, rates)
        turn = among(fields, self.depends_on, turn)
        _, bent = jax.jvp(
            lambda x: with_gradient(self.deformation, self.depends_on, x)[1], (fields,), (turn,)
        )
        by_fields = jax.tree.map(lambda h, g: h + along * by_e * g, bent, g)
        by_rates = jax.tree.map(lambda g: along * by_rate * g, g)
        return among(fields, self.depends_on, by_fields), among(rates, self.depends_on, by_rates)


class Load(Term):
    """External force per undeformed length."""

    @property
    def acts_on(self) -> tuple[str, ...]:
        return ("r",)

    @abstractmethod
    def force(self, time: Instants, fields: PointFields, rates: PointFields) -> VectorPerPoint:
        """f [N/m]."""

    def point_forces(self, time: Instants, fields: PointFields, rates: PointFields) -> PointFields:
        """-f, conjugate to the position."""
        return PointFields(-self.force(time, fields, rates), None)


def with_gradient(
    function: Callable[[PointFields], PerPoint], names: tuple[str, ...], at: PointFields
) -> tuple[PerPoint, PointFields]:
    """A function of the fields at every point, and its gradient with respect to the named ones; None
    for the others."""

    def of_named(*values):
        return function(at._replace(**dict(zip(names, values, strict=True))))

    value, pull_back = jax.vjp(of_named, *(getattr(at, name) for name in names))
    gradient = pull_back(jnp.ones_like(value))
    return value, PointFields(None, None)._replace(**dict(zip(names, gradient, strict=True)))


def among(like: PointFields, names: tuple[str, ...], values: PointFields) -> PointFields:
    """The named values; zeros for the other fields there are."""
    return PointFields(
        *(
            None if field is None else value if name in names else jnp.zeros_like(field)
            for name, field, value in zip(PointFields._fields, like, values, strict=True)
        )
    )
