"""Winches whose motors hold a tension (`elements/winch.py`): the length of every tether is an unknown."""

import dataclasses
import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from esail_jax import iteration_matrix
from esail_jax.array_types import Array
from esail_jax.elements.winch import Winches
from esail_jax.numerics import structured
from esail_jax.numerics.lines_in_time import LinesInTime
from esail_jax.physics import WinchLaw
from esail_jax.scenes.loading import load_scene
from esail_jax.scenes.structure import split
from esail_jax.steppers import kinks
from esail_jax.steppers.consistent import consistent_motion
from esail_jax.steppers.results import RESULTS
from esail_jax.steppers.transposable import Transposable
from support.bits import check_same, esail_run
from support.derivatives import check_both_modes
from support.payout import lagrangian as payout_lagrangian
from support.quick import build_jitted, jit
from support.winch_sail import CALM, LIGHT, TABLE, UNEQUAL, WITHOUT_TABLE


class HoldRate(WinchLaw):
    """A motor that holds a rate [m/s], with a gain [N s/m] and a torque [N]."""

    rate: Array
    gain: Array
    torque: Array

    def tension(self, measurements):
        return self.torque + self.gain * (measurements.payout_rate - self.rate)


class Constant(WinchLaw):
    """A constant tension [N] of every motor."""

    newtons: Array

    def tension(self, measurements):
        return self.newtons


def random_motion(name):
    """A system, and an arbitrary state of its tethers and lengths with the hub at rest."""
    system, q, v, *_ = build_jitted(*split(load_scene(name, CALM)))
    rng = np.random.default_rng(3)
    scale = np.array([1.0, 1e-2]).reshape(2, 1, 1, 1)[: system.tethers.coefs]
    move = np.ones((system.tethers.elements + 1, 1))
    move[0] = 0.0

    def moved(x, base):
        return x._replace(
            tether=base.tether + scale * move * rng.normal(size=base.tether.shape),
            reel=base.reel + rng.normal(size=2),
        )

    rest = jax.tree.map(jnp.zeros_like, q)
    return system, jnp.asarray(11.0), moved(q, q), moved(v, rest), moved(v, rest)._replace(hub=rest.hub)


@pytest.mark.parametrize("name", ["baseline", "truss"])
def test_rows_of_lengths_are_those_of_lagrange(name):
    """d/dt dT/dl' - d(T - U)/dl + F = 0 of deployed and stored tether, drum and motor, by automatic
    differentiation of the energies: (m_d + rho (L - l)) l'^2/2 is the part of the drum. To 1e-12 of the
    inertia of the drums."""
    system, time, q, v, vdot = random_motion(name)
    system = dataclasses.replace(system, dissipations=())

    @jit
    def both(q, v, vdot):
        now = system.at(time, q, v, vdot)
        reels, payout = now.reels, now.payout

        def lagrangian(length, rate, tether, moving):
            density = reels.tethers.line_density
            drum = 0.5 * (payout.drum + density * (payout.total - length)) * rate**2
            return (payout_lagrangian(reels, length, rate, tether, moving) + drum).sum()

        def momentum(*at):
            return jax.grad(lagrangian, 1)(*at)

        at = q.reel, v.reel, q.tether, v.tether
        expected = jax.jvp(momentum, at, (v.reel, vdot.reel, v.tether, vdot.tether))[1]
        expected = expected - jax.grad(lagrangian, 0)(*at) + jnp.array([0.0824, 0.1068])
        residual, _ = system.residual(time, q, v, vdot, system.no_multipliers())
        return residual.forces.reel, expected

    found, expected = both(q, v, vdot)
    assert np.abs(found - expected).max() < 1e-12 * 4.0


@pytest.mark.parametrize("name", ["baseline", "truss"])
def test_accelerations_solve_the_equations(name):
    """Those of a state with wind solve all rows at once; lengths are coupled to the nodes of their tether
    in both directions. The row of a length to 1e-12 of its motor's tension, those of nodes to 1e-12 of the
    largest. Forces and powers that come with the accelerations are those of the rows."""
    system, q, v, *_ = build_jitted(*split(load_scene(name, UNEQUAL | TABLE)))
    v = v._replace(reel=v.reel + jnp.array([0.4, -0.3]))

    @jit
    def solved(q, v):
        motion = consistent_motion(system, jnp.asarray(3.0), q, v)
        residual, power = system.residual(jnp.asarray(3.0), q, v, motion.vdot, motion.lam)
        return motion.vdot, residual.forces, (motion.forces, motion.power), (residual.forces, power)

    vdot, rows, *with_motion = solved(q, v)
    for found, expected in zip(*map(jax.tree.leaves, with_motion), strict=True):
        assert np.abs(found - expected).max() < 1e-11 * np.abs(rows.tether).max()
    assert np.abs(with_motion[0][1].winch) > 1e-3
    assert np.abs(vdot.reel).min() > 1e-4
    assert np.abs(rows.reel).max() < 1e-12
    assert np.abs(rows.tether[0, :, 1:]).max() < 1e-12 * np.abs(rows.tether[0, :, 0]).max()


