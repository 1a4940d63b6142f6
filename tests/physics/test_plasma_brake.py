"""Coulomb drag on a negative tether in low orbit (`[plasma_brake]`): published numbers, decay, refusals."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.loads.plasma_brake import PlasmaBrake, ions
from esail_jax.point_fields import PointFields
from esail_jax.scenes.build import build
from esail_jax.scenes.structure import split
from esail_jax.terms import find_term
from support.derivatives import check_both_modes
from support.quick import jit

MOTION, SPEED = 1.078e-3, 7.56e3
DUMBBELL = {"chain.rods": 1, "chain.length": 300.0, "chain.mass": 3.3e-3, "chain.base_mass": 20.0,
            "chain.tip_mass": 20.0, "initial.position": [-150.0, 0.0, 0.0],
            "initial.rod_vector": [300.0, 0.0, 0.0], "chain.youngs_modulus": 1e10}  # fmt: skip
"""Equal masses, which hardly tilt; a soft tether, whose vibration at 0.1 rad/s takes few steps."""


def as_written(volts, speed, density, mass_u=16.0, radius=1e-3):
    """The drag per length [N/m] of Janhunen (2014), with the constants of scipy."""
    from scipy.constants import atomic_mass, e, epsilon_0

    sheath = np.sqrt(epsilon_0 * volts / (e * density))
    reduced = volts / np.log(sheath / radius)
    pressure, bulk = mass_u * atomic_mass * density * speed**2, 0.5 * mass_u * atomic_mass * speed**2 / e
    return 3.864 * pressure * np.sqrt(epsilon_0 * reduced / (e * density)) * np.exp(-bulk / reduced)


def brake(volts):
    numbers = (7.5e3, 3e10, 16.0, 1e-3)
    speed, density, mass, radius = (jnp.asarray(x) for x in numbers)
    return PlasmaBrake(speed, density, ions(mass), radius, jnp.asarray(volts))


def test_published_force(validate):
    """5 km at -1 kV brake with 0.43 mN (Janhunen 2014, abstract), in oxygen of 3e10 1/m^3 at 7.5 km/s with
    an effective radius of 1 mm; two digits are printed, 3 % are accepted. Zero volts do not brake."""
    load = brake([-1e3, -500.0, 0.0])
    drag = np.asarray(load.drag)
    assert np.allclose(drag[:2], [as_written(x, 7.5e3, 3e10) for x in (1e3, 500.0)], rtol=1e-4, atol=0)
    assert drag[2] == 0.0
    validate(
        "BRAKE-1", "plasma brake of 5 km at -1 kV", "published estimate, 0.43 mN", "relative difference",
        abs(5e3 * drag[0] / 0.43e-3 - 1.0), 0.03,
    )  # fmt: skip
    # 0.43 mN lower a mass of 260 kg by 100 km in a year (the same abstract).
    year, motion = 3.156e7, 1.05e-3
    assert abs(2.0 * 0.43e-3 / (260.0 * motion) * year / 100e3 - 1.0) < 0.02


def test_direction():
    """The force is along the stream, less its part along the tether."""
    load = brake([-1e3, -1e3, -1e3])
    tangents = jnp.array([[2.0, 0.0, 0.6], [0.0, 1.5, 0.8], [0.0, 0.0, 0.0]])
    force = np.asarray(load.force(jnp.zeros(()), PointFields(None, tangents), PointFields(None, tangents)))
    sigma = float(load.drag[0])
    assert np.allclose(force[:, 0], [0.0, -sigma, 0.0], rtol=0, atol=1e-14 * sigma)
    assert np.allclose(force[:, 1], 0.0, atol=1e-14 * sigma)
    assert np.allclose(force[:, 2], [0.48 * sigma, -0.36 * sigma, 0.0], rtol=0, atol=1e-14 * sigma)


@pytest.mark.nightly
def test_decay_of_an_orbit(validate):
    """After whole orbits a satellite that starts at rest in Hill's axes is lower by 2 F t / (m n): exact
    for a constant force. The tether tilts by 0.01 rad, whose square counts: 1e-3 is accepted."""
    time = 2.0 * np.pi / MOTION
    end = {"integrator.t_end": time, "output.interval": time}
    run = esail.simulate("plasma-brake", DUMBBELL | end)
    joints, masses = np.asarray(run["joint_position"])[-1], np.array([20.0, 20.0]) + 3.3e-3 / 2
    found = -(masses @ joints)[0] / masses.sum()
    exact = 2.0 * 300.0 * as_written(1e3, SPEED, 3e10) * time / (masses.sum() * MOTION)
    validate(
        "BRAKE-2", "plasma brake on a circular orbit", "Hill's equations, constant force",
        "decay in one orbit", abs(found / exact - 1.0), 1e-3,
    )  # fmt: skip


def test_derivatives_by_every_number():
    """Derivatives of the force per length by every number of the table are difference quotients of
    fourth order to 1e-6, and both modes agree. (`test_rod_motion.py` checks derivatives of whole runs of
    chains.)"""
    numbers = {
        "plasma_brake.voltage": (-1e3, 5.0),
        "plasma_brake.speed": (SPEED, 40.0),
        "plasma_brake.number_density": (3e10, 1e8),
        "plasma_brake.tether_radius": (1e-3, 5e-6),
        "plasma_brake.ion_mass_u": (16.0, 0.05),
    }

    def drag(given):
        system = build(*split(esail.load_scene("plasma-brake", DUMBBELL | given))).system
        load = find_term(system.loads, PlasmaBrake)
        return {"drag": load.drag}

    assert max(check_both_modes(drag, numbers).values()) < 1e-6


@pytest.mark.nightly
def test_many_runs():
    """Members of a batch with other voltages and densities are runs of their own, to 1e-6 m."""
    volts, density = jnp.array([-1e3, -500.0]), jnp.array([3e10, 5e10])

    def end(volts, density):
        given = DUMBBELL | {"plasma_brake.voltage": volts, "plasma_brake.number_density": density}
        given |= {"integrator.t_end": 600.0, "output.interval": 600.0, "integrator.tolerance": 1e-11}
        return esail.simulate("plasma-brake", given)["joint_position"][-1, 1, :2]

    found = jit(jax.vmap(end))(volts, density)
    for k in range(2):
        assert np.allclose(found[k], end(float(volts[k]), float(density[k])), rtol=0, atol=1e-6)
    assert np.abs(found[1] - found[0]).max() > 1e-3


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"plasma_brake.voltage": 5.0}, r"`plasma_brake.voltage` must not be positive, but is 5.0"),
        ({"plasma_brake.speed": 0.0}, r"`plasma_brake.speed` must be positive, but is 0.0"),
        ({"plasma_brake.tether_radius": 2.0},
         r"`plasma_brake.tether_radius` must be below the radius of the sheath \(1.36 m\), but is 2.0"),
        ({"orbit.mean_motion": None}, r"`orbit.mean_motion` must be given with \[plasma_brake\]"),
        ({"plasma_brake.voltage": None}, r"`plasma_brake.voltage` must be given, but is missing"),
    ],
)  # fmt: skip
def test_bad_input(changes, message, nothing_compiles):
    """One line names the key before anything is compiled."""
    with pytest.raises(esail.SceneError, match=message):
        esail.load_scene("plasma-brake", changes)
