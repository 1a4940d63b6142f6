"""Tethers that are paid out and reeled in (`elements/deployment.py`)."""

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.coordinates import Coordinates
from esail_jax.elements.deployment import ExponentialPayout, RateTable, Reels
from esail_jax.elements.tether import TetherBatch
from esail_jax.observables.entry import elastic_energy, thermal_energy
from esail_jax.scenes.loading import load_scene
from esail_jax.scenes.structure import split
from support.bits import check_same, esail_run
from support.derivatives import check_both_modes
from support.payout import dissipation
from support.payout import lagrangian as payout_lagrangian
from support.quick import build_jitted, jit

FREE = {
    "tethers.count": 2,
    "tethers.length": 1000.0,
    "tethers.elements": 2,
    "tethers.bending_damping_time": None,
    "initial.spin_rate": 0.05,
    "deployment.start_length": [400.0, 450.0],
    "deployment.time": [0.0, 20.0, 40.0],
    "deployment.rate": [0.0, 2.0, 1.0],
    "integrator.t_end": 60.0,
    "output.interval": 10.0,
}
"""Two unequal tethers whose rates rise and fall."""

CALM = FREE | {"solar_wind": None, "voltage": None}
NOTHING_LOST = CALM | {"tethers.axial_damping_time": None}


def table(total):
    """Lengths of two tethers, with other rates."""
    times, rates = jnp.array([-1.0, 2.0, 5.0]), jnp.array([[1.0, 2.0], [4.0, -3.0], [5.0, 5.0]])
    return RateTable.undivided(total, jnp.array([0.4, 0.5]) * total, times, rates)


@functools.cache
def random_motion(name):
    """A system of cables or trusses with a table of rates, and an arbitrary state of its tethers."""
    built = build_jitted(*split(load_scene(name, FREE | {"solar_wind": None, "voltage": None})))
    total = built.system.payout.total
    system = dataclasses.replace(built.system, payout=table(total))
    rng = np.random.default_rng(58)
    scale = np.array([1.0, 1e-3]).reshape(2, 1, 1, 1)[: system.tethers.coefs]
    q, v, vdot = (
        x + scale * rng.normal(size=x.shape)
        for x in (built.q.tether, 0.0 * built.q.tether, 0.0 * built.q.tether)
    )
    return system, jnp.asarray(1.3), q, v, vdot


@pytest.mark.parametrize("time", [0.0, 1.3, 3.7, 9.0])
def test_rates_are_derivatives_of_lengths(time):
    """Of both laws, before, between and after the knots; the length at t = 0 is that of the start."""
    total = jnp.array([900.0, 1000.0])
    start = jnp.array([0.4, 0.5]) * total
    for payout in (table(total), ExponentialPayout(total, start, jnp.array([0.01, -0.02]))):
        now, at = payout.at(jnp.asarray(time)), jnp.asarray(time)
        rate = jax.jvp(lambda t, x=payout: x.at(t).length, (at,), (jnp.ones(()),))[1]
        acceleration = jax.jvp(lambda t, x=payout: x.at(t).rate, (at,), (jnp.ones(()),))[1]
        assert np.allclose(now.rate, rate, rtol=1e-13)
        assert np.allclose(now.acceleration, acceleration, rtol=1e-12)
        assert np.allclose(payout.at(jnp.zeros(())).length, start, rtol=1e-15)


def test_a_segment_goes_on_beyond_its_knots():
    """Within a segment the rate is the straight line of that segment, on either side of its ends, and a
    batch of instants has the numbers of each."""
    whole = table(jnp.array([900.0, 1000.0]))
    part = whole.in_segment(jnp.asarray(2.0), jnp.asarray(5.0))
    inside, beyond = jnp.asarray(3.0), jnp.asarray(5.5)
    assert np.array_equal(part.at(inside).length, whole.at(inside).length)
    now, before = part.at(beyond), part.at(jnp.asarray(4.5))
    assert np.allclose(now.rate - before.rate, now.acceleration, rtol=1e-12)
    assert not np.allclose(now.rate, whole.at(beyond).rate)
    several = part.at(jnp.array([[3.0], [5.5]]))
    assert np.array_equal(several.length, jnp.stack([part.at(inside).length, now.length]))


