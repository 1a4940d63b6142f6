"""Runs of rod chains: comparison with independent integrations, order, derivatives and energy."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from support.quick import jit
from support.rod_tips import STEEL_TIP, tip

TIPS = {
    (0, -1): (-13.3243418694279, -11.6864782929539, 0.0),
    (0, 1): (12.268613404679987, -14.527410090125797, 0.0),
    (1, 0): (-1.162451577436536, -3.329601126392827, 0.0),
    (0, 0, 1): (-3.830578240461789, -19.208620023784937, 4.843783318641380),
    (0, 0, -1): (-3.830578240461789, -19.208620023784937, -4.843783318641380),
}
"""Tip [m] of [MW]'s experiment 1 at 5 s, by direction of gravity. Gauss collocation of order 16 in long
double and a program in quadruple precision agree on it (`experiments/mw_rods/reference.py`)."""


def weight(direction):
    return {"gravity.acceleration": [9.81 * x for x in (*direction, 0.0)[:3]]}


@pytest.mark.nightly
def test_experiment_1_against_quadruple_precision(validate):
    """The tip agrees to 8 digits of 20 m for every direction of gravity but -X, where slack rods move
    chaotically.

    The method's tolerance is 1e-9 of a rod; with gravity along -Y a change of the start grows 1e5 times.
    """
    worst = 0.0
    for direction, exact in TIPS.items():
        run = esail.simulate("hanging-chain", weight(direction) | {"output.interval": 1.0})
        worst = max(worst, np.abs(tip(run)[-1] - exact).max())
        assert np.abs(run["energy_error"]).max() < 1e-9
    validate(
        "ROD-5", "[MW] experiment 1, 5 directions", "Gauss, quadruple precision", "tip at 5 s",
        worst, 2e-8, "m",
    )  # fmt: skip


@pytest.mark.nightly
def test_energy_of_experiment_1_at_the_papers_step(validate):
    """The energy error is at most the 6e-6 that [MW] find with ode45's pair at 1e-4 s.

    [MW] do not print the direction of gravity.
    """
    settings = {"integrator.method": "dopri5", "integrator.step": 1e-4}
    largest = 0.0
    for direction in (*TIPS, (-1, 0)):
        run = esail.simulate("hanging-chain", weight(direction) | settings)
        energy = run["kinetic_energy"] + run["elastic_energy"] + run["potential_energy"]
        error = np.abs(run["energy_error"]).max()
        if abs(energy[0]) > 1.0:  # Eq. 31 divides by the initial energy, which may be near zero
            error = max(error, np.abs(energy / energy[0] - 1.0).max())
        largest = max(largest, error)
    validate(
        "ROD-6", "[MW] experiment 1, 6 directions, step 1e-4 s", "[MW] Eq. 31", "energy error",
        largest, 6e-6,
    )  # fmt: skip


@pytest.mark.nightly
def test_experiment_2_against_quadruple_precision(validate):
    run = esail.simulate("steel-chain")
    validate(
        "ROD-7", "[MW] experiment 2", "Gauss, quadruple precision", "tip at 1 s",
        np.abs(tip(run)[-1] - STEEL_TIP).max(), 1e-10, "m",
    )  # fmt: skip


SHORT = {"chain.rods": 3, "integrator.t_end": 1.0, "output.interval": 0.5}


@pytest.mark.nightly
@pytest.mark.parametrize(
    "method, order", [("tsit5", 5), ("dopri5", 5), ("dopri8", 8), ("generalized-alpha", 2)]
)
def test_order_of_the_method(method, order):
    """The largest error along the path has the method's order in the step, to a fifth of the order.

    The rods are soft (35 rad/s), so that the steps resolve the axial vibration. The tolerance allows for
    terms of higher order: where the eighth-order method reaches rounding, its steps are as long as the
    fastest vibration.
    """
    soft = SHORT | {"chain.youngs_modulus": 1e7, "output.interval": 0.05}
    exact = tip(esail.simulate("hanging-chain", soft | {"integrator.tolerance": 1e-13}))
    size = {5: 5e-3, 8: 4e-2, 2: 1e-3}[order]
    extra = {"integrator.spectral_radius": 0.8} if order == 2 else {}
    errors = []
    for step in (size, size / 2):
        settings = {"integrator.method": method, "integrator.step": step} | extra
        run = esail.simulate("hanging-chain", soft | settings)
        assert run.steps >= round(1.0 / step)
        errors.append(np.abs(tip(run) - exact).max())
    assert abs(np.log2(errors[0] / errors[1]) - order) < 0.2 * order, errors


def test_saved_instants_change_nothing():
    """The steps do not depend on the saved instants, and instants within steps are as accurate as their
    ends."""
    few = esail.simulate("hanging-chain", SHORT | {"output.interval": 1.0})
    many = esail.simulate("hanging-chain", SHORT | {"output.interval": 1.0 / 512})
    assert few.steps == many.steps
    np.testing.assert_array_equal(tip(few)[-1], tip(many)[-1])
    assert np.abs(many["energy_error"]).max() < 1e-8


def traced(values):
    settings = {
        "chain.mass": jnp.array([0.1, 0.2, 0.3]) * values[0],
        "chain.youngs_modulus": 1e9 * values[1],
        "chain.length": values[2],
        "initial.rod_rate": jnp.array([1.0, 0.0, 0.2]) * values[3],
        "initial.rod_vector": jnp.array([0.1, -1.0, 0.0]) + values[4],
        "gravity.acceleration": jnp.array([0.0, -9.81, 0.0]) * values[5],
        "chain.tip_mass": 0.1 * values[6],
    }
    return esail.simulate(
        "hanging-chain", SHORT | {"integrator.method": "tsit5", "integrator.tolerance": 1e-12} | settings
    )


@pytest.mark.nightly
def test_gradients():
    """The derivative of the tip's final position is the same in reverse and forward mode, to rounding.

    The variables are masses, modulus, length, start, gravity and tip mass. Extrapolated central
    differences agree to 1e-6: every run chooses its own steps, so that their error is the tolerance
    divided by the change.
    """

    def place(values):
        joints = traced(values)["joint_position"]
        return joints[-1, -1] @ jnp.array([1.0, 2.0, 3.0]) + joints[1, 2, 1]

    at = jnp.array([1.0, 1.0, 1.0, 1.0, 0.0, 1.0, 1.0])
    value, reverse = jit(jax.value_and_grad(place))(at)
    forward = jit(jax.jacfwd(place))(at)
    assert np.isfinite(value)
    np.testing.assert_allclose(reverse, forward, rtol=1e-9, atol=1e-12)
    step, run = 1e-4, place  # concrete runs use the host's loop
    for i, unit in enumerate(np.eye(7)):
        wide, near = ((run(at + h * unit) - run(at - h * unit)) / (2.0 * h) for h in (2.0 * step, step))
        np.testing.assert_allclose(reverse[i], (4.0 * near - wide) / 3.0, rtol=1e-6, atol=1e-6)


@pytest.mark.nightly
def test_a_traced_run_is_the_concrete_one_and_vmap_a_loop():
    values = jnp.array([[1.0, 1.0, 1.0, 1.0, 0.0, 1.0, 1.0], [1.3, 0.8, 1.0, 2.0, 0.1, 0.5, 2.0]])
    many = jit(jax.vmap(lambda v: traced(v)["joint_position"]))(values)
    one = jit(lambda v: traced(v)["joint_position"])
    for found, value in zip(many, values, strict=True):
        alone = traced(value)  # concrete runs use the host's loop
        np.testing.assert_allclose(found, alone["joint_position"], rtol=0, atol=1e-12)
        np.testing.assert_allclose(one(value), alone["joint_position"], rtol=0, atol=1e-12)
    assert set(alone.observables) >= {"tension", "energy_error", "kinetic_energy"}


@pytest.mark.nightly
def test_loads_and_damping_of_the_sail_act_on_a_chain():
    """Coulomb thrust and axial damping act on a chain, and its energy balance closes.

    The implicit method agrees with the explicit one to second order.
    """
    settings = SHORT | {
        "integrator.t_end": 4.0, "output.interval": 1.0, "chain.axial_damping_time": 1e-2,
        "solar_wind.speed": 4e5, "solar_wind.number_density": 7.3e6,
        "solar_wind.cutoff_voltage": 1e3, "voltage.value": [2e7, 4e7, 1e7],
        "initial.heliocentric_position_au": [0.7, 0.7, 0.0],
    }  # fmt: skip
    explicit = esail.simulate("hanging-chain", settings)
    unloaded = esail.simulate("hanging-chain", settings | {"voltage.value": 0.0})
    assert np.linalg.norm(tip(explicit)[-1] - tip(unloaded)[-1]) > 1e-4
    scale = explicit["kinetic_energy"].max()
    assert np.abs(explicit["energy_balance_error"]).max() < 1e-8 * scale
    assert explicit["dissipated_energy"][-1] > 1e-6 * scale
    errors = []
    for step in (2e-3, 1e-3):
        method = {"integrator.method": "generalized-alpha", "integrator.step": step}
        implicit = esail.simulate("hanging-chain", settings | method)
        errors.append(np.abs(tip(implicit) - tip(explicit)).max())
        work = np.abs(implicit["external_work"] - explicit["external_work"]).max()
    assert errors[0] / errors[1] > 3.3 and errors[1] < 2e-3
    assert work < 1e-3 * np.abs(explicit["external_work"]).max()


@pytest.mark.nightly
def test_energy_of_a_bending_chain():
    """The energy of a clamped chain that swings from the horizontal includes the springs between the
    rods."""
    stiff = {"chain.bending": True, "chain.root": "clamped", "chain.second_moment": 1e-9}
    run = esail.simulate("hanging-chain", SHORT | stiff | {"initial.rod_vector": [1.0, 0.0, 0.0]})
    assert np.abs(run["energy_error"]).max() < 1e-8
    without = esail.simulate("hanging-chain", SHORT | {"initial.rod_vector": [1.0, 0.0, 0.0]})
    assert np.linalg.norm(tip(run)[-1] - tip(without)[-1]) > 0.1
    assert "hinges" in run.stats["terms"]
