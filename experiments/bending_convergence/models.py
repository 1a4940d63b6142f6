"""The variants compared, and a small driver that compiles one of them and runs it with several numbers."""

import dataclasses
import time
from typing import ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

import esail_jax as esail
from esail_jax import observables
from esail_jax.array_types import Instants, PerPoint, PerTether
from esail_jax.compiler import COMPILER_OPTIONS
from esail_jax.constants import ASTRONOMICAL_UNIT
from esail_jax.elements.axial import AxialEnergy
from esail_jax.elements.bending import BendingEnergy
from esail_jax.loads.coulomb import CoulombThrust
from esail_jax.numerics.vectors import dot
from esail_jax.scenes.build import build
from esail_jax.scenes.method_choice import with_method
from esail_jax.scenes.structure import split
from esail_jax.simulation.entry import fresh_state, with_jerk
from esail_jax.steppers.consistent import consistent_acceleration
from esail_jax.steppers.fixed_step import KEEP, StepInfo
from esail_jax.steppers.generalized_alpha import GeneralizedAlpha
from esail_jax.system import Power
from esail_jax.terms import PointFields, Term, find_term

STEP = 0.1
"""[s], for every mesh."""

SAVED = 1178
"""Instants kept after the first, every 2 KEEP steps of `STEP`: 4 s, 4712 s in all, three spin periods."""

TIMES = np.arange(SAVED + 1) * 2 * KEEP * STEP
"""Instants kept [s]."""

VARIANTS = ("nonlinear", "linear", "none", "truss")
"""Cable with EI kappa^2/2, with EI |r_xx|^2/2, without bending, and trusses."""

KEPT = (
    "coning_angle", "lagging_angle", "root_coning_angle", "root_lagging_angle", "tether_length",
    "max_axial_strain", "thrust_O", "reaction_B", "angular_velocity_B",
)  # fmt: skip


class LinearBending(Term):
    """W = EI |r_xx|^2 / 2: the curvature of a cable of small strain, stretch gradients included."""

    stiffness: PerTether

    name: ClassVar[str] = "linear bending"
    depends_on: ClassVar[tuple[str, ...]] = ("r_xx",)

    def density(self, fields: PointFields) -> PerPoint:
        """W [J/m]."""
        return 0.5 * self.stiffness * dot(fields.r_xx, fields.r_xx)

    def point_forces(self, time: Instants, fields: PointFields, rates: PointFields) -> PointFields:
        stress = jax.grad(lambda r_xx: self.density(fields._replace(r_xx=r_xx)).sum())(fields.r_xx)
        return PointFields(None, None, stress)


class Lane(NamedTuple):
    """Numbers that differ between runs of one program: EI over the scene's, and damping times [s]."""

    stiffness: float = 1.0
    axial: float = 1.0
    bending: float = 0.0


def scene_of(variant: str, elements: int, scene: str = "single-tether") -> esail.Scene:
    """The scene of a variant."""
    loaded = esail.load_scene(scene)
    tethers = {"elements": elements}
    if variant == "truss":
        tethers |= {"element": "truss"}
    if variant in ("none", "truss"):
        tethers |= {"bending": False, "second_moment": None}
    if variant != "nonlinear":
        tethers |= {"bending_damping_time": None}
    return dataclasses.replace(loaded, tethers=dataclasses.replace(loaded.tethers, **tethers))


def system_of(variant: str, structure, numbers: dict, lane: Lane):
    """System, its start, and the place of the sail."""
    numbers = dict(numbers)
    numbers["tethers.axial_damping_time"] = jnp.full_like(numbers["tethers.length"], lane.axial)
    if variant in ("nonlinear", "linear"):
        numbers["tethers.second_moment"] = numbers["tethers.second_moment"] * lane.stiffness
    if variant == "nonlinear":
        numbers["tethers.bending_damping_time"] = jnp.full_like(numbers["tethers.length"], lane.bending)
    model = build(structure, numbers)
    system = model.system
    if variant == "linear":
        axial, bending = (find_term(system.energies, kind) for kind in (AxialEnergy, BendingEnergy))
        system = dataclasses.replace(system, energies=(axial, LinearBending(bending.stiffness)))
    return system, model, numbers["initial.heliocentric_position_au"] * ASTRONOMICAL_UNIT


