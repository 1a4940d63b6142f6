"""The problem of a run (model and stepper) and its start, built from the structure and numbers of a
scene."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from esail_jax import observables
from esail_jax.array_types import Array, Bool, Maybe, Scalar, Vector
from esail_jax.compilation.jit import traced_once
from esail_jax.elements.hinges import Hinges
from esail_jax.environment.kepler_orbit import KeplerOrbit, at_place
from esail_jax.iteration_matrix import Inertia, inertia_of
from esail_jax.numerics.lockstep import select
from esail_jax.rod_chain import RodChain, energy_floor
from esail_jax.scenes.build import build, build_chain
from esail_jax.scenes.build_parts import origin_of
from esail_jax.scenes.method_choice import stepper_of
from esail_jax.scenes.rules import SceneError
from esail_jax.scenes.scene import Scene
from esail_jax.scenes.structure import Numbers, Structure
from esail_jax.simulation.law_jumps import watched
from esail_jax.simulation.rectification import AnyPoint, PointOnOrbit, rectified
from esail_jax.simulation.sampling import Control, is_sampled, sample
from esail_jax.steppers.consistent import project
from esail_jax.steppers.stepper import AbstractStepper, Motion, Point
from esail_jax.system import System

UNBALANCED = 1e-6
"""Fraction of the tip's centrifugal force by which a steady elongation may miss its equilibrium."""


class Problem(NamedTuple):
    """A built scene and the stepper that integrates it.

    origin: heliocentric position of the origin of the coordinates at t = 0 [m]; start_energy: kinetic and
    elastic energy at the start [J]; inertia: the factored mass matrix of a sail (None for a chain);
    energy_floor: the energy [J] below which the balance of a chain is not judged (None where the method
    needs no guard); scene_orbit: the orbit about the Sun on which the origin of I moves (None without
    one); carried: what changes at switch times and is not in the model yet (None if there is nothing)."""

    model: System | RodChain
    stepper: AbstractStepper
    origin: Vector
    start_energy: Scalar
    inertia: Inertia | None
    energy_floor: Scalar | None
    scene_orbit: KeplerOrbit | None = None
    carried: "Carried | None" = None

    @property
    def system(self) -> System:
        """The sum of terms."""
        return self.model.system if isinstance(self.model, RodChain) else self.model

    @property
    def hinges(self) -> Hinges | None:
        """The springs between the rods of a chain, if it has any."""
        return self.model.hinges if isinstance(self.model, RodChain) else None

    @property
    def terms(self) -> tuple[str, ...]:
        """Names of everything that was built."""
        return self.model.terms

    def in_segment(self, start: Scalar | np.ndarray, until: Scalar | np.ndarray) -> "Problem":
        """The problem between two switch times [s], after all events until the first of them."""
        if isinstance(self.model, RodChain):
            return self._replace(model=self.model.in_segment(start, until))
        return self._replace(model=self.model.with_events_until(start).in_segment(start, until))

    def under(self, carried: "Carried") -> "Problem":
        """The problem with what its model does not have yet (`settled`)."""
        return self._replace(carried=carried.without_memory)

    def settled(self) -> "Problem":
        """The problem whose model has what sampled laws hold, and the orbit on which
        the origin of its coordinates moves."""
        if self.carried is None:
            return self
        control, orbit = self.carried
        model = self.model if control is None else control.held_by(self.system)
        return self._replace(model=at_place(model, orbit), carried=None)


class Carried(NamedTuple):
    """What a run carries along beside its motion. It changes at switch times only.

    control: of sampled laws; orbit: the Kepler orbit on which the origin of the coordinates moves
    (`rectification`). Each is None without such a part."""

    control: Control | None = None
    orbit: KeplerOrbit | None = None

    @property
    def without_memory(self) -> "Carried":
        """The same without the memories of laws, which forces do not need."""
        return self if self.control is None else self._replace(control=self.control.without_memory)


class Start(NamedTuple):
    """The start of a run. unbalanced: unbalanced force of the steady elongation [N], per tether; q:
    positions of a sail at the start. `check_steady` judges both. carried: with the first sample of
    sampled laws. The problem does not contain it (`Problem.under`)."""

    problem: Problem
    motion: Motion
    unbalanced: Array
    q: Any
    carried: Carried


