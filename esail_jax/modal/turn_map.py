"""The motion of a sail over a turn, or over the part of a turn that brings each tether to the place of the
next one, as a map of its state.

A state is a vector z = (y, y' / Omega) [m]: the independent coordinates (`equilibria/moving_frame.py`) and
their rates over the spin rate, with the centre of mass at rest in the origin. The map is

    F(z, T, Delta) = R(-Delta) P flow_T(z) - (centre of mass),

the flow of the equations of motion over the duration T [s], by the package's own time integration. P
renumbers equal tethers, so that each stands again where it stood; over a whole turn it is the identity.
R(-Delta) turns the sail back about the direction of the wind by the angle [rad] that its spin axis has
precessed. A motion that repeats itself, apart from its precession and the path of its centre of mass, is a
fixed point of F: a *relative periodic orbit*. Wind and equations are the same in all places and times,
and at all angles about the wind: the curvature of the radial wind over the path of a turn, some 1e-8, is
left out by the shift of the centre of mass.
"""

from typing import ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from esail_jax.array_types import Array, Float, Scalar, Vector
from esail_jax.coordinates import Coordinates
from esail_jax.equilibria.moving_frame import MovingFrame, expanded, independent
from esail_jax.iteration_matrix import inertia_of
from esail_jax.numerics.angles import rotation_by
from esail_jax.simulation.advance import Window, move
from esail_jax.simulation.look import on_constraints
from esail_jax.simulation.problem import Problem
from esail_jax.steppers.collocation import Collocation
from esail_jax.steppers.consistent import consistent_acceleration, project
from esail_jax.steppers.results import RESULTS
from esail_jax.steppers.stepper import Motion, Point
from esail_jax.system import System

MOST_STEPS = 24
"""Largest number of steps whose derivative is recorded at once: a turn is put together from parts."""

PROJECTIONS = 2
"""Number of Newton corrections that bring a state that was moved along a tangent back to the
constraints."""

UNUSED_TOLERANCE = 1e-10
"""Tolerance of a method with a given step size, which it does not use."""

State = Float[Array, " m"]


class RecordedCollocation(Collocation):
    """Collocation with room for the record of MOST_STEPS steps, in blocks of six steps or more. The
    derivatives of many directions at once take as many records, and so much memory."""

    blocks_per_window: ClassVar[int] = 4


class Turn(NamedTuple):
    """The image of a state. state: F(z); rate: its derivative by the duration, in m/s; changes: derivative
    of F along the given directions, one a row."""

    state: State
    rate: State
    changes: Float[Array, "direction m"]


class Local(NamedTuple):
    """What the equations of a fixed point need beside the map, at a state.

    conditions: derivatives of the constraints, their rates and the centre of mass, one a row; momentum:
    angular momentum about the centre of mass [kg m^2/s]; slopes: its derivative; turns: displacements of
    the state in rotations about the three inertial axes; spins: changes of its rates by angular velocities
    Omega about them."""

    conditions: Float[Array, "c m"]
    momentum: Vector
    slopes: Float[Array, "3 m"]
    turns: Float[Array, "3 m"]
    spins: Float[Array, "3 m"]


def to_state(system: System, spin: Scalar | float, q: Coordinates, v: Coordinates) -> State:
    """The state of positions and velocities. spin: the rate Omega > 0 that scales velocities."""
    return jnp.concatenate([independent(system, q), independent(system, v) / spin])


def from_state(system: System, spin: Scalar | float, z: State) -> tuple[Coordinates, Coordinates]:
    """Positions and velocities of a state."""
    n = z.size // 2
    return expanded(system, z[:n]), expanded(system, spin * z[n:], derivative=1)


def renumbered(system: System, x: Coordinates, places: int) -> Coordinates:
    """Coordinates in which every tether has the number of the one that is `places` further, and
    the hub's body axes are turned back accordingly: the same sail, described from another tether."""
    if places == 0:
        return x
    angle = -2.0 * np.pi * places / system.tethers.count
    c, s = np.cos(angle), np.sin(angle)
    turn = jnp.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    points = system.hub.weights(turn @ system.hub.base_points.T)
    ring = None if x.ring is None else jnp.roll(x.ring, places, axis=-1)
    return Coordinates(jnp.roll(x.tether, places, axis=-1), points.T @ x.hub, ring)


