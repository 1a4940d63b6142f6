"""Terms that users write (`physics.py`): the wrappers that put them beside those of the package.

A wrapper divides a term into its structure and its numbers, as `own_law.py` does with voltage laws, hands
it what it may know, and refuses a result that is wrong in one line with the place in the term.
"""

import dataclasses
import inspect
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from esail_jax.array_types import (
    Array,
    Float,
    Instants,
    Maybe,
    PerElement,
    PerPoint,
    PerTether,
    Scalar,
    Vector,
    VectorPerPoint,
)
from esail_jax.control.calls_of_law import called, two_things
from esail_jax.elements.tether import TetherBatch
from esail_jax.environment.kepler_orbit import KeplerOrbit, PlaceOnOrbit
from esail_jax.errors import SceneError
from esail_jax.loads.coulomb import CoulombThrust
from esail_jax.loads.law_structure import NUMBER, LawStructure
from esail_jax.loads.own_law import arrays, check_same
from esail_jax.measurements import Measurements
from esail_jax.numerics.quadrature import gauss_legendre
from esail_jax.physics import LoadFields
from esail_jax.point_fields import Invariants, PointFields
from esail_jax.terms import (
    ControlledLoad,
    Dissipation,
    Energy,
    Field,
    HubLoad,
    HubMotion,
    Load,
    Term,
    Terms,
    TipLoad,
    WinchLaw,
)


class Own(eqx.Module):
    """A user's term: its structure, its numbers, and its place in the list of terms."""

    structure: LawStructure = eqx.field(static=True)
    numbers: tuple[Array, ...]
    place: int = eqx.field(static=True)

    @property
    def term(self) -> Any:
        """The term as the user wrote it."""
        return self.structure.law(self.numbers)

    @property
    def name(self) -> str:
        return self.term.name

    @property
    def instants(self) -> tuple[Array, ...]:
        """The instants [s] at which the term changes its form in time. Raises SceneError."""
        try:
            return tuple(jnp.ravel(jnp.asarray(x, float)) for x in self.term.knots)
        except Exception as error:
            reason = " ".join(f"{type(error).__name__}: {error}".split())
            name = f"{subject_of(self.term, self.place)}.knots"
            must = "be a property that gives a tuple of instants"
            raise SceneError(name, must, f"it raises {reason}") from error

    def call(self, method: str, *given: Any) -> Any:
        """What a method of the term returns. Raises SceneError."""
        term = self.term
        return called(term, method, *given, subject=subject_of(term, self.place), own=True)

    def like(self, method: str, returned: Any, shape: tuple[int, ...], what: str) -> Array:
        """What a method returned, as numbers of a shape. Raises SceneError for another shape."""
        return checked(self.term, self.place, method, returned, shape, what)


SCALARS = ("numbers", "energies", "powers")
"""How results are called that are no vectors: vectors must have all their components."""


def subject_of(term: Any, place: int) -> str:
    """A term in words: its place in the list of terms, and its class."""
    return f"terms[{place}] ({type(term).__name__})"


def checked(term: Any, place: int, method: str, returned: Any, shape: tuple[int, ...], what: str) -> Array:
    """What a method of a term returned, as numbers of a shape, to which axes of length one are repeated.
    Raises SceneError for another shape, and for what is no number."""
    try:
        numbers = jnp.asarray(returned)
    except (TypeError, ValueError):
        numbers = None
    if numbers is not None and jnp.result_type(numbers).kind in "fiu":
        same = zip(numbers.shape, shape, strict=False)
        whole = what.startswith(SCALARS) or numbers.shape[:1] == shape[:1]
        if whole and numbers.ndim == len(shape) and all(a in (1, b) for a, b in same):
            return jnp.broadcast_to(numbers.astype(float), shape)
    must, got = f"return {what} of shape {shape}", f"returns {described(returned)}"
    raise SceneError(f"{subject_of(term, place)}.{method}", must, f"{line_of(term, method)} {got}")


def described(returned: Any) -> str:
    """What a method returned, in words."""
    shape, dtype = getattr(returned, "shape", None), getattr(returned, "dtype", None)
    if shape is None:
        return f"a {type(returned).__name__}"
    kind = "" if dtype is None or jnp.issubdtype(dtype, jnp.floating) else f" of {dtype}"
    return f"an array{kind} of shape {shape}"


def line_of(term: Any, method: str) -> str:
    """File and line of a method of a term."""
    function = inspect.unwrap(getattr(type(term), method))
    code = getattr(function, "__code__", None)
    return "it" if code is None else f"{Path(code.co_filename).name}:{code.co_firstlineno}"


