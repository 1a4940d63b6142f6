"""The kinds of term a system is the sum of, and the point quantities they are written in.

    M q'' + Phi_q(q)^T lam = Q(t, q, q'),      Q = -dU/dq - dR/dq' + Q_load

An energy is a density W(e) [J/m] with U = integral of W dx, a dissipation a Rayleigh density R(e, e')
[W/m], where e is a measure of deformation such as a strain, a function of the `Shape`; a load is a force
per undeformed length [N/m]. Each is written once, for one point; arrays are component first with any batch
behind, so the same text acts on all quadrature points at once. Forces and tangents are derivatives of that
text (`jax.grad`, `jax.jvp`): nothing else is ever written down.
"""

from abc import abstractmethod
from collections.abc import Iterable
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from esail_jax.array_types import Array, Float, Instants, PerElement, PerPoint, PerTether, VectorPerPoint
from esail_jax.measurements import Measurements
from esail_jax.numerics.vectors import dot, reciprocal, stacked


class PointFields(NamedTuple):
    """What terms may depend on at a material point; also the quantities conjugate to it.

    r: position [m]; conjugate: force per length [N/m]
    r_x: slope dr/dx [-]; conjugate: axial force vector [N]
    r_xx: second derivative [1/m]; conjugate: [N m]. Present only if a term uses curvature
    """

    r: VectorPerPoint | None
    r_x: VectorPerPoint | None
    r_xx: VectorPerPoint | None = None


class Shape(NamedTuple):
    """What a slender member's deformation depends on, whichever way it points: s = |r_x|^2 [-], and
    m = |n|^2 [1/m^2], n the part of r_xx normal to r_x (None where nothing uses curvature). Also its rate,
    and what is conjugate to it."""

    stretch_squared: PerPoint
    normal_squared: PerPoint | None = None


def shape_of(fields: PointFields) -> Shape:
    """The shape at every point; the position does not matter to it."""
    normal = None if fields.r_xx is None else normal_squared(fields.r_x, fields.r_xx)
    return Shape(dot(fields.r_x, fields.r_x), normal)


@jax.custom_jvp
def normal_squared(r_x: VectorPerPoint, r_xx: VectorPerPoint) -> PerPoint:
    """|n|^2, n = r_xx - a r_x, a = (r_x . r_xx) / (r_x . r_x). A difference of products of the two vectors
    would lose all digits of a nearly straight cable."""
    _, normal = along_and_normal(r_x, r_xx)
    return dot(normal, normal)


@normal_squared.defjvp
def _normal_squared_jvp(primals, tangents):
    """2 n . (dr_xx - a dr_x): n . r_x is zero, which no compiler knows."""
    along, normal = along_and_normal(*primals)
    return dot(normal, normal), 2.0 * dot(normal, tangents[1] - along * tangents[0])


def along_and_normal(r_x: VectorPerPoint, r_xx: VectorPerPoint) -> tuple[PerPoint, VectorPerPoint]:
    """a and n of r_xx = a r_x + n."""
    along = dot(r_x, r_xx) * reciprocal(dot(r_x, r_x))
    return along, r_xx - along * r_x


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


class Deformation(Term):
    """A function of one scalar measure of deformation: an energy or a dissipation."""

    @abstractmethod
    def deformation(self, shape: Shape) -> PerPoint:
        """e: a strain, a curvature."""

    @abstractmethod
    def resultant(self, shape: Shape, rate: Shape | None) -> Shape:
        """What is conjugate to the shape. rate: None if nothing depends on it."""

    def point_forces(self, time: Instants, fields: PointFields, rates: PointFields) -> PointFields:
        return Together((self,)).point_forces(time, fields, rates)


class Energy(Deformation):
    """Elastic energy per undeformed length."""

    @abstractmethod
    def stored(self, e: PerPoint) -> PerPoint:
        """W(e) [J/m]."""

    def density(self, fields: PointFields) -> PerPoint:
        """W [J/m]."""
        return self.stored(self.deformation(shape_of(fields)))

    def resultant(self, shape: Shape, rate: Shape | None) -> Shape:
        """dW/d(shape)."""
        return jax.grad(lambda shape: self.stored(self.deformation(shape)).sum())(shape)


class Dissipation(Deformation):
    """Rayleigh dissipation function per undeformed length; the power lost is 2 R."""

    @abstractmethod
    def lost(self, e: PerPoint, rate: PerPoint) -> PerPoint:
        """R(e, e') [W/m], quadratic in the rate."""

    def density(self, fields: PointFields, rates: PointFields) -> PerPoint:
        """R [W/m]."""
        return self.of_rate(*jax.jvp(shape_of, (fields,), (rates,)))

    def of_rate(self, shape: Shape, rate: Shape) -> PerPoint:
        """R of a shape and its rate."""
        return self.lost(*jax.jvp(self.deformation, (shape,), (rate,)))

    def resultant(self, shape: Shape, rate: Shape | None) -> Shape:
        """dR/d(rate)."""
        return jax.grad(lambda rate: self.of_rate(shape, rate).sum())(rate)


