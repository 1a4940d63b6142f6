"""The rigid pendulum: closed forms of its equations, and Newton's law for a point mass on a rod."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from esail_jax.observables.rigid_pendulum import hinge_moments, inertia, rigid_pendulum, swing
from support.fake_run import TIME, make_run, scene_of


def test_constant_flapping_moment_has_a_closed_form():
    """A constant flapping moment gives gamma = A (1 - cos W t) with W = w sqrt(1 + eps), A = m / W^2.

    The coupling 2 w A^2 W (sin W t - sin(2 W t) / 2) then drives the lagging oscillator of frequency
    n = w sqrt(eps).
    """
    rate, eps, flap = 4e-3, 0.3, 2e-7
    fast, slow = rate * np.sqrt(1.0 + eps), rate * np.sqrt(eps)
    size = flap / fast**2
    drive = 2.0 * rate * size**2 * fast
    first, second = drive / (slow**2 - fast**2), -drive / 2.0 / (slow**2 - 4.0 * fast**2)
    free = -(fast * first + 2.0 * fast * second) / slow
    gamma, beta = swing(TIME, rate, eps, lambda _: np.array([flap, 0.0]), (0.0, 0.0))
    np.testing.assert_allclose(gamma, size * (1.0 - np.cos(fast * TIME)), atol=1e-7 * size)
    expected = first * np.sin(fast * TIME) + second * np.sin(2.0 * fast * TIME) + free * np.sin(slow * TIME)
    np.testing.assert_allclose(beta, expected, atol=1e-6 * np.abs(expected).max())


def test_constant_lagging_moment_of_a_run_has_a_closed_form():
    """A constant lagging moment adds beta = (M_X / I) (1 - cos n t) / n^2, n = w sqrt(eps), to the free
    swing."""
    scene = scene_of()
    run = make_run(scene)
    zero = np.zeros((len(TIME), 3))
    moment = np.zeros((len(TIME), 3, 3))
    moment[:, 1, 0] = 0.02
    run.data |= {"thrust_moment_B": moment, "coning_angle": zero, "lagging_angle": zero + 0.01}
    mass = 7653.0 * 4.28e-9 * 10e3
    total = (1.5 + mass / 3.0) * 1e8
    slow = 4e-3 * np.sqrt(1e-4 * (1.5 + mass / 2.0) / (1.5 + mass / 3.0))
    times, gamma, beta = rigid_pendulum(run, 1)
    expected = 0.01 * np.cos(slow * times) + 0.02 / total * (1.0 - np.cos(slow * times)) / slow**2
    np.testing.assert_allclose(beta, expected, rtol=1e-7)
    np.testing.assert_allclose(gamma, 0.0, atol=1e-15)


@pytest.mark.parametrize(("azimuth", "side"), [(0.0, 0.0), (2.0, 0.3)])
def test_equations_follow_from_newtons_law(azimuth, side):
    """The equations agree with Newton's law for a point mass on a massless rod in inertial axes.

    Body-fixed forces act on the mass: across the plane, where only the coupling moves the rod in the
    plane, and with a component along the spin.
    """
    rate, radius, length, mass = 4e-3, 3e3, 10e3, 1.5
    force_B = 3e-3 * np.array([1.0, -side * np.sin(azimuth), side * np.cos(azimuth)])

    def body_axes(time):
        c, s = np.cos(rate * time), np.sin(rate * time)
        return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])

    outward = np.array([0.0, np.cos(azimuth), np.sin(azimuth)])
    spin = np.array([rate, 0.0, 0.0])

    def slope(time, state):
        hinge = radius * body_axes(time) @ outward
        rod = state[:3] - hinge
        rod_rate = state[3:] - np.cross(spin, hinge)
        free = body_axes(time) @ force_B / mass
        pull = (rod_rate @ rod_rate + rod @ (free + rate**2 * hinge)) / length**2
        return np.concatenate([state[3:], free - pull * rod])

    tip = (radius + length) * outward
    solution = solve_ivp(
        slope,
        (0.0, TIME[-1]),
        np.concatenate([tip, np.cross(spin, tip)]),
        method="DOP853",
        t_eval=TIME,
        rtol=1e-11,
        atol=1e-9,
    )
    rods = np.array([body_axes(t).T @ x for t, x in zip(TIME, solution.y[:3].T, strict=True)])
    rods = rods - radius * outward
    sideways = np.array([0.0, -np.sin(azimuth), np.cos(azimuth)])
    coning, lagging = np.arcsin(rods[:, 0] / length), np.arctan2(rods @ sideways, rods @ outward)

    moments = hinge_moments(np.cross(rods, force_B), azimuth)
    forcing = np.stack(moments, axis=1) / (mass * length**2)
    gamma, beta = swing(
        TIME,
        rate,
        radius / length,
        lambda t: [np.interp(t, TIME, column) for column in forcing.T],
        (0.0, 0.0),
    )
    # The equations neglect third powers of the angles and 2 w gamma beta'.
    error = 3.0 * coning.max() ** 2 + 2.0 * np.abs(lagging).max()
    assert error < 0.1
    assert np.abs(lagging).max() > 1e-4
    np.testing.assert_allclose(gamma, coning, atol=error * coning.max())
    np.testing.assert_allclose(beta, lagging, atol=error * np.abs(lagging).max())


def test_inertia_of_the_baseline():
    """I and eps are those of a rod with a point mass, found by summation; R = 0 without a hub."""
    lengths = (np.arange(20000) + 0.5) / 20000 * 10e3
    unit = 7653.0 * 4.28e-9 * 10e3 / 20000
    second = 1.5 * 1e8 + unit * (lengths**2).sum()
    first = 1.5 * 1e4 + unit * lengths.sum()
    total, eps = inertia(scene_of(), 0)
    np.testing.assert_allclose(total, second, rtol=1e-8)
    np.testing.assert_allclose(eps, 1.0 * first / second, rtol=1e-8)
    assert inertia(scene_of(hub=None), 0)[1] == 0.0
