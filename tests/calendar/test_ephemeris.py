"""Planets from a kernel: against SPICE, against the library's raw numbers, and against known motions."""

import sys

import numpy as np
import pytest
import spiceypy
from jplephem.spk import SPK

from esail_jax.calendar.ephemeris import BODIES, EPOCH, JULIAN, heliocentric
from esail_jax.calendar.frames import to_equatorial
from esail_jax.calendar.instants import DAY, Instants, after, in_scale, read_instant, seconds_between
from esail_jax.errors import SceneError
from support.ellipses import Ellipse
from support.kernels import chebyshev, write_kernel

START, STOP = 8.4e8, 8.4e8 + 320 * DAY
AU = 1.495978707e8


MOTIONS = {
    (3, 0): Ellipse(AU, 0.0167, 365.25 * DAY, 0.3),
    (399, 3): Ellipse(4.7e3, 0.05, 27.3 * DAY, 1.0),
    (301, 3): Ellipse(3.8e5, 0.05, 27.3 * DAY, 1.0 + np.pi),
    (4, 0): Ellipse(1.52 * AU, 0.09, 687.0 * DAY, 2.0),
    (10, 0): Ellipse(8e5, 0.1, 4332.0 * DAY, 4.0),
}


def segments(names=tuple(MOTIONS), start=START, stop=STOP, records=80):
    return [(*x, start, stop, chebyshev(MOTIONS[x].position, start, stop, records)) for x in names]


@pytest.fixture(scope="module")
def kernel(tmp_path_factory):
    return write_kernel(tmp_path_factory.mktemp("kernel") / "made.bsp", segments())


TIMES = np.concatenate([[START, STOP], np.random.default_rng(67).uniform(START, STOP, 200)])
AT = after(EPOCH, TIMES)


def known(way):
    """The sums of positions [m] and velocities [m/s] along a way, in EME2000."""
    position = sum(sign * MOTIONS[x].position(TIMES) for sign, x in way)
    velocity = sum(sign * MOTIONS[x].velocity(TIMES) for sign, x in way)
    return 1e3 * position.T, 1e3 * velocity.T


WAYS = {
    "earth": [(1, (399, 3)), (1, (3, 0)), (-1, (10, 0))],
    "moon": [(1, (301, 3)), (1, (3, 0)), (-1, (10, 0))],
    "earth-moon barycentre": [(1, (3, 0)), (-1, (10, 0))],
    "mars": [(1, (4, 0)), (-1, (10, 0))],
}


@pytest.mark.parametrize("body", WAYS)
def test_motions_are_the_known_ones(kernel, body):
    """To the rounding of the polynomials."""
    found, (position, velocity) = heliocentric(kernel, body, AT), known(WAYS[body])
    assert np.abs(to_equatorial(found.position) - position).max() < 2e-2
    assert np.abs(to_equatorial(found.velocity) - velocity).max() < 1e-5


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("body", WAYS)
def test_states_are_those_of_spice(tmp_path, body, order):
    """`spkezr` of the same file, in the ecliptic of J2000: to a centimetre and a micrometre per second."""
    path = write_kernel(tmp_path / "made.bsp", segments(), order=order)
    spiceypy.furnsh(str(path))
    try:
        states = np.array([spiceypy.spkez(BODIES[body], t, "ECLIPJ2000", "NONE", 10)[0] for t in TIMES])
    finally:
        spiceypy.unload(str(path))
    found = heliocentric(path, body, AT)
    assert np.abs(found.position - 1e3 * states[:, :3]).max() < 1e-2
    assert np.abs(found.velocity - 1e3 * states[:, 3:]).max() < 1e-6


def test_numbers_are_those_of_the_library(kernel):
    with SPK.open(kernel) as opened:
        days, parts = AT.day + JULIAN, AT.second / DAY
        mars, sun = (opened[0, x].compute_and_differentiate(days, parts) for x in (4, 10))
    found = heliocentric(kernel, "mars", AT)
    assert np.abs(to_equatorial(found.position).T - 1e3 * (mars[0] - sun[0])).max() < 1e-3
    assert np.abs(to_equatorial(found.velocity).T - 1e3 / DAY * (mars[1] - sun[1])).max() < 1e-9