class Together(Term):
    """Several deformations: their resultants are added up as the two numbers they are at a point, before
    these become vectors."""

    terms: tuple[Deformation, ...]

    name: ClassVar[str] = "together"

    @property
    def depends_on(self) -> tuple[str, ...]:
        named = {name for term in self.terms for name in term.depends_on}
        return tuple(name for name in PointFields._fields if name in named)

    def of_mine(self, fields: PointFields) -> PointFields:
        """Without the fields that nothing here depends on."""
        mine = self.depends_on
        return PointFields(*(x if name in mine else None for name, x in fields._asdict().items()))

    def resultant(self, shape: Shape, rate: Shape | None) -> Shape:
        """S(y, y') of the shape y."""
        parts = [term.resultant(shape, rate) for term in self.terms]
        return jax.tree.map(lambda *x: sum(x[1:], x[0]), *parts)

    def rate_of(self, fields: PointFields, rates: PointFields) -> Shape | None:
        """y' = J x', J = dy/dx, if anything depends on it."""
        if not any(isinstance(term, Dissipation) for term in self.terms):
            return None
        return jax.jvp(shape_of, (fields,), (rates,))[1]

    def point_forces(self, time: Instants, fields: PointFields, rates: PointFields) -> PointFields:
        """J^T S: the stress resultants."""
        fields, rates = self.of_mine(fields), self.of_mine(rates)
        shape, turned = jax.vjp(shape_of, fields)
        found = self.resultant(shape, self.rate_of(fields, rates))
        if found.normal_squared is not None:
            # Into memory: they would be computed again for every component of the vectors.
            found = Shape(*stacked([x[None] for x in found]))
        return turned(found)[0]

    def pull_back(
        self, time: Instants, fields: PointFields, rates: PointFields, w: PointFields
    ) -> tuple[PointFields, PointFields]:
        """With a = (dS/dy)^T J w, b = (dS/dy')^T J w, and as second derivatives of the shape are symmetric,

        (dF/dx)^T w = J^T a + dJ^T[w] S + dJ^T[x'] b,      (dF/dx')^T w = J^T b
        """
        fields, rates, w = (self.of_mine(x) for x in (fields, rates, w))
        shape, turned = jax.vjp(shape_of, fields)
        along = jax.jvp(shape_of, (fields,), (w,))[1]
        found, back = jax.vjp(self.resultant, shape, self.rate_of(fields, rates))
        by_shape, by_rate = back(along)

        def bent(direction, force):
            """dJ^T[direction] force."""
            return jax.jvp(lambda x: jax.vjp(shape_of, x)[1](force)[0], (fields,), (direction,))[1]

        by_fields = [turned(by_shape)[0], bent(w, found)]
        if by_rate is None:
            return jax.tree.map(jnp.add, *by_fields), PointFields(None, None)
        return jax.tree.map(lambda *x: sum(x), *by_fields, bent(rates, by_rate)), turned(by_rate)[0]


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


class ControlledLoad(Load):
    """A load with a number per tether that a control law commands, such as the tether's voltage.

    Unless the command is constant, the system passes `Measurements` of every state to `commanded`, and the
    result, one number per element, to `with_command`, before forces are evaluated.
    """

    @property
    @abstractmethod
    def constant(self) -> bool:
        """Tells whether the command depends on neither time nor state."""

    @property
    @abstractmethod
    def law_name(self) -> str:
        """Name of the control law."""

    @property
    @abstractmethod
    def command(self) -> PerElement | None:
        """The command that forces are evaluated with; None if none has been set yet."""

    @abstractmethod
    def commanded(self, measurements: Measurements) -> PerTether:
        """The law's command for every tether, within its limits."""

    @abstractmethod
    def with_command(self, command: Float[Array, "*state element"]) -> "ControlledLoad":
        """The load with a given command."""


def needs_command(load: Load) -> bool:
    """Tells whether the system has to ask a control law before the load's forces can be evaluated."""
    return isinstance(load, ControlledLoad) and not load.constant


def find_term(terms: Iterable[Term], kind: type) -> Any:
    """The only term of a kind among `terms`; None if there is none.

    Raises ValueError if there are several."""
    found = [term for term in terms if isinstance(term, kind)]
    if len(found) > 1:
        raise ValueError(f"terms of kind {kind.__name__} must be one at most, but are {len(found)}")
    return found[0] if found else None