def flow(system: System, q: Coordinates, v: Coordinates, duration: Scalar, steps: int):
    """Positions and velocities after a duration [s], by `steps` steps of collocation; NaN if the
    integration fails."""
    zero = jnp.zeros(())
    step = lax.stop_gradient(duration) / steps
    stepper = RecordedCollocation(step, jnp.asarray(UNUSED_TOLERANCE))
    problem = Problem(system, stepper, jnp.zeros(3), zero, inertia_of(system), None)
    state, last = stepper.init(
        system, Point(zero, q, v, system.no_power, jnp.asarray(True)), jnp.asarray(jnp.inf)
    )
    window = Window(duration[None], jnp.asarray(1))
    motion, points, _ = move(problem, Motion(state, last, jnp.zeros(2)), window, jnp.asarray(jnp.inf))
    point, _ = on_constraints(problem, jax.tree.map(lambda x: x[0], points))
    good = motion.state.result == RESULTS.successful
    return jax.tree.map(lambda x: jnp.where(good, x, jnp.nan), (point.q, point.v))


def turn_map(
    steps: int,
    places: int,
    system: System,
    spin: Scalar,
    wind: Vector,
    z: State,
    duration: Scalar,
    precession: Scalar,
    directions: Float[Array, "direction m"],
) -> Turn:
    """The image of a state, with its derivatives.

    steps: number of time steps; places: by how many places the tethers are renumbered; spin: as for
    `to_state`; wind: unit vector; duration, precession: T and Delta; directions: tangents of the state, one
    a row."""
    parts = -(-steps // MOST_STEPS)

    def image(z):
        def part(state, _):
            return flow(system, *state, duration / parts, -(-steps // parts)), None

        (q, v), _ = lax.scan(part, from_state(system, spin, z), None, length=parts)
        acceleration, _ = consistent_acceleration(system, jnp.zeros(()), q, v)
        back = rotation_by(-precession * wind)
        q, v, acceleration = (
            system.centred(renumbered(system, x, places)).rotate(back) for x in (q, v, acceleration)
        )
        return to_state(system, spin, q, v), to_state(system, spin, v, acceleration)

    def along(direction):
        (state, rate), (change, _) = jax.jvp(image, (z,), (direction,))
        return state, rate, change

    state, rate, changes = jax.vmap(along)(directions)
    return Turn(state[0], rate[0], changes)


def local(system: System, spin: Scalar | float, z: State) -> Local:
    """What the equations of a fixed point need beside the map."""

    def conditions(z):
        q, v = from_state(system, spin, z)
        gaps, rates = jax.jvp(lambda q: system.constraints(jnp.zeros(()), q), (q,), (v,))
        rates = jax.tree.map(lambda x: x / spin, rates)
        rows = [jnp.ravel(x) for x in jax.tree.leaves((gaps, rates))]
        return jnp.concatenate([*rows, system.mean(q), system.mean(v) / spin])

    def momentum(z):
        return system.angular_momentum(*from_state(system, spin, z))

    def turned(axis):
        q, v = (MovingFrame(axis, jnp.zeros(3)).turned(x) for x in from_state(system, spin, z))
        whole = to_state(system, spin, q, v)
        return whole, jnp.where(jnp.arange(z.size) < z.size // 2, 0.0, jnp.roll(whole, z.size // 2))

    turns, spins = jax.vmap(turned)(jnp.eye(3))
    return Local(jax.jacfwd(conditions)(z), momentum(z), jax.jacfwd(momentum)(z), turns, spins)


def settled(system: System, spin: Scalar | float, z: State) -> State:
    """The nearest state on the constraints, with its centre of mass at rest in the origin."""
    q, v = from_state(system, spin, z)
    for _ in range(PROJECTIONS):
        q, v = project(system, jnp.zeros(()), q, v)
    return to_state(system, spin, system.centred(q), system.centred(v))
