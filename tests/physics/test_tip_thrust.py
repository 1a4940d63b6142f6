"""Thrust at the tips (`[tip_thrust]`): torque, spin-up, directions, and what is refused."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.loads.tip_thrust import Switching, TipThrust
from esail_jax.measurements import Measurements
from esail_jax.observables.run_warning import slack_warning
from support.one_tether import STEPPERS, integrate, one_tether, straight, turning
from support.quick import quickly

ROD, TIP, LENGTH = 0.6, 1.5, 2.0
"""Masses of rod and tip [kg], length [m]."""


@pytest.mark.parametrize("stepper", quickly(STEPPERS, ("collocation",)))
def test_spin_up_of_a_stiff_tether(stepper, validate):
    """A tangential force F turns a rod hinged at the axis with theta'' = F / ((m_u + m_t/3) L).

    Along the pulse, which rises and falls alike, the spin grows by F (off - on) / ((m_u + m_t/3) L) in all.
    The stretch of 1e-4 and methods of second order, (omega h)^2 = 2e-4, change the gain: 5e-4 is accepted.
    """
    force, on, off, rise, spin = 0.2, 0.5, 2.5, 1.5, 0.8
    one = lambda x: jnp.full(1, x)  # noqa: E731
    made = one_tether(
        kind="truss", elements=1, length=LENGTH, axial=1e5, line_density=ROD / LENGTH, tip_mass=TIP
    )
    switching = Switching(one(on), one(off), jnp.asarray(rise))
    made = dataclasses.replace(made, tip_loads=(TipThrust(one(force), switching, "tangential"),))
    q = straight(made)
    _, q, v, _ = integrate(stepper, made, q, turning(q, [spin, 0.0, 0.0]), 0.01, 420)
    r, rate = q.tether[-1, 0, :, -1, 0], v.tether[-1, 0, :, -1, 0]
    gained = np.cross(r, rate)[0] / LENGTH**2 - spin
    exact = force * (off - on) / ((TIP + ROD / 3.0) * LENGTH)
    validate(
        f"TIP-1 {stepper}", "stiff tether with a force at its tip", "torque = force times arm",
        "gain of the spin rate in a pulse", abs(gained / exact - 1.0), 5e-4,
    )  # fmt: skip


def test_directions():
    """Tangential, axial and radial forces are of the given size and form a right-handed set X_B, d, X_B x
    d, also for tethers that cone: the part of the chord along X_B does not count."""
    axis = jnp.array([1.0, 2.0, 2.0]) / 3.0
    chords = jnp.array([[0.3, 0.1], [0.9, -0.2], [0.1, 0.8]])
    chords = chords / jnp.linalg.norm(chords, axis=0)
    measured = Measurements(jnp.asarray(7.0), axis, chords, chords)
    force = jnp.array([2.0, 3.0])
    axial, radial, tangential = (
        TipThrust(force, None, name).force(measured) for name in ("axial", "radial", "tangential")
    )
    assert np.allclose(axial, axis[:, None] * force, rtol=0, atol=1e-15)
    assert np.allclose(axis @ radial, 0.0, atol=1e-15) and bool(((radial * chords).sum(0) > 0.0).all())
    assert np.allclose(jnp.linalg.norm(radial, axis=0), force, rtol=1e-14)
    in_plane = chords - axis[:, None] * (axis @ chords)
    assert np.allclose(jnp.cross(radial, in_plane, axis=0), 0.0, atol=1e-15)
    assert np.allclose(jnp.cross(axis[:, None], radial, axis=0), tangential, rtol=0, atol=1e-15)
    switching = Switching(jnp.array([5.0, 6.5]), jnp.array([50.0, 7.0]), jnp.asarray(4.0))
    pushed = TipThrust(force, switching, "axial").force(measured)
    assert np.allclose(axis @ pushed, [1.0, 3.0 * 0.125**3 * (10 - 15 * 0.125 + 6 * 0.125**2)], rtol=1e-14)


CALM = {f"solar_wind.{key}": None for key in ("speed", "number_density", "cutoff_voltage")}
CALM |= {"voltage.value": None, "tethers.count": 3, "tethers.elements": 2, "integrator.t_end": 600.0}
CALM |= {"initial.spin_rate": 1e-3, "output.interval": 5.0}
PULSE = {"tip_thrust.force": 2e-3, "tip_thrust.on": 100.0, "tip_thrust.off": 500.0}
PULSE |= {"tip_thrust.rise_time": 40.0}


@pytest.mark.nightly
def test_spin_up_of_a_sail():
    """A sail of three tethers spins up by p F (R + L) (off - on) / J, and its energy balance holds.

    The tips carry nearly all of the moment of inertia J; their angle about the spin axis follows that of a
    rigid sail. The tethers themselves, a tenth of the mass, still vibrate sideways: 2e-2 is accepted.
    """
    scene = esail.load_scene("baseline", CALM | PULSE)
    run = esail.simulate(scene)
    hub, tethers, tip = scene.hub, scene.tethers, scene.remote_units.mass
    radius, length = hub.radius, tethers.length
    inertia = 0.5 * np.pi * hub.density * hub.height * radius**4
    line = tethers.density * tethers.area
    inertia += 3 * (tip * (radius + length) ** 2 + line * ((radius + length) ** 3 - radius**3) / 3.0)
    gain = 3 * 2e-3 * (radius + length) * 400.0 / inertia
    offsets = run["tip_position_I"] - run["hub_position_I"][:, None]
    body = offsets @ run["rotation_IB"][0]
    angle = np.unwrap(np.arctan2(body[:, 0, 2], body[:, 0, 1]))
    late = run.time >= 550.0
    spin = np.polyfit(run.time[late], angle[late], 1)[0]
    assert abs((spin - 1e-3) / gain - 1.0) < 2e-2
    energy = np.abs(run["energy_balance_error"]).max()
    assert energy < 1e-6 * np.ptp(run["kinetic_energy"]) and np.ptp(run["external_work"]) > 0.0
    assert abs(run["external_work"][-1] / np.ptp(run["kinetic_energy"]) - 1.0) < 1e-2


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        ({"tip_thrust.force": float("inf")}, r"`tip_thrust.force` must be finite, but is inf"),
        ({"tip_thrust.direction": "up"}, r"`tip_thrust.direction` must be \"tangential\", .*, but is 'up'"),
        ({"tip_thrust.on": 1.0},
         r"`tip_thrust.off` must be given with `tip_thrust.on`, but is missing"),
        ({"tip_thrust.rise_time": 1.0},
         r"`tip_thrust.on` must be given with `tip_thrust.rise_time`, but is missing"),
        ({**PULSE, "tip_thrust.off": 50.0},
         r"`tip_thrust.off` must be after `tip_thrust.on` \(100.0\), but is 50.0"),
        ({**PULSE, "tip_thrust.rise_time": 0.0}, r"`tip_thrust.rise_time` must be positive, but is 0.0"),
        ({"tip_thrust.force": [1.0, 2.0]}, r"`tip_thrust.force` must be a number or a list of 3"),
    ],
)  # fmt: skip
def test_bad_input(overrides, message, nothing_compiles):
    """One line names the key before anything is compiled."""
    with pytest.raises(esail.SceneError, match=message):
        esail.load_scene("baseline", {"tethers.count": 3, "tip_thrust.force": 1e-3} | overrides)


def test_slack_tethers_are_named():
    """A tether without tension at an instant is named in the message of the run; zero strain, as at rest,
    is not slack."""
    strain = np.full((4, 3), 1e-3)
    strain[0] = 0.0
    assert slack_warning({"max_axial_strain": strain}) == "" and slack_warning({}) == ""
    strain[2, 1] = -1e-6
    assert slack_warning({"max_axial_strain": strain}).startswith("Tether 2 goes slack:")
    strain[3, 0] = -1e-6
    assert slack_warning({"max_axial_strain": strain}).startswith("Tethers 1, 2 go slack:")


@pytest.mark.nightly
def test_a_push_towards_the_hub_makes_tethers_slack(small):
    """A radial force of 0.3 N towards the hub is more than the spin holds: the message of the run says
    so."""
    inward = {"tip_thrust.force": -0.3, "tip_thrust.direction": "radial", "initial.spin_rate": 1e-3}
    run = esail.simulate("baseline", small | inward, save=["max_axial_strain"], throw=False)
    assert "Tethers 1, 2, 3 go slack" in run.stats["message"]