@pytest.mark.parametrize("law", ["table", "tension"])
def test_an_impulse_of_a_kink_changes_velocities_as_the_load_does(law):
    """What a second derivative adds at a kink of the thrust: the velocities, of the lengths too, change by
    an impulse [N s/m] along the tethers as the accelerations do by a load that is stronger [N/m]."""
    on_off = {"voltage.law": "on-off", "voltage.on": 1.0, "voltage.off": 9.0, "voltage.rise_time": 1.0}
    motor = {key: x for key, x in UNEQUAL.items() if key not in ("deployment.law", "deployment.drum_mass")}
    table = motor | {"deployment.time": [0.0, 25.0], "deployment.rate": [0.0, 0.4]}
    scene = table if law == "table" else UNEQUAL | TABLE
    system, q, v, *_ = build_jitted(*split(load_scene("truss", scene | on_off)))
    time, impulse = jnp.asarray(3.0), jnp.array([3e-7, -2e-7])
    coned = q._replace(tether=q.tether.at[0, 0].add(jnp.array([0.0, 3.0, 5.0])[:, None]))

    @jit
    def both(q, v):
        def accelerations(added):
            return consistent_motion(system.with_added_strength({0: added}), time, q, v).vdot

        changed, _ = kinks.response(system, time, q, v, (impulse,))
        return changed, jax.tree.map(jnp.subtract, accelerations(impulse), accelerations(0.0 * impulse))

    changed, expected = both(coned, v)
    assert (law == "tension") == (changed.reel is not None)
    for x, y in zip(*map(jax.tree.leaves, (changed, expected)), strict=True):
        assert np.abs(y).max() > 1e-9 and np.abs(x - y).max() < 1e-6 * np.abs(y).max()


def test_rows_of_several_states_are_those_of_each():
    """Two states at two instants, on an orbit with the tide and relative wind: rows and powers of both at
    once are those of each alone, to 1e-12 of the largest."""
    orbit = {"orbit.position_au": [0.9, 0.1, 0.2], "orbit.velocity": [1e3, 2e4, 3e3]}
    scene = load_scene("truss", UNEQUAL | TABLE | orbit | {"initial.heliocentric_position_au": None})
    system, q, v, *_ = build_jitted(*split(scene))
    rng = np.random.default_rng(6)

    def pair(x, size):
        return jax.tree.map(lambda a: jnp.stack([a + size * rng.normal(size=a.shape) for _ in range(2)]), x)

    times, rest = jnp.array([3.0, 11.0]), jax.tree.map(jnp.zeros_like, q)
    q, v, vdot = pair(q, 1e-3), pair(v, 1e-2), pair(rest, 1e-1)
    lam = jax.tree.map(lambda x: jnp.stack([x, x]), system.no_multipliers())

    @jit
    def both(q, v, vdot):
        each = jax.vmap(lambda t, *x: system.residual(t, *x))(times, q, v, vdot, lam)
        rows, power = system.residuals(times, q, v, vdot, lam)
        return (rows.forces, power), (each[0].forces, each[1])

    for found, expected in zip(*map(jax.tree.leaves, both(q, v, vdot)), strict=True):
        assert np.abs(found - expected).max() < 1e-12 * np.abs(expected).max()


