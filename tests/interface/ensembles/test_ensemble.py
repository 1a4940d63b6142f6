"""Ensembles in Python: equality with single runs, failed members, and statistics."""

import dataclasses
import inspect
import os
import threading

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from matplotlib import pyplot

import esail_jax as esail
import esail_jax.cores
from esail_jax.ensembles import (
    OUTCOMES,
    MemberRunner,
    Normal,
    Uniform,
    sensitivities,
    simulate_members,
    spread,
)
from esail_jax.ensembles.batch_size import GPU_SHARE, HOST_BYTES, PROBE_BATCH, batch_in_lockstep
from esail_jax.ensembles.member_program import members_program

SIGNALS = (
    "tip_position_I",
    "coning_angle",
    "angular_velocity_B",
    "thrust_O",
    "rotation_IB",
    "kinetic_energy",
)


@pytest.mark.nightly
def test_members_are_single_runs(scene, inputs, ensemble):
    """Members agree with single runs to the rounding of 50 steps, 1e-12 of a signal's magnitude.

    The program is another one with the same arithmetic. Transverse angular rates are sums that cancel.
    """
    assert ensemble.complete.all() and not any(ensemble.messages)
    for member in (0, 7):
        run = esail.simulate(scene, {key: x[member] for key, x in inputs.items()})
        assert run.steps == ensemble.steps[member]
        for name in SIGNALS:
            size = np.abs(run[name]).max()
            assert np.abs(run[name] - ensemble[name][member]).max() < 1e-12 * size, name
    assert np.ptp(ensemble["coning_angle"][:, -1, 0]) > 1e-6  # members differ


@pytest.mark.nightly
def test_every_core_takes_a_member(scene, inputs, ensemble, monkeypatch):
    """With two cores two members run at a time, with the same results.

    Each waits for the other to begin, which would fail if they ran one after the other.
    """
    barrier, one = threading.Barrier(2, timeout=300.0), MemberRunner._run_one

    def together(self, member, inputs):
        barrier.wait()
        return one(self, member, inputs)

    monkeypatch.setattr("esail_jax.ensembles.member_runner.cores", lambda: 2)
    monkeypatch.setattr(MemberRunner, "_run_one", together)
    found = simulate_members(scene, {key: x[:4] for key, x in inputs.items()})
    assert all(
        np.array_equal(found[name], x[:4], equal_nan=True) for name, x in ensemble.observables.items()
    )


@pytest.mark.parametrize(("set_already", "threads"), [(None, "1"), ("3", "3")])
def test_a_process_computes_with_one_thread(set_already, threads, monkeypatch):
    """Unless the user has set a number, which is not changed."""
    monkeypatch.setenv("NPROC", set_already or "")
    if set_already is None:
        monkeypatch.delenv("NPROC")
    esail_jax.cores.one_thread()
    assert os.environ["NPROC"] == threads


@pytest.mark.nightly
def test_simulate_members_draws_inputs(scene, inputs, ensemble):
    """With distributions and a number of members in place of inputs, members have the same numbers and
    rows."""
    vary = {
        "tethers.length": Normal(10e3, 10, per_tether=True),
        "initial.spin_rate": Uniform(3.9e-3, 4.1e-3),
    }
    found = simulate_members(scene, vary=vary, members=4, seed=3, observables=["coning_angle"])
    assert all(np.array_equal(x, inputs[key][:4]) for key, x in found.inputs.items())
    assert np.array_equal(found["coning_angle"], ensemble["coning_angle"][:4])
    assert "coning_angle" in found and "spin" not in found and list(dict(found)) == ["coning_angle"]
    text = "Ensemble(4 members, 4 complete; 11 instants to 200 s; observables coning_angle)"
    assert repr(found) == text
    # `esail_jax.save` is for one run. The check of types in the tests comes first, and is left out.
    with pytest.raises(TypeError, match="`solution` must be a Solution, but is of type Ensemble"):
        inspect.unwrap(esail.save)(found, "many.h5")
    assert np.array_equal(dict(**found)["coning_angle"], found["coning_angle"])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({}, r"`inputs` must be given, or `vary` and `members`, but neither is"),
        ({"inputs": {}}, r"`inputs` must have a value for every member, but is empty"),
        (
            {"vary": {"voltage.value": "uniform:1:2"}},
            "`members` must be given with `vary`",
        ),
        ({"vary": {}, "members": 0}, r"`members` must be a positive integer, but is 0"),
        (
            {"inputs": {"hub.radius": np.ones(2), "hub.height": np.ones(3)}},
            r"`inputs\[hub.height\]` must have 2 members, as `inputs\[hub.radius\]` does, but has 3",
        ),
        ({"inputs": {"hub.radius": np.ones(2)}, "members": 2}, "but both are"),
    ],
)
def test_members_that_are_none(scene, arguments, message):
    """Wrong arguments are refused in one line, before anything is compiled."""
    with pytest.raises(esail.SceneError, match=message):
        simulate_members(scene, **arguments)