@pytest.mark.parametrize("name", ["baseline", "truss"])
def test_rows_are_those_of_lagrange(name):
    """d/dt dT/dv - d(T - U)/dq of deployed and stored material, by automatic differentiation of the
    energies, equals the rows that are assembled from the forces at points: elasticity of the deployed part,
    convection, and the masses of the instant. So are the momenta dT/dv. To 1e-12 of the largest row:
    rounding."""
    system, time, q, v, vdot = random_motion(name)
    system = dataclasses.replace(system, dissipations=())

    @jit
    def both(q, v, vdot):
        now = system.at(time)
        reels, lengths = now.reels, (now.reels.now.length, now.reels.now.rate)

        def lagrangian(length, rate, q, v):
            return payout_lagrangian(reels, length, rate, q, v).sum()

        def momentum(length, rate, q, v):
            return jax.grad(lagrangian, 3)(length, rate, q, v)

        motion = (*lengths, q, v), (reels.now.rate, reels.now.acceleration, v, vdot)
        expected = jax.jvp(momentum, *motion)[1] - jax.grad(lagrangian, 2)(*lengths, q, v)
        rows = now.tether_forces(time, q, v, vdot)[0]
        momenta = now.tethers.inertia(v) + reels.drift(q)
        return rows, expected, momenta, momentum(*lengths, q, v)

    rows, expected, momenta, exact = (np.asarray(x) for x in both(q, v, vdot))
    size = np.abs(expected).max(axis=(1, 2, 3), keepdims=True)
    assert (np.abs(rows - expected) / size).max() < 1e-12
    assert np.abs(momenta - exact).max() < 1e-13 * np.abs(exact).max()


@pytest.mark.parametrize("name", ["baseline", "truss"])
def test_rows_of_a_tether_at_rest_and_all_deployed_are_those_without_reels(name):
    """To 1e-12 of the largest, with damping."""
    system, time, q, v, vdot = random_motion(name)
    total = system.payout.total
    still = RateTable.undivided(total, total, jnp.array([0.0, 9.0]), jnp.zeros((2, 2)))

    @jit
    def rows(q, v, vdot):
        at_rest = dataclasses.replace(system, payout=still).at(time)
        plain = dataclasses.replace(system, payout=None)
        return tuple(x.tether_forces(time, q, v, vdot)[0] for x in (at_rest, plain))

    with_reels, without = (np.asarray(x) for x in rows(q, v, vdot))
    size = np.abs(without).max(axis=(1, 2, 3), keepdims=True)
    assert (np.abs(with_reels - without) / size).max() < 1e-12


def test_bending_is_that_of_the_deployed_part():
    """A deployed tether has the energies of a tether of its length in the same place, bent or not: those
    of r_s and r_ss. To 1e-12: rounding."""
    system, time, q, _, _ = random_motion("baseline")
    now = system.at(time)
    share = now.reels.now.length / now.reels.payout.total
    short = TetherBatch(
        element_length=system.tethers.element_length * share,
        line_density=system.tethers.line_density,
        tip_mass=system.tethers.tip_mass,
        elements=system.tethers.elements,
        kind="cable",
        fields_used=system.tethers.fields_used,
    )
    bent = q * jnp.array([1.0, 3.0]).reshape(2, 1, 1, 1)

    @jit
    def energies(q):
        fields, x = short.interpolate(q.at[1].divide(share)), now.reels.tethers.interpolate(q)
        deployed = [(now.reels.per_tether(term.density(x))).sum() for term in now.acting_energies]
        weights = short.weights
        whole = [
            (jnp.tensordot(weights, term.density(fields), 1) * short.lengths).sum()
            for term in system.energies
        ]
        return jnp.stack(deployed), jnp.stack(whole)

    deployed, whole = energies(bent)
    assert len(whole) == 2 and np.all(np.abs(deployed - whole) < 1e-12 * np.abs(whole))


@pytest.mark.parametrize("name", ["baseline", "truss"])
def test_a_taut_tether_that_is_paid_out_dissipates_nothing(name):
    """Stretched uniformly and steadily paid out, its mesh points move at the rate c x and its material is
    not strained: the damping has no stress. With mesh points at rest the same term is at work."""
    system, time, q, _, _ = random_motion(name)
    now = system.at(time)
    x = jnp.arange(now.tethers.elements + 1.0)[:, None] * now.tethers.element_length
    share, c = now.reels.now.length / now.reels.payout.total, now.reels.now.rate / now.reels.now.length
    along = jnp.stack([1.1 * share * x, 1.1 * share * jnp.ones_like(x)][: now.tethers.coefs])
    q = jnp.zeros_like(q).at[:, 0].set(along)

    steady, at_rest = jit(lambda v: [dissipation(now, q, x) for x in v])((c * q, 0.0 * q))
    assert abs(steady) < 1e-25 * at_rest


