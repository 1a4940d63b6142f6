"""Orbit messages: both public readers read what is written, and other messages are read or refused."""

import numpy as np
import pytest
from astropy.time import Time
from ccsds_ndm.ndm_io import NdmIo
from oem import OrbitEphemerisMessage

from esail_jax.calendar.frames import to_equatorial
from esail_jax.calendar.instants import Instants, after, in_scale, read_instant, written
from esail_jax.errors import SceneError
from esail_jax.messages.reading import DEGREE, read_oem
from esail_jax.messages.trajectory import Trajectory, interpolation_error
from esail_jax.messages.writing import Head, oem_text
from support.ellipses import Ellipse

DAY = 86400.0
ORBIT = Ellipse(1.5e11, 0.2, 365.25 * DAY, 0.4)
HEAD = Head(read_instant("2026-01-02T03:04:05.6", "x"), "ESAIL JAX", "SAIL 1", "2027-012A")
TIMES = 60.25 + 600.123456789 * np.arange(-4.0, 10.0)
"""Seconds from a minute before the leap second at the end of 2016, within which a row is."""


def rows_of(times, scale="UTC", start="2016-12-31T23:59:00"):
    first = read_instant(f"{start} {scale}", "x")
    return Trajectory(after(first, times), ORBIT.position(times).T, ORBIT.velocity(times).T)


@pytest.fixture(params=["UTC", "TDB"])
def rows(request):
    return rows_of(TIMES, request.param)


@pytest.fixture
def path(tmp_path, rows):
    file = tmp_path / "sail.oem"
    file.write_text(oem_text(HEAD, rows, 7))
    return file


def printed(path):
    """The words of the rows of a file."""
    return [line.split() for line in path.read_text().partition("META_STOP")[2].split("\n") if line]


def test_the_text_is_that_of_the_standard():
    """At the pericentre, where the velocity is along Y of the ellipse, in the plane tilted by asin 0.6."""
    orbit = Ellipse(1.5e11, 0.2, 365.25 * DAY, 0.0)
    times = 600.0 * np.arange(4.0)
    at = after(read_instant("2027-03-01T00:00:00 TDB", "x"), times)
    rows = Trajectory(at, orbit.position(times).T, orbit.velocity(times).T)
    head, _, data = oem_text(HEAD, rows, 7).partition("META_STOP\n\n")
    assert head.split("\n") == [
        "CCSDS_OEM_VERS       = 2.0",
        "CREATION_DATE        = 2026-01-02T03:04:06",
        "ORIGINATOR           = ESAIL JAX",
        "",
        "META_START",
        "OBJECT_NAME          = SAIL 1",
        "OBJECT_ID            = 2027-012A",
        "CENTER_NAME          = SUN",
        "REF_FRAME            = EME2000",
        "TIME_SYSTEM          = TDB",
        "START_TIME           = 2027-03-01T00:00:00.000000000",
        "STOP_TIME            = 2027-03-01T00:30:00.000000000",
        "INTERPOLATION        = HERMITE",
        "INTERPOLATION_DEGREE = 7",
        "",
    ]
    date, *numbers = data.split("\n")[0].split()
    assert date == "2027-03-01T00:00:00.000000000"
    assert numbers[:3] == ["120000000.000000", "0.000000", "0.000000"]
    speed, angle = orbit.velocity(np.zeros(1))[1, 0] / 0.8, np.arcsin(0.6) + np.radians(84381.448 / 3600.0)
    expected = [0.0, 1e-3 * speed * np.cos(angle), 1e-3 * speed * np.sin(angle)]
    assert numbers[3:] == [f"{x:.9f}" for x in expected]
    assert data.endswith("\n") and not data.endswith("\n\n")


def test_the_reader_oem_reads_the_rows(path, rows):
    """To the last printed digit, which is that of a millimetre and of a micrometre per second."""
    (segment,) = OrbitEphemerisMessage.open(path)
    assert segment.metadata["INTERPOLATION_DEGREE"] == 7
    states = list(segment)
    for state, words in zip(states, printed(path), strict=True):
        assert [*state.position, *state.velocity] == [float(x) for x in words[1:]]
    position, velocity = (1e-3 * to_equatorial(x) for x in (rows.position, rows.velocity))
    assert np.abs([x.position for x in states] - position).max() < 0.6e-6
    assert np.abs([x.velocity for x in states] - velocity).max() < 0.6e-9
    elapsed = [(x.epoch - states[0].epoch).sec for x in states]
    assert np.abs(elapsed - (TIMES - TIMES[0])).max() < 2e-9