def test_one_instant_and_instants_of_utc(kernel):
    """69 seconds from UTC to TDB are two thousand kilometres of the Earth's way."""
    tdb = read_instant("2027-01-01T00:00:00 TDB", "x")
    one = heliocentric(kernel, "earth", tdb)
    assert one.position.shape == one.velocity.shape == (3,)
    utc = heliocentric(kernel, "earth", in_scale(tdb, "UTC"))
    assert np.abs(utc.position - one.position).max() < 1e-2
    late = heliocentric(kernel, "earth", Instants(tdb.day, tdb.second, "UTC"))
    shift = np.linalg.norm(late.position - one.position) / np.linalg.norm(one.velocity)
    assert abs(shift - seconds_between(tdb, in_scale(Instants(tdb.day, tdb.second, "UTC"), "TDB"))) < 1e-3


def test_the_last_segment_that_covers_an_instant_counts(tmp_path):
    """As for SPICE. The centre of a body may be the Sun itself."""
    middle = 0.5 * (START + STOP)
    about_sun = (4, 10)
    first = (*about_sun, START, STOP, chebyshev(MOTIONS[4, 0].position, START, STOP, 80))
    second = (*about_sun, middle, STOP, chebyshev(MOTIONS[3, 0].position, middle, STOP, 40))
    path = write_kernel(tmp_path / "made.bsp", [first, second])
    found = to_equatorial(heliocentric(path, "mars", AT).position)
    early, late = (known([(1, x)])[0] for x in ((4, 0), (3, 0)))
    assert np.abs(found - np.where((TIMES < middle)[:, None], early, late)).max() < 1.0


def test_what_a_kernel_cannot_give_is_refused(kernel, tmp_path):
    def message(path=kernel, body="earth", at=AT):
        with pytest.raises(SceneError) as error:
            heliocentric(path, body, at, "start.body")
        assert "\n" not in str(error.value)
        return str(error.value)

    assert message(body="mras") == (
        "`start.body` must be one of mercury, venus, earth-moon barycentre, mars, jupiter, saturn, uranus, "
        "neptune, moon, earth, but is 'mras' (perhaps `mars`)"
    )
    assert message(body="venus") == (
        f"`{kernel}` must hold the motion of venus and the Sun, but holds earth-moon barycentre, mars, "
        "moon, earth"
    )
    assert message(at=read_instant("2060-03-01T12:00:00 TDB", "x")) == (
        f"`{kernel}` must hold the instant 2060-03-01T12:00:00.000 TDB, but spans 2026-08-14 to 2027-06-30"
    )
    assert message(tmp_path / "none.bsp").endswith("must be an SPK kernel, but is no file")
    assert message(tmp_path).endswith("must be an SPK kernel, but is no file")
    no_sun = write_kernel(tmp_path / "no_sun.bsp", segments([(3, 0), (399, 3)]))
    assert "must hold the motion of earth and the Sun" in message(no_sun)
    for kind, frame in ((3, 1), (2, 17)):
        other = write_kernel(tmp_path / "other.bsp", segments(), kind, frame)
        assert message(other).endswith(f"in the frame J2000 (1), but has type {kind} in frame {frame}")


@pytest.mark.parametrize("change", ["text", "empty", "head", "short"])
def test_a_file_that_is_no_kernel_is_refused(kernel, tmp_path, change):
    whole = kernel.read_bytes()
    content = {"text": b"time,speed\n" * 200, "empty": b"", "head": whole[:900], "short": whole[:-40000]}
    path = tmp_path / "wrong.bsp"
    path.write_bytes(content[change])
    with pytest.raises(SceneError, match=r"must be an intact SPK kernel, but is not: ") as error:
        heliocentric(path, "earth", AT)
    assert "\n" not in str(error.value)


def test_the_library_that_is_missing_is_named(kernel, monkeypatch):
    monkeypatch.setitem(sys.modules, "jplephem.spk", None)
    with pytest.raises(
        SceneError, match=r"jplephem, but that is missing: `pip install 'esail_jax\[flight\]'`"
    ):
        heliocentric(kernel, "earth", AT)