def test_rows_have_the_same_derivative_in_both_senses():
    """y . (J x) = (J^T y) . x for the derivative J of all rows by lengths, rates and their accelerations,
    forward of the system and backward of what reverse mode takes in its place, to 1e-12 of the sum of all
    parts."""
    system, time, *motion = random_motion("truss")
    rng = np.random.default_rng(9)
    lam = system.no_multipliers()

    def rows(of, reels):
        moved = (x._replace(reel=reel) for x, reel in zip(motion, reels, strict=True))
        return of.residual(time, *moved, lam)[0].forces

    at = tuple(x.reel for x in motion)
    x = jax.tree.map(lambda a: jnp.asarray(rng.normal(size=a.shape)), at)

    @jit
    def both(x):
        forward = jax.jvp(lambda reels: rows(system, reels), (at,), (x,))[1]
        y = jax.tree.map(lambda a: jnp.cos(jnp.arange(a.size)).reshape(a.shape), forward)
        backward = jax.vjp(lambda reels: rows(Transposable.of(system), reels), at)[1](y)[0]
        parts = jax.tree.map(lambda a, b: a * b, forward, y)
        return parts, jax.tree.map(lambda a, b: a * b, backward, x)

    there, back = (np.concatenate([np.ravel(a) for a in jax.tree.leaves(parts)]) for parts in both(x))
    assert abs(there.sum() - back.sum()) < 1e-12 * np.abs(there).sum()
    assert np.abs(back).min() > 0.0


def test_the_iteration_matrix_is_the_derivative_of_the_rows():
    """In a turning frame, where no hub joins the tethers: solving M + s K + s c C for the derivative of the
    residual along a random change of lengths and nodes gives that change, to 1e-9 of it."""
    frame = {"hub": None, "initial.sailing_angle_deg": None}
    built = build_jitted(
        *split(load_scene("truss", CALM | frame | {"hub.density": None, "hub.height": None}))
    )
    system, time, s, c = built.system, jnp.asarray(11.0), 0.3, 0.2
    rng = np.random.default_rng(1)
    nodes = jnp.asarray(rng.normal(size=built.q.tether.shape)).at[:, :, 0].set(0.0)
    change = built.q._replace(tether=nodes, reel=jnp.asarray(rng.normal(size=2)))
    v = built.v._replace(reel=jnp.array([0.3, -0.2]))

    @jit
    def solved(q, v, change):
        lam, rest = system.no_multipliers(), jax.tree.map(jnp.zeros_like, q)

        def rows(step):
            moved = q.axpy(s * step, change), v.axpy(s * c * step, change), rest.axpy(step, change)
            return system.residual(time, *moved, lam)[0].forces

        expected = jax.jvp(rows, (jnp.zeros(()),), (jnp.ones(()),))[1]
        matrix = iteration_matrix.tangent(system, time, q, v, lam, jnp.asarray(s), jnp.asarray(c))
        rhs = iteration_matrix.to_vector(system, expected, lam)
        solution = structured.solve(matrix, structured.factor(matrix), rhs)
        return iteration_matrix.from_vector(system, solution)[0]

    found = solved(built.q, v, change)
    assert np.abs(found.reel - change.reel).max() < 1e-9
    assert np.abs(found.tether - change.tether).max() < 1e-9


@pytest.mark.nightly
@pytest.mark.parametrize("name", ["baseline", "truss"])
def test_energy_and_momenta_are_constant(name, validate):
    """With constant motors and no damping, the sum of the energy of the sail and of (m_d + rho (L - l))
    l'^2/2 + F l is constant, to 1e-8 of the work of the winches; so are both momenta, and the balance with
    the work of the winches closes."""
    constant = {"deployment.tension": [[0.1, 0.12], [0.1, 0.12]], "integrator.tolerance": 1e-12}
    run = esail.simulate(name, LIGHT | constant)
    tethers = load_scene(name, LIGHT).tethers
    length, rate = run["deployed_length"], run["payout_rate"]
    inertia = np.array([3.0, 4.0]) + tethers.density * tethers.area * (1000.0 - length)
    motors = (0.5 * inertia * rate**2 + np.array([0.1, 0.12]) * length).sum(1)
    total = run["kinetic_energy"] + run["elastic_energy"] + motors
    work = np.abs(run["winch_work"]).max()
    case = f"winches with constant tension ({name})"
    validate(
        f"WIN-{name}",
        case,
        "work of the winches",
        "change of the energy over it",
        np.ptp(total) / work,
        1e-8,
    )
    assert np.abs(run["energy_balance_error"]).max() < 1e-8 * work
    about = run["total_angular_momentum_I"]
    turned = max(np.abs(x - x[0]).max() for x in (run["angular_momentum_I"], about))
    assert turned < 1e-9 * np.abs(run["angular_momentum_I"]).max()
    drift = np.abs(run["total_momentum_I"] - run["total_momentum_I"][0]).max()
    assert drift < 1e-8 * 0.6 * 0.06 * 60.0


