"""The kinds of terms of the equations of motion.

    M (q'' - a(t, q, q')) + Phi_q(q)^T lam = Q(t, q, q'),      Q = -dU/dq - dR/dq' + Q_load

An energy is a density W(e) [J/m], with U the integral of W dx. A dissipation is a Rayleigh density R(e, e')
[W/m]. Both are functions of a measure of deformation e, such as a strain, which is a function of the
`Invariants`. A load is a force per undeformed length [N/m]. Each is written once, for one point: arrays
have the component first and any batch after it, so that the same code acts on all quadrature points at
once. Forces and tangents are derivatives of that code (`jax.grad`, `jax.jvp`); none is written by hand.

Three kinds do not act along the tethers. A tip load is a force on every remote unit, a hub load a force and
a torque on the hub, and a field an acceleration a of everything that has mass.
"""

from abc import abstractmethod
from collections.abc import Iterable
from typing import Any, ClassVar, NamedTuple, Protocol, TypeGuard

import equinox as eqx
import jax
import jax.numpy as jnp

from esail_jax.array_types import (
    Array,
    Float,
    Instants,
    Maybe,
    Nodal,
    PerElement,
    PerPoint,
    PerTether,
    Rotation,
    Scalar,
    Vector,
    VectorPerPoint,
)
from esail_jax.measurements import Measurements
from esail_jax.numerics.vectors import stacked
from esail_jax.point_fields import Invariants, PointFields, invariants_of


class Term(eqx.Module):
    """A term with forces at material points.

    depends_on: the fields it reads, for a dissipation with their rates. acts_on: the fields to whose
    conjugates it contributes.
    """

    name: eqx.AbstractClassVar[str]
    depends_on: eqx.AbstractClassVar[tuple[str, ...]]

    @property
    def acts_on(self) -> tuple[str, ...]:
        return self.depends_on

    @abstractmethod
    def point_forces(self, time: Instants, fields: PointFields, rates: PointFields) -> PointFields:
        """The term's part of the left-hand side of the equations of motion, conjugate to the fields; None
        for a field that it does not act on."""

    def thermal_part(self, time: Instants) -> "Term | None":
        """The part of an energy that depends on the temperature of an instant; None if there is none."""
        return None

    def pull_back(
        self, time: Instants, fields: PointFields, rates: PointFields, w: PointFields
    ) -> tuple[PointFields, PointFields]:
        """Transposed derivative (dF/dx)^T w and (dF/dx')^T w of the forces F(x, x') at every point. The
        results are conjugate to fields x and rates x'; None where F does not depend on them."""
        w = PointFields(*(x if name in self.acts_on else None for name, x in w._asdict().items()))
        _, transposed = jax.vjp(lambda *x: self.point_forces(time, *x), fields, rates)
        return transposed(w)


class Deformation(Term):
    """An energy or a dissipation: a function of one scalar measure of deformation."""

    def at(self, time: Instants) -> "Deformation":
        """The term at one or several instants. A term that does not change with time is the same at all."""
        return self

    @abstractmethod
    def deformation(self, invariants: Invariants) -> PerPoint:
        """The measure of deformation e, such as a strain or a squared curvature."""

    @abstractmethod
    def stress_resultant(self, invariants: Invariants, rate: Invariants | None) -> Invariants:
        """The stress resultants conjugate to the invariants. rate: None if no term depends on it."""

    def point_forces(self, time: Instants, fields: PointFields, rates: PointFields) -> PointFields:
        return SummedDeformations((self,)).point_forces(time, fields, rates)


class Energy(Deformation):
    """Elastic energy per undeformed length."""

    @abstractmethod
    def energy_density(self, e: PerPoint) -> PerPoint:
        """W(e) [J/m]."""

    def at(self, time: Instants) -> "Energy":
        return self

    def density(self, fields: PointFields) -> PerPoint:
        """W [J/m] of the fields."""
        return self.energy_density(self.deformation(invariants_of(fields)))

    def stress_resultant(self, invariants: Invariants, rate: Invariants | None) -> Invariants:
        """dW/dy of the invariants y."""
        return jax.grad(lambda y: self.energy_density(self.deformation(y)).sum())(invariants)


