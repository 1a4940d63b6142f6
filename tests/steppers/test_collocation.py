"""Collocation: order, agreement with independent references, output, derivatives, failure."""

import re

import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.numerics.lobatto import Lobatto
from esail_jax.scenes.scene import parse
from esail_jax.simulation.results import SimulationError
from support.golden import GOLDEN, REFERENCE, SUMS, errors
from support.quick import quickly
from support.whole_runs import check_derivative, check_going_on, numbers, tips_of_batch_and_loop

METHOD = {"integrator.method": "collocation"}
SMALL = METHOD | {
    "tethers.count": 3,
    "tethers.elements": 2,
    "integrator.t_end": 300.0,
    "output.interval": 20.0,
}
"""Three tethers of two elements: what most tests here share, and compile once."""


def collocated(case: str, tolerance: float) -> esail.Solution:
    """A scene of the golden references, run by collocation."""
    text = re.sub(r"(?m)^(method|step|spectral_radius) = .*\n", "", (GOLDEN / f"{case}.toml").read_text())
    return esail.simulate(parse(text, case), METHOD | {"integrator.tolerance": tolerance})


# ---- tables -------------------------------------------------------------------------------------


@pytest.mark.parametrize("stages", [2, 3, 4, 5])
@pytest.mark.parametrize("spectral_radius", [1.0, 0.5, 0.1])
def test_tables_of_lobatto(stages, spectral_radius):
    """Values at 0 and at the stages integrate polynomials of degree s exactly up to any node, the end
    2 s - 2, and one degree more, no further, without damping; what is infinitely stiff is multiplied by the
    spectral radius; the kept eigenvectors give the matrix and its square back. To rounding: 1e-12."""
    table = Lobatto.of(stages, spectral_radius)
    c = table.nodes
    for n in range(stages + 1):
        found = table.matrix @ c**n + table.start * 0.0**n
        assert np.allclose(found, c ** (n + 1) / (n + 1), rtol=0, atol=1e-12)
    exact = 2 * stages if spectral_radius == 1.0 else 2 * stages - 1
    for n in range(exact):
        assert abs(table.matrix[-1] @ c**n + table.start[-1] * 0.0**n - 1 / (n + 1)) < 1e-12
    assert abs(table.matrix[-1] @ c**exact - 1 / (exact + 1)) > 1e-6
    stiff = -1e9
    state = np.linalg.solve(np.eye(stages) - stiff * table.matrix, 1.0 + stiff * table.start)
    assert abs(abs(state[-1]) - spectral_radius) < 1e-6
    for power, matrix in ((1, table.matrix), (2, table.squared)):
        again = (table.mix @ np.diag(table.rates**power) @ table.split).real
        assert np.allclose(again, matrix, rtol=0, atol=1e-12)
    assert np.allclose(table.start_squared, table.matrix @ table.start, rtol=0, atol=1e-14)


@pytest.mark.parametrize("spectral_radius", [1.0, 0.5])
def test_undamped_oscillations_do_not_grow(spectral_radius):
    """Amplification of any undamped oscillation: modulus 1 for Lobatto IIIA, less with damping, least where
    it is infinitely fast. Rounding: 1e-12."""
    table = Lobatto.of(4, spectral_radius)
    for z in 1j * np.logspace(-2, 5, 60):
        state = np.linalg.solve(np.eye(4) - z * table.matrix, 1.0 + z * table.start)
        assert spectral_radius - 1e-6 < abs(state[-1]) < 1.0 + 1e-12


def test_polynomials_of_a_step():
    """The value, and integrals from the start to anywhere in the step, once and twice, of a quartic through
    the start and four stages; the divided difference sees x^4 and nothing below. To rounding."""
    table, x = Lobatto.of(4, 0.5), 0.37
    for n in range(5):
        values = table.every_node**n
        exact = (x**n, x ** (n + 1) / (n + 1), x ** (n + 2) / (n + 1) / (n + 2))
        for power in range(3):
            found = x**power * (x ** np.arange(5)) @ table.integrals(power) @ values
            assert abs(found - exact[power]) < 1e-13
    powers = [abs(table.difference() @ table.every_node**n - (n == 4)) for n in range(5)]
    assert max(powers) < 1e-10


# ---- accuracy -----------------------------------------------------------------------------------


