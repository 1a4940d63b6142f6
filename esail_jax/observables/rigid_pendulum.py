"""Rigid-pendulum model of a tether: its motion without flexibility ([PGV] Eq. 83-85, derived).

A rigid uniform tether (mass m_t, length L) with a tip mass m_u is hinged at distance R from an axis
X that rotates at a constant rate w. With the rotating axes r, outward through the hinge, and s = X x r, the
point of the tether at distance l from the hinge is at

    R r + l n,    n = sin(gamma) X + cos(gamma) (cos(beta) r + sin(beta) s).

The kinetic energy is, up to a constant and a total time derivative,

    I gamma'^2 / 2 + I cos(gamma)^2 (w + beta')^2 / 2 + w^2 R S cos(gamma) cos(beta),
    I = (m_u + m_t / 3) L^2,    S = (m_u + m_t / 2) L.

Lagrange's equations, to first order and with the quadratic coupling in the second, are

    gamma'' + w^2 (1 + eps) gamma = -M_s / I
    beta''  + w^2 eps beta        =  M_X / I + 2 w gamma gamma'
    eps = R S / I = (R / L) (m_u + m_t / 2) / (m_u + m_t / 3)

with the moment M of the load about the hinge; a rotation about -s increases the coning angle. As in the
paper, the term 2 w gamma beta' of the first equation is neglected: it is of third order if beta is of the
order of gamma^2. With R = 0 and M_X = 0 the second equation conserves the angular momentum
cos(gamma)^2 (w + beta').

[PGV] Eq. 83 and 84 agree with these equations, but their components of M refer to body axes, which are X
and s for tether 1 only. Eq. 85 has half of the coupling, w gamma gamma'.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from esail_jax.observables.saved_rows import leading_finite, observable, per_tether
from esail_jax.scenes.hub import azimuths, root_positions

STEPS_PER_TURN = 50
"""Smallest number of integration steps per revolution. It prevents that the step grows during a quiet start
and skips a later pulse of the load."""


def inertia(scene: Any, tether: int) -> tuple[float, float]:
    """The moment of inertia I [kg m^2] about the hinge and eps [-] of one tether. Without a hub R
    is 0."""
    tethers, count = scene.tethers, scene.tethers.count
    length, area, density = (
        per_tether(value, count)[tether] for value in (tethers.length, tethers.area, tethers.density)
    )
    unit = 0.0 if scene.remote_units is None else per_tether(scene.remote_units.mass, count)[tether]
    radius = float(np.linalg.norm(root_positions(scene.hub, count)[1:, tether]))
    mass = density * area * length
    reduced = unit + mass / 3.0
    return reduced * length**2, radius / length * (unit + mass / 2.0) / reduced


def hinge_moments(moment_B: np.ndarray, azimuth: float) -> tuple[np.ndarray, np.ndarray]:
    """The moments [N m] that increase coning and lagging, (-M_s, M_X), from components in B
    (time, 3)."""
    sideways = np.array([0.0, -np.sin(azimuth), np.cos(azimuth)])
    return -moment_B @ sideways, moment_B[:, 0]


def swing(
    times: np.ndarray,
    rate: float,
    eps: float,
    forcing: Callable[[float], np.ndarray],
    start: tuple[float, float],
) -> tuple[np.ndarray, np.ndarray]:
    """Integrates the equations of the pendulum. Returns gamma and beta [rad] at the given times [s].

    The pendulum starts at rest relative to the rotating axes.

    rate: w [rad/s], not zero
    forcing: function of time with the values (-M_s, M_X) / I [rad/s^2]
    start: gamma and beta [rad] at the first time
    """

    def slope(time, state):
        gamma, beta, gamma_rate, beta_rate = state
        flap, lag = forcing(time)
        return [
            gamma_rate,
            beta_rate,
            flap - rate**2 * (1.0 + eps) * gamma,
            lag - rate**2 * eps * beta + 2.0 * rate * gamma * gamma_rate,
        ]

    solution = solve_ivp(
        slope,
        (times[0], times[-1]),
        [*start, 0.0, 0.0],
        method="DOP853",
        t_eval=times,
        rtol=1e-9,
        atol=1e-12,
        max_step=2.0 * np.pi / abs(rate) / STEPS_PER_TURN,
    )
    return solution.y[0], solution.y[1]


def rigid_pendulum(run: Any, tether: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Times [s], gamma and beta [rad] of the rigid tether under the moments of a run.

    The result is None if the model does not apply: without spin, with gravity on a sail without a hub
    (which does not fall), with tethers whose length changes, or without data.
    """
    scene = run.scene
    rate = float(scene.initial.spin_rate)
    names = ("thrust_moment_B", "coning_angle", "lagging_angle")
    signals = [x for x in (observable(run, name) for name in names) if x is not None]
    pulled = scene.gravity is not None and scene.hub is None
    changing = scene.deployment is not None
    if rate == 0.0 or pulled or changing or len(signals) < len(names):
        return None
    moment, coning, lagging = (signal[:, tether] for signal in signals)
    known = leading_finite(moment, coning, lagging)
    if known < 2:
        return None
    times = np.asarray(run.time)[:known]
    total, eps = inertia(scene, tether)
    azimuth = azimuths(scene.hub, scene.tethers.count)[tether]
    forcing = CubicSpline(times, np.stack(hinge_moments(moment[:known], azimuth), axis=1) / total)
    return times, *swing(times, rate, eps, forcing, (coning[0], lagging[0]))
