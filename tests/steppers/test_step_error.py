"""The estimate of the error of fixed steps, and the warning that it causes."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.coordinates import Coordinates
from esail_jax.elements.axial import AxialEnergy
from esail_jax.ensembles import simulate_members
from esail_jax.observables.run_warning import run_warning, step_warning
from esail_jax.scenes.structure import split
from esail_jax.steppers.energy_momentum import EnergyMomentum
from esail_jax.steppers.fixed_step import STEPS_PER_FACTORISATION
from esail_jax.steppers.generalized_alpha import GeneralizedAlpha
from esail_jax.steppers.step_error import RunningError, StepErrors, updated
from esail_jax.terms import find_term
from support.quick import build_jitted, jit

LONG, SHORT = 5.0, 0.5
"""Step sizes [s]. The sail's slowest axial vibration, 0.12 rad/s, advances by 0.6 and 0.06 rad per step."""

SAIL = {
    "tethers.count": 3, "tethers.elements": 2, "integrator.method": "generalized-alpha",
    "integrator.t_end": 1000.0,
}  # fmt: skip


@pytest.fixture(scope="module")
def runs():
    """Runs with a long step, a tenth and a hundredth of it.

    Saved instants are ten steps apart, so that all runs share one program.
    """
    return [esail.simulate("baseline", SAIL | stepped(step)) for step in (LONG, SHORT, SHORT / 10.0)]


def stepped(step: float) -> dict:
    """Overrides for a step size."""
    return {"integrator.step": step, "output.interval": 10.0 * step}


FACTORS = [("tip_position_I", "tip_error", 3.0), ("reaction_B", "root_force_error", 8.0)]


@pytest.mark.nightly
@pytest.mark.parametrize(("signal", "estimate", "most"), FACTORS)
def test_the_estimate_is_the_error_within_a_factor(runs, signal, estimate, most):
    """The estimate is at least the error, and at most `most` times the error.

    It is larger because magnitudes are added; forces, and with them their errors, are also damped. The run
    with a tenth of the step, whose error is a hundredth, serves as the exact solution.
    """
    for run, finer in itertools.pairwise(runs):
        true = finer[signal][::10]
        size = np.ptp(true, axis=0).max()
        error = np.abs(run[signal] - true).max() / size
        assert error < run.numerics[estimate][-1] < most * error


@pytest.mark.nightly
def test_too_long_a_step_is_said(runs):
    """The long step, with root force errors of 5e-2 of the range, causes a warning; the short one, with
    1e-3, does not."""
    long, short, _ = (run.stats["message"] for run in runs)
    assert "The step is too long" in long and "forces at the roots" in long and "tips" not in long
    assert short == ""


@pytest.mark.nightly
def test_estimates_begin_with_nothing(runs):
    """The estimate at a saved instant covers all earlier steps; at the first instant it is zero."""
    for run in runs:
        assert run.numerics["tip_error"][0] == 0.0 and run.numerics["tip_error"][-1] > 0.0


@pytest.mark.nightly
def test_members_are_told_like_runs(runs):
    """Ensemble members get the same warning as a run. A traced run cannot print, so it returns the
    estimate."""
    scene = esail.load_scene("baseline", SAIL | stepped(LONG))
    found = simulate_members(scene, {"voltage.value": np.array([20e3])}, ["tip_position_I"])
    assert found.messages == (runs[0].stats["message"],)


def test_phase_errors_are_the_known_ones():
    """The phase error per step is (h omega)^3/12 for trapezoidal and midpoint rule, and 11/24 (h omega)^3
    for Houbolt's method, which generalized-alpha resembles at a spectral radius of 0."""
    step = jnp.asarray(0.1)
    found = [float(GeneralizedAlpha(step, jnp.asarray(rho)).phase_error) for rho in (1.0, 0.0)]
    assert found == pytest.approx([1.0 / 12.0, 11.0 / 24.0], rel=1e-14)
    assert EnergyMomentum(step).phase_error == pytest.approx(1.0 / 12.0, rel=1e-15)


