"""What fixed steps may be off by is estimated, and said."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.coordinates import Coordinates
from esail_jax.elements.axial import AxialEnergy
from esail_jax.ensembles.members import simulate_members
from esail_jax.observables.run_warning import run_warning, step_warning
from esail_jax.simulation.prepare import prepare
from esail_jax.steppers.energy_momentum import EnergyMomentum
from esail_jax.steppers.fixed_step import KEEP
from esail_jax.steppers.generalized_alpha import GeneralizedAlpha
from esail_jax.steppers.step_error import Course, StepErrors, after_steps, no_errors
from esail_jax.terms import find_term

LONG, SHORT = 5.0, 0.5
"""Steps [s]: the whole sail's slowest axial vibration, 0.12 rad/s, is 0.6 and 0.06 of a radian a step."""

SAIL = {
    "tethers.count": 3, "tethers.elements": 2, "integrator.method": "generalized-alpha",
    "integrator.t_end": 1000.0, "output.interval": 50.0,
}  # fmt: skip


@pytest.fixture(scope="module")
def runs():
    """With a long step, a tenth and a hundredth of it, all by one program."""
    steps = (LONG, SHORT, SHORT / 10.0)
    return [esail.simulate("baseline", SAIL | {"integrator.step": step}) for step in steps]


FACTORS = [("tip_position_I", "tip_error", 3.0), ("reaction_B", "root_force_error", 8.0)]


@pytest.mark.parametrize(("signal", "estimate", "most"), FACTORS)
def test_the_estimate_is_the_error_within_a_factor(runs, signal, estimate, most):
    """No less than the error, as magnitudes are added up, and at most `most` times as much: forces are
    damped, and what they were off by with them. The run with a tenth of the step, whose error is a
    hundredth, takes the truth's place."""
    for run, true in itertools.pairwise(runs):
        size = np.ptp(true[signal], axis=0).max()
        error = np.abs(run[signal] - true[signal]).max() / size
        assert error < run.numerics[estimate][-1] < most * error


def test_too_long_a_step_is_said(runs):
    """Forces at the roots are off by 5e-2 of their range with the long step, by 1e-3 with the short one."""
    long, short, _ = (run.stats["message"] for run in runs)
    assert "The step is too long" in long and "forces at the roots" in long and "tips" not in long
    assert short == ""


def test_estimates_begin_with_nothing(runs):
    """What is kept at a saved instant is of all steps before."""
    for run in runs:
        assert run.numerics["tip_error"][0] == 0.0 and run.numerics["tip_error"][-1] > 0.0


@pytest.mark.slow
def test_members_are_told_like_runs(runs):
    """Members run under a trace, where nothing can be said; what they are off by is handed out."""
    scene = esail.load_scene("baseline", SAIL | {"integrator.step": LONG})
    found = simulate_members(scene, {"voltage.value": np.array([20e3])}, ["tip_position_I"])
    assert found.messages == (runs[0].stats["message"],)


def test_phase_errors_are_the_known_ones():
    """Trapezoidal rule and midpoint lose (h omega)^3/12 a step; Houbolt's method, which generalized-alpha
    is like at a spectral radius of 0, 11/24."""
    step = jnp.asarray(0.1)
    found = [float(GeneralizedAlpha(step, jnp.asarray(rho)).phase_error) for rho in (1.0, 0.0)]
    assert found == pytest.approx([1.0 / 12.0, 11.0 / 24.0], rel=1e-14)
    assert EnergyMomentum(step).phase_error == pytest.approx(1.0 / 12.0, rel=1e-15)


@pytest.fixture(scope="module")
def system():
    """Two trusses on a hub, the second of which is let go after 10 s."""
    release = {"tethers.count": 2, "event.time": [10.0], "event.release": [2], "integrator.step": 0.1}
    return prepare(esail.load_scene("truss", SAIL | release)).problem.system