class Dissipation(Deformation):
    """Rayleigh dissipation function R per undeformed length. The dissipated power is 2 R."""

    @abstractmethod
    def rayleigh_density(self, e: PerPoint, rate: PerPoint) -> PerPoint:
        """R(e, e') [W/m], quadratic in the rate e'."""

    def density(self, fields: PointFields, rates: PointFields) -> PerPoint:
        """R [W/m] of the fields and their rates."""
        return self.density_of_invariants(*jax.jvp(invariants_of, (fields,), (rates,)))

    def density_of_invariants(self, invariants: Invariants, rate: Invariants) -> PerPoint:
        """R [W/m] of the invariants and their rates."""
        return self.rayleigh_density(*jax.jvp(self.deformation, (invariants,), (rate,)))

    def stress_resultant(self, invariants: Invariants, rate: Invariants | None) -> Invariants:
        """dR/dy' of the rates y' of the invariants."""
        return jax.grad(lambda rate: self.density_of_invariants(invariants, rate).sum())(rate)


class SummedDeformations(Term):
    """The sum of several energies and dissipations.

    Their stress resultants are added while they are two numbers at a point, before they become vectors.
    """

    terms: tuple[Deformation, ...]

    name: ClassVar[str] = "summed deformations"

    @property
    def depends_on(self) -> tuple[str, ...]:
        named = {name for term in self.terms for name in term.depends_on}
        return tuple(name for name in PointFields._fields if name in named)

    def at(self, time: Instants) -> "SummedDeformations":
        """The sum of the terms at one or several instants."""
        return SummedDeformations(tuple(term.at(time) for term in self.terms))

    def fields_needed(self, fields: PointFields) -> PointFields:
        """The fields that a term of the sum depends on; None in place of the others."""
        needed = self.depends_on
        return PointFields(*(x if name in needed else None for name, x in fields._asdict().items()))

    def stress_resultant(self, invariants: Invariants, rate: Invariants | None) -> Invariants:
        """S(y, y') of the invariants y and their rates."""
        parts = [term.stress_resultant(invariants, rate) for term in self.terms]
        return jax.tree.map(lambda *x: sum(x[1:], x[0]), *parts)

    def invariant_rates(self, fields: PointFields, rates: PointFields) -> Invariants | None:
        """y' = J x', J = dy/dx; None without a dissipation, as nothing else depends on y'."""
        if not any(isinstance(term, Dissipation) for term in self.terms):
            return None
        return jax.jvp(invariants_of, (fields,), (rates,))[1]

    def point_forces(self, time: Instants, fields: PointFields, rates: PointFields) -> PointFields:
        """F = J^T S."""
        fields, rates = self.fields_needed(fields), self.fields_needed(rates)
        invariants, to_fields = jax.vjp(invariants_of, fields)
        stress = self.at(time).stress_resultant(invariants, self.invariant_rates(fields, rates))
        if stress.normal_squared is not None:
            # Stacked into memory; otherwise they are computed again for every component of the vectors.
            stress = Invariants(*stacked([x[None] for x in stress]))
        return to_fields(stress)[0]

    def pull_back(
        self, time: Instants, fields: PointFields, rates: PointFields, w: PointFields
    ) -> tuple[PointFields, PointFields]:
        """The transposed derivative. Let a = (dS/dy)^T J w and b = (dS/dy')^T J w. Second derivatives of
        the invariants are symmetric, hence

        (dF/dx)^T w = J^T a + dJ^T[w] S + dJ^T[x'] b,      (dF/dx')^T w = J^T b
        """
        fields, rates, w = (self.fields_needed(x) for x in (fields, rates, w))
        invariants, to_fields = jax.vjp(invariants_of, fields)
        along = jax.jvp(invariants_of, (fields,), (w,))[1]
        rate = self.invariant_rates(fields, rates)
        stress, back = jax.vjp(self.at(time).stress_resultant, invariants, rate)
        # These numbers are written into memory, as in `point_forces`; otherwise they are computed again for
        # every component of the vectors.
        parts, structure = jax.tree.flatten(back(along))
        by_invariants, by_rate = jax.tree.unflatten(structure, stacked([x[None] for x in parts]))

        def second_derivative(direction, force):
            """dJ^T[direction] force."""
            return jax.jvp(lambda x: jax.vjp(invariants_of, x)[1](force)[0], (fields,), (direction,))[1]

        by_fields = [to_fields(by_invariants)[0], second_derivative(w, stress)]
        if by_rate is None:
            return jax.tree.map(jnp.add, *by_fields), PointFields(None, None)
        by_fields.append(second_derivative(rates, by_rate))
        return jax.tree.map(lambda *x: sum(x), *by_fields), to_fields(by_rate)[0]