@pytest.fixture(scope="module")
def system():
    """Two trusses on a hub; the second is released after 10 s."""
    release = {"tethers.count": 2, "event.time": [10.0], "event.release": [2], "integrator.step": 0.1}
    return build_jitted(*split(esail.load_scene("truss", SAIL | release))).system


BLOCK = STEPS_PER_FACTORISATION

after_one_block = jit(updated)


def after_blocks(errors, system, h, q, take, phase_error):
    """The estimates after `take` steps of length h [s], block by block. q: the coordinates at the
    start and after each step (first axis); the last block need not be full."""
    for start in range(0, take, BLOCK):
        first = jax.tree.map(lambda x, i=start: x[i], q)
        ends = jax.tree.map(lambda x, i=start: x[i + 1 : i + 1 + BLOCK], q)
        time, count = jnp.asarray(h * start), jnp.asarray(min(BLOCK, take - start))
        errors = after_one_block(
            errors, system, time, jnp.asarray(h), first, ends, count, jnp.asarray(phase_error)
        )
    return errors


def straight(system, stretch: float, steps: int) -> Coordinates:
    """Equal coordinates for all steps: tethers along Y with the same strain in all elements, hub
    as built."""
    tethers = system.tethers
    along = stretch * tethers.element_length * np.arange(tethers.elements + 1)[:, None]
    q = jnp.zeros((1, 3, tethers.elements + 1, tethers.count)).at[0, 1].set(along)
    q = Coordinates(q, system.hub.base_points)
    return jax.tree.map(lambda x: jnp.broadcast_to(x, (steps + 1, *x.shape)), q)


def axial_force(system, stretch: float) -> float:
    """EA eps r_x [N] with the Green-Lagrange strain eps."""
    return float(find_term(system.energies, AxialEnergy).stiffness[0]) * 0.5 * (stretch**2 - 1.0) * stretch


@pytest.mark.parametrize("stretch", [0.99, 1.01])
@pytest.mark.parametrize("take", [2 * BLOCK, BLOCK + 5])
def test_errors_grow_under_pressure(system, stretch, take):
    """Errors grow by exp(sigma t), sigma^2 = -N/(rho A l^2), under compression N < 0, and not under
    tension.

    The sail is at rest, so that no new error is added. A block may end early.
    """
    steps, h, tethers = 2 * BLOCK, 0.5, system.tethers
    before = RunningError(jnp.array([1e-3, 2e-3]), jnp.zeros((3, 2)), jnp.ones((3, 2)))
    errors = StepErrors(before, before, jnp.zeros(2))
    after = after_blocks(errors, system, h, straight(system, stretch, steps), take, 0.1)
    pressure = max(-axial_force(system, stretch), 0.0)
    sigma = np.sqrt(pressure / tethers.line_density[0]) / tethers.element_length[0]
    # 1e-12 allows for the rounding of an exponential.
    np.testing.assert_allclose(after.tip.error, before.error * np.exp(sigma * h * take), rtol=1e-12)


def test_a_third_difference_counts_with_the_phase_it_costs(system):
    """The error of tips that oscillate by A is pi/2 c times the sum of their |third differences|.

    Over n steps this is c (h omega)^3 n A, up to a relative error of order (h omega)^2. A block has two
    differences fewer than steps; their sum is scaled up. Steps that do not count do not widen the range.
    """
    # Five whole periods, in which blocks begin at all phases, so that |sin| has its mean value.
    steps, take, phase = 13 * BLOCK, 11 * BLOCK, 2.0 * np.pi / 44.0
    count = jnp.arange(steps + 1)
    wave = jnp.where(count <= take, jnp.sin(phase * count), 100.0)
    q = straight(system, 1.0, steps)
    q = q._replace(tether=q.tether.at[:, 0, 2, -1, :].add(wave[:, None]))
    tip = after_blocks(StepErrors.initial(2), system, 0.1, q, take, 0.2).tip
    np.testing.assert_allclose(tip.error, 0.2 * phase**3 * take, rtol=phase**2)
    np.testing.assert_allclose((tip.high - tip.low)[2], 2.0, atol=1e-12)


