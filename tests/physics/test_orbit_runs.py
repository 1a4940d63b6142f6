"""A small sail on its orbit in every kind of run: all methods, resumed runs, batches, ensembles, and
a
design of a sail that changes its temperatures."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.design import Design, Variable, objectives
from esail_jax.ensembles import simulate_members
from esail_jax.scenes.structure import split
from esail_jax.scenes.toml_text import to_toml
from esail_jax.steppers.consistent import consistent_motion
from support.near_sun import NEAR_SUN, SCENE
from support.quick import build_jitted, jit
from support.whole_runs import check_resumed_bits

VELOCITY = np.array(NEAR_SUN["orbit.velocity"])

ORBITS = {
    "orbit.position_au": np.array([[0.008, 0.006, 0.001], [0.0085, 0.0055, 0.001], [0.008, 0.006, 0.003]]),
    "orbit.velocity": VELOCITY + np.array([[0.0, 0.0, 0.0], [4e3, -2e3, 1e3], [-1e4, 5e3, 2e4]]),
}
"""The orbits of three members."""

NAMES = ("tip_position_I", "hub_position_I", "heliocentric_velocity", "orbital_elements", "thrust_O")

FIXED = ("generalized-alpha", "energy-momentum")


def settings_of(method):
    """The keys of a method. Fixed steps of 0.1 s: 80 between two saved instants."""
    return {"integrator.method": method} | ({"integrator.step": 0.1} if method in FIXED else {})


@pytest.fixture(scope="module")
def members():
    """A run of each of the three orbits."""
    return [esail.simulate(SCENE, {key: x[k].tolist() for key, x in ORBITS.items()}) for k in range(3)]


# ---- methods of integration -------------------------------------------------------------------------


@pytest.mark.nightly
@pytest.mark.parametrize("method", FIXED)
def test_fixed_steps_have_order_two_on_an_orbit(method, members):
    """The differences of tips and hub from the run of collocation fall by 3.5 to 4.5 if the step is halved
    (order two: 4), so that tide and wind are taken at the instants at which each method needs them. The
    error of collocation, 5e-10 of the length per step, is far below them."""
    found = []
    for step, stride in ((0.1, 1), (0.05, 2)):
        # The same number of steps between saved instants, so that both runs share one program.
        settings = {"integrator.method": method, "integrator.step": step, "output.interval": 80 * step}
        run = esail.simulate(SCENE, settings)
        found.append([np.abs(run[x][::stride] - members[0][x]).max() for x in NAMES[:2]])
    ratios = np.divide(*found)
    assert ((ratios > 3.5) & (ratios < 4.5)).all(), ratios


@pytest.mark.nightly
def test_consistent_accelerations():
    """Accelerations and multipliers that belong to a state on an orbit solve the equations of motion of
    that instant at every node that a hub does not hold. The tension is 0.6 N; 1e-12 N is its rounding."""
    system, q, v, _ = build_jitted(*split(SCENE))
    time = jnp.asarray(50.0)

    @jit
    def left(system, q, v):
        motion = consistent_motion(system, time, q, v)
        return system.residual(time, q, v, motion.vdot, motion.lam)[0].forces.tether[0, :, 1:]

    assert np.abs(left(system, q, v)).max() < 1e-12


@pytest.mark.nightly
@pytest.mark.parametrize("method", ["collocation", *FIXED])
def test_resumed_run_is_bit_identical(method, tmp_path):
    """A run on an orbit that is continued twice from its file is that of one run, bit for bit."""
    file = tmp_path / "scene.toml"
    file.write_text(to_toml(SCENE.replace(settings_of(method))))
    check_resumed_bits(file, (24, 32, 80), tmp_path)


# ---- many runs --------------------------------------------------------------------------------------


def check_members(found, members):
    """Signals of members agree with those of single runs to rounding: 1e-14 of their magnitude. The hub
    moves by centimetres only; its position is compared to 1e-14 of its base points' distance, 1 m."""
    for name in NAMES:
        for k, run in enumerate(members):
            error = np.abs(np.asarray(found[name][k]) - run[name]).max()
            size = 1.0 if name == "hub_position_I" else np.abs(run[name]).max()
            assert error < 1e-14 * size, (name, k, error)
    assert np.ptp(found["tip_position_I"], axis=0).max() > 10.0  # m: the orbits matter