def inner_terms_of(energies: tuple[Term, ...], dissipations: tuple[Term, ...]) -> tuple[Term, ...]:
    """Energies and dissipations; those that are functions of the invariants as one summed term."""
    terms = (*energies, *dissipations)
    summed = tuple(term for term in terms if isinstance(term, Deformation))
    others = tuple(term for term in terms if not isinstance(term, Deformation))
    return (SummedDeformations(summed), *others) if summed else others


class Load(Term):
    """External force per undeformed length."""

    def knots(self, measurements: Maybe[Measurements]) -> tuple[Array, ...]:
        """Instants [s] at which the load changes its form in time, as foreseen from a state. Steps end
        there. measurements: None if no load needs a command."""
        return ()

    def holding(self, volts: PerTether, elements: int) -> "Load":
        """The load when a sampled voltage law holds other voltages [V], on tethers of `elements`
        elements."""
        return self

    @property
    def has_kinks(self) -> bool:
        """Tells whether the load has a strength per tether with kinks in time, as a `KinkedLoad` has."""
        return False

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
    def is_sampled(self) -> bool:
        """Tells whether the command is held between the samples of a control law, and so constant there."""
        return False

    @property
    def measures_motion(self) -> bool:
        """Tells whether the control law needs all measurements (`sensors.with_motion`)."""
        return False

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


class KinkedLoad(Protocol):
    """A load with a strength per tether that has kinks in time (`steppers/kinks.py`)."""

    def strength(self, time: Scalar, measurements: Maybe[Measurements]) -> PerTether:
        """The force per length [N/m] that has the kinks."""

    def kinks(
        self, time: Scalar, measurements: Maybe[Measurements]
    ) -> tuple[Float[Array, "kink tether"], Float[Array, "kink tether"]]:
        """Distances from the kinks that are no knots, and by how much the derivative of the strength with
        respect to them jumps."""

    def with_added_strength(self, added: PerElement) -> Load:
        """The load with a strength [N/m] that is added to its own."""


def has_kinks(load: Load) -> TypeGuard[KinkedLoad]:
    """Tells whether the load has a strength per tether with kinks in time."""
    return load.has_kinks


def needs_command(load: Load) -> TypeGuard[ControlledLoad]:
    """Tells whether the system has to ask a control law before the load's forces can be evaluated."""
    return isinstance(load, ControlledLoad) and not load.constant


def has_law(load: Load) -> TypeGuard[ControlledLoad]:
    """Tells whether a control law ever changes the load's command, at every state or from sample to
    sample."""
    return isinstance(load, ControlledLoad) and (not load.constant or load.is_sampled)


class BodyTerm(eqx.Module):
    """A term that does not act along the tethers."""

    name: eqx.AbstractClassVar[str]

    @property
    def knots(self) -> tuple[Array, ...]:
        """Instants [s] at which the term changes its form in time. Steps with error control end there."""
        return ()


class TipLoad(BodyTerm):
    """A force on every remote unit."""

    @property
    def measures_motion(self) -> bool:
        """Tells whether the force needs all measurements (`sensors.with_motion`)."""
        return False

    def holding(self, volts: PerTether, elements: int) -> "TipLoad":
        """The load when a sampled voltage law holds other voltages [V]."""
        return self

    @abstractmethod
    def force(self, measurements: Measurements) -> Float[Array, "3 tether"]:
        """The forces [N] in inertial axes."""


class HubMotion(NamedTuple):
    """The motion of the hub: the input of the loads on it.

    time [s]. position [m] and velocity [m/s] of the hub's centre, in I. rotation: C_B^I, which maps
    components in B to components in I. angular_velocity: of B, in B [rad/s]. heliocentric_position: of the
    hub's centre [m], None for a sail without an orbit. sun: unit vector towards the Sun in I; None until a
    load that knows the Sun adds it.
    """

    time: Scalar
    position: Vector
    velocity: Vector
    rotation: Rotation
    angular_velocity: Vector
    heliocentric_position: Vector | None = None
    sun: Vector | None = None


