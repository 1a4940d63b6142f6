"""Floquet multipliers: against the modes of a sail that faces the wind, and how they are shown."""

import dataclasses

import numpy as np
import pytest

import esail_jax as esail
from esail_jax.cli import main
from esail_jax.modal.multipliers import FASTEST, Floquet
from esail_jax.modal.notes import GROWING
from esail_jax.plotting.modes import mode_multipliers
from support.payout import FROM_REST

SPIN = 4e-3
TURN = 2.0 * np.pi / SPIN
SMALL = {"tethers.count": 3, "tethers.elements": 1}
UNEQUAL = {"tethers.length": [1e4, 9e3, 1.1e4], "remote_units.mass": [1.5, 1.2, 2.0]}
UNRESOLVED = 2e-9
"""Error of an exponent relative to the fastest motion: order seven with 0.5 rad in a step."""


def at_angle(degrees, overrides=SMALL):
    """Modes and multipliers of a small sail in the wind."""
    scene = overrides | {"initial.sailing_angle_deg": degrees}
    return esail.modes("sun-facing", scene, converge=False, floquet=True)


SHORT = 400.0
"""Deployed length [m] of tethers of 1,000 m."""

PAID_OUT = SMALL | {
    "hub.height": None, "hub.density": None, "hub.radius": 1.0, "tethers.bending_damping_time": None,
    "initial.spin_rate": 0.05, "remote_units.mass": 0.5, "integrator.t_end": 9.0, "output.interval": 1.0,
}  # fmt: skip


def hub_with(stored):
    """A hub with point masses [kg] at the roots of three tethers, 1 m from its centre."""
    inertia = [200.0 + 3.0 * stored, 150.0 + 1.5 * stored, 150.0 + 1.5 * stored]
    return {"hub.mass": 300.0 + 3.0 * stored, "hub.inertia": np.diag(inertia).tolist()}


@pytest.fixture(scope="module")
def short():
    """Modes and multipliers of a sail of constant length with what longer tethers would have wound up."""
    stored = 7653.0 * 4.28e-9 * (1000.0 - SHORT)
    return at_angle(0.0, PAID_OUT | hub_with(stored) | {"tethers.length": SHORT})


@pytest.fixture(scope="module")
def facing():
    return at_angle(0.0)


def difference(table):
    """The worst difference of exponents and eigenvalues, relative to the latter, of all modes that
    are slow enough."""
    orbit, known = table.floquet, np.isfinite(table.floquet.multiplier)
    assert known.sum() == (np.abs(table.eigenvalue) <= FASTEST * SPIN).sum() > 15
    change = np.abs(orbit.exponent - table.eigenvalue)[known] / np.abs(table.eigenvalue[known])
    mu = np.exp(table.eigenvalue[known] * orbit.period)
    assert np.abs(orbit.multiplier[known] - mu).max() < 1e-6  # errors of the exponents times the turn
    return change.max()


@pytest.mark.nightly
def test_facing_the_wind_multipliers_are_those_of_the_modes(facing, validate):
    """The linearised equations and the derivative of the time integration over a third of a turn give the
    same exponents; the turn is that of the spin, and nothing precesses or drifts."""
    case = "multipliers of a coned sail facing the wind"
    validate(
        "FLO-1", case, "eigenvalues of the modes", "exponents, relative", difference(facing), UNRESOLVED
    )
    orbit = facing.floquet
    assert abs(orbit.period / TURN - 1.0) < 1e-12
    assert orbit.precession == 0.0
    assert max(abs(orbit.tilt_drift), abs(orbit.spin_drift), orbit.left) < 1e-11  # rounding


@pytest.mark.nightly
def test_unequal_tethers_use_the_map_of_a_whole_turn(validate):
    """Without equal tethers nothing is renumbered; exponents and eigenvalues still agree."""
    found = difference(at_angle(0.0, SMALL | UNEQUAL))
    case = "multipliers of unequal tethers"
    validate("FLO-2", case, "eigenvalues of the modes", "exponents, relative", found, UNRESOLVED)


@pytest.mark.nightly
@pytest.mark.parametrize("law", FROM_REST.values(), ids=FROM_REST)
def test_tethers_that_begin_to_be_paid_out(law, short):
    """At the length of the start, with the winches at rest: the multipliers of a sail of that length whose
    hub has what is wound up as point masses at the roots. Motions that decay by more than 1e-8 in a map
    are not resolved: these have no multipliers."""
    paid = {"tethers.length": 1000.0, "deployment.start_length": SHORT}
    found = at_angle(0.0, PAID_OUT | hub_with(0.0) | paid | law).floquet
    known = np.isfinite(short.floquet.multiplier)
    np.testing.assert_array_equal(known, np.isfinite(found.multiplier))
    lost = np.exp(short.eigenvalue.real * found.period / 3.0) < 1e-8
    slow = np.abs(short.eigenvalue) <= FASTEST * 0.05
    np.testing.assert_array_equal(known, slow & ~lost)
    assert known.sum() > 9 and (slow & lost).sum() > 3
    change = np.abs(found.exponent - short.floquet.exponent)[known]
    assert np.all(change < 1e-8 * np.abs(found.exponent[known]))