def straight(system, stretch: float, steps: int) -> Coordinates:
    """Tethers at rest along Y, all elements with one strain, before and after steps; the hub as built."""
    tethers = system.tethers
    along = stretch * tethers.element_length * np.arange(tethers.elements + 1)[:, None]
    q = jnp.zeros((1, 3, tethers.elements + 1, tethers.count)).at[0, 1].set(along)
    q = Coordinates(q, system.hub.base_points)
    return jax.tree.map(lambda x: jnp.broadcast_to(x, (steps + 1, *x.shape)), q)


def axial_force(system, stretch: float) -> float:
    """EA eps r_x [N] with Green-Lagrange's strain."""
    return float(find_term(system.energies, AxialEnergy).stiffness[0]) * 0.5 * (stretch**2 - 1.0) * stretch


@pytest.mark.parametrize("stretch", [0.99, 1.01])
def test_errors_grow_under_pressure(system, stretch):
    """exp(sigma t) with sigma^2 = -N/(rho A l^2); under tension they stay. Nothing moves, so nothing is
    added."""
    steps, h, tethers = 2 * KEEP, 0.5, system.tethers
    before = Course(jnp.array([1e-3, 2e-3]), jnp.zeros((3, 2)), jnp.ones((3, 2)))
    errors = StepErrors(before, before, jnp.zeros(2))
    times, q = h * jnp.arange(steps + 1), straight(system, stretch, steps)
    after = after_steps(errors, system, times, q, jnp.asarray(steps), jnp.asarray(0.1))
    pressure = max(-axial_force(system, stretch), 0.0)
    sigma = np.sqrt(pressure / tethers.line_density[0]) / tethers.element_length[0]
    # Rounding of an exponential.
    np.testing.assert_allclose(after.tip.error, before.error * np.exp(sigma * h * steps), rtol=1e-12)


def test_a_third_difference_counts_with_the_phase_it_costs(system):
    """Tips that oscillate by A are put off by pi/2 c times the sum of |third differences| over n steps,
    which is c (h omega)^3 n A to the order of (h omega)^2; steps that do not count widen no range."""
    steps, take, phase = 10 * KEEP, 8 * KEEP, 2.0 * np.pi / 40.0  # whole periods: |sin| has its mean
    count = jnp.arange(steps + 1)
    wave = jnp.where(count <= take, jnp.sin(phase * count), 100.0)
    q = straight(system, 1.0, steps)
    q = q._replace(tether=q.tether.at[:, 0, 2, -1, :].add(wave[:, None]))
    tip = after_steps(no_errors(2), system, 0.1 * count, q, jnp.asarray(take), jnp.asarray(0.2)).tip
    np.testing.assert_allclose(tip.error, 0.2 * phase**3 * take, rtol=phase**2)
    np.testing.assert_allclose((tip.high - tip.low)[2], 2.0, atol=1e-12)


def test_a_released_tether_pulls_at_nothing(system):
    """Its own elastic force goes on, but is no reaction; that of the one that is held is EA eps r_x."""
    later, times = system.with_events_until(jnp.asarray(10.0)), 0.1 * jnp.arange(KEEP + 1)
    q, take = straight(later, 1.01, KEEP), jnp.asarray(KEEP)
    found = after_steps(no_errors(2), later, times, q, take, jnp.asarray(0.1)).force.high
    held = axial_force(later, 1.01)
    np.testing.assert_allclose(found, [[0.0, 0.0], [held, 0.0], [0.0, 0.0]], atol=1e-12 * held)


def test_a_chain_with_too_long_a_step_is_told():
    """The rods of a double pendulum vibrate at some 200 rad/s, undamped: in 4 s steps of 1e-3 s put their
    forces off by 0.3 of the range (1 at most), those of 1e-4 s by a hundredth of that."""
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
    """Neither what is unknown nor one of the two is passed over; without an estimate nothing is said."""
    text = step_warning(parts)
    assert said in text if said else text == ""


def test_balance_and_steps_are_both_said():
    """In one message, from what a run file keeps."""
    rows = {"energy_error": np.array([0.0, 2e-3])}
    numerics = {"tip_error": np.array([0.0, 0.5]), "root_force_error": np.zeros(2)}
    said = run_warning(rows, numerics)
    assert "energy balance is off" in said and "The step is too long" in said
