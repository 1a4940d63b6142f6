"""Whole runs of generalized-alpha against time-exact references of an independent code
(`golden/README.md`)."""

import numpy as np
import pytest

import esail_jax as esail
from support.golden import FAST, GOLDEN, REFERENCE, SUMS, errors
from support.quick import quickly


def enter(validate, case, what, found, tolerance):
    """Enters two rows in the validation record: the worst smooth signal and the worst fast signal."""
    fast = {name for name in found if name in FAST or name.startswith("reaction")}
    for number, names, bound in ((1, found.keys() - fast, tolerance), (2, fast, 10.0 * tolerance)):
        worst = max(found[name] for name in names)
        kind = "smooth" if number == 1 else "fast"
        quantity = f"worst of {len(names)} {kind} signals / range"
        validate(f"GOL-{case}-{number}", what, REFERENCE, quantity, worst, bound)


def assert_within(found, tolerance):
    """Checks errors against `tolerance`, and against ten times `tolerance` for signals with fast modes."""
    for name, error in found.items():
        loose = name in FAST or name.startswith("reaction")
        assert error < tolerance * (10 if loose else 1), (name, error)


@pytest.mark.parametrize("case", quickly(["unequal", "stiff_clamped", "stiff_pinned"]))
def test_sail_follows_the_time_exact_solution(case, validate):
    """With h = 0.1 s every signal agrees to 5e-3 of its range; the fastest transverse mode has omega h >
    0.05."""
    solution = esail.simulate(GOLDEN / f"{case}.toml")
    found = errors(solution, np.load(GOLDEN / f"{case}.npz"))
    if case != "unequal":
        found = {name: error for name, error in found.items() if name not in SUMS}
    enter(validate, case, f"{case.replace('_', ', ')} sail, h = 0.1 s", found, 5e-3)


@pytest.mark.nightly
def test_undamped_turning_frame_follows_the_time_exact_solution(validate):
    """With h = 2 ms, which resolves the undamped axial vibration at 59 rad/s, every signal agrees with the
    reference.

    Elongation and reactions agree to 1e-2 of their range.
    """
    reference = np.load(GOLDEN / "turning_frame.npz")
    solution = esail.simulate(GOLDEN / "turning_frame.toml", {"integrator.step": 0.002})
    found = errors(solution, reference)
    enter(validate, "turning_frame", "undamped tethers on a turning frame, h = 2 ms", found, 1e-3)


@pytest.mark.nightly
def test_error_falls_with_the_square_of_the_step():
    """The tip's error falls by 3.5 to 4.5 between h = 0.1 and 0.05 s (second order: 4)."""
    reference = np.load(GOLDEN / "unequal.npz")
    # The scene's interval is 2 s. Half of it for half the step lets both runs share one program.
    steps = ({"integrator.step": h, "output.interval": 20 * h} for h in (0.1, 0.05))
    coarse, fine = (errors(esail.simulate(GOLDEN / "unequal.toml", step), reference) for step in steps)
    assert 3.5 < coarse["tip_position_I"] / fine["tip_position_I"] < 4.5


@pytest.mark.nightly
def test_instants_between_steps_are_as_good_as_those_on_them():
    """Positions, rates and energies at instants within steps are as accurate as at the ends of steps.

    Steps are 0.16 s, saved instants 2 s apart. Kinetic energy is the hardest: its range is 2e-4 of its
    value.
    """
    reference = np.load(GOLDEN / "unequal.npz")
    run = esail.simulate(GOLDEN / "unequal.toml", {"integrator.step": 0.16})
    assert_within(errors(run, reference), 5e-3)


@pytest.mark.nightly
def test_baseline_follows_the_time_exact_solution_over_three_periods(validate):
    """With h = 0.1 s every signal agrees to 1e-3 of its range; the fastest transverse mode has omega h =
    0.03."""
    solution = esail.simulate("baseline")
    found = errors(solution, np.load(GOLDEN / "baseline.npz"))
    enter(validate, "baseline", "baseline sail, 3 spin periods, h = 0.1 s", found, 1e-3)
    # These signals are much more accurate. The bounds are twice the measured errors.
    assert found["tip_position_I"] < 6e-7
    assert found["coning_angle"] < 1e-4
    assert found["thrust_O"] < 1e-6


@pytest.mark.nightly
def test_comparison_can_fail():
    """The comparison notices half a per cent more tip mass."""
    reference = np.load(GOLDEN / "unequal.npz")
    heavier = {"remote_units.mass": [1.005, 0.7035, 1.206], "integrator.t_end": 600.0}
    with pytest.raises(AssertionError):
        assert_within(errors(esail.simulate(GOLDEN / "unequal.toml", heavier), reference), 5e-3)
