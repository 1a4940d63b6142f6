"""Systems of one tether, and one function that integrates them with any stepper.

An exact case builds its system with `one_tether`, chooses the initial state, and calls `integrate` with
each of STEPPERS. A new stepper needs one line in STEPPERS to run all exact cases.
"""

import functools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from esail_jax.array_types import Vector
from esail_jax.coordinates import Coordinates
from esail_jax.elements.axial import AxialDissipation, AxialEnergy
from esail_jax.elements.bending import BendingEnergy
from esail_jax.elements.tether import TetherBatch
from esail_jax.equilibria.steady_stretch import along, unstretched_line
from esail_jax.iteration_matrix import factor_mass
from esail_jax.joints.roots import FrameRoots, HubRoots, clamp_normals
from esail_jax.loads.fields import UniformGravity
from esail_jax.numerics.lockstep import select
from esail_jax.steppers.collocation import Collocation
from esail_jax.steppers.consistent import consistent_motion, project
from esail_jax.steppers.energy_momentum import EnergyMomentum
from esail_jax.steppers.generalized_alpha import GeneralizedAlpha
from esail_jax.steppers.results import RESULTS
from esail_jax.steppers.stepper import Point
from esail_jax.system import Power, System
from support.quick import jit

AZIMUTH = jnp.zeros(1)
"""Azimuth [rad] of the tether, which points along Y_B; the spin axis is X_B."""


def one_tether(
    *,
    kind="cable",
    elements=4,
    length=1.0,
    axial=1.0,
    bending=None,
    line_density=0.0,
    tip_mass=0.0,
    strain="green-lagrange",
    damping_time=None,
    radius=0.0,
    spin=0.0,
    clamped=False,
    gravity=None,
    loads=(),
    hub=None,
):
    """The system of a tether at `radius` from the axis of a frame that turns at `spin`, or on a
    hub.

    SI units; axial is EA [N], bending EI [N m^2].
    """
    one = lambda x: jnp.full(1, float(x))  # noqa: E731
    energies = [AxialEnergy(one(axial), strain)]
    if bending is not None:
        energies.append(BendingEnergy(one(bending)))
    damping = [] if damping_time is None else [AxialDissipation(one(axial), one(damping_time), strain)]
    fields = ("r",) * bool(loads) + ("r_x",) + ("r_xx",) * (bending is not None)
    tethers = TetherBatch(one(length / elements), one(line_density), one(tip_mass), elements, kind, fields)
    anchor = jnp.array([[0.0], [radius], [0.0]])
    normals = clamp_normals(AZIMUTH) if clamped else None
    if hub is None:
        roots = FrameRoots(jnp.eye(3), jnp.asarray(float(spin)), anchor, normals)
    else:
        roots = HubRoots(hub.weights(anchor), None)
    fields = () if gravity is None else (UniformGravity(jnp.asarray(gravity, float)),)
    return System(tethers, roots, hub, tuple(energies), tuple(damping), tuple(loads), fields)


def straight(system, direction=(0.0, 1.0, 0.0), line=None):
    """The coordinates of a straight tether, undeformed unless `line` gives its distances and
    slopes.

    The tether starts at its root; the hub has its reference position.
    """
    line = unstretched_line(system.tethers) if line is None else line
    tether = along(jnp.asarray(line), jnp.asarray(direction)[:, None])
    hub = None if system.hub is None else system.hub.base_points
    root = system.roots.positions(hub) if hub is not None else system.roots.anchors
    return Coordinates(tether.at[0].add(root[:, None]), hub)


class Pulled(System):
    """A system with a constant force [N] at the tip. The force is constant and so has no tangent."""

    pull: Vector = eqx.field(kw_only=True)

    @classmethod
    def of(cls, system: System, pull: Vector):
        """`system` with the force `pull`."""
        return cls(*(getattr(system, name) for name in System.__dataclass_fields__), pull=pull)

    def tether_forces(self, *state):
        forces, power = super().tether_forces(*state)
        pull = self.pull.reshape(3, *(1,) * (forces.ndim - 4))  # forces of one state or of several
        return forces.at[0, ..., -1, 0].add(-pull), power


def turning(q, omega):
    """omega x q, the velocities of a rigid rotation about an axis through the origin."""
    omega = jnp.asarray(omega, float)
    hub = None if q.hub is None else jnp.cross(omega, q.hub)
    return Coordinates(jnp.cross(omega, q.tether, axisb=1, axisc=1), hub)


STEPPERS = {
    "generalized-alpha": GeneralizedAlpha,
    "collocation": lambda step, _: Collocation(step, jnp.asarray(1e-11)),
    "energy-momentum": lambda step, _: EnergyMomentum(step),
}
"""Makers of the steppers, (step [s], spectral radius) -> stepper, by name."""


# Every case compiles a program of its own and runs it once or twice.
@functools.partial(jit, static_argnums=(0, 6))
def _integrate(name, system, q, v, step, steps, rows, spectral_radius):
    """The points at the start and after every step, and whether every step converged.

    rows: number of steps in the result, at least `steps`; the later ones repeat the start."""
    stepper, zero = STEPPERS[name](step, spectral_radius), jnp.zeros(())
    start = Point(zero, q, v, Power(zero, zero), jnp.asarray(True))
    state, _ = stepper.init(system, start, jnp.asarray(jnp.inf))

    def good(state):
        return (state.result == RESULTS.successful) & (state.rejected == 0.0)

    def block(carry):
        state, points = carry
        later, found = stepper.block(system, state)
        ends = jax.vmap(lambda k: stepper.evaluate(system, found.pick((k,)), found.end[k]))(
            jnp.arange(len(found.end))
        )
        # Attempts that were not taken and steps beyond the last one have no row.
        row = jnp.where(found.taken, state.taken.astype(int) + found.taken.cumsum(), rows + 1)
        return later, jax.tree.map(lambda all, x: all.at[row].set(x, mode="drop"), points, ends)

    points = jax.tree.map(lambda x: jnp.broadcast_to(x, (rows + 1, *x.shape)), start)
    state, points = lax.while_loop(
        lambda carry: good(carry[0]) & (carry[0].taken < steps), block, (state, points)
    )
    return points, good(state)


# The steppers share this program.
@jit
def _on_constraints(system, points):
    """(time, q, v, lam) of points, projected on the constraints unless they are ends of steps."""

    def on_constraints(point):
        mass = factor_mass(system, point.time, point.q)
        projected = project(system, point.time, point.q, point.v, mass)
        q, v = select(point.exact, (point.q, point.v), projected)
        return point.time, q, v, consistent_motion(system, point.time, q, v, mass).lam

    return jax.vmap(on_constraints)(points)


def integrate(name, system, q, v, step, steps, spectral_radius=0.9, rows=None):
    """(time, q, v, lam) at every step, and checks that every step converged.

    Runs with different numbers of steps share a program if `rows` is the largest of them.

    As in a run, an interpolated end of a step is projected on the constraints, and the multipliers are
    those that fit the state. With constraints the spectral radius should be below 1. At 1 the method's own
    multipliers alternate from step to step, and momentum drifts a hundred times more than at 0.9.
    """
    rows, spectral_radius = rows or steps, jnp.asarray(float(spectral_radius))
    points, good = _integrate(name, system, q, v, jnp.asarray(float(step)), steps, rows, spectral_radius)
    assert good
    found = _on_constraints(system, points)
    if rows > steps:
        found = jax.tree.map(lambda x: jnp.asarray(np.asarray(x)[: steps + 1]), found)
    time, q, v, lam = found
    return np.asarray(time), q, v, lam