class Surroundings(eqx.Module):
    """What terms may know beside the motion: where the Sun is, and the current of the tethers.

    origin: heliocentric position [m] of the origin of I without an orbit. orbit: on which the origin of the
    coordinates moves; first: position [m] and velocity [m/s] of the scene's orbit at t = 0, on which the
    origin of I moves; both None without an orbit. thrust: the load that commands the voltages; None
    without wind.
    """

    origin: Vector
    orbit: KeplerOrbit | PlaceOnOrbit | None
    first: tuple[Vector, Vector] | None
    thrust: CoulombThrust | None

    def shift(self, time: Instants) -> tuple[Array, Array] | None:
        """Position [m] and velocity [m/s] of the origin of the coordinates in I; None where both are the
        same, without an orbit."""
        if self.orbit is None or self.first is None:
            return None
        here, there = self.orbit.at(time), KeplerOrbit(*self.first).at(time)
        return here[0] - there[0], here[1] - there[1]

    def sun(self, heliocentric: Vector | None) -> Vector:
        """Unit vector towards the Sun, from a heliocentric position, without one from the origin."""
        away = self.origin if heliocentric is None else heliocentric
        return -away / jnp.sqrt(away @ away)

    def measured(self, measurements: Measurements) -> Measurements:
        """The measurements with the direction of the wind and, if it is known, the electron current."""
        measurements = measurements._replace(wind=-self.sun(measurements.position))
        if self.thrust is None or self.thrust.collector is None:
            return measurements
        volts = self.thrust.commanded(measurements)
        at = measurements.time, volts, measurements.position
        return measurements._replace(current=self.thrust.collector.current(*at))

    def holding(self, volts: PerTether, elements: int) -> "Surroundings":
        """The surroundings when a sampled voltage law holds other voltages [V]."""
        if self.thrust is None or self.thrust.sampled is None:
            return self
        return dataclasses.replace(self, thrust=self.thrust.holding(volts, elements))


class OwnDeformation(Own):
    """What a user's energy and a user's dissipation share. elements: number of elements of a tether."""

    elements: int = eqx.field(static=True)

    @property
    def depends_on(self) -> tuple[str, ...]:
        return self.term.depends_on

    def deformation(self, invariants: Invariants) -> PerPoint:
        """The measure of deformation. It sees the curvature only if it depends on it."""
        if "r_xx" not in self.depends_on:
            invariants = invariants._replace(normal_squared=None)
        given = jax.tree.map(lambda x: divided(x, self.elements), invariants)
        measure = self.call("deformation", given)
        return joined(self.like("deformation", measure, given.stretch_squared.shape, "numbers"))


class OwnEnergy(OwnDeformation, Energy):
    """A user's energy."""

    def energy_density(self, e: PerPoint) -> PerPoint:
        given = divided(e, self.elements)
        energies = self.call("energy_density", given)
        return joined(self.like("energy_density", energies, given.shape, "energies [J/m]"))


class OwnDissipation(OwnDeformation, Dissipation):
    """A user's dissipation."""

    def rayleigh_density(self, e: PerPoint, rate: PerPoint) -> PerPoint:
        given = divided(e, self.elements)
        powers = self.call("rayleigh_density", given, divided(rate, self.elements))
        return joined(self.like("rayleigh_density", powers, given.shape, "powers [W/m]"))


def divided(x: Float[Array, "*batch element"], elements: int) -> Float[Array, "*batch elem tether"]:
    """Splits the axis of all elements into (element, tether)."""
    return x.reshape(*x.shape[:-1], elements, -1)


def joined(x: Float[Array, "*batch elem tether"]) -> Float[Array, "*batch element"]:
    """The inverse of `divided`."""
    return x.reshape(*x.shape[:-2], -1)


class AlongTethers(Own):
    """What continuous and commanded loads share.

    elements: number of elements of a tether; distance: x [m] of the points (point, element); around: what
    the load may know."""

    elements: int = eqx.field(static=True)
    distance: Float[Array, "point element"]
    around: Surroundings

    @property
    def depends_on(self) -> tuple[str, ...]:
        return self.term.depends_on

    def forces(self, term: Any, time: Instants, fields: PointFields, rates: PointFields) -> VectorPerPoint:
        """f [N/m] of the term, which may have its command."""
        shift = self.around.shift(time)
        if shift is not None:
            moved = (expanded(x, fields.r.ndim) for x in shift)
            fields, rates = (c._replace(r=c.r + x) for c, x in zip((fields, rates), moved, strict=True))
        batch = (1,) * (fields.r.ndim - 3)
        points, elements = self.distance.shape
        x = divided(self.distance.reshape(points, *batch, elements), self.elements)
        given = [self.given(c, x) for c in (fields, rates)]
        forces = called(
            term,
            "force",
            time[..., None] if jnp.ndim(time) else time,
            *given,
            subject=subject_of(term, self.place),
            own=True,
        )
        return joined(self.like("force", forces, given[0].r_x.shape, "forces [N/m]"))

    def given(self, fields: PointFields, x: Float[Array, "*point"]) -> LoadFields:
        """The fields as a load sees them."""
        r, r_x = (divided(c, self.elements) for c in (fields.r, fields.r_x))
        needed = fields.r_xx is not None and "r_xx" in self.depends_on
        return LoadFields(r, r_x, divided(fields.r_xx, self.elements) if needed else None, x)


