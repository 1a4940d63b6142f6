"""A sail on its orbit about the Sun (`[orbit]`): an independent integration, conservation, and what is
refused."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.constants import ASTRONOMICAL_UNIT as AU
from esail_jax.constants import SOLAR_MU
from esail_jax.environment import kepler_orbit
from esail_jax.environment.kepler_orbit import KeplerOrbit
from esail_jax.environment.solar_wind import SteadyWind, WindOnOrbit
from esail_jax.loads.coulomb import CoulombThrust
from esail_jax.loads.voltage import Constant, OrbitalFeedback
from esail_jax.loads.voltage_limits import Limits
from esail_jax.measurements import Measurements
from esail_jax.observables import elastic_energy
from esail_jax.point_fields import PointFields
from esail_jax.scenes.structure import split
from esail_jax.steppers.consistent import consistent_motion
from esail_jax.system import System
from support.quick import build_jitted, jit
from support.ring_sail import SAIL, TIGHT, reference, ring_scene

REFERENCE = "independent NumPy code (`support/ring_reference.py`), Dormand & Prince 8(5,3)"

NEAR_SUN = {
    "orbit.position_au": [0.008, 0.006, 0.001],
    "orbit.velocity": [-2e5, 2.4e5, 3e4],
    "solar_wind.reference_distance_au": 0.01,
}
"""Two solar radii from the Sun the tide, the turn of its direction and the thinning of the wind are so
large that one per cent of each is seen in two minutes."""

NO_RING = {key: None for key in SAIL if key.startswith("auxiliary_tethers.")}
FIVE = NEAR_SUN | NO_RING | {"tethers.strain": "engineering", "solar_wind.relative": True}
FIVE |= {"integrator.t_end": 120.0}
CABLES = NEAR_SUN | {
    "auxiliary_tethers.element": "cable",
    "tethers.element": "cable",
    "tethers.elements": 1,
    # Less damping: the explicit reference keeps overdamped slopes at its stability limit.
    "tethers.axial_damping_time": 0.02,
    "auxiliary_tethers.axial_damping_time": [0.02, 0.03, 0.02, 0.01, 0.02],
}


@pytest.fixture(scope="module")
def five():
    """A run of five unequal tethers of trusses, with the wind relative to them."""
    return esail.simulate(ring_scene(FIVE | TIGHT))


def check_against_reference(solution, case, what, validate):
    exact = reference(solution.scene).run(np.asarray(solution.time))
    found = {
        name: np.abs(np.asarray(solution[name]) - values).max() / np.ptp(values)
        for name, values in exact.items()
    }
    worst = max(found, key=found.get)
    validate(case, what, REFERENCE, f"worst of {len(found)} signals / range", found[worst], 1e-6)


@pytest.mark.nightly
def test_run_follows_an_independent_integration(five, validate):
    """Every signal of five unequal tethers agrees with the independent code, which integrates heliocentric
    positions without a closed-form orbit or a tide, to 1e-6 of its range.

    Measured: positions 1e-9, energies 1e-8, dissipated power, which is small, 3e-7."""
    check_against_reference(five, "ORB-2", "five unequal tethers near the Sun, relative wind", validate)


@pytest.mark.nightly
def test_run_with_a_ring_follows_an_independent_integration(validate):
    """The same for cables joined by a ring of cables: the tide acts on slopes and own vectors."""
    run = esail.simulate(ring_scene(CABLES | TIGHT))
    check_against_reference(run, "ORB-3", "five cables near the Sun, ring of cables", validate)


@pytest.mark.nightly
def test_observables_of_the_orbit(five):
    """Position and velocity are those of the Kepler orbit through the start plus those of the hub, the
    elements are those of the state, and O is the orbital frame at the hub of the moment.

    The velocity is compared with a difference quotient of positions of 1e8 m along 10 s, whose error is
    h^2 r'''/6 = 0.2 m/s of 3e5 m/s: 1e-6."""
    r, v, elements = (np.asarray(five[x]) for x in ("heliocentric_position", "heliocentric_velocity",
                                                    "orbital_elements"))  # fmt: skip
    h = five.time[2] - five.time[1]
    assert np.allclose((r[2:] - r[:-2]) / (2 * h), v[1:-1], rtol=0, atol=1e-5 * np.abs(v).max())
    assert np.allclose(r[0], AU * np.array(NEAR_SUN["orbit.position_au"]), rtol=1e-15)
    assert np.allclose(five["hub_position_I"][0], 0.0, atol=1e-9)
    size = np.linalg.norm(r, axis=1)
    energy = 0.5 * (v**2).sum(1) - SOLAR_MU / size
    assert np.allclose(elements[:, 0], -0.5 * SOLAR_MU / energy, rtol=1e-12)
    momentum = np.linalg.norm(np.cross(r, v), axis=1)
    assert np.allclose(elements[:, 1], np.sqrt(1.0 + 2.0 * energy * momentum**2 / SOLAR_MU**2), rtol=1e-9)
    cosine = (r * five["rotation_IB"][:, :, 0]).sum(1) / size
    assert np.allclose(np.cos(five["sailing_angle"]), cosine, rtol=0, atol=1e-12)
    assert np.ptp(np.arctan2(r[:, 1], r[:, 0])) > 0.02  # the Sun line has turned


@pytest.mark.nightly
def test_energy_balance_includes_the_tide(five):
    """The work of the tide and of the wind is the change of energy, to the tolerance of the run."""
    assert np.abs(five["energy_balance_error"]).max() < 1e-10 * np.abs(five["external_work"]).max()


COARSE = NO_RING | {
    "hub.density": 1.0,
    "tethers.count": 3,
    "tethers.length": 1e3,
    "tethers.elements": 1,
    "tethers.axial_damping_time": None,
    "remote_units.mass": [0.5, 0.6, 0.7],
    "solar_wind.speed": None,
    "solar_wind.number_density": None,
    "solar_wind.cutoff_voltage": None,
    "voltage.value": None,
    "initial.spin_rate": 4e-5,
    "orbit.position_au": [1.0, 0.2, 0.1],
    "orbit.velocity": [5e3, 24e3, 3e3],
    "integrator.t_end": 3.15576e7,
    "integrator.tolerance": 1e-6,
    "output.interval": 3.15576e6,
}
"""Three unequal tethers of one truss each, without wind and damping, for a year on an ellipse."""


def totals(system, point):
    """Energy [J] and angular momentum [kg m^2/s] about the Sun of all masses, from their heliocentric
    positions and velocities."""
    origin, velocity = system.kepler_orbit.at(point.time)
    place = jax.tree.map(lambda x: x, point.q)._replace(
        tether=point.q.tether + origin[:, None, None], hub=point.q.hub + origin
    )
    moving = point.v._replace(tether=point.v.tether + velocity[:, None, None], hub=point.v.hub + velocity)
    momenta = system.momenta(moving)
    ones = jax.tree.map(jnp.ones_like, point.q)
    mass = system.momenta(ones).tether[0, 0]
    kinetic = 0.5 * sum((x * p).sum() for x, p in zip(moving[:2], momenta[:2], strict=True))
    hub = system.hub.mass / jnp.linalg.norm(system.hub.centre(place.hub))
    potential = -SOLAR_MU * ((mass / jnp.linalg.norm(place.tether[0], axis=0)).sum() + hub)
    momentum = jnp.cross(place.tether[0], momenta.tether[0], axis=0).sum((1, 2))
    momentum = momentum + jnp.cross(place.hub, momenta.hub).sum(0)
    return kinetic + potential + elastic_energy(system, point.time, point.q), momentum


@pytest.mark.nightly
def test_energy_and_angular_momentum_about_the_sun_over_a_year(validate):
    """Without wind, the total energy and angular momentum about the Sun are kept to 1e-9 over a year.

    The sums are over all masses in heliocentric positions and velocities, so that the closed-form orbit and
    the motion relative to it enter together. The tolerance of the run, 1e-6 of the tethers' length per
    step, changes the spin; that is 1e-12 of the orbit's part."""
    scene = ring_scene(COARSE)
    run = esail.simulate(scene, save=["heliocentric_position"])
    system, q, v, _ = build_jitted(*split(scene))
    begin = run.final_state._replace(time=jnp.zeros(()), q=q, v=v)
    (e0, h0), (e1, h1) = (jit(totals)(system, point) for point in (begin, run.final_state))
    error = max(abs(e1 / e0 - 1.0), np.linalg.norm(h1 - h0) / np.linalg.norm(h0))
    validate(
        "ORB-4", "coarse sail, a year on an ellipse", "conservation",
        "energy and angular momentum about the Sun", float(error), 1e-9,
    )  # fmt: skip
    assert np.ptp(np.linalg.norm(run["heliocentric_position"], axis=1)) > 0.1 * AU


def test_one_solution_of_kepler_s_equation_per_evaluation(monkeypatch):
    """The residual of one state, of several, and consistent accelerations solve Kepler's equation once,
    although the tide, its power, the wind and a law that asks for the wind at the hub need the place."""
    changes = {"tethers.count": 3, "voltage.law": "constant-thrust", "voltage.thrust": 0.05}
    scene = esail.load_scene("heliocentric", changes | {"voltage.value": None, "voltage.maximum": 4e4})
    system, q, v, _ = build_jitted(*split(scene))
    state, solve, solved = (q, v, v, system.no_multipliers()), kepler_orbit.anomaly, []

    def counted(*given):
        solved.append(given)
        return solve(*given)

    monkeypatch.setattr(kepler_orbit, "anomaly", counted)
    several = jax.tree.map(lambda x: jnp.stack([x, x]), state)
    for function, time, arguments in (
        (System.residual, jnp.ones(()), state),
        (System.residuals, jnp.ones(2), several),
        (consistent_motion, jnp.ones(()), state[:2]),
    ):
        solved.clear()
        jax.eval_shape(function, system, time, *arguments)
        assert len(solved) == 1, function


def test_wind_along_the_orbit():
    """At every point and instant the wind is radial from the Sun with constant speed, its density is
    n_0 (R_ref/R)^2, its thrust per speed falls like 1/R, and relative to a point of the moving frame it has
    the velocity u - V - dr/dt. Instants are an axis of their own, as in a step with several stages."""
    orbit = KeplerOrbit(jnp.array([0.8 * AU, 0.3 * AU, 0.1 * AU]), jnp.array([-9e3, 25e3, 2e3]))
    steady = SteadyWind(jnp.asarray(4e5), jnp.asarray(7e6), jnp.asarray(1e3), jnp.zeros(3))
    wind = WindOnOrbit(steady, orbit, jnp.asarray(0.9 * AU))
    times, random = jnp.array([[0.0], [3e6]]), np.random.default_rng(2)
    r, r_x, rate = (jnp.asarray(random.normal(size=(3, 4, 2, 5)) * x) for x in (1e10, 1.0, 30.0))
    load = CoulombThrust.of(wind, Constant(jnp.full(5, 2e4)), 1, relative=True)
    found = load.force(times, PointFields(r, r_x), PointFields(rate, None))
    here = wind.at(times, r)
    for k, time in enumerate(times[:, 0]):
        origin, velocity = orbit.at(time)
        place = origin[:, None, None] + r[:, :, k]
        distance = jnp.linalg.norm(place, axis=0)
        density = 7e6 * (0.9 * AU / distance) ** 2
        assert np.allclose(here.number_density[:, k], density, rtol=1e-14)
        u = 4e5 * place / distance - velocity[:, None, None] - rate[:, :, k]
        along = r_x[:, :, k] / jnp.linalg.norm(r_x[:, :, k], axis=0)
        push = 0.18 * 19e3 * jnp.sqrt(8.854e-12 * 1.67e-27 * density)
        exact = push * (u - (u * along).sum(0) * along)
        assert np.allclose(found[:, :, k], exact, rtol=0, atol=1e-13 * jnp.abs(exact).max())
        at = wind.direction(place[:, 0, 0])
        assert np.allclose(at, place[:, 0, 0] / distance[0, 0], rtol=0, atol=1e-15)


def test_a_law_measures_the_heliocentric_position():
    """The position that a control law measures is the hub's, from the Sun: the place of the moving origin
    plus the position relative to it, 1e6 m, to the rounding of numbers of 1e9 m."""
    system, q, v, _ = build_jitted(*split(ring_scene(FIVE)))
    time, away = jnp.asarray(30.0), jnp.array([1e6, -2e6, 5e5])
    moved = q.axpy(1.0, system.uniform(away))
    found = system.directions(time, moved, v).position
    assert np.allclose(found, system.kepler_orbit.at(time)[0] + away, rtol=0, atol=1e-6)


def test_feedback_follows_the_sun_line():
    """The target of attitude feedback keeps its direction in the orbital frame of the moment: the angle to
    the wind stays, and it lies in the plane of the wind and of X_O = Z_H x Z_O."""
    one, angle = jnp.ones(()), np.deg2rad(35.0)
    target = jnp.array([np.sin(angle), 0.0, np.cos(angle)])
    law = OrbitalFeedback(jnp.ones(1), one, target, Limits(None), None)
    for phi in (0.0, 1.0, 2.5):
        out, forward = (np.array([np.cos(phi + x), np.sin(phi + x), 0.0]) for x in (0.0, 0.5 * np.pi))
        measured = Measurements(one, jnp.zeros(3), jnp.zeros((3, 1)), jnp.zeros((3, 1)), jnp.asarray(out))
        exact = np.cos(angle) * out + np.sin(angle) * forward
        assert np.allclose(law.aim(measured), exact, rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        ({"orbit.velocity": [0, 0, 0]}, r"`orbit.velocity` must not be zero, but is \[0, 0, 0\]"),
        ({"orbit.position_au": [0.0, 0.0, 0.0]}, r"`orbit.position_au` must not be zero"),
        ({"orbit.position_au": [0, 0, 1]}, r"`orbit.position_au` must not lie on the ecliptic's axis"),
        ({"orbit.position_au": [1.0, float("nan"), 0.0]}, r"`orbit.position_au` must be finite"),
        ({"orbit.velocity": 3e4}, r"`orbit.velocity` must be a list of three numbers, but is 30000.0"),
        ({"orbit.velocity": [0.0, 2e3, 0.0]},
         r"`orbit.velocity` must give an orbit whose pericentre is outside the Sun \(6.957e\+08 m\), "
         r"but the pericentre is at 3.38025e\+08 m"),
        ({"orbit.velocity": [5e4, 0, 0]}, r"`orbit.velocity` must give .*, but the pericentre is at 0 m"),
        ({"initial.heliocentric_position_au": [1.0, 0.0, 0.0]},
         r"`initial.heliocentric_position_au` must be left out with \[orbit\], but is given"),
        ({"hub": None}, r"`orbit` must be left out without \[hub\], but is given"),
        ({"orbit.velocity": None}, r"`orbit.velocity` must be given, but is missing"),
        ({"orbit": None, "solar_wind.reference_distance_au": 1.0},
         r"`solar_wind.reference_distance_au` must be left out without \[orbit\], but is given"),
        ({"solar_wind.reference_distance_au": 0.0},
         r"`solar_wind.reference_distance_au` must be positive, but is 0.0"),
        ({"orbit.mean_motion": 1e-3}, r"`orbit.mean_motion` must be a known key"),
    ],
)  # fmt: skip
def test_bad_input(overrides, message, nothing_compiles):
    """One line names the key before anything is compiled."""
    with pytest.raises(esail.SceneError, match=message):
        esail.load_scene("heliocentric", overrides)


def test_modes_are_refused(nothing_compiles):
    """A sail on an orbit has no steady state."""
    with pytest.raises(esail.SceneError, match="`orbit` must be left out of a scene whose modes are asked"):
        esail.modes("heliocentric")