def energy(system, time, q, v):
    """T + U [J] of the tethers with what is wound up."""
    now = system.at(time)
    moving = 0.5 * (v * now.tethers.inertia(v)).sum() + now.reels.energy_of_motion(q, v)
    return moving + elastic_energy(system, time, Coordinates(q, None))


@pytest.mark.parametrize("name", ["baseline", "truss"])
def test_the_winch_balances_the_energy(name):
    """d(T + U)/dt = power of the rows - sum l' F_w - dissipated power, for arbitrary motions with
    damping."""
    system, time, q, v, vdot = random_motion(name)
    system = dataclasses.replace(system, hub=None)

    @jit
    def balance(q, v, vdot):
        now = system.at(time)
        rows, power = now.tether_forces(time, q, v, vdot)
        forces = now.winch_forces(time, q, v, vdot, None)
        change = jax.jvp(functools.partial(energy, system), (time, q, v), (jnp.ones(()), v, vdot))[1]
        supplied = (rows * v).sum() - (now.reels.now.rate * forces).sum() - power.dissipated
        return change, supplied, power.dissipated

    change, supplied, dissipated = balance(q, v, vdot)
    assert dissipated > 0.0 and abs(change - supplied) < 1e-11 * abs(change)


def test_heated_tethers_balance_their_energy():
    """d(T + U)/dt = power of the rows + power of heating - sum l' F_w, where heating is the power of the
    thermal stress plus the rate of the thermal energy; for an arbitrary motion while the temperature
    changes."""
    heat = {"thermal.expansion": 1e-2, "thermal.reference_temperature": 0.0, "thermal.time": [0.0, 4.0]}
    heat |= {"thermal.temperature": [[1.0, 3.0], [9.0, 0.5]]}
    _, time, q, v, vdot = random_motion("truss")
    built = build_jitted(*split(load_scene("truss", NOTHING_LOST | heat)))
    system = dataclasses.replace(built.system, hub=None, payout=table(built.system.payout.total))

    @jit
    def balance(q, v, vdot):
        now, one = system.at(time), jnp.ones(())
        rows, power = now.tether_forces(time, q, v, vdot)
        forces = now.winch_forces(time, q, v, vdot, None)
        change = jax.jvp(functools.partial(energy, system), (time, q, v), (one, v, vdot))[1]

        def stored(time, q):
            return thermal_energy(system, time, Coordinates(q, None))

        heating = power.external + jax.jvp(stored, (time, q), (one, v))[1]
        return change, (rows * v).sum() - (now.reels.now.rate * forces).sum() + heating, heating

    change, supplied, heating = balance(q, v, vdot)
    assert abs(heating) > 1e-6 * abs(change) and abs(change - supplied) < 1e-11 * abs(change)


@pytest.mark.parametrize("name", ["baseline", "truss"])
def test_the_force_of_a_winch_is_lagranges_equation_of_the_length(name):
    """-(d/dt dT/dl' - d(T - U)/dl) by automatic differentiation, without and with elasticity, to 1e-12 of
    the largest part."""
    system, time, q, v, vdot = random_motion(name)
    elastic = dataclasses.replace(system, dissipations=()).at(time)

    @jit
    def both(q, v, vdot):
        def of(now):
            reels, lengths = now.reels, now.reels.now

            def lagrangian(length, rate, q, v):
                return payout_lagrangian(reels, length, rate, q, v).sum()

            def momentum(*x):
                return jax.grad(lagrangian, 1)(*x)

            state, rates = (*lengths[:2], q, v), (*lengths[1:], v, vdot)
            expected = jax.grad(lagrangian, 0)(*state) - jax.jvp(momentum, state, rates)[1]
            return now.winch_forces(time, q, v, vdot, None), expected

        limp = dataclasses.replace(elastic, energies=())
        limp = dataclasses.replace(limp, reels=dataclasses.replace(elastic.reels, energies=()))
        return of(limp), of(elastic)

    limp, taut = both(q, v, vdot)
    assert np.abs(taut[0]).max() > 100.0 * np.abs(limp[0]).max()
    for force, expected in (limp, taut):
        assert np.abs(force - expected).max() < 1e-12 * np.abs(expected).max()