def test_the_reader_ccsds_ndm_reads_the_rows(path):
    (segment,) = NdmIo().from_path(path).body.segment
    assert (segment.metadata.center_name, segment.metadata.ref_frame) == ("SUN", "EME2000")
    for state, words in zip(segment.data.state_vector, printed(path), strict=True):
        values = [state.x, state.y, state.z, state.x_dot, state.y_dot, state.z_dot]
        assert state.epoch == words[0]
        assert [float(x.value) for x in values] == [float(x) for x in words[1:]]


def test_our_reader_reads_the_rows(path, rows):
    """In metres and in the ecliptic again; the rounding of one component turns into two."""
    found = read_oem(path)
    (segment,) = found.segments
    assert (found.object_name, found.object_id, segment.degree) == ("SAIL 1", "2027-012A", 7)
    assert segment.rows.at.scale == rows.at.scale
    assert np.array_equal(segment.rows.at.day, rows.at.day)
    assert np.abs(segment.rows.at.second - rows.at.second).max() < 1e-9
    assert np.abs(segment.rows.position - rows.position).max() < 1e-3
    assert np.abs(segment.rows.velocity - rows.velocity).max() < 1e-6


def test_between_the_rows_the_orbit_is_within_the_stated_error(path, rows):
    """Days apart, where the error is more than the rounding of the rows."""
    times = np.arange(0.0, 81.0, 4.0) * DAY
    apart = rows_of(times, rows.at.scale)
    path.write_text(oem_text(HEAD, apart, 5))
    stated = interpolation_error(apart, 5)
    wanted = np.linspace(times[0], times[-1], 999)
    position, velocity = read_oem(path).state(after(apart.first(), wanted))
    assert np.linalg.norm(position - ORBIT.position(wanted).T, axis=1).max() < stated[0]
    assert np.linalg.norm(velocity - ORBIT.velocity(wanted).T, axis=1).max() < stated[1]
    assert stated[0] < 1e5


@pytest.mark.parametrize("scale", ["UTC", "TDB"])
def test_states_about_a_leap_second_are_right_in_both_scales(path, rows, scale):
    """To three millimetres: rows are rounded to one."""
    wanted = np.array([TIMES[0], -500.0, 59.0, 60.5, 60.999, 61.5, 100.0, 3000.0, TIMES[-1]])
    at = in_scale(after(read_instant(f"2016-12-31T23:59:00 {rows.at.scale}", "x"), wanted), scale)
    position, velocity = read_oem(path).state(at)
    assert np.abs(position - ORBIT.position(wanted).T).max() < 3e-3
    assert np.abs(velocity - ORBIT.velocity(wanted).T).max() < 1e-4
    one, _ = read_oem(path).state(Instants(at.day[1:2].reshape(()), at.second[1:2].reshape(()), scale))
    assert np.array_equal(one, position[1])


def test_the_reader_oem_interpolates_as_ours(tmp_path):
    """To the rounding of its powers of seconds: 10 cm."""
    path = tmp_path / "sail.oem"
    path.write_text(oem_text(HEAD, rows_of(60.0 * np.arange(9.0)), 5))
    theirs, ours = OrbitEphemerisMessage.open(path), read_oem(path)
    for second in (10.0, 45.0, 200.0, 470.0):
        at = after(ours.segments[0].rows.first(), np.array(second))
        state = theirs(Time(written(at, 9)[0], scale="utc"))
        position, velocity = (1e-3 * to_equatorial(x) for x in ours.state(at))
        assert np.abs(state.position - position).max() < 1e-4
        assert np.abs(state.velocity - velocity).max() < 1e-5


