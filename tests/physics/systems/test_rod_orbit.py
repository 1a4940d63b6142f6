"""Tethered satellites on a circular orbit: Hill's equations, libration, explicit and implicit method."""

import numpy as np
import pytest
from scipy.optimize import least_squares

import esail_jax as esail
from support.rod_tips import tip

MOTION = 1.1e-3
SCENE = esail.load_scene("tethered-satellite")


def clohessy_wiltshire(start, rate, t):
    """The closed solution of Hill's equations."""
    n, s, c = MOTION, np.sin(MOTION * t), np.cos(MOTION * t)
    (x, y, z), (u, v, w) = start, rate
    return np.array([
        (4 - 3 * c) * x + s / n * u + 2 / n * (1 - c) * v,
        6 * (s - n * t) * x + y - 2 / n * (1 - c) * u + (4 * s - 3 * n * t) / n * v,
        z * c + w / n * s,
    ])  # fmt: skip


@pytest.mark.nightly
def test_centre_of_mass_moves_as_a_free_particle(validate):
    """The centre of mass follows Clohessy & Wiltshire's solution over an orbit, to 1e-9 of the chain's
    size.

    Internal forces do not act on it, and the field is linear.
    """
    settings = {
        "initial.position": [50.0, -300.0, 20.0], "initial.velocity": [0.1, -0.2, 0.05],
        "initial.rod_rate": [0.02, 0.01, -0.03], "integrator.t_end": 5712.0, "output.interval": 571.2,
    }  # fmt: skip
    scene = esail.load_scene(SCENE, settings)
    run = esail.simulate(scene)
    assert np.abs(run["energy_error"]).max() < 1e-8
    joints, masses = run["joint_position"], np.full(10, 0.92)
    total = 500.0 + 100.0 + masses.sum()
    middles = 0.5 * (joints[:, 1:] + joints[:, :-1])
    centre = (500.0 * joints[:, 0] + 100.0 * joints[:, -1] + 0.92 * middles.sum(1)) / total
    share = (100.0 * 10 + 0.92 * (np.arange(10) + 0.5).sum()) / total
    start = np.array(settings["initial.position"]) + share * np.array(scene.initial.rod_vector)
    rate = np.array(settings["initial.velocity"]) + share * np.array(settings["initial.rod_rate"])
    exact = np.array([clohessy_wiltshire(start, rate, t) for t in run.time])
    validate(
        "ROD-8", "tethered satellites, an orbit", "Clohessy & Wiltshire", "centre of mass",
        np.abs(centre - exact).max() / 2e4, 1e-9,
    )  # fmt: skip


@pytest.mark.nightly
def test_libration_frequencies(validate):
    """The line between the bodies librates at sqrt(3) n in the orbital plane and at 2 n across it.

    The amplitude of 0.01 rad reduces the frequencies by amplitude^2/4, 2.5e-5. An elastic tether reduces
    them by 2/3 of its strain, because Coriolis forces stretch it in phase with the motion: 1e-4 for the
    tether of the scene; this tether is ten times as stiff.
    """
    settings = {
        "chain.rods": 4, "chain.length": 5000.0, "chain.mass": 2.3, "chain.youngs_modulus": 87e10,
        "initial.rod_vector": (2.5 * np.array(SCENE.initial.rod_vector)).tolist(),
    }  # fmt: skip
    run = esail.simulate(SCENE, settings | {"integrator.t_end": 22848.0})
    line = tip(run)
    angles = {
        "in plane": (np.arctan2(line[:, 1], line[:, 0]), np.sqrt(3.0)),
        "out of plane": (np.arcsin(line[:, 2] / np.linalg.norm(line, axis=1)), 2.0),
    }
    for number, (name, (angle, ratio)) in enumerate(angles.items(), start=9):

        def misfit(p, angle=angle):
            return p[0] * np.cos(p[2] * MOTION * run.time) + p[1] * np.sin(p[2] * MOTION * run.time) - angle

        fit = least_squares(misfit, [angle[0], 0.0, ratio], x_scale=[1e-2, 1e-2, 1e-4], xtol=1e-14)
        assert np.abs(fit.fun).max() < 0.02 * abs(angle[0])
        validate(
            f"ROD-{number}", "libration of tethered satellites", f"{ratio:.4g} n", f"frequency {name}",
            abs(fit.x[2] / ratio - 1.0), 1e-4,
        )  # fmt: skip


@pytest.mark.nightly
def test_the_implicit_method_on_orbit():
    """The implicit method converges to the explicit method's path of a free chain in orbit, with second
    order."""
    settings = {"integrator.t_end": 1000.0, "output.interval": 100.0, "chain.rods": 4}
    settings |= {"initial.rod_vector": [2000.3, 20.0, 20.0], "chain.youngs_modulus": 87e7}
    exact = esail.simulate(SCENE, settings)["joint_position"]
    errors = []
    for step in (0.4, 0.2):
        method = {"integrator.method": "generalized-alpha", "integrator.step": step}
        errors.append(np.abs(esail.simulate(SCENE, settings | method)["joint_position"] - exact).max())
    assert 3.5 < errors[0] / errors[1] < 4.5, errors
