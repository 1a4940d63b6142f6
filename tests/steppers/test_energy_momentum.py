"""Energy-momentum: conservation, energy balance, order, derivatives, resuming and refused input."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.elements.axial import AxialEnergy
from esail_jax.elements.bending import BendingEnergy
from esail_jax.point_fields import PointFields
from esail_jax.scenes.structure import split
from esail_jax.steppers.energy_momentum import Secant
from support.one_tether import integrate
from support.quick import build_jitted, jit
from support.soft_sail import SOFT, STEPS, orders, stepped
from support.whole_runs import check_going_on

METHOD = {"integrator.method": "energy-momentum"}
ZERO = jnp.zeros(())
PERIOD = 2.0 * np.pi / 4e-3
SMALL = METHOD | {"tethers.count": 3, "tethers.elements": 2, "integrator.step": PERIOD / 300}
FREE = {"tethers.axial_damping_time": None, "tethers.bending_damping_time": None}
"""Overrides that remove the damping; the built-in scene `voltage-off` has no load either."""

CONED = SMALL | FREE | {"initial.coning_angle_deg": 5.0}
"""Overrides for tethers that start on a cone and swing through the spin plane, by 0.3 rad peak to peak."""


# ---- discrete gradient --------------------------------------------------------------------------


def random_fields(straight):
    """Fields at the start and the end of a step with a large rotation and a stretch of some
    percent.

    The curvature is random; with `straight` it is zero at the start.
    """
    random = np.random.default_rng(1)
    turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
    r_x = np.array([1.02, 0.0, 0.0])[:, None] + 0.02 * random.normal(size=(3, 7))
    r_xx = random.normal(size=(3, 7))
    end = PointFields(None, jnp.asarray(turn @ (1.01 * r_x)), jnp.asarray(random.normal(size=(3, 7))))
    return PointFields(None, jnp.asarray(r_x), jnp.asarray(0.0 * r_xx if straight else r_xx)), end


def middle_of(start, end):
    return jax.tree.map(lambda a, b: 0.5 * (a + b), start, end)


ENERGIES = {
    "axial": AxialEnergy(jnp.full(1, 3.0), "green-lagrange"),
    "engineering": AxialEnergy(jnp.full(1, 3.0), "engineering"),
    "bending": BendingEnergy(jnp.full(1, 2.0)),
}


@jit
def gradient(term, at):
    """The gradient of the energy density."""
    return term.point_forces(ZERO, at, at)


def secant(term, start, at):
    """The discrete gradient of a step from `start`; `at` is the mean of start and end, or the
    start."""
    return Secant(term, start).point_forces(ZERO, at, at)


secant_quickly, slope_of_secant = jit(secant), jit(jax.jacfwd(secant, argnums=2))


@pytest.mark.parametrize("straight", [False, True])
@pytest.mark.parametrize("name", ENERGIES)
def test_discrete_gradient(name, straight):
    """The discrete gradient conserves energy and angular momentum, to rounding.

    Its work between two states is the change of energy, and it has no moment on the mean fields. Between
    equal states it is the gradient. Its own derivative is finite.
    """
    term, (start, end) = ENERGIES[name], random_fields(straight)
    mean = middle_of(start, end)
    force = secant_quickly(term, start, mean)
    pairs = [(f, *x) for f, *x in zip(force, start, end, mean, strict=True) if f is not None]
    work = sum((f * (b - a)).sum(0) for f, a, b, _ in pairs)
    assert np.allclose(work, term.density(end) - term.density(start), rtol=0, atol=1e-13)
    assert np.abs(sum(np.cross(x, f, axis=0) for f, _, _, x in pairs)).max() < 1e-13
    for a, b in zip(secant_quickly(term, start, start), gradient(term, start), strict=True):
        assert (a is None and b is None) or np.allclose(a, b, rtol=0, atol=1e-14)
    slope = slope_of_secant(term, start, start)
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(slope))


# ---- conservation -------------------------------------------------------------------------------


def kicked(overrides):
    """system, q and v of a free sail with random velocities (0.5 m/s) of all nodes but the
    roots."""
    model = build_jitted(*split(esail.load_scene("voltage-off", SMALL | FREE | overrides)))
    kick = 0.5 * np.random.default_rng(0).normal(size=model.v.tether[0, :, 1:].shape)
    tether = model.v.tether.at[0, :, 1:].add(kick)
    return model.system, model.q, model.v._replace(tether=tether)


def kept(system, q, v):
    """Energy [J], momentum [kg m/s] and angular momentum about the origin [kg m^2/s]."""
    momenta = system.momenta(v)
    kinetic = 0.5 * sum(jnp.vdot(x, p) for x, p in zip(*map(jax.tree.leaves, (v, momenta)), strict=True))
    fields = system.tethers.interpolate(q.tether)
    energy = kinetic + system.integrate(sum(term.density(fields) for term in system.energies))
    moment = jnp.cross(q.tether, momenta.tether, axis=1).sum((0, 2, 3))
    return energy, system.momentum(v), moment + jnp.cross(q.hub, momenta.hub).sum(0)


KINDS = {
    "pinned": {},
    "engineering": {"tethers.strain": "engineering"},
    "clamped": {"tethers.root": "clamped", "tethers.second_moment": 1e-8},
    "truss": {"tethers.element": "truss", "tethers.bending": False},
}


@pytest.mark.nightly
@pytest.mark.parametrize("kind", KINDS)
def test_free_sail_keeps_energy_and_momenta(kind, validate):
    """A free sail keeps energy and both momenta to 1e-12 and the constraints to 1e-10 m.

    The sail flaps over half a turn, in 160 steps.
    """
    system, q, v = kicked(KINDS[kind])
    _, q, v, _ = integrate("energy-momentum", system, q, v, PERIOD / 300, 160)
    found = jit(jax.vmap(lambda q, v: kept(system, q, v)))(q, v)
    case, reference = f"free sail that flaps, {kind}, energy-momentum", "conservation"
    for number, (name, x) in enumerate(zip(("energy", "momentum", "moment"), found, strict=True)):
        error = np.abs(x - x[0]).max() / np.linalg.norm(x[0])
        validate(f"EMM-{kind}-{number + 1}", case, reference, name, error, 1e-12)
    time = PERIOD / 300 * jnp.arange(161)
    constraints = jit(jax.vmap(system.constraints))(time, q)
    violation = max(float(jnp.abs(x).max()) for x in jax.tree.leaves(constraints))
    validate(f"EMM-{kind}-4", case, "constraint equations", "largest violation", violation, 1e-10, "m")
    assert np.ptp(system.tethers.element_length * q.tether[:, 0, 0, -1]) > 1.0  # the tethers moved


@pytest.mark.nightly
def test_energy_over_many_turns(validate):
    """A free sail keeps its energy over 300 turns of 300 steps, and over the first 30, without drift.

    Without drift the mean over the last third equals that over the first.
    """
    times = {"integrator.t_end": 300 * PERIOD, "output.interval": PERIOD / 3}
    run = esail.simulate("voltage-off", CONED | times)
    for periods, bound in ((30, 1e-11), (300, 1e-10)):
        energy = (run["kinetic_energy"] + run["elastic_energy"])[: 3 * periods + 1]
        change = np.abs(energy / energy[0] - 1.0)
        case = f"free sail that flaps, {periods} turns, energy-momentum"
        validate(f"EMM-{periods}", case, "conservation", "energy", change.max(), bound)
        third = len(energy) // 3
        drift = abs(np.mean(energy[-third:]) - np.mean(energy[:third])) / energy[0]
        validate(f"EMM-{periods}-drift", case, "conservation", "drift between thirds", drift, bound / 10)
        assert np.ptp(run["coning_angle"][: 3 * periods + 1]) > 0.1
    assert run.numerics["constraint_violation"].max() < 1e-10


# ---- balance, order -----------------------------------------------------------------------------


def driven(hub, settings):
    """A run of 80 s with wind and damping; the sail has a hub or is held by a turning frame."""
    times = {"integrator.t_end": 80.0, "integrator.step": 2.0, "output.interval": 10.0}
    scene = esail.load_scene("baseline", SMALL | {"tethers.axial_damping_time": 50.0} | times | settings)
    return esail.simulate(scene if hub else dataclasses.replace(scene, hub=None))


WEIGHT = {"gravity.acceleration": [1e-3, -2e-3, 5e-4]}
CLAMPED = {"tethers.root": "clamped", "tethers.second_moment": 1e-8}
CASES = {
    "hub": (True, {}),
    "clamped to a hub, gravity": (True, CLAMPED | WEIGHT),
    "turning frame, gravity": (False, WEIGHT),
    "clamped to a turning frame": (False, CLAMPED),
}


@pytest.mark.nightly
@pytest.mark.parametrize("case", CASES)
def test_energy_balance_closes(case, validate):
    """dE = W - D holds at the end of every step, to 1e-12 of the kinetic energy (rounding).

    The error is also less than 1e-6 of the dissipated energy.
    """
    run = driven(*CASES[case])
    error = np.abs(run["energy_balance_error"]).max() / run["kinetic_energy"].max()
    validate(f"EMM-{case}", f"driven, damped: {case}, energy-momentum", "dE = W - D",
             "balance / kinetic energy", error, 1e-12)  # fmt: skip
    assert run["dissipated_energy"][-1] > 1e6 * np.abs(run["energy_balance_error"]).max()
    assert run.numerics["constraint_violation"].max() < 1e-10


@pytest.mark.nightly
def test_second_order(validate):
    """The error falls by 2^(2.0 +- 0.1) at every halving of the step, as in `test_generalized_alpha.py`.

    The method's own multipliers alternate from step to step and are not compared; the reactions are those
    of the saved states.
    """
    settings = SOFT | METHOD
    runs = {h: esail.simulate("baseline", settings | stepped(h)) for h in (*STEPS, 0.2 / 64)}
    exact = runs.pop(0.2 / 64)
    for name in ("tip_position_I", "coning_angle", "angular_velocity_B", "reaction_B"):
        found = orders([np.abs(runs[h][name][-1] - exact[name][-1]).max() for h in STEPS])
        distance = np.abs(found - 2.0).max()
        case = "order of energy-momentum, soft sail"
        validate(f"EMM-order-{name}", case, "its own at h/64", f"{name}, distance from 2", distance, 0.1)


# ---- resuming ------------------------------------------------------------------------------------


SHORT = SMALL | {"integrator.step": 2.0, "integrator.t_end": 80.0, "output.interval": 40.0}


@pytest.mark.nightly
def test_a_longer_run_goes_on_bit_for_bit(tmp_path):
    """A run file that is continued to a later end is bit-identical to that of one run to that end."""
    check_going_on(SHORT | {"output.interval": 4.0}, 1700, 2600, tmp_path)


# ---- input --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("scene", "key", "value", "message"),
    [
        ("baseline", "integrator.spectral_radius", 0.5, "be left out without generalized-alpha"),
        ("baseline", "integrator.tolerance", 1e-9, "be left out with energy-momentum"),
        ("baseline", "integrator.step", -0.1, "be positive"),
        ("hanging-chain", "integrator.step", 0.1, "for a chain"),
    ],
)
def test_bad_input(scene, key, value, message):
    """Keys of other methods are refused, and so are chains."""
    with pytest.raises(esail.SceneError, match=message):
        esail.load_scene(scene, METHOD | {key: value})