@pytest.mark.parametrize("name", ["baseline", "truss"])
def test_states_at_one_instant_have_their_own_winch_forces(name):
    """Several motions of tethers of the same lengths, as in the map of a turn: the forces are those of each
    motion alone, with elasticity and damping, to 1e-12 of the largest."""
    system, time, q, v, vdot = random_motion(name)
    now, parts = system.at(time), np.array([1.0, 1.0 + 1e-4, 1.0 - 2e-4])

    @jit
    def both(q, v, vdot):
        each = [now.winch_forces(time, x * q, x * v, x * vdot, None) for x in parts]
        together = (jnp.stack([x * y for x in parts], axis=2) for y in (q, v, vdot))
        return jnp.stack(each), now.winch_forces(time, *together, None)

    each, together = both(q, v, vdot)
    assert np.ptp(each, axis=0).min() > 1e-6 * np.abs(each).max()
    assert np.abs(each - together).max() < 1e-12 * np.abs(each).max()


@pytest.mark.parametrize("name", ["baseline", "truss"])
def test_the_force_of_a_winch_at_rest(name):
    """Of a uniform static stretch e it is T (1 + e) - W, not T: the length that is reeled in carries
    energy."""
    system, time, q, _, _ = random_motion(name)
    now = system.at(time)
    e, share = 1e-3, now.reels.now.length / now.reels.payout.total
    x = jnp.arange(now.tethers.elements + 1.0)[:, None] * now.tethers.element_length
    along = jnp.stack([(1.0 + e) * share * x, (1.0 + e) * share * jnp.ones_like(x)][: now.tethers.coefs])
    q = jnp.zeros_like(q).at[:, 0].set(along)
    r = now.reels
    rest = r.now._replace(rate=0.0 * share, acceleration=0.0 * share)
    reels = Reels.of(r.tethers, r.payout, rest, r.energies, r.dissipations)
    at_rest = dataclasses.replace(now, reels=reels)
    force = jit(lambda q: at_rest.winch_forces(time, q, 0.0 * q, 0.0 * q, None))(q)
    stiffness, strain = now.tethers.of_tethers(now.energies[0].stiffness)[0], e + 0.5 * e**2
    tension = stiffness * strain * (1.0 + e)
    assert np.allclose(force, tension * (1.0 + e) - 0.5 * stiffness * strain**2, rtol=1e-10)


@pytest.mark.nightly
@pytest.mark.parametrize("name", ["baseline", "truss"])
def test_momenta_and_energy_of_a_free_sail(name, validate):
    """Hub and unequal tethers without loads: both momenta are constant, the stored tether included, to 1e-8
    of that of a remote unit and 1e-9 of the largest angular momentum; the energy changes by the work of the
    winches, to 1e-6 of it."""
    run = esail.simulate(name, NOTHING_LOST | {"output.interval": 1.0})
    part = 1.5 * 0.05 * 450.0
    drift = np.abs(run["total_momentum_I"] - run["total_momentum_I"][0]).max() / part
    about = run["total_angular_momentum_I"]
    turned = max(np.abs(x - x[0]).max() for x in (run["angular_momentum_I"], about))
    missing = np.abs(run["energy_balance_error"]).max() / np.abs(run["winch_work"][-1])
    assert drift < 1e-8 and turned < 1e-9 * np.abs(run["angular_momentum_I"]).max()
    case = f"payout of a free sail ({name})"
    validate(f"DEP-{name}", case, "work of the winches", "error of the energy over it", missing, 1e-6)
    assert np.allclose(run["deployed_length"][-1], [470.0, 520.0], rtol=1e-12)
    integral = np.trapezoid(run["winch_power"].sum(1), run.time)
    assert abs(integral / run["winch_work"][-1] - 1.0) < 2e-3  # the trapezoidal rule over intervals of 1 s