@pytest.mark.nightly
def test_a_law_of_ones_own_is_added_to_the_table():
    """A constant law gives the same motion as a table with its numbers, to the tolerance of the iterations,
    and half of the table and half of the law do, too."""
    flat = {"deployment.time": [0.0, 25.0], "deployment.tension": [[0.1, 0.12], [0.1, 0.12]]}
    half = flat | {"deployment.tension": [[0.05, 0.06], [0.05, 0.06]]}
    names = ["deployed_length", "payout_rate", "winch_tension"]
    table = esail.simulate("truss", CALM | flat, save=names)
    law = esail.simulate("truss", WITHOUT_TABLE, terms=[Constant(jnp.array([0.1, 0.12]))], save=names)
    both = esail.simulate("truss", CALM | half, terms=[Constant(jnp.array([0.05, 0.06]))], save=names)
    for name in names:
        for other in (law, both):
            assert np.abs(other[name] - table[name]).max() < 1e-6 * np.abs(table[name]).max()


def test_a_tension_goes_on_beyond_its_segment():
    """Within a segment of a run it is the straight line of that segment, on either side of its ends."""
    table = LinesInTime.undivided(jnp.array([0.0, 25.0, 50.0]), jnp.array([[0.1], [0.2], [0.6]]))
    one = jnp.ones(1)
    part = Winches(9.0 * one, one, one, table).in_segment(jnp.asarray(0.0), jnp.asarray(25.0)).tension
    assert np.allclose(part.at(jnp.asarray(30.0)), 0.22, rtol=1e-12)
    assert np.allclose(table.at(jnp.asarray(30.0)), 0.28, rtol=1e-12)


@pytest.mark.nightly
def test_a_motor_holds_a_rate():
    """A stiff gain holds the rate to torque over gain; the law sees length, rate and tension."""
    seen = []

    class Watched(HoldRate):
        def tension(self, measurements):
            seen.append([measurements.deployed_length, measurements.root_tension])
            return super().tension(measurements)

    law = Watched(jnp.asarray(0.2), jnp.asarray(2000.0), jnp.array([0.1, 0.12]))
    run = esail.simulate("truss", WITHOUT_TABLE, terms=[law], save=["payout_rate", "deployed_length"])
    assert np.allclose(run["payout_rate"][-1], 0.2, atol=1e-4)
    assert np.allclose(run["deployed_length"][-1], np.array([50.0, 60.0]) + 0.2 * 60.0, atol=0.01)
    assert all(x is not None and x.shape[-1] == 2 for pair in seen for x in pair)


def test_the_measured_tension_is_that_of_what_is_deployed():
    """A law reads the stress of r_s: with table and law it is the tension of a sail of the deployed length,
    m w^2 (r + l) of a light tether, to a per cent."""
    scene = load_scene("truss", CALM | {"deployment.start_length": 55.0})
    system, q, v, *_ = build_jitted(*split(scene))
    measured = jit(lambda q, v: system.all_measurements(jnp.zeros(()), q, v))(q, v)
    radius = scene.hub.radius
    assert np.allclose(measured.root_tension, np.array([0.5, 0.6]) * 0.06**2 * (55.0 + radius), rtol=1e-2)
    assert np.allclose(measured.deployed_length, 55.0) and not measured.payout_rate.any()


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("change", "method", "words"),
    [
        ({"tethers.length": 70.0, "deployment.tension": [[0.0, 0.0], [0.0, 0.0]]}, {}, "of 3 to 70 m"),
        ({"deployment.tension": [[0.0, 0.0], [0.0, 0.0]], "tethers.length": 70.0},
         {"integrator.method": "generalized-alpha", "integrator.step": 0.5}, "of 3 to 70 m"),
        ({"deployment.tension": [[1.0, 0.0], [1.0, 0.0]], "initial.spin_rate": 0.002}, {}, "tether 1 has"),
    ],
)  # fmt: skip
def test_a_run_ends_with_its_tether(change, method, words):
    """Paid out to its end, or reeled in to a twentieth of the start: the run ends there with a message, and
    the rows before it are kept, all of them of lengths in between."""
    run = esail.simulate("truss", CALM | change | method, throw=False)
    assert run.result == RESULTS.tether_ended
    assert "A tether was paid out to its end, or reeled in." in run.stats["message"]
    assert words in run.stats["message"]
    last = float(re.search(r"has ([0-9.]+) m", run.stats["message"])[1])
    total = change.get("tethers.length", 1000.0)
    assert min(abs(last - end) for end in (total, 2.5, 3.0)) < 0.02
    lengths = run["deployed_length"]
    known = np.isfinite(lengths).all(1)
    assert 2 < known.sum() < len(known) and not known[known.sum() :].any()
    assert (lengths[known] < total).all() and (lengths[known] > np.array([2.5, 3.0])).all()