@traced_once(static_argnums=(0,))
def start(
    structure: Structure,
    numbers: Numbers,
    stepper: AbstractStepper | None = None,
    point: AnyPoint | None = None,
) -> Start:
    """The problem and the motion at its start.

    stepper: a method in place of the scene's; point: an instant to start from in place of the scene's
    start."""
    origin = origin_of(numbers)
    zero = jnp.zeros(())
    scene_orbit: KeplerOrbit | None = None
    orbit: KeplerOrbit | None = None
    model: RodChain | System
    first: Any  # as `stepper.init` takes it
    if structure.has("chain"):
        chain, rods = build_chain(structure, numbers)
        if stepper is None:
            stepper = stepper_of(structure, numbers, chain, rods)
        unbalanced, inertia = jnp.zeros(1), None
        floor = energy_floor(chain) if stepper.energy_guard else None
        model = chain if stepper.relative_coordinates else chain.system
        q, v = chain.coordinates(rods)
        first = (
            rods
            if stepper.relative_coordinates
            else Point(zero, q, v, chain.system.no_power, jnp.asarray(True))
        )
        if point is not None:
            q, v, first = point.q, point.v, point
        at_start = chain.system.at(zero if point is None else point.time)
        energy = observables.chain.internal_energy(at_start, chain.hinges, q, v)
    else:
        built = build(structure, numbers)
        model, q, v, unbalanced = built.system, built.q, built.v, built.unbalanced
        if stepper is None:
            stepper = stepper_of(structure, numbers, model, None)
        first = Point(zero, q, v, model.no_power, jnp.asarray(True))
        if isinstance(model.kepler_orbit, KeplerOrbit):
            scene_orbit = orbit = model.kepler_orbit
        if point is not None:
            if orbit is not None:
                parts = point.parts() if isinstance(point, PointOnOrbit) else (point, orbit)
                point, orbit = rectified(model, *parts)
            model = model.with_events_until(point.time)
            q, v = project(model, point.time, point.q, point.v)
            first = point._replace(q=q, v=v)
        now = model.at(first.time, q, v)
        energy = observables.kinetic_energy(now, v, q) + observables.elastic_energy(model, first.time, q)
        thermal = observables.thermal_energy(model, first.time, q)
        if thermal is not None and point is None:
            first = first._replace(work=model.no_power._replace(external=-thermal))
        elif thermal is not None:
            energy = energy - thermal
        inertia, floor = inertia_of(model), None
    if point is not None:
        energy = energy - point.work.external + point.work.dissipated
        if point.work.winch is not None:
            energy = energy - point.work.winch
    problem = Problem(model, stepper, origin, energy, inertia, floor, scene_orbit)
    carried = Carried(None, orbit)
    if not structure.has("chain") and isinstance(model, System) and is_sampled(model):
        carried = carried._replace(control=sample(at_place(model, orbit), first, None))
    state, last = stepper.init(problem.under(carried).settled().model, first, jnp.asarray(jnp.inf))
    jump = zero if watched(model) else None
    return Start(problem, Motion(state, last, jnp.zeros(2), jump), unbalanced, q, carried)


def restart(
    problem: Problem,
    motion: Motion,
    point: Point,
    until: Scalar,
    carried: Carried,
    due: Maybe[Bool[Array, ""]],
) -> tuple[Motion, Carried]:
    """The motion that starts from a point on the constraints at a switch time, and what the run
    carries along from there on.

    problem: the problem after the event; until: the next switch time [s]; carried: before the switch time;
    due: whether that is a sampling instant, None without sampled laws."""
    control, orbit = carried
    if orbit is not None:
        point, orbit = rectified(problem.system, point, orbit)
    if control is not None:
        control = select(due, sample(at_place(problem.system, orbit), point, control), control)
    carried = Carried(control, orbit)
    state, last = problem.stepper.init(problem.under(carried).settled().model, point, until)
    return Motion(state, last, motion.counts, motion.jump), carried


def require_64_bit() -> None:
    """Raises RuntimeError if JAX computes in 32 bit."""
    if not jax.config.jax_enable_x64:  # type: ignore[attr-defined]  # JAX's types lack its options
        raise RuntimeError(
            "esail_jax needs 64-bit numbers (positions of 1e4 m and elongations of 1e-6 m meet in "
            "one vector), but JAX is set to 32 bit: remove `jax_enable_x64 = False`."
        )


def check_steady(scene: Scene, first: Start) -> None:
    """Raises SceneError if the elements have no steady elongation at the initial spin rate."""
    tethers = first.problem.system.tethers
    q, spin = first.q.tether, float(np.abs(scene.initial.spin_rate))
    lengths = np.asarray(tethers.element_length) * tethers.elements
    mass = np.asarray(tethers.line_density) * lengths + np.asarray(tethers.tip_mass)
    allowed = UNBALANCED * mass * lengths * spin**2 + 1e-9
    unbalanced = np.asarray(first.unbalanced)
    positions = np.asarray(q)
    radial = np.linalg.norm(positions[0, :, -1] - positions[0, :, 0], axis=0)
    bad = ~(unbalanced <= allowed) | ~np.isfinite(radial)
    if bad.any() and first.problem.system.ring is not None:
        raise SceneError(
            "auxiliary_tethers.length",
            "leave the sail a steady start",
            f"none was found at a spin rate of {spin} rad/s",
        )
    if bad.any():
        raise SceneError(
            "initial.spin_rate",
            f"leave tether {int(np.argmax(bad)) + 1} a steady elongation",
            f"is {spin}: its elements cannot hold the centrifugal force",
        )