def march(stepper: GeneralizedAlpha, system, model, refine: int, saved: int):
    """Saved instants and states, start included; iterations and failed steps.

    The blocks before t = 0 are trials that find a_0, as `schedule.beginning` and `entry.with_jerk` do it.
    """
    zero = jnp.zeros(())
    nothing = Power(zero, zero)
    at_rest = consistent_acceleration(system, zero, model.q, model.v)
    state = fresh_state(model.q, model.v, *at_rest, nothing, nothing)
    blocks = 2 * refine

    def block(state, index):
        trial = index < 0
        time = jnp.maximum(index, 0) * KEEP * stepper.step_size
        after, (states, info) = stepper.block(system, time, state, KEEP)
        tried = with_jerk(stepper, state, jax.tree.map(lambda v: v[0], states.v))
        failed = ~jax.vmap(StepInfo.converged)(info)
        state = jax.tree.map(lambda x, y: jnp.where(trial, x, y), tried, after)
        return state, jnp.where(trial, 0, jnp.stack([info.iterations.sum(), failed.sum()]))

    def interval(state, index):
        state, counts = lax.scan(block, state, index * blocks + jnp.arange(blocks))
        return state, (state, counts.sum(0))

    # The interval before t = 0 hands back the state at t = 0.
    _, (states, counts) = lax.scan(interval, state, jnp.arange(-1, saved))
    time = jnp.arange(saved + 1) * blocks * KEEP * stepper.step_size
    return time, states, counts.sum(0)


def history(variant: str, structure, numbers: dict, lane: Lane, refine: int, saved: int):
    """Tether 1 in the hub's frame from its root, observables, iterations per step, steps that failed."""
    system, model, origin = system_of(variant, structure, numbers, lane)
    stepper = GeneralizedAlpha(jnp.asarray(STEP / refine), model.spectral_radius)
    times, states, (iterations, failed) = march(stepper, system, model, refine, saved)
    listed = {entry.name: entry.function for entry in observables.listed(system)}
    zero = jnp.zeros(())

    def look(at):
        time, state = at
        q, v, vdot, lam = state.q, state.v, state.vdot, state.lam
        residual, power = system.residual(time, q, v, vdot, lam)
        fields, rates = system.tethers.interpolate(q.tether), system.tethers.interpolate(v.tether)
        load = find_term(system.loads, CoulombThrust).force(time, fields, rates)
        instant = observables.Instant(
            system, time, q, v, vdot, lam, state.work, zero, origin, residual.forces, power, load
        )
        nodal = q.tether[..., 0].at[0].add(-q.tether[0, :, :1, 0])
        shape = jnp.einsum("ib,kin->kbn", system.rotation(time, q), nodal)
        return {"shape_B": shape} | {name: listed[name](instant) for name in KEPT if name in listed}

    return lax.map(look, (times, states)), iterations / (2 * KEEP * refine * saved), failed


class Run(NamedTuple):
    """One run: what was asked, what was seen (time first), and what it cost."""

    variant: str
    elements: int
    lane: Lane
    refine: int
    seen: dict[str, np.ndarray]
    iterations: float
    microseconds: float


def run(
    variant: str, elements: int, lanes: tuple[Lane, ...], refine: int = 1, scene: str = "single-tether"
) -> list[Run]:
    """Compile a variant once and run it with every lane's numbers; step `STEP` / refine."""
    structure, numbers = split(with_method(scene_of(variant, elements, scene)))

    def one_lane(lane):
        return history(variant, structure, numbers, lane, refine, SAVED)

    abstract = Lane(*[jax.ShapeDtypeStruct((), float)] * 3)
    program = jax.jit(one_lane, compiler_options=COMPILER_OPTIONS).lower(abstract).compile()
    found = []
    for lane in lanes:
        values = Lane(*map(jnp.asarray, map(float, lane)))
        begin = time.perf_counter()
        seen, iterations, failed = jax.block_until_ready(program(values))
        cost = (time.perf_counter() - begin) / (2 * KEEP * refine * SAVED) * 1e6
        if int(failed):
            print(f"{variant} {elements} {lane}: {int(failed)} steps did not converge", flush=True)
        seen = {name: np.asarray(value) for name, value in seen.items()}
        found.append(Run(variant, elements, lane, refine, seen, float(iterations), cost))
    return found
