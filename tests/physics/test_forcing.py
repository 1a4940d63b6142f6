"""No forcing is passed over: steps of the default method end where a load changes its form in time."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.ensembles import simulate_members
from esail_jax.steppers.collocation_step_size import change_of_step
from esail_jax.steppers.knots import NEAR, fitting_step
from support.quick import jit

SAIL = {
    "tethers.count": 3, "tethers.elements": 1, "tethers.element": "truss", "tethers.bending": False,
    "tethers.second_moment": None, "tethers.bending_damping_time": None, "output.interval": 50.0,
}  # fmt: skip
PULSES = [x for k in (1, 2, 3) for x in (50.0 * k - 1.0, 50.0 * k - 0.5, 50.0 * k + 0.5, 50.0 * k + 1.0)]
SWITCHED = SAIL | {"voltage.law": "on-off", "voltage.rise_time": 0.5, "integrator.t_end": 200.0}


@pytest.mark.nightly
@pytest.mark.parametrize("kind", ["voltage", "wind"])
def test_short_pulses_of_a_table_are_not_passed_over(kind):
    """Three pulses of 1.5 s in 200 s, where steps could be 30 s long. Their impulse moves the hub by up to
    a few millimetres, as in a run of far smaller tolerance, to 1 %: that of positions is 0.1 mm."""
    if kind == "voltage":
        own = {"voltage.law": "piecewise-linear", "voltage.time": [0.0, *PULSES],
               "voltage.table": [0.0, *[0.0, 1.0, 1.0, 0.0] * 3]}  # fmt: skip
    else:
        own = {"solar_wind.time": [0.0, *PULSES, 200.0], "solar_wind.speed": 4e5,
               "solar_wind.number_density": [0.0, *[0.0, 5e8, 5e8, 0.0] * 3, 0.0]}  # fmt: skip
    own |= {"integrator.t_end": 200.0}
    run, fine = (
        esail.simulate("baseline", SAIL | own | {"integrator.tolerance": tolerance})
        for tolerance in (1e-8, 1e-12)
    )
    moved = [x["hub_position_I"][-1] - x["hub_position_I"][0] for x in (run, fine)]
    assert np.linalg.norm(moved[1]) > 5e-4
    np.testing.assert_allclose(moved[0], moved[1], rtol=0, atol=1e-2 * np.linalg.norm(moved[1]))


@pytest.mark.nightly
def test_traced_switch_times_are_those_of_the_host():
    """A pulse of 5 s that begins at a traced instant: the run has the steps of the host, and its rows to
    1e-9 of the largest entry. So has a member of an ensemble."""
    pulse = {"voltage.on": 100.0, "voltage.off": 105.0}
    host = esail.simulate("baseline", SWITCHED | pulse)
    assert abs(host["external_work"][-1]) > 1e-6

    def traced(on):
        run = esail.simulate("baseline", SWITCHED | {"voltage.on": on, "voltage.off": on + 5.0})
        return dict(run), run.steps

    rows, steps = jit(traced)(100.0)
    assert int(steps) == host.steps
    members = simulate_members(
        esail.load_scene("baseline", SWITCHED | pulse),
        {"voltage.on": [90.0, 100.0], "voltage.off": [95.0, 105.0]},
        ["external_work", "tip_position_I"],
    )
    for name in ("external_work", "tip_position_I"):
        size = np.abs(host[name]).max()
        np.testing.assert_allclose(rows[name], host[name], rtol=0, atol=1e-9 * size, err_msg=name)
        np.testing.assert_allclose(members[name][1], host[name], rtol=0, atol=1e-9 * size, err_msg=name)


@pytest.mark.nightly
def test_derivatives_by_switching_instants():
    """Forward and reverse mode agree with difference quotients of runs (Richardson) to 1e-6: the voltage
    reaches the one at which thrust begins at the end of a step, too."""

    def angle(on, off):
        scene = SWITCHED | {"voltage.on": on, "voltage.off": off, "voltage.rise_time": 5.0}
        return esail.simulate("baseline", scene)["coning_angle"][-1, 0]

    at = (60.0, 160.0)
    found = jax.jit(jax.grad(angle, (0, 1)))(*at)

    def quotient(k, h):
        ends = [float(angle(*(x + sign * h * (i == k) for i, x in enumerate(at)))) for sign in (1, -1)]
        return (ends[0] - ends[1]) / (2.0 * h)

    for k in range(2):
        expected = (4.0 * quotient(k, 0.1) - quotient(k, 0.2)) / 3.0
        assert abs(found[k] / expected - 1.0) < 1e-6


def test_steps_fit_between_knots():
    """Equal steps, none longer than asked for, that end just before the next knot; one that was reached, or
    that is NaN, is none."""
    knots = jnp.array([30.0, jnp.nan, 10.0, 20.0])
    for time, h, expected, stop in (
        (0.0, 4.0, 10.0 / 3.0, 10.0), (0.0, 50.0, 10.0, 10.0), (10.0 - NEAR * 11.0, 4.0, 10.0 / 3.0, 20.0),
        (25.0, 5.0, 5.0, 30.0), (30.0, 7.0, 7.0, np.inf),
    ):  # fmt: skip
        found, end = fitting_step(knots, jnp.asarray(time), jnp.asarray(h))
        assert float(found) == pytest.approx(expected, rel=1e-10)
        assert float(end) == pytest.approx(stop, rel=1e-10) and (end < stop or stop == np.inf)


def test_the_next_step_follows_from_the_error():
    """The error grows with the sixth power of the step; a step is shortened to a fifth at most, and made
    three times longer at most, with a safety factor of 0.85."""
    errors = jnp.array([1.0, 0.85**6, 2.0**-6, 1e30, 0.0])
    np.testing.assert_allclose(jax.vmap(change_of_step)(errors), [0.85, 1.0, 1.7, 0.2, 3.0], rtol=1e-12)


@pytest.mark.nightly
def test_derivatives_by_the_phases_of_a_window():
    """Angle and work, by the phases at which the voltage begins to rise and to fall and by the rise, agree
    with difference quotients of runs (Richardson) to 5e-4: the kinks at the cutoff voltage are foreseen
    from the motion, to 1e-4 of the rise."""

    def of(*phases):
        keys = zip(("on", "off", "rise"), phases, strict=True)
        scene = SAIL | {f"voltage.{key}_phase_deg": x for key, x in keys}
        scene |= {"voltage.law": "phase-window", "initial.spin_rate": 4e-2, "integrator.t_end": 200.0}
        run = esail.simulate("baseline", scene | {"initial.sailing_angle_deg": 40.0})
        return jnp.stack([run["coning_angle"][-1, 0], run["external_work"][-1]])

    at = (10.0, 190.0, 20.0)
    found = jit(jax.jacrev(of, (0, 1, 2)))(*at)

    def quotient(k, h):
        ends = [np.asarray(of(*(x + s * h * (i == k) for i, x in enumerate(at)))) for s in (1, -1)]
        return (ends[0] - ends[1]) / (2.0 * h)

    for k in range(3):
        np.testing.assert_allclose(found[k], (4.0 * quotient(k, 0.1) - quotient(k, 0.2)) / 3.0, rtol=5e-4)