@pytest.mark.nightly
def test_precession_is_that_of_a_tilted_sail(facing, validate):
    """At a small sailing angle the spin axis precesses as the mode in which the whole sail tilts tells: it
    turns in B at the rate of this mode, and so in space at the difference to the spin. 1e-4: the square of
    the angle, 0.1 deg, and the change of the precession with it."""
    mode = facing.name.index("spin-axis precession (tilt of the whole sail)")
    rate = SPIN - facing.eigenvalue[mode].imag
    orbit = at_angle(0.1).floquet
    found = orbit.precession / (rate * orbit.period) - 1.0
    validate("FLO-3", "orbit at 0.1 deg", "precession mode", "precession, relative", abs(found), 1e-4)


@pytest.mark.nightly
def test_orbit_at_ten_degrees_repeats_itself_and_is_stable():
    """At 10 deg the sail has a periodic orbit: sailing angle and spin keep their values to 1e-8 in a turn,
    where the first turn from the usual start changes the shape by 1e-2. No small motion about it grows."""
    table = at_angle(10.0)
    orbit = table.floquet
    assert abs(np.degrees(orbit.sailing_angle) - 10.0) < 1e-9
    assert max(abs(orbit.tilt_drift), abs(orbit.spin_drift), orbit.left) < 1e-8
    assert np.nanmax(orbit.growth) < 1.0 + GROWING  # the accuracy of a multiplier
    moved = np.abs(orbit.exponent - table.eigenvalue) / np.abs(table.eigenvalue)
    assert 1e-6 < np.nanmax(moved) < 1e-2  # the load varies by a sixth during a turn
    assert "no motion grows" in str(table)


# ---- how they are shown ---------------------------------------------------------------------------


@pytest.fixture(scope="module")
def shown():
    """A table with multipliers that belong to its eigenvalues, those of fast modes unknown."""
    table = esail.modes("voltage-off", {"tethers.count": 4, "tethers.elements": 2}, converge=False)
    fast = np.abs(table.eigenvalue) > FASTEST * SPIN
    exponent = np.where(fast, complex(np.nan, np.nan), table.eigenvalue)
    orbit = Floquet(np.exp(exponent * TURN), exponent, TURN, -1e-3, 0.0, 0.0, 0.0, 0.0, 0.1)
    return dataclasses.replace(table, floquet=orbit)


@pytest.mark.nightly
def test_records_hold_the_multipliers(shown):
    """A record has the multiplier, the exponent and the damping ratio of the orbit, null for a fast mode; a
    table without multipliers has none of the three."""
    record = shown.records()[0]
    mu, s = complex(*record["floquet_multiplier"]), complex(*record["floquet_exponent"])
    assert abs(mu - np.exp(s * TURN)) < 1e-12
    assert record["floquet_damping_ratio"] == pytest.approx(record["damping_ratio"], rel=1e-12)
    assert shown.records()[-1]["floquet_multiplier"] is None
    assert len(shown.first(5).records()) == 5 == len(shown.first(5).floquet.growth)
    plain = dataclasses.replace(shown, floquet=None)
    assert not any("floquet" in key for key in plain.records()[0])
    assert "|mu|" in str(shown) and "|mu|" not in str(plain)


def test_figure_of_the_multipliers(shown):
    """The left picture has every known multiplier with its conjugate. The right picture has a circle for
    every known mode under the mean load, and a dot or a cross for every known mode on the orbit whose
    damping is not exactly zero: the damping of a free motion is a rounding error, and may be zero."""
    left, right = mode_multipliers(shown).axes
    known = np.isfinite(shown.floquet.multiplier)
    damped = known & (shown.floquet.exponent.real != 0.0)
    assert sum(len(line.get_xdata()) for line in left.lines) == 2 * known.sum()
    assert sum(len(line.get_xdata()) for line in right.lines) == known.sum() + damped.sum()


def test_scene_without_orbit_is_refused(capsys):
    """A sail without wind has an equilibrium, and one without hub no free spin axis: both are refused in
    one line."""
    assert main(["modes", "voltage-off", "--floquet"]) == 2
    must = "must be given for Floquet multipliers, but is missing"
    assert capsys.readouterr().err == f"`solar_wind` {must}\n"
    no_hub = dataclasses.replace(esail.load_scene("sun-facing"), hub=None)
    with pytest.raises(esail.SceneError, match=f"`hub` {must}"):
        esail.modes(no_hub, floquet=True)