OTHER = """CCSDS_OEM_VERS = 3.0
COMMENT A message of another writer
CREATION_DATE = 2026-060T00:00:00
ORIGINATOR = SOMEBODY

META_START
OBJECT_NAME = Sail
COMMENT in the middle
OBJECT_ID = 2027-012A
CENTER_NAME = Sun
REF_FRAME = ICRF
TIME_SYSTEM = TDB
START_TIME = 2027-060T00:00:00
USEABLE_START_TIME = 2027-03-01T00:10:00
STOP_TIME = 2027-03-01T01:00:00Z
META_STOP
2027-060T00:00:00    1.5e8 0 0   0 30 0   0 0 0
2027-03-01T00:30:00Z 1.5e8 5.4e4 0 0 30 0 0 0 0

2027-03-01T01:00:00.000 1.5e8 1.08e5 0 0 30 0 0 0 0
COVARIANCE_START
EPOCH = 2027-03-01T00:30:00
1.0
COVARIANCE_STOP
META_START
OBJECT_NAME = SAIL
OBJECT_ID = 2027-012A
CENTER_NAME = SUN
REF_FRAME = EME2000
TIME_SYSTEM = TDB
START_TIME = 2027-03-01T01:00:00
STOP_TIME = 2027-03-01T02:00:00
INTERPOLATION = LAGRANGE
INTERPOLATION_DEGREE = 4
META_STOP
2027-03-01T01:00:00 1.5e8 1.08e5 0 0 29 0
2027-03-01T02:00:00 1.5e8 2.124e5 0 0 29 0
"""


def test_segments_of_other_writers_are_read(tmp_path):
    """Between segments the velocity jumps; the earlier one has the instant. Only the usable part counts."""
    path = tmp_path / "other.oem"
    path.write_text(OTHER, encoding="utf-8-sig")
    found = read_oem(path)
    assert [(len(x.rows.position), x.degree) for x in found.segments] == [(3, DEGREE), (2, 4)]
    at = after(
        read_instant("2027-03-01T00:00:00 TDB", "x"), np.array([600.0, 3599.0, 3600.0, 3601.0, 7200.0])
    )
    position, velocity = (to_equatorial(x) for x in found.state(at))
    assert np.abs(position[:, 0] - 1.5e11).max() < 1e-4
    assert (
        np.abs(position[:, 1] - 1e3 * np.array([1.8e4, 107970.0, 1.08e5, 108029.0, 2.124e5])).max() < 1e-4
    )
    assert np.abs(velocity[:, 1] - [3e4, 3e4, 3e4, 2.9e4, 2.9e4]).max() < 1e-6
    with pytest.raises(SceneError) as error:
        found.state(read_instant("2027-03-01T00:09:00 TDB", "x"))
    assert str(error.value) == (
        f"`{path}` must hold the instant 2027-03-01T00:09:00.000 TDB, but spans 2027-03-01T00:10:00.000 to "
        "2027-03-01T01:00:00.000 and 2027-03-01T01:00:00.000 to 2027-03-01T02:00:00.000"
    )