@pytest.mark.nightly
def test_heated_tethers_are_paid_out():
    """With a temperature that rises and falls the energy changes by the work of winches and heating, to
    1e-6 of the larger one; so it does in an orbit of temperatures with a table whose knots are others than
    those of the rates. By expansion and temperature: forward against reverse mode, and differences."""
    heat = {
        "thermal.expansion": 2e-5, "thermal.reference_temperature": 250.0,
        "thermal.time": [0.0, 15.0, 35.0],
        "thermal.temperature": [[300.0, 250.0], [200.0, 240.0], [330.0, 250.0]],
    }  # fmt: skip
    run = esail.simulate("truss", NOTHING_LOST | heat)
    work = np.abs(run["external_work"]).max() + np.abs(run["winch_work"]).max()
    assert np.abs(run["external_work"]).max() > 1e-6 * work
    assert np.abs(run["energy_balance_error"]).max() < 1e-6 * work
    numbers = {"thermal.expansion": (2e-5, 1e-7)}

    def signals(given):
        part = NOTHING_LOST | heat | {"integrator.t_end": 24.0, "output.interval": 12.0}
        run = esail.simulate("truss", part | given)
        return {name: run[name][1:] for name in ("winch_work", "external_work", "winch_tension")}

    for (key, name), error in check_both_modes(signals, numbers).items():
        assert error < 1e-5, (key, name)


@pytest.mark.nightly
def test_a_table_without_rates_is_the_scene_without_it():
    """All of the tether deployed and none moved: the same sail to the tolerance of runs, whose steps end at
    other instants, and the same rows to rounding."""
    whole = {key: x for key, x in FREE.items() if not key.startswith("deployment")}
    rest = {"deployment.start_length": 1000.0, "deployment.time": [0.0, 9.0], "deployment.rate": [0.0, 0.0]}
    runs = [esail.simulate("truss", whole | x) for x in ({}, rest)]
    for name in ("tip_position_I", "hub_position_I", "reaction_B", "kinetic_energy", "thrust_O"):
        a, b = (np.asarray(run[name]) for run in runs)
        assert np.abs(a - b).max() < 1e-7 * np.abs(a).max(), name


@pytest.mark.nightly
def test_spin_down():
    """Slowly paid out, tethers stay radial and the spin follows from the angular momentum H:
    w = H/[J + sum (m (r + l)^2 + rho ((r + l)^3 - r^3)/3 + rho (L - l) r^2)], to 1e-3."""
    slow = {
        "deployment.time": [0.0, 50.0],
        "deployment.rate": [0.0, 0.04],
        "deployment.start_length": 400.0,
    }
    run = esail.simulate("truss", CALM | slow | {"integrator.t_end": 200.0, "output.interval": 50.0})
    scene = load_scene("truss", CALM)
    hub, tethers, m = scene.hub, scene.tethers, scene.remote_units.mass
    rho, r, total = tethers.density * tethers.area, hub.radius, tethers.length
    spinning = 0.5 * hub.density * np.pi * r**4 * hub.height

    def inertia(length):
        deployed = rho * ((r + length) ** 3 - r**3) / 3.0
        return spinning + 2.0 * (m * (r + length) ** 2 + deployed + rho * (total - length) * r**2)

    lengths = run["deployed_length"][:, 0]
    expected = 0.05 * inertia(lengths[0]) / inertia(lengths)
    assert np.abs(run["lagging_angle"]).max() < np.deg2rad(1.0)
    assert np.abs(run["spin_rate"][:, 1] / expected - 1.0).max() < 1e-3


@pytest.mark.nightly
@pytest.mark.parametrize("method", ["collocation", "generalized-alpha"])
def test_derivatives_by_the_numbers_of_a_deployment(method):
    """By start length and rates: forward against reverse mode, and against differences of runs."""
    how = {"integrator.method": method}
    how |= {"integrator.tolerance": 1e-12} if method == "collocation" else {"integrator.step": 0.02}
    short = FREE | {"integrator.t_end": 24.0, "output.interval": 12.0} | how

    numbers = {
        "deployment.start_length": ([400.0, 450.0], [0.3, 0.3]),
        "deployment.rate": ([0.0, 2.0, 1.0], [0.0, 1e-2, 5e-3]),
    }

    def signals(given):
        run = esail.simulate("truss", short | given)
        names = ("lagging_angle", "winch_work", "winch_tension", "hub_position_I")
        return {name: run[name][1:] for name in names}

    for (key, name), error in check_both_modes(signals, numbers).items():
        assert error < 1e-6, (key, name)