@pytest.mark.nightly
def test_batch_of_orbits_equals_single_runs(members):
    """`jax.vmap` of `simulate` over position and velocity of the orbit gives the runs of each orbit."""

    def signals(orbit):
        run = esail.simulate(SCENE, orbit, save=NAMES)
        return {name: run[name] for name in NAMES}

    check_members(jit(jax.vmap(signals))(jax.tree.map(jnp.asarray, ORBITS)), members)


@pytest.mark.nightly
def test_ensemble_of_orbits(members):
    """Members of an ensemble with orbits of their own, whose eccentricities differ, are the single runs."""
    ensemble = simulate_members(SCENE, ORBITS, NAMES)
    assert ensemble.complete.all()
    check_members(ensemble, members)
    assert np.ptp(ensemble["orbital_elements"][:, 0, 1]) > 0.01


# ---- designs ----------------------------------------------------------------------------------------

MODULATED = {"voltage.law": "harmonic", "voltage.cosine": [0.05], "voltage.sine": [0.02]}
MODULATED |= {"voltage.maximum": 40e3, "integrator.tolerance": 1e-12}
AMPLITUDES = {"voltage.cosine": Variable([0.0], 0.1), "voltage.sine": Variable([0.0], 0.1)}
WARM = {"thermal.expansion": 2.3e-5, "thermal.reference_temperature": 300.0}
SERIES = WARM | {"thermal.time": [13.0, 52.0]}
SERIES |= {"thermal.temperature": [[310.0, 300.0, 290.0], [200.0, 210.0, 250.0]]}


@pytest.mark.nightly
def test_a_design_on_an_orbit(monkeypatch):
    """An iteration of a design of a heated sail on an orbit lowers its objective. The gradient by the
    amplitudes of the voltage, the velocity of the orbit, and the temperatures and their instants agrees
    with difference quotients of fourth order, one for each of these variables.

    The differences are those of runs on the host with a tolerance of 1e-12. They choose other steps at
    every value, which changes the objective by 1e-10, and the smallest of the derivatives is 1e-3.
    Measured: 2e-7."""
    monkeypatch.setattr("esail_jax.design.problem.jit", jit)
    variables = AMPLITUDES | {
        "orbit.velocity": Variable(VELOCITY.tolist(), 1e4),
        "thermal.temperature": Variable(SERIES["thermal.temperature"], 20.0),
        "thermal.time": Variable(SERIES["thermal.time"], 2.0),
    }
    scene = SCENE.replace(MODULATED | SERIES)
    design = Design(scene, {"mean-torque": 1.0, "lagging": 1.0}, variables)
    begin, after = design.optimise(1)
    value, slope = (x[0] for x in design.optimiser.evaluate(jnp.asarray(begin.x)))
    assert abs(value / begin.value[0] - 1.0) < 1e-12
    first = 0
    for key, variable in variables.items():
        size = np.size(variable.start)
        along = np.zeros(len(design.start))
        along[first : first + size] = np.linspace(1.0, 0.5, size)
        first += size
        e = 0.05
        ends = [float(design.objective_at(design.start + s * e * along)) for s in (-2, -1, 1, 2)]
        quotient = (8.0 * (ends[2] - ends[1]) - (ends[3] - ends[0])) / (12.0 * e)
        assert abs(quotient) > 1e-4, key
        assert abs(slope @ along / quotient - 1.0) < 1e-5, (key, slope @ along, quotient)
    assert after.value[0] < begin.value[0]
    run = esail.simulate(design.scene_at(after.x[0]))
    found = objectives.values(run, ("mean-torque", "lagging"))
    total = sum(found[x] / design.objective.reference_values[x] for x in found)
    assert abs(total / after.value[0] - 1.0) < 1e-6
