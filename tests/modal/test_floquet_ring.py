"""Floquet multipliers of a sail with auxiliary tethers and forces on the remote units."""

import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.equilibria.couplings import indices
from esail_jax.modal import floquet
from esail_jax.modal.multipliers import FASTEST
from esail_jax.modal.periodic_orbit import run
from esail_jax.modal.turn_map import from_state, settled, to_state
from esail_jax.numerics.angles import rotation_by
from esail_jax.steppers.stepper import Point
from esail_jax.system import Power
from support.sail_modes import RING, SPIN

SAIL = RING | {
    "tethers.count": 3,
    "tethers.elements": 1,
    "auxiliary_tethers.length": 17322.0,
    "tip_thrust.force": 5e-3,
    "tip_thrust.direction": "axial",
}
"""Three tethers whose tips are joined, as long as the chords of their circle."""


TILTED = SAIL | {"initial.sailing_angle_deg": 10.0, "tip_thrust.force": 1e-4}
"""The sail at a sailing angle."""


def with_multipliers(scene):
    """The modes of the sail in the wind, with their multipliers."""
    return esail.modes("sun-facing", scene, converge=False, floquet=True)


@pytest.mark.nightly
def test_facing_the_wind_multipliers_are_those_of_the_modes(validate):
    """The linearised equations and the derivative of the time integration give the same exponents. 2e-9:
    the steps of order seven have 0.5 rad of the fastest motion."""
    table = with_multipliers(SAIL)
    known = np.isfinite(table.floquet.multiplier)
    assert known.sum() == (np.abs(table.eigenvalue) <= FASTEST * SPIN).sum() > 15
    error = np.abs(table.floquet.exponent / table.eigenvalue - 1.0)[known].max()
    case = "multipliers with a ring and axial forces, facing the wind"
    validate("FLO-4", case, "eigenvalues of the modes", "exponents, relative", error, 2e-9)


def after_a_turn(scene, setting, orbit, z):
    """The state after a turn from the state z, seen from its centre of mass and turned back by the
    precession, as `esail.simulate` computes it."""
    system, zero = setting.system, np.zeros(())
    q, v = from_state(system, setting.spin, jnp.asarray(z))
    start = Point(zero, q, v, Power(zero, zero), np.asarray(True))
    end = esail.simulate(scene, start=start, save=["kinetic_energy"]).final_state
    back = rotation_by(-orbit.precession * setting.parts * jnp.asarray(setting.wind))
    q, v = (system.centred(x).rotate(back) for x in (end.q, end.v))
    return np.asarray(to_state(system, setting.spin, q, v))


@pytest.mark.nightly
def test_multipliers_are_those_of_runs_over_a_turn(monkeypatch, validate):
    """A small change of the start along a sum of motions returns after a turn as the sum of the motions
    times their multipliers.

    The multipliers come from tangents of a third of a turn, and the changes here from differences of two
    runs of a whole turn by the usual driver at a sailing angle of 10 deg. Points of tethers are moved by
    0.1 m, those of the hub, which is 1 m large, by 1 mm. 1e-5: the square of the hub's angle, 1e-3, and
    the accuracy of the runs, 1e-9 m."""
    kept = []
    original = floquet.multipliers
    monkeypatch.setattr(floquet, "multipliers", lambda *parts: kept.append(parts) or original(*parts))
    table = with_multipliers(TILTED)
    setting, orbit = kept[0][2:]
    period = orbit.duration * setting.parts
    turn = {"integrator.t_end": period, "output.interval": period, "integrator.tolerance": 1e-13}
    scene = esail.load_scene("sun-facing", TILTED | turn)
    values, vectors = np.linalg.eig(orbit.map)
    hub = indices(setting.system).hub
    hub = np.concatenate([hub, hub + len(orbit.state) // 2])
    groups = {0.1: [], 1e-3: []}
    for mu in table.floquet.multiplier[np.isfinite(table.floquet.multiplier)]:
        motion = orbit.tangents @ vectors[:, np.abs(values**setting.parts - mu).argmin()]
        motion = motion / np.abs(motion).max()
        groups[1e-3 if np.abs(motion[hub]).max() > 0.01 else 0.1].append((mu, motion))
    assert len(groups[0.1]) > 15 and len(groups[1e-3]) >= 3  # the hub wobbles both ways, and twists
    errors = []
    for size, motions in groups.items():
        along = sum(motion.real for _, motion in motions)
        expected = sum((mu * motion).real for mu, motion in motions)
        ends = []
        for step in (size, -size):
            z = jnp.asarray(orbit.state + step * along)
            z = run(settled, setting.system, setting.spin, z)
            ends.append(after_a_turn(scene, setting, orbit, z))
        found = (ends[0] - ends[1]) / (2.0 * size)
        errors.append(np.abs(found - expected).max() / np.abs(expected).max())
    case = "multipliers with a ring and axial forces at 10 deg"
    validate("FLO-5", case, "differences of runs over a turn", "change of the state", max(errors), 1e-5)
