"""Chains that are paid out and reeled in (`elements/deployment.py`, `rod_chain.py`)."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.numerics.vectors import dot
from esail_jax.rod_chain import RodState, fastest_rate, turning_rate
from esail_jax.scenes.build import build_chain
from esail_jax.scenes.method_choice import rates
from esail_jax.scenes.structure import split
from support.bits import check_same, esail_run
from support.derivatives import check_both_modes
from support.payout import dissipation
from support.payout import lagrangian as payout_lagrangian
from support.quick import jit

RATE = 1e-3
"""Mean motion [rad/s] of the orbits here."""


def chain(lengths, anchor="fixed", **tables):
    """A scene of a chain in orbit; `tables` adds keys of its tables."""
    lengths = np.asarray(lengths, float)
    count, start = len(lengths), 0.4 * lengths.sum()
    spread = np.linspace(0.9, 1.1, count)[:, None] * lengths[:, None] * 0.4
    kinds = {
        "chain": esail.Chain(
            rods=count,
            mass=(0.02 * lengths).tolist(),
            length=lengths.tolist(),
            area=1e-6,
            youngs_modulus=1e6,
            tip_mass=3.0,
            anchor=anchor,
            axial_damping_time=tables.pop("damping", None),
            base_mass=50.0 if anchor == "free" else None,
        ),
        "deployment": esail.ChainDeployment(
            **tables.pop("deployment", {"start_length": start, "time": [0.0, 900.0], "rate": [0.0, 0.02]})
        ),
        "initial": esail.ChainInitial(rod_vector=(spread * [0.8, 0.6, 0.0]).tolist()),
        "orbit": esail.Orbit(mean_motion=RATE),
        "integrator": esail.Integrator(t_end=600.0),
        "output": esail.Output(interval=100.0),
    }
    return esail.Scene(**(kinds | tables))


@functools.cache
def random_motion(anchor):
    """A chain of unequal rods with damping, at an arbitrary state of its joints."""
    given = {"start_length": 30.0, "law": "exponential", "growth": 0.3}
    end = esail.Integrator(t_end=2.0)
    scene = chain(
        [20.0, 30.0, 40.0], anchor, damping=0.2, deployment=given, initial=start_of(12.0), integrator=end
    )
    built, state = build_chain(*split(scene))
    rng = np.random.default_rng(5)
    x, v = (jnp.asarray(a + rng.normal(size=a.shape)) for a in (state.x, state.v))
    return built, RodState(x, v, state.work)


def start_of(length):
    """The start of three rods, this long."""
    return esail.ChainInitial(rod_vector=[[length, 0.0, 0.0]] * 3)


@pytest.mark.parametrize("anchor", ["fixed", "free"])
def test_the_linear_solution_solves_lagranges_equations(anchor):
    """The accelerations of the solution in O(n) satisfy d/dt dT/dv - d(T - U)/dq = 0 of deployed and
    stored material at every joint that moves, with the Lagrangian of Hill's axes,
    V.V/2 + W . (r x V) + r.A r/2 per mass: convection, its Coriolis force and the tide on the reel
    included. To 1e-12 of the largest force."""
    model, state = random_motion(anchor)
    time = jnp.asarray(1.7)
    tide, turning = model.system.fields[0].matrices
    spin = jnp.array([0.0, 0.0, RATE])
    assert np.allclose(turning, 2.0 * np.cross(np.eye(3), spin).T)

    @jit
    def forces(state):
        found = model(time, state)
        system = model.system.at(time)
        reels, now = system.reels, system.reels.now
        (q, v), (_, vdot) = model.coordinates(state), model.coordinates(RodState(found.x, found.v, None))
        batch = reels.tethers

        def lagrangian(length, rate, q, v):
            share = length / reels.payout.total
            fields, rates = batch.interpolate_motion(q, v)
            u = reels.stretching.distance
            velocity = rates.r + batch.repeat_per_element(rate / share) * u * fields.r_x

            def frame(r, velocity):
                turned = jnp.tensordot(spin, jnp.cross(r, velocity, axis=0), 1)
                return turned + 0.5 * dot(r, jnp.tensordot(tide, r, 1))

            density = reels.density * batch.repeat_per_element(share) * frame(fields.r, velocity)
            stored = reels.density[0] * (reels.payout.total - length)
            base = stored if batch.base_mass is None else stored + batch.base_mass
            tip, root = (frame(q[0, :, k], v[0, :, k]) for k in (-1, 0))
            own = 0.0 if batch.base_mass is None else 0.5 * batch.base_mass * dot(v[0, :, 0], v[0, :, 0])
            rest = reels.per_tether(density) + batch.tip_mass * tip + base * root + own
            return (payout_lagrangian(reels, length, rate, q, v) + rest).sum()

        def momentum(length, rate, q, v):
            return jax.grad(lagrangian, 3)(length, rate, q, v)

        lengths = now.length, now.rate
        motion = (*lengths, q.tether, v.tether), (now.rate, now.acceleration, v.tether, vdot.tether)
        inertia = jax.jvp(momentum, *motion)[1]
        rows = inertia - jax.grad(lagrangian, 2)(*lengths, q.tether, v.tether)
        damping = jax.grad(lambda v: dissipation(system, q.tether, v))(v.tether)
        return rows + damping, inertia, system.residual(time, q, v, vdot, system.no_multipliers())[0].forces

    rows, inertia, residual = forces(state)
    size = np.abs(inertia).max()
    first = 0 if anchor == "free" else 1
    assert np.abs(rows[:, :, first:]).max() < 1e-12 * size
    assert np.abs(residual.tether[:, :, first:]).max() < 1e-12 * size


@pytest.mark.parametrize("anchor", ["fixed", "free"])
def test_a_field_does_work_on_all_of_the_motion(anchor):
    """The power of the tide is the sum of its force times the velocity V of the material, reel and end
    masses included; the Coriolis force has none, whatever part of V is the rate of mesh points."""
    model, state = random_motion(anchor)
    time = jnp.asarray(1.7)
    tide, _ = model.system.fields[0].matrices

    @jit
    def powers(state):
        system, (q, v) = model.system.at(time), model.coordinates(state)
        fields, rates = system.reels.tethers.interpolate_motion(q.tether, v.tether)
        velocity = system.reels.velocity(fields, rates)
        density = system.reels.density * system.reels.stretching.share
        whole = system.reels.per_tether(density * dot(jnp.tensordot(tide, fields.r, 1), velocity)).sum()
        for mass, node in ((system.tethers.tip_mass, -1), (system.tethers.base_mass, 0)):
            force = jnp.tensordot(tide, q.tether[0, :, node], 1)
            whole = whole + (mass * dot(force, v.tether[0, :, node])).sum()
        return system.field_power(time, q, v), whole

    found, expected = powers(state)
    assert np.allclose(found, expected, rtol=1e-12)


@pytest.mark.nightly
@pytest.mark.parametrize("growth", [0.3, -0.3])
def test_the_angle_of_an_exponential_deployment_in_orbit(growth):
    """A light tether that is paid out as exp(k W t) rests at sin(2 theta) = -4 k/3 from the vertical, on
    either side by the sign of k: to 1e-6 rad; the strain, 1e-6, begins at zero."""
    theta = 0.5 * np.arcsin(-4.0 * growth / 3.0)
    along = np.array([np.cos(theta), np.sin(theta), 0.0])
    given = {"start_length": 100.0, "law": "exponential", "growth": growth * RATE}
    start = esail.ChainInitial(
        rod_vector=(100.0 * along).tolist(), rod_rate=(growth * RATE * 100.0 * along).tolist()
    )
    light = esail.Chain(
        rods=1,
        mass=1e-5,
        length=400.0,
        area=1e-6,
        youngs_modulus=1e10,
        tip_mass=10.0,
        axial_damping_time=0.5,
    )
    run = esail.simulate(
        chain(
            [400.0],
            deployment=given,
            initial=start,
            chain=light,
            integrator=esail.Integrator(t_end=2000.0, tolerance=1e-13),
        )
    )
    tip = run["joint_position"][:, -1]
    angle = np.arctan2(tip[:, 1], tip[:, 0])
    assert np.abs(angle - theta).max() < 1e-6
    assert np.allclose(run["deployed_length"], 100.0 * np.exp(growth * RATE * run.time), rtol=1e-12)
    assert np.abs(run["energy_balance_error"]).max() < 1e-6 * np.abs(run["winch_work"][-1])
    assert np.sign(run["winch_work"][-1]) == -np.sign(growth)


def test_payout_is_no_turning():
    """A straight chain that is paid out fast does not turn faster than its orbit, and what it is at the end
    counts for the choice of its method: an implicit step is that of the orbit, a thousandth of a radian at
    twice its rate."""
    along = [-160.0 / 2, 0.0, 0.0]
    given = {"start_length": 160.0, "time": [0.0, 10000.0], "rate": [3.0, 3.0]}
    start = esail.ChainInitial(rod_vector=along, rod_rate=[-1.5, 0.0, 0.0])
    end = esail.Integrator(t_end=10000.0)
    scene = chain([15850.0] * 2, deployment=given, initial=start, integrator=end)
    built, state = build_chain(*split(scene))
    assert np.isclose(turning_rate(built.at(jnp.zeros(())), state), 2.0 * RATE, rtol=1e-12)
    fastest, _ = rates(*split(scene), jnp.asarray(10000.0))
    first, last = (fastest_rate(built.at(jnp.asarray(t))) for t in (0.0, 10000.0))
    assert last < fastest < 0.2 * first


@pytest.mark.nightly
@pytest.mark.parametrize("method", ["tsit5", "generalized-alpha"])
def test_derivatives_of_a_chain_that_is_paid_out(method):
    """By start length, rates and growth: forward against reverse mode, and against differences."""
    how = {"tolerance": 1e-12} if method == "tsit5" else {"step": 1.0}
    end = esail.Integrator(t_end=200.0, method=method, **how)
    scene = chain([50.0, 60.0], damping=1.0, integrator=end)
    scene = scene.replace({"deployment.time": [0.0, 90.0], "output.interval": 100.0})
    numbers = {"deployment.start_length": (44.0, 1e-3), "deployment.rate": ([0.0, 0.02], [0.0, 1e-6])}

    def signals(given):
        run = esail.simulate(scene, given)
        return {name: run[name][1:] for name in ("joint_position", "winch_work", "tension")}

    for (key, name), error in check_both_modes(signals, numbers).items():
        assert error < 1e-5, (key, name)


@pytest.mark.nightly
def test_a_chain_is_resumed_bit_for_bit(tmp_path):
    """Within a deployment, beyond a knot of the rates."""
    from esail_jax.scenes.toml_text import to_toml

    scene, whole, parts = (tmp_path / name for name in ("a.toml", "whole.h5", "parts.h5"))
    scene.write_text(to_toml(chain([50.0, 60.0], damping=1.0)))
    assert esail_run(scene, whole) == 0
    assert esail_run(scene, parts, "--t-end", "310") == 0
    assert esail_run(scene, parts, "--resume") == 0
    check_same(parts, whole)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"deployment.rate": None}, r"`deployment.rate` must be given with the law table"),
        ({"deployment.start_length": 111.0}, r"`deployment.start_length` must be between .* of all rods"),
        ({"deployment.rate": [0.0, -0.3]}, r"`deployment.rate` must leave the chain a length between 0"),
        ({"deployment.rate": [[0.0, 0.0], [0.0, 0.0]]}, r"`deployment.rate` must be"),
        ({"chain.mass": [1.0, 2.0]}, r"`chain.mass` must be the same for all rods, per length, with"),
        ({"chain.area": [1e-6, 2e-6]}, r"`chain.area` must be the same for all rods with"),
        ({"initial.rod_vector": [100.0, 0.0, 0.0]}, r"`initial.rod_vector` must be the rods of what is"),
        ({"chain.bending": True, "chain.second_moment": 1e-15}, r"`chain.bending` must be left out with"),
        ({"integrator.method": "energy-momentum", "integrator.step": 1.0, "integrator.tolerance": None},
         r"`integrator.method` must be one of the others with"),
    ],
)  # fmt: skip
def test_what_a_chain_cannot_do_is_refused(change, message):
    with pytest.raises(esail.SceneError, match=message):
        chain([50.0, 60.0]).replace(change)