def test_a_block_adds_its_third_differences(system):
    """The estimate of one block of n steps is pi/2 c n/(n - 2) times the sum of its n - 2 |third
    differences|, to rounding; of fewer than three steps it is nothing new."""
    wave = np.random.default_rng(1).normal(size=BLOCK + 1)
    q = straight(system, 1.0, BLOCK)
    q = q._replace(tether=q.tether.at[:, 0, 2, -1, :].add(wave[:, None]))
    for take in (2, 3, 9, BLOCK):
        tip = after_blocks(StepErrors.initial(2), system, 0.1, q, take, 0.2).tip
        share = 0.5 * np.pi * 0.2 * take / max(take - 2, 1)
        expected = share * np.abs(np.diff(wave[: take + 1], 3)).sum()
        np.testing.assert_allclose(tip.error, expected, rtol=1e-12)
        np.testing.assert_allclose(tip.high[2], wave[: take + 1].max(), rtol=1e-14)
        np.testing.assert_allclose(tip.low[2], wave[: take + 1].min(), rtol=1e-14)


def test_a_released_tether_pulls_at_nothing(system):
    """The root force of a released tether is zero; that of an attached tether is EA eps r_x."""
    later = system.with_events_until(jnp.asarray(10.0))
    q = straight(later, 1.01, BLOCK)
    found = after_blocks(StepErrors.initial(2), later, 0.1, q, BLOCK, 0.1).force.high
    held = axial_force(later, 1.01)
    np.testing.assert_allclose(found, [[0.0, 0.0], [held, 0.0], [0.0, 0.0]], atol=1e-12 * held)


@pytest.mark.nightly
def test_a_chain_with_too_long_a_step_is_told():
    """A chain whose step is too long causes a warning.

    The rods of a double pendulum vibrate at some 200 rad/s, undamped. In 4 s, steps of 1e-3 s change their
    forces by 0.3 of the range (1 at most), and steps of 1e-4 s by a hundredth of that.
    """
    chain = {"chain.rods": 2, "integrator.method": "generalized-alpha", "output.interval": 0.5}
    chain = esail.load_scene("hanging-chain", chain | {"integrator.t_end": 4.0, "integrator.step": 1e-3})
    long, short = (esail.simulate(chain, {"integrator.step": step}) for step in (1e-3, 1e-4))
    root = [run["tension"][:, 0] for run in (long, short)]
    error = np.abs(root[0] - root[1]).max() / np.ptp(root[1])
    assert error < 1.5 * long.numerics["root_force_error"][-1] < 4.0 * error
    assert "The step is too long" in long.stats["message"] and short.stats["message"] == ""


SAID = [
    ([1e-3, 6e-3], ""),
    ([2e-2, 0.0], "puts off the tips by about 2e-02 of their range."),
    ([1.0, 0.3], "the tips by as much as they range over and the forces at the roots by about 3e-01"),
    ([0.0, np.nan], "the forces at the roots by as much as they range over"),
    ([], ""),
]


@pytest.mark.parametrize(("parts", "said"), SAID)
def test_what_is_said(parts, said):
    """The message names every error that is large or not a number; without an estimate there is no
    message."""
    text = step_warning(parts)
    assert said in text if said else text == ""


def test_balance_and_steps_are_both_said():
    """One message, made from the contents of a run file, names the energy balance and the step."""
    rows = {"energy_error": np.array([0.0, 2e-3])}
    numerics = {"tip_error": np.array([0.0, 0.5]), "root_force_error": np.zeros(2)}
    said = run_warning(rows, numerics)
    assert "energy balance is off" in said and "The step is too long" in said
