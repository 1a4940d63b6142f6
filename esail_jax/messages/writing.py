"""Orbits and attitudes as messages of the CCSDS, in the text form of keys and values.

OEM 2.0 (CCSDS 502.0-B-2) holds positions and velocities about the Sun, AEM 1.0 (CCSDS 504.0-B-1)
quaternions. Both are in EME2000, whose axes are taken as those of the ICRF. Dates have nanoseconds: at the
orbital speed of the Earth a microsecond is 3 cm."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from esail_jax.calendar.frames import attitude_to_equatorial, quaternions, to_equatorial
from esail_jax.calendar.instants import Instants, in_scale, seconds_between, written
from esail_jax.errors import SceneError
from esail_jax.messages.trajectory import Trajectory

DATE_DIGITS = 9
"""Decimals of the second."""

POSITION_DIGITS, VELOCITY_DIGITS = 6, 9
"""Decimals of positions [km] and velocities [km/s]."""

QUATERNION_DIGITS = 12

LONGEST = 200
"""Most characters of a name: a line of a message has 254."""


class Head(NamedTuple):
    """What a message says of itself. creation: one instant; object_id: the international designator, such
    as "2027-012A", or another name of a body that has none."""

    creation: Instants
    originator: str
    object_name: str
    object_id: str


def oem_text(head: Head, rows: Trajectory, degree: int) -> str:
    """The text of an Orbit Ephemeris Message. degree: odd degree of the polynomials between the rows
    (Hermite), which the message names.

    Positions are rounded to a millimetre, velocities to a micrometre per second. The scale of the instants
    is that of the dates. Raises SceneError for names that do not fit in a line, for rows whose instants do
    not increase or that are not finite, and for a degree that the rows do not have."""
    most = 2 * len(rows.position) - 1
    if degree % 2 == 0 or not 3 <= degree <= most:
        must = f"be odd, 3 or more, and {most} at most for {len(rows.position)} rows"
        raise SceneError("degree", must, f"is {degree}")
    frame = [("CENTER_NAME", "SUN"), ("REF_FRAME", "EME2000")]
    method = [("INTERPOLATION", "HERMITE"), ("INTERPOLATION_DEGREE", str(degree))]
    columns = [
        *decimals("position", 1e-3 * to_equatorial(rows.position), POSITION_DIGITS),
        *decimals("velocity", 1e-3 * to_equatorial(rows.velocity), VELOCITY_DIGITS),
    ]
    dates = dates_of(rows.at)
    lines = [" ".join(x) for x in zip(dates, *columns, strict=True)]
    return message("OEM", "2.0", head, [*frame, *span(rows.at, dates), *method], lines)


def aem_text(head: Head, at: Instants, rotation: Float[np.ndarray, "time 3 3"]) -> str:
    """The text of an Attitude Ephemeris Message with the quaternions from EME2000 to the axes of the body.

    rotation: maps components in the body's axes to the ecliptic of J2000, as `rotation_IB`. Between two
    rows the body must turn by less than half a turn, or the direction of the turn is lost. Raises
    SceneError for names that do not fit in a line, for instants that do not increase, and for matrices that
    are not finite."""
    frames = [("REF_FRAME_A", "EME2000"), ("REF_FRAME_B", "SC_BODY_1"), ("ATTITUDE_DIR", "A2B")]
    kind = [("ATTITUDE_TYPE", "QUATERNION"), ("QUATERNION_TYPE", "LAST")]
    columns = decimals("rotation", quaternions(attitude_to_equatorial(rotation)), QUATERNION_DIGITS)
    dates = dates_of(at)
    lines = [" ".join(x) for x in zip(dates, *columns, strict=True)]
    data = ["DATA_START", *lines, "DATA_STOP"]
    return message("AEM", "1.0", head, [*frames, *span(at, dates), *kind], data)


def message(kind: str, version: str, head: Head, meta: list[tuple[str, str]], data: list[str]) -> str:
    """The text of a message with one segment."""
    names = {"originator": head.originator, "object_name": head.object_name, "object_id": head.object_id}
    for key, value in names.items():
        fits = 0 < len(value) <= LONGEST and value.strip() == value
        if not (fits and value.isascii() and value.isprintable()):
            must = f"be 1 to {LONGEST} printable characters of ASCII without a blank at the ends"
            raise SceneError(key, must, f"is {value!r}")
    created = written(in_scale(head.creation, "UTC", "creation"), 0)[0]
    lines = [
        keyed(f"CCSDS_{kind}_VERS", version),
        keyed("CREATION_DATE", created),
        keyed("ORIGINATOR", head.originator),
        "",
        "META_START",
        keyed("OBJECT_NAME", head.object_name),
        keyed("OBJECT_ID", head.object_id),
        *(keyed(*x) for x in meta),
        "META_STOP",
        "",
        *data,
    ]
    return "\n".join(lines) + "\n"


def keyed(key: str, value: str) -> str:
    """The line of a key and its value."""
    return f"{key:<20} = {value}"


def span(at: Instants, dates: list[str]) -> list[tuple[str, str]]:
    """The scale of the dates, the first one and the last one."""
    return [("TIME_SYSTEM", at.scale), ("START_TIME", dates[0]), ("STOP_TIME", dates[-1])]


def dates_of(at: Instants) -> list[str]:
    """The dates of rows. Raises SceneError for instants that do not increase."""
    before, later = (Instants(at.day[x], at.second[x], at.scale) for x in (slice(-1), slice(1, None)))
    steps = seconds_between(before, later)
    if (steps < 10.0**-DATE_DIGITS).any():
        row = int(np.argmax(steps < 10.0**-DATE_DIGITS)) + 1
        raise SceneError("time", "increase from row to row", f"does not at index {row}")
    return written(at, DATE_DIGITS)


def decimals(name: str, table: Float[np.ndarray, "time column"], digits: int) -> list[list[str]]:
    """The columns of a table of numbers as texts of the same width. Raises SceneError for numbers that are
    not finite. name: what the table is called in an error."""
    finite = np.isfinite(table).all(axis=1)
    if not finite.all():
        raise SceneError(name, "be finite", f"is not at index {int(np.argmin(finite))}")
    columns = []
    for column in table.T.tolist():
        texts = [f"{x:z.{digits}f}" for x in column]
        width = max(map(len, texts))
        columns.append([x.rjust(width) for x in texts])
    return columns
