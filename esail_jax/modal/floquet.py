"""Floquet multipliers of a sail that spins at a sailing angle: how small motions about its periodic orbit
grow or decay in a turn.

At a sailing angle the load on a tether changes during a turn, and the sail has no equilibrium but a
motion that repeats itself (`periodic_orbit.py`). The derivative of the map of a turn has the eigenvalues
mu, the multipliers: a small motion is multiplied by mu in every turn. Its exponent s = ln(mu) / T takes
the place of the eigenvalue of a mode: Re s is the rate of growth, Im s the frequency, known up to whole
multiples of the spin rate, of which the one nearest to the mode's is given. Facing the wind, s is the
mode's eigenvalue.

If the tethers are equal, the map is that of the part of a turn that brings each tether to the place of
the next; with p tethers, mu is the p-th power of its eigenvalue nu. Multipliers are assigned to modes by
their values and by the likeness of the motions.
"""

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from scipy.optimize import linear_sum_assignment

from esail_jax.array_types import Complex, Float
from esail_jax.equilibria import motions
from esail_jax.equilibria.moving_frame import MovingFrame, expanded, independent
from esail_jax.errors import SimulationError
from esail_jax.loads.coulomb import CoulombThrust
from esail_jax.modal.multipliers import FASTEST, LEAST, Floquet
from esail_jax.modal.periodic_orbit import Orbit, Setting, periodic_orbit
from esail_jax.modal.solving import Solved
from esail_jax.modal.turn_map import to_state
from esail_jax.steppers.results import RESULTS
from esail_jax.system import System

Host = np.ndarray

STEP_ANGLE = 0.5
"""Phase [rad] of the fastest motion in a time step."""


class Moving(NamedTuple):
    """What is needed of a scene's modes. found: their equilibrium; system: with the loads as they are;
    axes: of B at the start."""

    found: Solved
    system: System
    axes: Float[Host, "3 3"]


def floquet(table: Any, moving: Moving) -> Floquet:
    """The multipliers. table: a `ModeTable` of all modes of a sail with a hub in the wind.

    Raises SimulationError if no periodic orbit is found."""
    solved, system, axes = moving.found, moving.system, moving.axes
    spin, count = solved.spin, system.tethers.count
    equal = table.groups[0].n is not None and count > 1
    parts = count if equal else 1
    steps = int(np.ceil(2.0 * np.pi * FASTEST / STEP_ANGLE / parts))
    places = int(np.sign(spin)) if equal else 0
    thrust = next(load for load in system.loads if isinstance(load, CoulombThrust))
    wind = np.asarray(thrust.wind.origin)
    setting = Setting(system, abs(spin), wind / np.linalg.norm(wind), steps, places, parts)
    q = solved.at.q
    v = MovingFrame(jnp.asarray(axes[:, 0] * spin), jnp.zeros(3)).turned(q)
    orbit = periodic_orbit(setting, np.asarray(to_state(system, abs(spin), q, v)))
    if not orbit.converged:
        raise SimulationError(
            "No periodic orbit was found at this sailing angle. Try a smaller one, or leave out --floquet.",
            RESULTS.nonfinite,
        )
    return multipliers(table, moving, setting, orbit)


def multipliers(table: Any, moving: Moving, setting: Setting, orbit: Orbit) -> Floquet:
    """The multipliers of an orbit."""
    spin, count = setting.spin, setting.system.tethers.count
    values, vectors = np.linalg.eig(orbit.map)
    slow = np.flatnonzero(np.abs(table.eigenvalue) <= FASTEST * spin)
    waves = np.array([signed_wave(table, int(k)) for k in slow])
    angle = 2.0 * np.pi * waves * setting.places / count
    rates = table.eigenvalue[slow]
    expected = np.exp(rates * orbit.duration - 1j * angle)
    shapes = np.stack([state_of(table, moving, int(k)) for k in slow], axis=1)
    targets = np.concatenate([expected, [1.0, 1.0]])
    shapes = np.concatenate([orbit.tangents.T @ shapes, orbit.tangents.T @ orbit.neutral], axis=1)
    shapes = shapes / np.linalg.norm(shapes, axis=0)
    likeness = np.abs(shapes.conj().T @ (vectors / np.linalg.norm(vectors, axis=0)))
    # Of each conjugate pair of motions one is a mode of the table, at an eigenvalue or its conjugate.
    cost = np.abs(targets[:, None] - values) + (1.0 - likeness)
    place = linear_sum_assignment(cost)[1]
    nu = values[place]
    exponent = np.full(len(table), complex(np.nan, np.nan))
    multiplier = exponent.copy()
    logarithm = np.log(nu[:-2]) + 1j * angle
    turns = np.round((rates.imag * orbit.duration - logarithm.imag) / (2.0 * np.pi))
    resolved = np.abs(nu[:-2]) > LEAST
    known = slow[resolved]
    exponent[known] = (logarithm + 2j * np.pi * turns)[resolved] / orbit.duration
    multiplier[known] = nu[:-2][resolved] ** setting.parts
    parts = setting.parts
    return Floquet(
        multiplier,
        exponent,
        parts * orbit.duration,
        parts * orbit.precession,
        parts * orbit.tilt,
        parts * orbit.spin,
        orbit.left,
        float(np.abs(nu[-2:] ** parts - 1.0).max()),
        orbit.sailing_angle,
    )


def signed_wave(table: Any, mode: int) -> int:
    """The number of a wave exp(i n phi + s t) with the eigenvalue s of the table; 0 for motions
    that are no waves."""
    n = int(table.wave_number[mode])
    return 0 if n < 0 else -n if table.motions[mode][2] else n


def state_of(table: Any, moving: Moving, mode: int) -> Complex[Host, " m"]:
    """A mode as a change of the state (u, (Omega x u + s u) / |Omega|)."""
    solved, axes = moving.found, moving.axes
    group, column, conjugate = table.motions[mode]
    shapes = table.groups[group]
    local, hub = shapes.local[:, :, column], shapes.hub[:, column]
    if shapes.n is not None:
        count = table.places.mass.shape[1]
        local = local * np.exp(2j * np.pi * shapes.n * np.arange(count) / count)
    y = np.asarray(independent(moving.system, solved.at.q))
    basis = motions.rigid_hub_basis(moving.system, y, axes)
    u = basis @ np.concatenate([local.T.ravel(), hub])
    u = u.conj() if conjugate else u
    turning = axes[:, 0] * solved.spin

    def turned(part):
        frame = MovingFrame(jnp.asarray(turning), jnp.zeros(3))
        motion = expanded(moving.system, jnp.asarray(part), derivative=1)
        return np.asarray(independent(moving.system, frame.turned(motion)))

    rate = turned(u.real) + 1j * turned(u.imag) + table.eigenvalue[mode] * u
    return np.concatenate([u, rate / abs(solved.spin)])