def expanded(x: Float[Array, "3 ..."], ndim: int) -> Array:
    """A vector at one instant, or several, with axes for the points."""
    if x.ndim == 1:
        return x.reshape(3, *(1,) * (ndim - 1))
    return x[:, None]


class OwnLoad(AlongTethers, Load):
    """A user's load without a command."""

    def knots(self, measurements: Maybe[Measurements]) -> tuple[Array, ...]:
        return self.instants

    def force(self, time: Instants, fields: PointFields, rates: PointFields) -> VectorPerPoint:
        return self.forces(self.term, time, fields, rates)


class OwnCommandedLoad(AlongTethers, ControlledLoad):
    """A user's load with a number per tether that depends on the state. value: that number."""

    value: Maybe[PerElement] = None

    @property
    def constant(self) -> bool:
        return False

    @property
    def measures_motion(self) -> bool:
        return True

    @property
    def law_name(self) -> str:
        return f"command of {self.name}"

    @property
    def command(self) -> PerElement | None:
        return self.value

    def knots(self, measurements: Maybe[Measurements]) -> tuple[Array, ...]:
        return self.instants

    def commanded(self, measurements: Measurements) -> PerTether:
        count = measurements.chords.shape[1]
        given = self.around.measured(measurements)
        numbers = self.call("commanded", given)
        if numbers is None and given.current is None:
            got = f"{line_of(self.term, 'commanded')} returns None, as `current` is None without"
            name = f"{subject_of(self.term, self.place)}.commanded"
            raise SceneError(name, "return numbers", f"{got} `tethers.wire_radius`")
        if isinstance(numbers, float | int) or getattr(numbers, "shape", None) == ():
            numbers = jnp.full(count, numbers)
        return self.like("commanded", numbers, (count,), "a number for every tether,")

    def with_command(self, command: Float[Array, "*state element"]) -> "OwnCommandedLoad":
        return dataclasses.replace(self, value=command)

    def holding(self, volts: PerTether, elements: int) -> "OwnCommandedLoad":
        return dataclasses.replace(self, around=self.around.holding(volts, elements))

    def force(self, time: Instants, fields: PointFields, rates: PointFields) -> VectorPerPoint:
        term = self.term
        # The term is made here and is not a tree any more: its command is no field of it.
        object.__setattr__(term, "command", divided(self.value, self.elements))
        return self.forces(term, time, fields, rates)


class OwnTipLoad(Own, TipLoad):
    """A user's force on the remote units."""

    around: Surroundings

    @property
    def knots(self) -> tuple[Array, ...]:
        return self.instants

    @property
    def measures_motion(self) -> bool:
        return True

    def holding(self, volts: PerTether, elements: int) -> "OwnTipLoad":
        return dataclasses.replace(self, around=self.around.holding(volts, elements))

    def force(self, measurements: Measurements) -> Float[Array, "3 tether"]:
        forces = self.call("force", self.around.measured(measurements))
        return self.like("force", forces, measurements.chords.shape, "forces [N]")


class OwnHubLoad(Own, HubLoad):
    """A user's force and torque on the hub."""

    around: Surroundings

    @property
    def knots(self) -> tuple[Array, ...]:
        return self.instants

    def wrench(self, hub: HubMotion) -> tuple[Vector, Vector]:
        sun, shift = self.around.sun(hub.heliocentric_position), self.around.shift(hub.time)
        if shift is not None:
            hub = hub._replace(position=hub.position + shift[0], velocity=hub.velocity + shift[1])
        returned = self.call("wrench", hub._replace(sun=sun))
        if not isinstance(returned, tuple | list) or len(returned) != 2:
            got = f"{len(returned)} things" if isinstance(returned, tuple | list) else described(returned)
            name, must = (
                f"{subject_of(self.term, self.place)}.wrench",
                "return two things, the force and the",
            )
            raise SceneError(name, f"{must} torque", f"{line_of(self.term, 'wrench')} returns {got}")
        force, torque = returned
        return self.like("wrench", force, (3,), "a force [N]"), self.like(
            "wrench", torque, (3,), "a torque [N m]"
        )


