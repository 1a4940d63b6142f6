"""Where an orbit about the Sun starts: at a planet, on an orbit message, or by numbers in other units."""

import jax
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.calendar.frames import TO_EQUATOR, to_equatorial
from esail_jax.calendar.instants import after, in_scale, read_instant, seconds_between
from esail_jax.constants import ASTRONOMICAL_UNIT
from esail_jax.errors import InputError
from esail_jax.messages.trajectory import Trajectory
from esail_jax.messages.writing import Head, oem_text
from esail_jax.scenes.toml_text import to_toml
from support.ellipses import Ellipse
from support.kernels import chebyshev, write_kernel

EPOCH = "2027-03-01T12:00:00"


def scene(**orbit):
    """The heliocentric sail with another start."""
    return esail.load_scene("heliocentric", {f"orbit.{key}": value for key, value in orbit.items()})


def start(of):
    """Position [m] and velocity [m/s] of a scene at t = 0."""
    return np.array(of.orbit.position_au) * ASTRONOMICAL_UNIT, np.array(of.orbit.velocity)


def test_kilometres_and_the_equator():
    """The same state in other units and axes, to rounding."""
    position, velocity = start(scene())
    km, km_s = 1e-3 * position, 1e-3 * velocity
    found = start(scene(position_km=km.tolist(), velocity_km_s=km_s.tolist()))
    turned = (to_equatorial(km).tolist(), to_equatorial(km_s).tolist())
    equatorial = start(scene(position_km=turned[0], velocity_km_s=turned[1], frame="equatorial"))
    in_au = (to_equatorial(position / ASTRONOMICAL_UNIT).tolist(), to_equatorial(velocity).tolist())
    astronomical = start(scene(position_au=in_au[0], velocity=in_au[1], frame="equatorial"))
    for given in (found, equatorial, astronomical):
        np.testing.assert_allclose(given[0], position, rtol=0.0, atol=1e-15 * np.linalg.norm(position))
        np.testing.assert_allclose(given[1], velocity, rtol=0.0, atol=1e-15 * np.linalg.norm(velocity))


def test_a_start_may_be_traced():
    """Its derivative is the turn of the axes and the change of units."""

    def position(km):
        given = scene(position_km=km, velocity_km_s=[0.0, 30.0, 0.0], frame="equatorial")
        return given.orbit.position_au

    slope = jax.jacfwd(position)(np.array([1.5e8, 0.0, 1e6]))
    np.testing.assert_allclose(slope, TO_EQUATOR.T * (1e3 / ASTRONOMICAL_UNIT), rtol=1e-14, atol=1e-24)


def test_a_message_gives_the_state_of_the_date(tmp_path):
    """Between its rows, at the epoch, to the error of its interpolation and the last printed digit."""
    orbit = Ellipse(1.5e11, 0.1, 3.2e7, 0.3)
    first = read_instant("2027-03-01T00:00:00", "x")
    times = np.arange(0.0, 86401.0, 3600.0)
    rows = Trajectory(after(first, times), orbit.position(times).T, orbit.velocity(times).T)
    path = tmp_path / "cruise.oem"
    path.write_text(oem_text(Head(first, "TEST", "SAIL", "2027-012A"), rows, 7))
    given = {"orbit.oem": str(path), "initial.epoch": "2027-03-01T12:34:56.5"}
    position, velocity = start(esail.load_scene("heliocentric", given))
    at = 12 * 3600.0 + 34 * 60.0 + 56.5
    assert np.abs(position - orbit.position(np.array([at]))[:, 0]).max() < 2e-3
    assert np.abs(velocity - orbit.velocity(np.array([at]))[:, 0]).max() < 2e-6
    with pytest.raises(InputError, match="2027-04-01"):
        esail.load_scene("heliocentric", given | {"initial.epoch": "2027-04-01"})


def test_a_planet_gives_its_state_of_the_date(tmp_path):
    """A kernel with the Earth on an ellipse about a Sun at rest, in EME2000 and TDB."""
    orbit = Ellipse(1.5e8, 0.1, 3.2e7, 0.3)
    j2000 = read_instant("2000-01-01T12:00:00 TDB", "x")
    first, last = (
        float(seconds_between(j2000, read_instant(f"2027-{x} TDB", "x"))) for x in ("02-01", "04-01")
    )

    def at_rest(t):
        return np.zeros((3, len(t)))

    spans = [(399, 0, orbit.position), (10, 0, at_rest)]
    made = [(body, centre, first, last, chebyshev(x, first, last, 60)) for body, centre, x in spans]
    kernel = write_kernel(tmp_path / "made.bsp", made)
    given = {"orbit.start_at": "earth", "orbit.kernel": str(kernel), "initial.epoch": EPOCH}
    position, velocity = start(esail.load_scene("heliocentric", given))
    at = np.array([float(seconds_between(j2000, in_scale(read_instant(EPOCH, "x"), "TDB")))])
    np.testing.assert_allclose(
        position, TO_EQUATOR.T @ (1e3 * orbit.position(at)[:, 0]), rtol=0.0, atol=1.0
    )
    np.testing.assert_allclose(
        velocity, TO_EQUATOR.T @ (1e3 * orbit.velocity(at)[:, 0]), rtol=0.0, atol=1e-4
    )
    with pytest.raises(esail.SceneError, match=r"`orbit.start_at` must be one of mercury, venus"):
        esail.load_scene("heliocentric", given | {"orbit.start_at": "vulcan"})
    with pytest.raises(esail.SceneError, match="must hold the instant 2027-06-01"):
        esail.load_scene("heliocentric", given | {"initial.epoch": "2027-06-01"})