FIRST_ROW = "2027-060T00:00:00    1.5e8 0 0   0 30 0   0 0 0"
NO_ROW = "have rows of a date and 6 or 9 numbers, but line 17 has '2027-060"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "CCSDS_OEM_VERS = 3.0",
            "CCSDS_OPM_VERS = 3.0",
            "begin with CCSDS_OEM_VERS = 1.0, 2.0 or 3.0, but line 1 has 'CCSDS_OPM_VERS = 3.0'",
        ),
        (
            "VERS = 3.0",
            "VERS = 4.0",
            "begin with CCSDS_OEM_VERS = 1.0, 2.0 or 3.0, but line 1 has 'CCSDS_OEM_VERS = 4.0'",
        ),
        (
            "ORIGINATOR = ",
            "ORIGINATOR: ",
            "have keys with values before META_START, but line 4 has 'ORIGINATOR: SOMEBODY'",
        ),
        (
            "CENTER_NAME = Sun",
            "CENTER_NAME = SOLAR SYSTEM BARYCENTER",
            "have CENTER_NAME = SUN, as orbits here are about the Sun, but line 10 has "
            "'SOLAR SYSTEM BARYCENTER'",
        ),
        (
            "REF_FRAME = ICRF",
            "REF_FRAME = TOD",
            "have REF_FRAME = EME2000 or ICRF, whose axes do not turn, but line 11 has 'TOD'",
        ),
        (
            "TIME_SYSTEM = TDB",
            "TIME_SYSTEM = GPS",
            "have TIME_SYSTEM = UTC or TDB, the scales of dates here, but line 12 has 'GPS'",
        ),
        (
            "STOP_TIME = 2027-03-01T01:00:00Z\n",
            "",
            "name STOP_TIME in every segment, but line 15 has META_STOP without it",
        ),
        (
            "REF_FRAME = ICRF",
            "OBJECT_ID = 2",
            "have each key once, with a value, before META_STOP, but line 11 has 'OBJECT_ID = 2'",
        ),
        (
            "META_STOP\n2027-060",
            "2027-060",
            "have each key once, with a value, before META_STOP, but line 16 has "
            "'2027-060T00:00:00    1.5e8 0 0   0 30 0 ...'",
        ),
        (
            FIRST_ROW,
            "2027-060T00:00:00 1.5e8 0 0 0 30",
            "have rows of a date and 6 or 9 numbers, but line 17 has",
        ),
        (
            FIRST_ROW,
            FIRST_ROW.replace("30", "nan"),
            "have rows of a date and 6 or 9 numbers, but line 17 has",
        ),
        (
            FIRST_ROW,
            FIRST_ROW.replace("30", "fast"),
            "have rows of a date and 6 or 9 numbers, but line 17 has",
        ),
        (
            FIRST_ROW,
            FIRST_ROW.replace("060T", "366T"),
            "have dates of TDB such as 2027-03-01T12:00:00, but line 17 has '2027-366T00:00:00'",
        ),
        (
            "T00:30:00Z",
            "T23:59:60Z",
            "have dates of TDB such as 2027-03-01T12:00:00, but line 18 has '2027-03-01T23:59:60Z'",
        ),
        (
            "T00:30:00Z",
            "T00:00:00Z",
            "have rows in the order of time, but line 18 has '2027-03-01T00:00:00Z",
        ),
        (
            "2027-03-01T02:00:00 1.5e8 2.124e5 0 0 29 0",
            "",
            "have two rows or more in every segment, but line 36 has the end of a segment of 1",
        ),
        (
            "OBJECT_NAME = SAIL\n",
            "OBJECT_NAME = ROVER\n",
            "have one OBJECT_NAME, that of the first segment: 'Sail', but line 26 has 'ROVER'",
        ),
        (
            "DEGREE = 4",
            "DEGREE = many",
            "have an INTERPOLATION_DEGREE of 1 or more, but line 34 has 'many'",
        ),
        (
            OTHER[OTHER.index("META_START") :],
            "",
            "have a segment, which begins with META_START, but line 4 has the end of the file",
        ),
        (
            OTHER[OTHER.index("REF_FRAME") :],
            "",
            "end the keys of a segment with META_STOP, but line 10 has the end of the file",
        ),
    ],
)
def test_the_line_that_is_wrong_is_named(tmp_path, old, new, message):
    path = tmp_path / "other.oem"
    assert old in OTHER
    path.write_text(OTHER.replace(old, new, 1))
    with pytest.raises(SceneError) as error:
        read_oem(path)
    assert str(error.value).startswith(f"`{path}` must {message}")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("content", "reason"),
    [(None, "does not exist"), (b"\n \n", "is empty"), (b"\xff\xfe\x00", "cannot be read as text")],
)
def test_what_is_no_message_is_refused(tmp_path, content, reason):
    path = tmp_path / "other.oem"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(SceneError, match=rf"must be an OEM, but {reason}$"):
        read_oem(path)
    with pytest.raises(SceneError, match=r"must be an OEM, but is a folder$"):
        read_oem(tmp_path)


def test_what_does_not_fit_in_a_message_is_refused():
    rows = rows_of(TIMES)
    for name in ("", "two\nlines", "Ähre", " blank", "x" * 201):
        with pytest.raises(SceneError, match=r"`object_name` must be 1 to 200 printable characters"):
            oem_text(HEAD._replace(object_name=name), rows, 7)
    for degree in (1, 4, 29):
        with pytest.raises(SceneError, match=r"`degree` must be odd, 3 or more, and 27 at most"):
            oem_text(HEAD, rows, degree)
    equal = Instants(np.append(rows.at.day[:13], rows.at.day[12]), rows.at.second.copy(), "UTC")
    equal.second[13] = equal.second[12]
    with pytest.raises(SceneError) as error:
        oem_text(HEAD, rows._replace(at=equal), 7)
    assert str(error.value) == "`time` must increase from row to row, but does not at index 13"
    velocity = rows.velocity.copy()
    velocity[4, 1] = np.nan
    with pytest.raises(SceneError) as error:
        oem_text(HEAD, rows._replace(velocity=velocity), 7)
    assert str(error.value) == "`velocity` must be finite, but is not at index 4"
