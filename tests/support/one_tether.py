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
from esail_jax.joints.roots import FrameRoots, HubRoots, clamp_normals
from esail_jax.simulation.entry import fresh_state, with_jerk
from esail_jax.steppers.collocation import KEEP as BLOCK
from esail_jax.steppers.collocation import Collocation
from esail_jax.steppers.consistent import consistent_acceleration
from esail_jax.steppers.energy_momentum import EnergyMomentum
from esail_jax.steppers.fixed_step import KEEP, StepInfo
from esail_jax.steppers.generalized_alpha import GeneralizedAlpha
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
    """Returns the system of a tether at `radius` from the axis of a frame that turns at `spin`, or on a
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
    gravity = None if gravity is None else jnp.asarray(gravity, float)
    return System(tethers, roots, hub, tuple(energies), tuple(damping), tuple(loads), gravity)


def straight(system, direction=(0.0, 1.0, 0.0), line=None):
    """Returns the coordinates of a straight tether, undeformed unless `line` gives its distances and
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
        """Returns `system` with the force `pull`."""
        return cls(*(getattr(system, name) for name in System.__dataclass_fields__), pull=pull)

    def tether_forces(self, *state):
        forces, power = super().tether_forces(*state)
        pull = self.pull.reshape(3, *(1,) * (forces.ndim - 4))  # forces of one state or of several
        return forces.at[0, ..., -1, 0].add(-pull), power


def turning(q, omega):
    """Returns omega x q, the velocities of a rigid rotation about an axis through the origin."""
    omega = jnp.asarray(omega, float)
    hub = None if q.hub is None else jnp.cross(omega, q.hub)
    return Coordinates(jnp.cross(omega, q.tether, axisb=1, axisc=1), hub)


def generalized_alpha(system, q, v, step, steps, spectral_radius):
    """Returns (q, v, lam) at the start and after every step. `steps` must be a multiple of the block
    length."""
    return fixed_step(GeneralizedAlpha(step, spectral_radius), system, q, v, steps)


def energy_momentum(system, q, v, step, steps, _):
    """Returns the same as `generalized_alpha`."""
    return fixed_step(EnergyMomentum(step), system, q, v, steps)


def fixed_step(stepper, system, q, v, steps):
    """Integrates with a stepper of fixed step, which reuses its factors within a block."""
    zero = jnp.zeros(())
    nothing = Power(zero, zero)
    vdot, lam = consistent_acceleration(system, zero, q, v)
    begin = fresh_state(q, v, vdot, lam, nothing, nothing)
    kept = stepper.factor(system, zero, q, v, lam)
    trial, _ = stepper.step(system, zero, begin, kept, jnp.asarray(jnp.inf))
    state = with_jerk(stepper, begin, trial.v)

    def block(state, index):
        state, (states, info) = stepper.block(system, index * KEEP * stepper.step_size, state, KEEP)
        return state, ((states.q, states.v, states.lam), jax.vmap(StepInfo.converged)(info).all())

    _, (trajectory, good) = lax.scan(block, state, jnp.arange(steps // KEEP))
    flat = jax.tree.map(lambda x: x.reshape(steps, *x.shape[2:]), trajectory)
    return jax.tree.map(lambda a, b: jnp.concatenate([a[None], b]), (q, v, lam), flat), good.all()


def collocation(system, q, v, step, steps, _):
    """Returns (q, v, lam) at the start and after every step."""
    method = Collocation(step, jnp.asarray(1e-11))
    begin = method.start(system, jnp.zeros(()), q, v)
    room = jax.tree.map(lambda x: jnp.zeros((steps + 1 + BLOCK, *x.shape)), (q, v))

    def going(state):
        now, count, _ = state
        return (count <= steps) & (now.rejected == 0.0)

    def block(state):
        now, count, kept = state
        now, records = method.block(system, now)
        found = (records.start.q, records.start.v)  # taken steps come first; a block may end early
        kept = jax.tree.map(lambda all, x: lax.dynamic_update_slice_in_dim(all, x, count, 0), kept, found)
        return now, count + records.taken.sum(), kept

    end, _, kept = lax.while_loop(going, block, (begin, jnp.zeros((), int), room))
    q, v = jax.tree.map(lambda x: x[: steps + 1], kept)
    time = jnp.arange(steps + 1) * step
    lam = jax.vmap(lambda *at: consistent_acceleration(system, *at)[1])(time, q, v)
    return (q, v, lam), end.rejected == 0.0


STEPPERS = {
    "generalized-alpha": generalized_alpha,
    "collocation": collocation,
    "energy-momentum": energy_momentum,
}
"""By name: (system, q, v, step, steps, spectral_radius) -> ((q, v, lam) at all steps, converged)."""


# Every case compiles a program of its own and runs it once.
@functools.partial(jit, static_argnums=(0, 5))
def _integrate(name, system, q, v, step, steps, spectral_radius):
    return STEPPERS[name](system, q, v, step, steps, spectral_radius)


def integrate(name, system, q, v, step, steps, spectral_radius=0.9):
    """Returns (time, q, v, lam) at every step, and checks that every step converged.

    With constraints the spectral radius should be below 1. At 1 the multipliers alternate from step to
    step, and momentum drifts a hundred times more than at 0.9.
    """
    assert steps % KEEP == 0
    (q, v, lam), good = _integrate(
        name, system, q, v, jnp.asarray(float(step)), steps, jnp.asarray(float(spectral_radius))
    )
    assert good
    return step * np.arange(steps + 1), q, v, lam