@pytest.mark.parametrize("case", quickly(["unequal", "stiff_clamped", "stiff_pinned", "turning_frame"]))
def test_sail_follows_the_time_exact_solution(case, validate):
    """Tolerance 1e-10: every signal of the independent code to 1e-5 of its range; its own output is good to
    1e-3 where the symmetric sails' sums cancel, at the clamped root, and in the undamped ringing."""
    found = errors(collocated(case, 1e-10), np.load(GOLDEN / f"{case}.npz"))
    rough = {*SUMS, "root_coning_angle", "root_lagging_angle"}
    smooth = max(error for name, error in found.items() if name not in rough)
    what = f"{case.replace('_', ', ')} sail, collocation"
    validate(f"COL-{case}-1", what, REFERENCE, "worst smooth signal / range", smooth, 1e-5)
    validate(f"COL-{case}-2", what, REFERENCE, "worst signal / range", max(found.values()), 1e-3)


@pytest.mark.slow
def test_baseline_over_three_periods(validate):
    """Default tolerance: every signal within 1e-3 of its range of the time-exact reference."""
    times = {"integrator.t_end": 4712.0, "output.interval": 4.0}
    reference = np.load(GOLDEN / "baseline.npz")
    found = errors(esail.simulate("baseline", METHOD | times), reference)
    validate("COL-baseline", "baseline, collocation, default tolerance", "independent code",
             "worst of all signals / range", max(found.values()), 1e-3)  # fmt: skip


@pytest.fixture(scope="module")
def fixed_steps():
    """Runs with steps of 20, 10 and 5 s, and of 0.5 s, of tethers soft enough for their axial motion to be
    resolved: stiff parts of a motion have a lower order, s + 1."""
    soft = SMALL | {"tethers.youngs_modulus": 7e8}
    return {h: esail.simulate("baseline", soft | {"integrator.step": h}) for h in (20.0, 10.0, 5.0, 0.5)}


@pytest.mark.slow
def test_order(fixed_steps):
    """2 s - 1 = 7, to 0.6 where the steps are not yet small (measured 6.6, 7.0; at 5 s the tips' error is
    8e-10 m, at 2.5 s it would be the rounding of 1e4 m)."""
    exact = fixed_steps[0.5]["tip_position_I"][-1]
    found = [np.abs(fixed_steps[h]["tip_position_I"][-1] - exact).max() for h in (20.0, 10.0, 5.0)]
    assert (np.abs(np.diff(np.log2(found)) + 7.0) < 0.6).all(), found


@pytest.mark.slow
def test_constraints_hold(fixed_steps):
    """The hub keeps its shape at every saved instant, to rounding of its metres."""
    for solution in fixed_steps.values():
        assert solution.numerics["constraint_violation"].max() < 1e-13


@pytest.mark.slow
def test_energy_balance(fixed_steps):
    """|dE - W + D| falls with the step like the error, thirty-fold at least per halving."""
    for step, bound in ((20.0, 1e-6), (10.0, 3e-8), (5.0, 1e-9)):
        solution = fixed_steps[step]
        error = np.abs(solution["energy_balance_error"]).max()
        assert error < bound * solution["kinetic_energy"].max()


def test_error_follows_the_tolerance():
    """A tolerance a hundred times smaller takes the error down at least ten-fold."""
    exact = esail.simulate("baseline", SMALL | {"integrator.tolerance": 1e-13})
    found = []
    for tolerance in (1e-7, 1e-9, 1e-11):
        solution = esail.simulate("baseline", SMALL | {"integrator.tolerance": tolerance})
        found.append(np.abs(solution["tip_position_I"] - exact["tip_position_I"]).max())
    assert found[1] < found[0] / 10 and found[2] < found[1] / 10, found


def test_reactions_of_a_stiff_sail_at_the_default_tolerance():
    """A thousand times the stiffness leaves a thousandth of the strain, which is a difference of positions:
    the default tolerance follows it, and keeps the reactions to 2e-4 of their range throughout. With that
    of the baseline they are ten times as far off."""
    stiff = SMALL | {"tethers.youngs_modulus": 70e12, "tethers.second_moment": 1.47e-21}
    stiff |= {"output.interval": 1.0, "integrator.t_end": 200.0}
    exact = esail.simulate("baseline", stiff | {"integrator.tolerance": 1e-13})["reaction_B"]
    found = []
    for tolerance in ({}, {"integrator.tolerance": 5e-10}):
        error = np.abs(esail.simulate("baseline", stiff | tolerance)["reaction_B"] - exact).max()
        found.append(error / np.ptp(exact, axis=0).max())
    assert found[0] < 2e-4 < 10 * found[0] < found[1], found