class Limit(WinchLaw):
    """A motor that pulls harder beyond a length [m]: at once, or over a distance [m]."""

    beyond: Array
    over: Array

    def tension(self, measurements):
        past = measurements.deployed_length - self.beyond
        smooth = jax.nn.sigmoid(past / jnp.where(self.over > 0.0, self.over, 1.0))
        return 0.1 + 0.02 * jnp.where(self.over > 0.0, smooth, past > 0.0)


@pytest.mark.nightly
def test_a_tension_that_jumps_is_said_and_has_no_derivative():
    """A derivative would lack that of the instant. Rounded off it is right, to 1e-6; beyond the lengths of
    the run nothing jumps."""
    short = WITHOUT_TABLE | {"integrator.t_end": 30.0, "output.interval": 10.0}

    def last(spin, beyond, over=0.0):
        law = Limit(jnp.asarray(beyond), jnp.asarray(over))
        given = short | {"initial.spin_rate": spin, "integrator.tolerance": 1e-11}
        return esail.simulate("truss", given, terms=[law], max_steps=4000)

    def length(*given):
        return last(*given)["deployed_length"][-1].sum()

    assert "A law of your own jumps within steps, by up to 17 %" in last(0.06, 61.0).stats["message"]
    with pytest.raises(esail.SimulationError, match="A law of your own jumps"):
        jax.grad(length)(0.06, 61.0)
    for beyond, over in ((61.0, 0.5), (900.0, 0.0)):
        assert last(0.06, beyond, over).stats["message"] == ""
        quotient = (length(0.06 + 1e-6, beyond, over) - length(0.06 - 1e-6, beyond, over)) / 2e-6
        assert jax.grad(length)(0.06, beyond, over) == pytest.approx(quotient, rel=1e-6)


@pytest.mark.nightly
def test_the_mirror_image_is_paid_out_alike():
    """With the other sense of the spin the lengths and the lag, which is counted in that sense, are the
    same, to 1e-8 of their ranges: the tolerance of the iterations."""
    names = ["deployed_length", "lagging_angle"]
    one, other = (
        esail.simulate("truss", CALM | {"initial.spin_rate": spin}, save=names) for spin in (0.06, -0.06)
    )
    for name in names:
        assert np.abs(one[name] - other[name]).max() < 1e-8 * np.ptp(one[name])


@pytest.mark.nightly
def test_other_methods_and_meshes_agree():
    """Four unequal tethers with wind: against generalized-alpha and twice the elements, lengths and tips to
    1e-5 of their ranges."""
    four = UNEQUAL | {
        "tethers.count": 4,
        "remote_units.mass": [0.5, 0.6, 0.55, 0.5],
        "deployment.start_length": [50.0, 60.0, 55.0, 52.0],
        "deployment.drum_mass": 3.0,
        "deployment.time": [0.0, 25.0],
        "deployment.tension": [0.1, 0.08],
    }
    how = {"integrator.method": "generalized-alpha", "integrator.step": 0.02}
    runs = [esail.simulate("truss", four | x) for x in ({}, how, {"tethers.elements": 4})]
    for other in runs[1:]:
        for name in ("deployed_length", "payout_rate", "lagging_angle"):
            error = np.abs(other[name] - runs[0][name]).max() / np.ptp(runs[0][name])
            assert error < 1e-5, name


@pytest.mark.nightly
def test_a_run_is_resumed_bit_for_bit(tmp_path):
    """Beyond the knot of the tensions."""
    from esail_jax.scenes.toml_text import to_toml

    scene, whole, parts = (tmp_path / name for name in ("a.toml", "whole.h5", "parts.h5"))
    scene.write_text(to_toml(load_scene("truss", CALM)))
    assert esail_run(scene, whole) == 0
    assert esail_run(scene, parts, "--t-end", "30") == 0
    assert esail_run(scene, parts, "--resume") == 0
    check_same(parts, whole)


