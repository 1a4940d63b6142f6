"""Defines the compared variants, and compiles and runs one of them with several sets of parameters."""

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
from esail_jax.compilation.options import COMPILER_OPTIONS
from esail_jax.constants import ASTRONOMICAL_UNIT
from esail_jax.elements.axial import AxialEnergy
from esail_jax.elements.bending import BendingEnergy
from esail_jax.loads.coulomb import CoulombThrust
from esail_jax.numerics.vectors import dot
from esail_jax.point_fields import PointFields
from esail_jax.scenes.build import build
from esail_jax.scenes.method_choice import with_method
from esail_jax.scenes.structure import split
from esail_jax.steppers.fixed_step import STEPS_PER_FACTORISATION as BLOCK
from esail_jax.steppers.generalized_alpha import GeneralizedAlpha
from esail_jax.steppers.stepper import Point
from esail_jax.system import Power
from esail_jax.terms import Term, find_term

STEP = 0.1
"""Step [s] of every mesh."""

SPECTRAL_RADIUS = 0.25
"""Default of the package for generalized-alpha."""

SAVED = 1178
"""Number of saved instants after the first, one per 2 BLOCK steps of `STEP`: every 4 s, 4712 s in all,
which are three spin periods."""

TIMES = np.arange(SAVED + 1) * 2 * BLOCK * STEP
"""Saved instants [s]."""

VARIANTS = ("nonlinear", "linear", "none", "truss")
"""Names of the variants: cable with EI kappa^2/2, with EI |r_xx|^2/2, without bending; truss."""

KEPT = (
    "coning_angle", "lagging_angle", "root_coning_angle", "root_lagging_angle", "tether_length",
    "max_axial_strain", "thrust_O", "reaction_B", "angular_velocity_B",
)  # fmt: skip


class LinearBending(Term):
    """Linear bending energy W = EI |r_xx|^2 / 2, for small strain; it also contains stretch gradients."""

    stiffness: PerTether

    name: ClassVar[str] = "linear bending"
    depends_on: ClassVar[tuple[str, ...]] = ("r_xx",)

    def density(self, fields: PointFields) -> PerPoint:
        """W [J/m]."""
        return 0.5 * self.stiffness * dot(fields.r_xx, fields.r_xx)

    def point_forces(self, time: Instants, fields: PointFields, rates: PointFields) -> PointFields:
        """The stress dW/dr_xx of every point."""
        stress = jax.grad(lambda r_xx: self.density(fields._replace(r_xx=r_xx)).sum())(fields.r_xx)
        return PointFields(None, None, stress)


class Lane(NamedTuple):
    """Parameters that differ between runs of one program: EI / EI of the scene, and damping times [s]."""

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
    """The system, its model with the initial state, and the sail's position from the Sun [m]."""
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


def integrate(stepper: GeneralizedAlpha, system, model, refine: int, saved: int):
    """Integrates; returns saved times and states including the start, iterations, and rejected steps.

    A saved instant is the end of 2 * refine blocks of steps. A rejected step would end its block early, so
    the last number must be zero."""
    zero = jnp.zeros(())
    start = Point(zero, model.q, model.v, Power(zero, zero), jnp.asarray(True))
    state, _ = stepper.init(system, start, jnp.asarray(jnp.inf))

    def block(state, _):
        state, steps = stepper.block(system, state)
        log = steps.log
        return state, (log.statistics["iterations_per_step"] @ log.taken, state.rejected)

    def interval(state, _):
        state, (iterations, rejected) = lax.scan(block, state, None, length=2 * refine)
        return state, ((state.time, state.now), iterations.sum(), rejected[-1])

    _, (states, iterations, rejected) = lax.scan(interval, state, None, length=saved)
    states = jax.tree.map(lambda x, y: jnp.concatenate([x[None], y]), (state.time, state.now), states)
    return *states, iterations.sum(), rejected[-1]


def history(variant: str, structure, numbers: dict, lane: Lane, refine: int, saved: int):
    """Observables with the shape of tether 1 in the hub's frame, iterations per step, failed
    steps."""
    system, model, origin = system_of(variant, structure, numbers, lane)
    stepper = GeneralizedAlpha(jnp.asarray(STEP / refine), jnp.asarray(SPECTRAL_RADIUS))
    times, states, iterations, failed = integrate(stepper, system, model, refine, saved)
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

    return lax.map(look, (times, states)), iterations / (2 * BLOCK * refine * saved), failed


class Run(NamedTuple):
    """One run: its settings, its signals (time first), and its time per step [us]."""

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
    """Compiles a variant once and runs it with the parameters of every lane; the step is `STEP` /
    refine."""
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
        cost = (time.perf_counter() - begin) / (2 * BLOCK * refine * SAVED) * 1e6
        if int(failed):
            print(f"{variant} {elements} {lane}: {int(failed)} steps did not converge", flush=True)
        seen = {name: np.asarray(value) for name, value in seen.items()}
        found.append(Run(variant, elements, lane, refine, seen, float(iterations), cost))
    return found