# ---- output -------------------------------------------------------------------------------------


@pytest.mark.parametrize("interval", [0.7, 33.0])
def test_saved_instants_force_no_step(interval):
    """The steps, and so the state at the end, are the same whatever is saved, to the last bit."""
    usual = esail.simulate("baseline", SMALL)
    other = esail.simulate("baseline", SMALL | {"output.interval": interval})
    assert other.steps == usual.steps
    assert np.array_equal(other["tip_position_I"][-1], usual["tip_position_I"][-1])
    assert other.numerics["steps"].sum() <= usual.steps


def test_output_between_steps_is_as_good_as_the_steps():
    """Every instant of a coarse run, most within a step, against a fine one, in parts of the range: what
    follows from positions to 1e-7, the sum of the reactions, three times the axial force, to 1e-4."""
    instants = SMALL | {"output.interval": 1.0}
    coarse, fine = (
        esail.simulate("baseline", instants | {"integrator.tolerance": t}) for t in (1e-9, 1e-12)
    )
    bounds = {"tip_position_I": 1e-7, "thrust_O": 1e-7, "coning_angle": 1e-7, "reaction_O": 1e-4}
    for name, bound in bounds.items():
        difference = np.abs(coarse[name] - fine[name]).max() / np.ptp(fine[name])
        assert difference < bound, (name, difference)


def test_a_longer_run_goes_on_bit_for_bit(tmp_path):
    """A run file carried on to a later end holds what one run to that end holds."""
    check_going_on(SMALL, 410, 900, tmp_path)


# ---- derivatives --------------------------------------------------------------------------------


def outcome(x):
    """Five numbers of different kinds that a run ends with."""
    end = esail.simulate("baseline", SMALL | {"integrator.step": 5.0} | numbers(x))
    picked = (
        end["tip_position_I"][-1, 0, 0],
        1e4 * end["root_coning_angle"][-1, 1],
        1e4 * end["sailing_angle"][-1],
        1e3 * end["dissipated_energy"][-1],
        1e3 * end["reaction_O"][-1, 2],
    )
    return jnp.stack(picked)


@pytest.mark.slow
def test_derivative_of_a_run():
    """Difference quotient to 1e-5: iterations end at 5e-7 m, which the quotient magnifies a thousandfold
    (measured 5e-6 in an angle that hardly changes). Concrete run to 1e-9: rounding, which the square of a
    strain's small rate shows first (measured 3e-11)."""
    check_derivative(outcome, [1.0, 0.5, 0.2, 3.0, 0.1], quotient_to=1e-5, concrete_to=1e-9)


@pytest.mark.slow
def test_vmap_is_a_loop():
    """Members of a batch make their own steps: 1e-9 of the range, the tolerance being the same."""
    together, alone = tips_of_batch_and_loop(SMALL, [5e3, 2e4, 4e4])
    assert np.abs(together - alone).max() < 1e-9 * np.ptp(together)


# ---- failure ------------------------------------------------------------------------------------


def test_a_step_that_is_too_long_says_so():
    """Half a turn in one step: the stages' equations cannot be solved, and nothing shorter is tried."""
    with pytest.raises(SimulationError, match=r"could not be solved. At t = 0 s with a step of 800 s. Ask"):
        esail.simulate("baseline", SMALL | {"integrator.step": 800.0, "integrator.t_end": 4000.0})


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("integrator.spectral_radius", 0.5, "be left out without generalized-alpha"),
        ("integrator.tolerance", 2.0, "must lie in"),
    ],
)
def test_bad_input(key, value, message):
    """What belongs to another method is refused."""
    with pytest.raises(esail.SceneError, match=message):
        esail.load_scene("baseline", METHOD | {key: value})


def test_a_chain_has_other_methods():
    """Rods turn too fast for factors that are kept."""
    with pytest.raises(esail.SceneError, match="for a chain"):
        esail.load_scene("hanging-chain", METHOD)