class HubLoad(BodyTerm):
    """A force and a torque on the hub."""

    @abstractmethod
    def wrench(self, hub: HubMotion) -> tuple[Vector, Vector]:
        """The force [N] at the hub's centre, in I, and the torque [N m] about the centre, in B."""


class Field(BodyTerm):
    """An acceleration of everything that has mass: tethers, remote units, ring and hub."""

    @abstractmethod
    def acceleration(
        self, time: Scalar, position: VectorPerPoint, velocity: VectorPerPoint
    ) -> VectorPerPoint:
        """a [m/s^2] of free particles at positions [m] with velocities [m/s], all in inertial axes."""

    def at_nodes(self, time: Scalar, q: Nodal, v: Nodal) -> Nodal:
        """The nodal vectors of the field: its values at the positions of the nodes and, for slopes, its
        derivative along them. Between nodes it is interpolated."""
        if q.shape[0] == 1:
            return self.acceleration(time, q[0], v[0])[None]
        # All nodes are on one axis: the compiler's loops over short axes are slow.
        (r, slope), (rate, slope_rate) = (x.reshape(2, 3, -1) for x in (q, v))
        vectors = jax.jvp(lambda *x: self.acceleration(time, *x), (r, rate), (slope, slope_rate))
        return jnp.stack(vectors).reshape(q.shape)

    def gradients(
        self, time: Scalar, position: Vector, velocity: Vector
    ) -> tuple[Float[Array, "3 3"], Float[Array, "3 3"]] | None:
        """The gradients da/dr [1/s^2] and da/dv [1/s] at a point, for the iteration matrix; None where it
        leaves them out."""
        return jax.jacfwd(lambda *x: self.acceleration(time, *x), (0, 1))(position, velocity)


class LinearField(Field):
    """A field that is linear in position and velocity, and does not change with time: it acts on slopes as
    on positions."""

    @property
    @abstractmethod
    def matrices(self) -> tuple[Float[Array, "3 3"], Float[Array, "3 3"]]:
        """The gradients da/dr [1/s^2] and da/dv [1/s]."""

    def acceleration(
        self, time: Scalar, position: VectorPerPoint, velocity: VectorPerPoint
    ) -> VectorPerPoint:
        by_position, by_velocity = self.matrices
        return jnp.tensordot(by_position, position, 1) + jnp.tensordot(by_velocity, velocity, 1)

    def at_nodes(self, time: Scalar, q: Nodal, v: Nodal) -> Nodal:
        q, v = (jnp.moveaxis(x, 1, 0) for x in (q, v))
        return jnp.moveaxis(self.acceleration(time, q, v), 0, 1)

    def gradients(
        self, time: Scalar, position: Vector, velocity: Vector
    ) -> tuple[Float[Array, "3 3"], Float[Array, "3 3"]]:
        return self.matrices


class WinchLaw(BodyTerm):
    """What the motors of winches hold, beside their table (`elements/winch.py`)."""

    def tension(self, measurements: Measurements) -> PerTether:
        """The tension F [N] that every motor holds; positive against payout. A sampled law with a memory
        has `init` and `update` instead: its tension is then that of the first sample."""
        law: Any = self
        return law.update(measurements, law.init(measurements))[0]

    def holding(self, volts: PerTether, elements: int) -> "WinchLaw":
        """The law when a sampled voltage law holds other voltages [V]."""
        return self


class Terms(eqx.Module):
    """What acts, by kind; kinds that are absent are empty. The sum of two has the terms of both."""

    energies: tuple[Energy, ...] = ()
    dissipations: tuple[Dissipation, ...] = ()
    loads: tuple[Load, ...] = ()
    tip_loads: tuple[TipLoad, ...] = ()
    hub_loads: tuple[HubLoad, ...] = ()
    fields: tuple[Field, ...] = ()
    winch_laws: tuple[WinchLaw, ...] = ()

    def __add__(self, other: "Terms") -> "Terms":
        return Terms(**{kind: (*terms, *getattr(other, kind)) for kind, terms in vars(self).items()})


def find_term(terms: Iterable[eqx.Module], kind: type) -> Any:
    """The only term of a kind among `terms`; None if there is none.

    Raises ValueError if there are several."""
    of_kind = [term for term in terms if isinstance(term, kind)]
    if len(of_kind) > 1:
        raise ValueError(f"terms of kind {kind.__name__} must be one at most, but are {len(of_kind)}")
    return of_kind[0] if of_kind else None
