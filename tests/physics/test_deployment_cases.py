"""Exact cases of tethers and chains that are paid out and reeled in."""

from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.scenes.loading import load_scene
from esail_jax.scenes.structure import split
from esail_jax.steppers.stepper import Point
from support.quick import build_jitted, jit

PAIR = {
    "hub.height": 1.0,
    "tethers.count": 2,
    "tethers.length": 1000.0,
    "tethers.elements": 1,
    "remote_units.mass": 0.5,
    "solar_wind": None,
    "voltage": None,
    "initial.sailing_angle_deg": 0.0,
    "deployment.start_length": 100.0,
}


def test_free_payout():
    """A straight tether without tension is paid out at a constant rate: nothing accelerates, the guide does
    not pull, and the force on hub and reel is the momentum rho l'^2 that leaves with the tether, against
    the motion. To 1e-9 of that force."""
    given = {"deployment.time": [0.0, 9.0], "deployment.rate": [20.0, 20.0], "integrator.t_end": 9.0}
    system = build_jitted(*split(load_scene("truss", PAIR | {"tethers.elements": 3} | given))).system
    rate, density = 20.0, 7653.0 * 4.28e-9
    xi = jnp.linspace(0.0, 1.0, 4)[:, None]
    along = jnp.zeros((1, 3, 4, 2)).at[0, 1].set(xi * jnp.ones(2))

    @jit
    def rows(along):
        now = system.at(jnp.zeros(()))
        return now.tether_forces(jnp.zeros(()), 100.0 * along, rate * along, 0.0 * along)[0]

    found = np.asarray(rows(along))[0]
    flux = density * rate**2
    assert np.abs(found[:, 1:]).max() < 1e-9 * flux
    assert np.allclose(found[:, 0], np.array([[0.0], [flux], [0.0]]), atol=1e-9 * flux)


@pytest.mark.nightly
@pytest.mark.parametrize("light", [True, False])
def test_lag_behind_a_held_hub(light):
    """Paid out at a constant rate from a hub that a large inertia holds at w, a straight tether rests at
    sin(phi) = -2 l'/(r w), whatever its mass, with the tension m (l w^2 + r w^2 cos(phi)) + rho (l^2 w^2/2
    + r l w^2 cos(phi)): the angle to 1e-6 rad, the tension to 1e-6 of itself with the stretch, up to 3e-5,
    in l and the stretching in l': a tether that starts at the angle of an unstretched one swings so fast
    that its tension is 1e-6 less."""
    w, rate, radius, elements, end = 0.05, 0.01, 1.0, 4, 40.0
    density = 1e-3 if light else 7653.0 * 20.0
    given = {
        "hub.density": 1e9,
        "hub.radius": radius,
        "tethers.youngs_modulus": 1e12,
        "tethers.elements": elements,
        "tethers.density": density,
        "initial.spin_rate": w,
        "deployment.time": [0.0, 99.0],
        "deployment.rate": [rate, rate],
        "integrator.t_end": end,
        "integrator.tolerance": 1e-11,
        "output.interval": 10.0,
    }
    scene = load_scene("truss", PAIR | given)
    system, q, v, *_ = build_jitted(*split(scene))
    rho = density * scene.tethers.area
    axis = np.asarray(system.rotation(jnp.zeros(()), q))[:, 0]
    outward = np.asarray(q.tether[0, :, -1] - q.tether[0, :, 0])
    outward = outward / np.linalg.norm(outward, axis=0)
    phi = np.arcsin(-2.0 * rate / (radius * w))
    part = np.linspace(0.0, 1.0, elements + 1)

    def pull(length, here, drawn):
        """Tension beyond a part of the tether, whose nodes are at the distances `drawn`."""
        far = drawn + radius * np.cos(phi)
        beyond = np.interp(np.linspace(here, 1.0, 1001), part, far)
        return w**2 * (0.5 * far[-1] + rho * length * (1.0 - here) * np.trapezoid(beyond, dx=1e-3))

    def stretched(length):
        """Distances of the nodes from the root, and the tension there."""
        drawn = length * part
        for _ in range(3):
            middle = [pull(length, x, drawn) for x in 0.5 * (part[1:] + part[:-1])]
            strain = np.array(middle) / (1e12 * scene.tethers.area)
            drawn = length / elements * np.concatenate([[0.0], np.cumsum(1.0 + strain)])
        return drawn, pull(length, 0.0, drawn)

    drawn = stretched(100.0)[0][:, None]
    growing = rate * (stretched(100.5)[0] - stretched(99.5)[0])[:, None]
    phi = np.arcsin(-2.0 * growing[-1, 0] / (radius * w))
    along = np.cos(phi) * outward + np.sin(phi) * np.cross(axis, outward, axis=0)
    nodes = np.asarray(q.tether[0, :, :1]) + drawn * along[:, None]
    rates = w * np.cross(axis, nodes, axis=0) + growing * along[:, None]
    zero = jnp.zeros(())
    start = Point(
        zero,
        q._replace(tether=jnp.asarray(nodes)[None]),
        v._replace(tether=jnp.asarray(rates)[None]),
        system.no_power,
        jnp.asarray(True),
    )
    run = esail.simulate(scene, start=start)
    assert np.abs(run["lagging_angle"] - phi).max() < 1e-6
    _, expected = stretched(run["deployed_length"][-1, 0])
    assert np.allclose(run["winch_tension"][-1], expected, rtol=2e-7)