@pytest.mark.nightly
@pytest.mark.parametrize("method", ["collocation", "generalized-alpha"])
def test_derivatives(method):
    """By start length, tension, drum mass and spin: reverse mode against forward mode, and forward mode
    against differences, to 1e-6 of the range. The tethers are a hundred times softer than others, so that
    their tension, which is rounded at 1e-16 of E A, has more digits."""
    how = {"tolerance": 1e-12} if method == "collocation" else {"step": 0.25}
    short = {"integrator.t_end": 20.0, "output.interval": 4.0, "integrator.method": method}
    short |= {f"integrator.{key}": x for key, x in how.items()} | {"deployment.time": [0.0, 10.0]}
    short |= {"tethers.youngs_modulus": 1e9}
    numbers = {
        "deployment.start_length": ([50.0, 60.0], [1e-3, -1e-3]),
        "deployment.tension": ([[0.1, 0.12], [0.08, 0.1]], [[1e-4, 2e-4], [-1e-4, 1e-4]]),
        "deployment.drum_mass": ([3.0, 4.0], [1e-3, 1e-3]),
        "initial.spin_rate": (0.06, 1e-6),
    }

    def signals(given):
        run = esail.simulate("truss", CALM | short | given, max_steps=4000)
        return {name: run[name] for name in ("deployed_length", "payout_rate", "winch_tension")}

    for (key, name), error in check_both_modes(signals, numbers).items():
        assert error < 1e-6, (key, name)


@pytest.mark.nightly
def test_second_derivatives_and_batches():
    """The derivative of a gradient by the tension is that of differences of the gradient, to 1e-6; a batch
    of gradients is their sequence."""
    short = {"integrator.t_end": 10.0, "output.interval": 5.0, "integrator.tolerance": 1e-12}

    def last(newtons):
        tension = {"deployment.tension": newtons * jnp.ones((2, 2))}
        run = esail.simulate("truss", CALM | short | tension, save=["deployed_length"], max_steps=2000)
        return run["deployed_length"][-1].sum()

    slope = esail.jit(jax.grad(last))
    second = esail.jit(jax.grad(jax.grad(last)))(0.1)
    assert abs(second - (slope(0.101) - slope(0.099)) / 2e-3) < 1e-6 * abs(second)
    batch = esail.jit(jax.vmap(jax.grad(last)))(jnp.array([0.08, 0.1]))
    assert np.allclose(batch, [slope(0.08), slope(0.1)], rtol=1e-10)


@pytest.mark.parametrize(
    ("change", "terms", "message"),
    [
        ({"deployment.tension": None}, (), r"`deployment.tension` must be given, or a WinchLaw among"),
        ({"deployment.time": None}, (), r"`deployment.time` must be given, or a WinchLaw among"),
        ({"deployment.time": None}, (Constant(jnp.ones(2)),), r"`deployment.time` must be given"),
        ({"deployment.drum_mass": None}, (), r"`deployment.drum_mass` must be given with the law tension"),
        ({"deployment.drum_mass": 0.0}, (), r"`deployment.drum_mass` must be positive"),
        ({"deployment.drum_mass": [1.0, 2.0, 3.0]}, (), r"`deployment.drum_mass` must"),
        ({"deployment.rate": [0.0, 1.0]}, (), r"`deployment.rate` must be left out with the law tension"),
        ({"deployment.tension": [0.1, 0.1, 0.1]}, (), r"`deployment.tension` must have as many rows"),
        ({"deployment.tension": [[0.1], [0.1]]}, (), r"`deployment.tension` must have rows of 2"),
        ({"deployment.start_length": 1001.0}, (), r"`deployment.start_length` must be between"),
        ({}, (Constant(jnp.ones(3)),), r"terms\[0\] \(Constant\).tension` must return numbers of newtons"),
    ],
)  # fmt: skip
def test_what_is_refused(change, terms, message):
    """In one line that names the key, before anything is computed."""
    with pytest.raises(esail.SceneError, match=message):
        esail.simulate("truss", CALM | change, terms=terms)


@pytest.mark.parametrize("change", [{}, {"deployment.start_length": 900.0, "deployment.law": "exponential",
                                         "deployment.growth": 0.0}])  # fmt: skip
def test_a_winch_law_needs_winches(change):
    with pytest.raises(esail.SceneError, match=r"must be no WinchLaw without the law \"tension\""):
        esail.simulate("truss", {"tethers.count": 2} | change, terms=[Constant(jnp.ones(2))])