class OwnField(Own, Field):
    """A user's acceleration field."""

    around: Surroundings

    @property
    def knots(self) -> tuple[Array, ...]:
        return self.instants

    def acceleration(
        self, time: Scalar, position: VectorPerPoint, velocity: VectorPerPoint
    ) -> VectorPerPoint:
        shift = self.around.shift(time)
        if shift is not None:
            moved = (x.reshape(3, *(1,) * (position.ndim - 1)) for x in shift)
            position, velocity = (c + x for c, x in zip((position, velocity), moved, strict=True))
        accelerations = self.call("acceleration", time, position, velocity)
        return self.like("acceleration", accelerations, position.shape, "accelerations [m/s^2]")


class OwnWinchLaw(Own, WinchLaw):
    """A user's law of what the motors of winches hold."""

    around: Surroundings

    @property
    def knots(self) -> tuple[Array, ...]:
        return self.instants

    def holding(self, volts: PerTether, elements: int) -> "OwnWinchLaw":
        return dataclasses.replace(self, around=self.around.holding(volts, elements))

    def tension(self, measurements: Measurements) -> PerTether:
        numbers = self.call("tension", self.around.measured(measurements))
        return self.per_tether("tension", numbers, measurements.chords.shape[1])

    def per_tether(self, method: str, numbers: Any, count: int) -> PerTether:
        """Tensions [N] that a method returned, one per tether."""
        if isinstance(numbers, float | int) or getattr(numbers, "shape", None) == ():
            numbers = jnp.full(count, numbers)
        return self.like(method, numbers, (count,), "numbers of newtons, one per tether,")


class SampledWinchLaw(OwnWinchLaw):
    """A user's law of winches with a control period, by sample and hold. It has `tension(measurements)`, or
    `init(measurements)` and `update(measurements, memory)`. held: the tensions of the last sample [N]."""

    held: PerTether

    def tension(self, measurements: Measurements) -> PerTether:
        return self.held

    def first_memory(self, measurements: Measurements) -> Any:
        """The memory before the first sample; None for a law without a memory."""
        if not self.has_memory:
            return None
        memory = self.call("init", self.around.measured(measurements))
        return arrays(memory, subject_of(self.term, self.place))

    def sample(self, measurements: Measurements, memory: Any) -> tuple[PerTether, Any]:
        """The tensions [N], and the next memory."""
        if not self.has_memory:
            return super().tension(measurements), None
        subject = subject_of(self.term, self.place)
        returned = self.call("update", self.around.measured(measurements), memory)
        tensions, after = two_things(returned, subject, "tensions")
        after = arrays(after, subject)
        check_same(memory, after, subject)
        return self.per_tether("update", tensions, measurements.chords.shape[1]), after

    @property
    def has_memory(self) -> bool:
        """Tells whether the law has a memory."""
        return hasattr(self.term, "update")


Divided = tuple[LawStructure, tuple[Array, ...]]


def own_terms(terms: tuple[Divided, ...], tethers: TetherBatch, around: Surroundings) -> Terms:
    """The wrappers of terms that are divided into structure and numbers."""
    elements, wrappers = tethers.elements, Terms()
    for place, (structure, numbers) in enumerate(terms):
        term, own = structure.law(numbers), (structure, numbers, place)
        if isinstance(term, Energy):
            wrappers += Terms(energies=(OwnEnergy(*own, elements),))
        elif isinstance(term, Dissipation):
            wrappers += Terms(dissipations=(OwnDissipation(*own, elements),))
        elif isinstance(term, Load):
            kind = OwnCommandedLoad if hasattr(term, "commanded") else OwnLoad
            wrappers += Terms(loads=(kind(*own, elements, distances(tethers), around),))
        elif isinstance(term, TipLoad):
            wrappers += Terms(tip_loads=(OwnTipLoad(*own, around),))
        elif isinstance(term, WinchLaw):
            law = OwnWinchLaw(*own, around)
            if hasattr(term, "period"):
                law = SampledWinchLaw(*own, around, jnp.zeros(tethers.count))
            wrappers += Terms(winch_laws=(law,))
        elif isinstance(term, HubLoad):
            wrappers += Terms(hub_loads=(OwnHubLoad(*own, around),))
        else:
            wrappers += Terms(fields=(OwnField(*own, around),))
    return wrappers


def distances(tethers: TetherBatch) -> Float[Array, "point element"]:
    """The undeformed distance [m] of every point from its root."""
    lengths = tethers.of_tethers(tethers.lengths)
    start = jnp.cumsum(lengths, axis=0) - lengths
    xi = gauss_legendre(len(tethers.weights))[0]
    return joined(start + xi[:, None, None] * lengths)


def fields_needed(terms: tuple[LawStructure, ...]) -> set[str]:
    """The fields that terms depend on. Numbers do not matter."""
    made = [x.law((jnp.zeros(()),) * x.others.count(NUMBER)) for x in terms]
    return {name for term in made if isinstance(term, Term) for name in term.depends_on}