@pytest.mark.nightly
def test_lag_behind_a_free_hub():
    """Slow payout from a hub that is free to turn: the mean of the lag is that of
    sin(phi) = -(2 l' w + l w')/(r w^2) with the spin that the run has, and about
    -(2 l'/(r w)) J/(J + sum m l^2), both to 5 %: the tethers swing about it."""
    given = {
        "hub.density": 2000.0,
        "hub.radius": 2.0,
        "tethers.density": 1.0,
        "initial.spin_rate": 0.05,
        "deployment.time": [0.0, 1000.0, 3000.0],
        "deployment.rate": [0.0, 0.01, 0.01],
        "integrator.t_end": 3000.0,
        "output.interval": 10.0,
    }
    run = esail.simulate("truss", PAIR | given)
    w = run["spin_rate"][:, 1]
    part = run.time >= 1000.0
    length, rate = run["deployed_length"][:, 0], run["payout_rate"][:, 0]
    sine = -(2.0 * rate * w + length * np.gradient(w, run.time)) / (2.0 * w**2)
    found = np.sin(run["lagging_angle"][part]).mean()
    assert abs(found / sine[part].mean() - 1.0) < 0.05
    spinning = 0.5 * 2000.0 * np.pi * 2.0**4
    shared = -(2.0 * rate / (2.0 * w)) * spinning / (spinning + 2.0 * 0.5 * (length + 2.0) ** 2)
    assert abs(found / shared[part].mean() - 1.0) < 0.05


FOUR = {
    "hub.density": 1e5,
    "hub.height": 1.0,
    "hub.radius": 10.0,
    "tethers.count": 4,
    "tethers.length": 1000.0,
    "tethers.elements": 3,
    "remote_units.mass": [0.5, 0.6, 0.55, 0.45],
    "initial.spin_rate": 0.05,
    "initial.sailing_angle_deg": 5.0,
    "deployment.time": [0.0, 400.0, 3800.0, 4200.0],
    "integrator.t_end": 4200.0,
    "output.interval": 20.0,
}
RATES = np.array([0.0, 0.15, 0.15, 0.0])[:, None] * np.array([1.0, 0.98, 1.01, 0.97])
OUT = {"deployment.start_length": [20.0, 25.0, 22.0, 20.0], "deployment.rate": RATES}
IN = {"deployment.start_length": [590.0, 583.6, 597.7, 572.9], "deployment.rate": -0.6 * RATES}


