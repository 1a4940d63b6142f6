"""Modes of sails with a force on every remote unit: closed forms, a dense linearisation, and which loads
leave no steady state."""

import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.equilibria.moving_frame import MovingFrame, rotation_about
from esail_jax.equilibria.sparse import linearised_sparse
from esail_jax.equilibria.steady_state import steady_state
from support.sail_modes import RING, SMALL, SPIN, UNEQUAL, built, compared_with_dense

MASS, LENGTH, FORCE = 1.5, 1e4, 0.05
LIGHT = SMALL | {
    "tethers.density": 1.0,
    "tethers.youngs_modulus": 7e12,
    "remote_units.mass": MASS,
    "hub.radius": 1.0,
    "tip_thrust.force": FORCE,
}
"""Point masses on light and stiff tethers. FORCE is a fifth of their centrifugal force, 0.24 N."""


def swings(direction):
    """The frequencies [rad/s] of the lagging and of the coning swing on a resting hub (n = 2), and
    the mean coning angle [rad]."""
    table = esail.modes("voltage-off", LIGHT | {"tip_thrust.direction": direction}, converge=False)
    names = ("in-plane swing (lagging)", "out-of-plane swing (coning)")
    found = [table.name.index(f"{name}, neighbours opposed (n = 2)") for name in names]
    return 2.0 * np.pi * table.frequency_hz[found], np.mean(table.coning_angle), table


@pytest.mark.nightly
def test_axial_forces_raise_the_cone_and_its_swing(validate):
    """A mass that is pushed by F along the spin axis of a sail that accelerates at a rises to the cone
    sin(Lambda) = (F - m a) / (m Omega^2 L). With constant angular momentum about the axis it swings about
    it as a conical pendulum,

        omega^2 = Omega^2 (1 + 3 sin^2 Lambda).

    2e-4: the root is 1e-4 of the length from the axis, and the tether has 3e-5 of the mass."""
    (_, coning), angle, table = swings("axial")
    # All masses and no other force: the sail accelerates by the sum of the forces over its mass.
    total = table.places.mass.sum() + float(table.system.hub.mass_matrix.sum())
    assert abs(table.acceleration * total / (4.0 * FORCE) - 1.0) < 1e-6
    sine = (FORCE / MASS - table.acceleration) / (SPIN**2 * LENGTH)
    case, exact = "axial forces on the remote units", "conical pendulum"
    validate("MOD-12", case, exact, "sine of the cone, relative", abs(np.sin(angle) / sine - 1.0), 2e-4)
    error = coning / (SPIN * np.sqrt(1.0 + 3.0 * sine**2)) - 1.0
    validate("MOD-13", case, exact, "coning swing, relative", abs(error), 2e-4)
    assert sine > 0.2 and "accelerating uniformly" in table.notes[0]


@pytest.mark.nightly
def test_radial_forces_follow_the_swinging_tether(validate):
    """A force F along the chord, less its part along the spin axis, turns with a tether that lags and does
    not follow one that rises. On a rim of radius R

        omega_in^2 = Omega^2 R / L,        omega_out^2 = Omega^2 (1 + R / L) + F / (m L),

    the first one as without the force. A force that kept its direction would add F / (m L) to it, too, two
    thousand times as much. 1e-4: the tether has 3e-5 of the mass, and its stretch changes the swings by
    2e-5."""
    (lagging, coning), angle, _ = swings("radial")
    rim = LIGHT["hub.radius"] / LENGTH
    case, exact = "radial forces on the remote units", "pendulum on a rotating rim"
    error = lagging / (SPIN * np.sqrt(rim)) - 1.0
    validate("MOD-14", case, exact, "lagging swing, relative", abs(error), 1e-4)
    error = coning / np.sqrt(SPIN**2 * (1.0 + rim) + FORCE / (MASS * LENGTH)) - 1.0
    validate("MOD-15", case, exact, "coning swing, relative", abs(error), 1e-4)
    assert abs(angle) < 1e-9


PUSHED = {
    "unequal, radial forces": UNEQUAL
    | {"tip_thrust.direction": "radial", "tip_thrust.force": [2e-3, 1e-3, 2e-3, 1.5e-3]},
    "ring, axial forces": RING | {"tip_thrust.direction": "axial", "tip_thrust.force": 2e-2},
}


@pytest.mark.nightly
@pytest.mark.parametrize("case", PUSHED)
def test_dense_linearisation(case, validate):
    """Frequencies and damping in the wind with forces on the remote units are those of the dense
    linearisation, in which every coordinate may act on every other. 1e-7: rounding of the dense
    eigenvalues."""
    worst, ours, theirs = compared_with_dense(SMALL | PUSHED[case])
    assert ours == theirs > 30
    number = dict(zip(PUSHED, (16, 17), strict=True))[case]
    case = f"modes of a coned sail, {case}"
    validate(f"MOD-{number}", case, "dense linearisation", "eigenvalues above 2 Omega", worst, 1e-7)


@pytest.mark.nightly
def test_refused_loads_have_a_moment_about_the_spin_axis():
    """Why `esail modes` refuses tangential forces and the relative wind: on the steady cone of the sail
    without them they have a moment about the spin axis,

        sum F rho(tip)    and    -(sigma/u) Omega times the integral of rho^2 along the tethers,

    which changes the spin. rho is the distance from the axis, along a tether from R to rho(tip). 1e-4: the
    tethers are not quite straight and not stretched evenly, by 1e-4 of their length."""
    system, start, spin = built("sun-facing", SMALL)
    at, _, y = steady_state(system, start, spin)
    turn = np.asarray(rotation_about(system, spin / SPIN, jnp.asarray(y)))
    frame = MovingFrame(spin, at.frame.acceleration)

    def moment(overrides):
        """The moment [N m] that is not balanced."""
        other, _, _ = built("sun-facing", SMALL | overrides)
        return -linearised_sparse(other, frame, y, at.lam).balance @ turn

    assert bool(at.converged) and abs(moment({})) < 1e-9
    thrust, radius, length = 2e-3, 1.0, 1e4
    tips = np.linalg.norm(np.cross(spin / SPIN, np.asarray(at.q.tether[0, :, -1]), axisb=0), axis=1)
    found = moment({"tip_thrust.force": thrust, "tip_thrust.direction": "tangential"})
    assert abs(found / (thrust * tips.sum()) - 1.0) < 1e-4
    load = system.loads[0]
    per_speed = float(load.wind.at(jnp.zeros(())).thrust_per_speed(load.voltage)[0])
    squares = length * (tips**3 - radius**3) / (3.0 * (tips - radius))
    found = moment({"solar_wind.relative": True})
    assert abs(found / (-per_speed * SPIN * squares.sum()) - 1.0) < 1e-4
    # Axial forces on unequal tethers tilt the hub against the axis of the spin.
    unequal = SMALL | UNEQUAL | {"tip_thrust.force": 2e-3, "tip_thrust.direction": "axial"}
    with pytest.raises(esail.SimulationError, match="tilt the hub, and then change the spin"):
        esail.modes("sun-facing", unequal, converge=False)