@pytest.mark.nightly
def test_lockstep_and_subsets(scene, inputs, ensemble):
    """Members in lockstep, as on a GPU, agree to rounding, also if the batch does not divide their
    number."""
    part = {key: x[:5] for key, x in inputs.items()}
    found = simulate_members(scene, part, SIGNALS, batch=3, lockstep=True)
    assert list(found.observables) == list(SIGNALS) and len(found) == 5
    for name in SIGNALS:
        size = np.abs(ensemble[name]).max()
        assert np.abs(found[name] - ensemble[name][:5]).max() < 1e-11 * size, name
    assert (found.steps == ensemble.steps[:5]).all()


def test_a_batch_in_lockstep_has_no_more_members_than_the_ensemble():
    """A batch is filled with copies of its last member: a batch of hundreds for two members would take
    hundreds of times as long. Members whose results do not fit into the memory are in several batches."""

    def lower(count):
        return jax.jit(jnp.sin).lower(jnp.zeros(count))

    third = int(GPU_SHARE * HOST_BYTES / 3.5)
    assert batch_in_lockstep(8, 100, lower) == 100
    assert batch_in_lockstep(third, 100, lower) == batch_in_lockstep(third, PROBE_BATCH, lower) == 3
    assert batch_in_lockstep(8, 2, lambda _: pytest.fail("a program was made to be measured")) == 2


@pytest.mark.nightly
def test_failed_members_are_kept_apart(scene):
    """Failed members have NaN and a message, and are left out of the statistics; the others are not
    changed.

    One member has no equilibrium, and the steps of another cannot be solved.
    """
    stiff = scene.replace({"integrator.method": "collocation", "integrator.step": 8.0})
    inputs = {"initial.spin_rate": np.array([4e-3, 1.0, 4e-3]), "voltage.value": np.array([2e4, 2e4, 1e9])}
    found = simulate_members(stiff, inputs, ["kinetic_energy", "coning_angle"])
    assert found.complete.tolist() == [True, False, False] and found.failed.tolist() == [1, 2]
    assert "steady elongation" in found.messages[1] and "could not be solved" in found.messages[2]
    assert np.isfinite(found["kinetic_energy"][0]).all()
    assert np.isnan(found["kinetic_energy"][1]).all() and np.isnan(found["kinetic_energy"][2][1:]).all()
    seen = spread(found, "coning_angle")
    assert np.array_equal(seen.mean, found["coning_angle"][0]) and not seen.deviation.any()


@pytest.mark.nightly
def test_bound_of_steps(scene, inputs, ensemble):
    """A member that needs far more steps than the others fails at the bound, and says so; the others are
    the same to the bit. A run ends at the end of a block of steps, so that the bound is not exact."""
    few = {key: x[:3].copy() for key, x in inputs.items()}
    few["initial.spin_rate"][1] *= 10.0
    found = simulate_members(scene, few, ["coning_angle"], max_steps=100)
    assert found.complete.tolist() == [True, False, True] and 100 <= found.steps[1] < 200
    assert "more steps than `max_steps` allows" in found.messages[1]
    for member in (0, 2):
        assert np.array_equal(found["coning_angle"][member], ensemble["coning_angle"][member])
    assert np.isnan(found["coning_angle"][1, -1]).all()
    with pytest.raises(esail.SceneError, match="`max_steps` must be a positive whole number, but is 0"):
        simulate_members(scene, inputs, max_steps=0)