@pytest.mark.nightly
def test_derivatives_of_short_tethers_that_become_long():
    """The factors of a block of steps are those of its lengths: with those of another instant, by which the
    length is off by more than the strain, the derivative had no digit. By the spin rate, against
    differences, over fifty steps and more than one block."""
    short = CALM | {
        "tethers.length": 200.0, "tethers.density": 76530.0, "remote_units.mass": 0.05,
        "deployment.start_length": 10.0, "deployment.time": [0.0, 300.0], "deployment.rate": [0.0, 0.01],
        "integrator.t_end": 600.0, "output.interval": 300.0,
    }  # fmt: skip

    @jit
    def spin(w):
        return esail.simulate("baseline", short | {"initial.spin_rate": w})["spin_rate"][1:, 0]

    moved = jax.jvp(spin, (0.3,), (1.0,))[1]
    by_differences = (spin(0.3 + 1e-5) - spin(0.3 - 1e-5)) / 2e-5
    assert np.abs(moved - by_differences).max() < 1e-5 * np.abs(by_differences).max()


@pytest.mark.nightly
def test_a_run_is_resumed_bit_for_bit(tmp_path):
    """Within a deployment, beyond a knot of the rates."""
    from esail_jax.scenes.toml_text import to_toml

    scene, whole, parts = (tmp_path / name for name in ("a.toml", "whole.h5", "parts.h5"))
    scene.write_text(to_toml(load_scene("truss", FREE)))
    assert esail_run(scene, whole) == 0
    assert esail_run(scene, parts, "--t-end", "31") == 0
    assert esail_run(scene, parts, "--resume") == 0
    check_same(parts, whole)


@pytest.mark.nightly
def test_the_mirror_image():
    """With the opposite spin, the motion is mirrored: the angles behind and the work are the same."""
    runs = [esail.simulate("truss", NOTHING_LOST | {"initial.spin_rate": x}) for x in (0.05, -0.05)]
    for name in ("winch_work", "winch_tension", "lagging_angle", "coning_angle"):
        a, b = (np.sort(np.asarray(run[name]).reshape(len(run.time), -1)) for run in runs)
        assert np.abs(a - b).max() < 1e-6 * np.abs(a).max() + 1e-9, name


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"deployment.rate": None}, r"`deployment.rate` must be given with the law table"),
        ({"deployment.growth": 0.1}, r"`deployment.growth` must be left out with the law table"),
        ({"deployment.law": "tension"}, r"`deployment.rate` must be left out with the law tension, but is"),
        ({"deployment.start_length": 1100.0}, r"`deployment.start_length` must be between a two-"),
        ({"deployment.start_length": 4.0}, r"`deployment.start_length` must be between a two-"),
        ({"deployment.rate": [0.0, 20.0, 40.0]}, r"`deployment.rate` must leave tether 1 a length"),
        ({"deployment.rate": [0.0, -40.0, 60.0]}, r"`deployment.rate` must leave tether 1 .* at 2"),
        ({"deployment.rate": [-90.0, 90.0, 0.0]}, r"`deployment.rate` must leave tether 1 .* at 10 s"),
        ({"deployment.rate": [0.0, 1.0]}, r"`deployment.rate` must have as many rows as"),
        ({"deployment.rate": [[0.0] * 3] * 3}, r"`deployment.rate` must have rows of 2"),
        ({"tethers.root": "clamped"}, r'`tethers.root` must be "pinned" with \[deployment\]'),
        ({"tethers.bending_damping_time": 0.1}, r"`tethers.bending_damping_time` must be left out with"),
        ({"integrator.method": "energy-momentum"}, r"`integrator.method` must be one of the others with"),
        ({"initial.elongation": "paper"}, r'`initial.elongation` must be "steady" with \[deployment\]'),
    ],
)  # fmt: skip
def test_what_cannot_be_deployed_is_refused(given, message):
    with pytest.raises(esail.SceneError, match=message):
        load_scene("baseline", FREE | given)


def test_a_traced_instant_of_the_rates_is_refused():
    """What it changes in the motion, a jump of l'', is not in the derivatives."""
    with pytest.raises(esail.SceneError, match=r"`deployment.time` must be plain numbers, but is traced"):
        jax.eval_shape(
            lambda x: load_scene("truss", FREE | {"deployment.time": x}).deployment.time, jnp.arange(3.0)
        )