REFUSED = {
    "two starts": (
        {"start_at": "earth", "kernel": "x", "oem": "y"},
        r"`orbit.oem` must be left out with `orbit",
    ),
    "no kernel": (
        {"start_at": "earth"},
        r"`orbit.kernel` must be given with `orbit.start_at`, but is missing",
    ),
    "kernel alone": ({"kernel": "x.bsp"}, r"`orbit.kernel` must be left out without the start"),
    "no date": ({"oem": "x.oem"}, r"`initial.epoch` must be given with `orbit.oem`, but is missing"),
    "no velocity": (
        {"position_km": [1e8, 0.0, 0.0]},
        r"`orbit.velocity_km_s` must be given with `orbit.pos",
    ),
    "frame": (
        {"position_km": [1e8, 0.0, 0.0], "velocity_km_s": [0.0, 30.0, 0.0], "frame": "galactic"},
        r"`orbit.frame` must be \"ecliptic\" or \"equatorial\", but is 'galactic'",
    ),
    "zero": (
        {"position_km": [0.0] * 3, "velocity_km_s": [1.0] * 3},
        r"`orbit.position_km` must not be zero",
    ),
    "frame of a planet": (
        {"start_at": "earth", "kernel": "x", "frame": "ecliptic"},
        r"`orbit.frame` must be",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_refused(name):
    """In one line that names the key."""
    orbit, message = REFUSED[name]
    with pytest.raises(esail.SceneError, match=message):
        scene(**orbit)


def test_another_date_needs_another_start():
    """The state belongs to the date: it does not stay behind."""
    first = esail.load_scene("heliocentric", {"initial.epoch": EPOCH})
    with pytest.raises(esail.SceneError, match=r"`initial.epoch` must be changed together with `orbit.pos"):
        first.replace({"initial.epoch": "2027-04-01"})
    assert first.replace({"initial.epoch": "2027-03-01T12:00"}).orbit == first.orbit
    assert first.replace({"initial.epoch": None}).initial.epoch is None
    both = {"initial.epoch": "2027-04-01", "orbit.position_au": [1.0, 0.0, 0.0]}
    assert first.replace(both).initial.epoch == "2027-04-01"


def test_an_override_replaces_the_start_of_a_file(tmp_path):
    """As a whole: numbers take the place of a message, which is not even opened; half a start, or one that
    is taken away, is refused."""
    text = to_toml(scene())
    at, rest = text.index("[orbit]"), text.index("position_au")
    lines = [x for x in text[rest:].splitlines() if not x.startswith(("position_au", "velocity ="))]
    path = tmp_path / "start.toml"
    path.write_text(text[:at] + '[orbit]\noem = "missing.oem"\n' + "\n".join(lines))
    date = {"initial.epoch": EPOCH}
    with pytest.raises(InputError, match=r"missing.oem` must be an OEM, but does not exist"):
        esail.load_scene(path, date)
    numbers = {"orbit.position_au": [1.0, 0.0, 0.5], "orbit.velocity": [0.0, 3e4, 0.0]}
    assert esail.load_scene(path, date | numbers).orbit.position_au == (1.0, 0.0, 0.5)
    with pytest.raises(esail.SceneError, match=r"`orbit.velocity` must be given with `orbit.position_au`"):
        esail.load_scene(path, date | {"orbit.position_au": [1.0, 0.0, 0.5]})
    velocity = {"orbit.oem": None, "orbit.velocity": [0.0, 3e4, 0.0]}
    with pytest.raises(esail.SceneError, match=r"`orbit.position_au` must be given, but is missing"):
        esail.load_scene(path, date | velocity)


def test_a_chain_has_no_such_start():
    """Its orbit is a circle: the key that is not known is the one that was given."""
    with pytest.raises(esail.SceneError, match=r"`orbit.position_km` must be a known key"):
        esail.load_scene("tethered-satellite", {"orbit.position_km": [1e8, 0.0, 0.0]})