def test_sensitivities():
    """Sensitivities of known numbers are right."""
    rng = np.random.default_rng(0)
    inputs = {"a": rng.normal(size=4000), "b": rng.normal(size=(4000, 3)), "c": rng.normal(size=4000)}
    y = 2.0 * inputs["a"] + inputs["b"].sum(1) + 1e-3 * rng.normal(size=4000)
    found = sensitivities(inputs, np.where(np.arange(4000) < 10, np.nan, y))
    # The shares are 4/7, 3/7 and 0, up to correlations within the sample, 1/sqrt(4000).
    assert abs(found.share["a"] - 4 / 7) < 0.03 and abs(found.share["b"] - 3 / 7) < 0.03
    assert found.share["c"] < 1e-3 and found.explained > 0.99999
    assert abs(found.correlation["a"] - np.sqrt(4 / 7)) < 0.05
    assert abs(sum(found.share.values()) - found.explained) < 1e-12
    few = sensitivities({"b": rng.normal(size=(29, 3))}, np.arange(29.0))
    assert np.isnan(few.share["b"]) and np.isnan(few.explained)


@pytest.mark.nightly
def test_spread(ensemble):
    """Quantiles lie between the extremes; the middle one is the median of the members."""
    seen = spread(ensemble, "coning_angle")
    rows = ensemble["coning_angle"]
    assert np.allclose(seen.quantiles[2], np.median(rows, axis=0), rtol=1e-12)
    assert (seen.minimum <= seen.quantiles[0]).all() and (seen.quantiles[-1] <= seen.maximum).all()
    for outcome in OUTCOMES:
        if outcome.observable in ensemble.observables:
            assert np.isfinite(outcome.of(ensemble)).all()


class Share(eqx.Module):
    """A law of a user's own: a share of the nominal voltages."""

    share: float = 0.5

    def commanded(self, measurements):
        return self.share * measurements.nominal


def test_a_law_of_ones_own_has_one_program_in_a_process(scene, inputs):
    """No key names such a program. It is that of the same structure and numbers; the law's are among
    them."""

    def program(law, **changed):
        of_law = scene.replace({"voltage_law": law} | changed)
        return members_program(of_law, ("coning_angle",), inputs, None)

    first = program(Share())
    assert first.program.key is None
    assert program(Share()) is first
    assert program(Share(0.6)) is not first
    tight = {"integrator.tolerance": jnp.asarray(1e-9)}  # an array of JAX has no hash
    assert program(Share(), **tight) is program(Share(), **tight) is not first
    assert program(Share(), **{"solar_wind.speed": 4.1e5}) is not first
    assert program(Share(), **{"integrator.t_end": 30.0}) is not first


def test_an_observable_of_an_ensemble_is_drawn_as_a_fan(ensemble):
    """The median over all tethers of all members, in minutes; of a vector one fan per component."""
    ax = esail.plot(ensemble, "coning_angle")
    (median,) = ax.get_lines()
    np.testing.assert_array_equal(median.get_xdata(), ensemble.time / 60.0)
    angles = np.moveaxis(ensemble["coning_angle"], 1, 0).reshape(len(ensemble.time), -1)
    np.testing.assert_array_equal(median.get_ydata(), np.median(angles, axis=1))
    assert "coning angle" in ax.get_ylabel()
    other = esail.plot(ensemble, "thrust_O", ax=ax)
    assert other is ax and len(ax.get_lines()) == 4
    np.testing.assert_array_equal(
        ax.get_lines()[3].get_ydata(), np.median(ensemble["thrust_O"][..., 2], axis=0)
    )
    assert {"fans", "distributions"} <= set(esail.plot(ensemble))
    pyplot.close("all")


def test_an_unknown_name_is_refused_with_a_hint(ensemble):
    for find in (ensemble.__getitem__, lambda name: esail.plot(ensemble, name)):
        with pytest.raises((KeyError, ValueError), match="spin_rate"):
            find("spin_rates")
    none = dataclasses.replace(ensemble, complete=np.zeros(len(ensemble), bool))
    with pytest.raises(ValueError, match="must have a member that reached its end, but has none"):
        esail.plot(none, "coning_angle")