@pytest.mark.nightly
@pytest.mark.parametrize("change", [OUT, IN], ids=["out", "in"])
def test_four_unequal_tethers_in_the_wind(change, validate):
    """From 2 % to 58 % of their length in 33 turns, and reeled in: twice the elements, and another method
    of second order with short steps, to 1e-5 of the ranges of lag and tips."""
    one = esail.simulate("truss", FOUR | change)
    assert one.stats["message"] == ""
    fixed = {"integrator.method": "generalized-alpha", "integrator.step": 0.01}
    names, way = ("lagging_angle", "tip_position_I"), "out" if change is OUT else "in"
    for reference, other in (("twice the elements", {"tethers.elements": 6}), ("generalized-alpha", fixed)):
        run = esail.simulate("truss", FOUR | change | other, save=names)
        error = max(np.abs(run[name] - one[name]).max() / np.ptp(one[name]) for name in names)
        id = f"DEP-four-{way}-{'mesh' if 'elements' in reference else 'method'}"
        validate(id, f"four unequal tethers, {way}", reference, "lag and tips / range", error, 1e-5)


@pytest.mark.nightly
@pytest.mark.parametrize("out_of_plane", [False, True])
def test_libration_while_a_tether_is_reeled_in(out_of_plane):
    """About its steady angle in orbit, sin(2 theta) = -4 k/3 with k = growth/W, a light tether that is
    reeled in swings as d'' + 2 k W d' + s W^2 d = 0 with s = 3 cos(2 theta) in the plane and 1 + 3
    cos(theta)^2 out of it: the amplitude grows as exp(|k| W t), though the equations have no term that
    drives it. The swing to 1e-3 of its size, which allows an exponent wrong by 1e-3 of a third."""
    k, rate, start = -0.2, 1e-3, 1000.0
    theta = 0.5 * np.arcsin(-4.0 * k / 3.0)
    stiffness = 1.0 + 3.0 * np.cos(theta) ** 2 if out_of_plane else 3.0 * np.cos(2.0 * theta)
    turning = np.sqrt(stiffness - k**2)
    small = 1e-4
    turned, beyond = (0.0, small) if out_of_plane else (small, 0.0)

    def tip(turned, beyond):
        angle = theta + turned
        along = np.cos(beyond) * np.array([np.cos(angle), np.sin(angle), 0.0])
        along = along + np.array([0.0, 0.0, np.sin(beyond)])
        scene = esail.Scene(
            chain=esail.Chain(
                rods=1, mass=1e-5, length=1500.0, area=1e-6, youngs_modulus=1e10, tip_mass=10.0,
                axial_damping_time=0.5,
            ),
            deployment=esail.ChainDeployment(start_length=start, law="exponential", growth=k * rate),
            initial=esail.ChainInitial(
                rod_vector=(start * along).tolist(), rod_rate=(k * rate * start * along).tolist()
            ),
            orbit=esail.Orbit(mean_motion=rate),
            integrator=esail.Integrator(t_end=5000.0, tolerance=1e-13),
            output=esail.Output(interval=100.0),
        )  # fmt: skip
        run = esail.simulate(scene)
        x, y, z = run["joint_position"][:, -1].T
        return SimpleNamespace(time=run.time, plane=np.arctan2(y, x), beyond=np.arctan2(z, np.hypot(x, y)))

    steady, moved = tip(0.0, 0.0), tip(turned, beyond)
    swing = (moved.beyond - steady.beyond) if out_of_plane else (moved.plane - steady.plane)
    tau = rate * steady.time
    growth = np.exp(-k * tau)
    exact = small * growth * (np.cos(turning * tau) + k / turning * np.sin(turning * tau))
    assert np.abs(swing - exact).max() < 1e-3 * small * growth[-1]
