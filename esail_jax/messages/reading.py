"""Orbits from messages of the CCSDS (OEM, versions 1.0 to 3.0, in the text form of keys and values).

A message has segments; each one names its centre, its frame and its scale of time, and has rows of a date,
a position [km] and a velocity [km/s]. Here the centre must be the Sun, the frame EME2000 or the ICRF, the
scale UTC or TDB. Accelerations and covariances are not read."""

import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple, NoReturn

import numpy as np
from jaxtyping import Float

from esail_jax.calendar.frames import to_ecliptic
from esail_jax.calendar.instants import (
    Instants,
    Scale,
    after,
    in_scale,
    read_instant,
    seconds_between,
    written,
)
from esail_jax.errors import SceneError
from esail_jax.messages.trajectory import Trajectory, interpolated

VERSIONS = ("1.0", "2.0", "3.0")

CHOICES = {
    "CENTER_NAME": (("SUN",), "as orbits here are about the Sun"),
    "REF_FRAME": (("EME2000", "ICRF"), "whose axes do not turn"),
    "TIME_SYSTEM": (("UTC", "TDB"), "the scales of dates here"),
}
"""Values that are understood, in capital letters, and why only these."""

NEEDED = (
    "OBJECT_NAME", "OBJECT_ID", "CENTER_NAME", "REF_FRAME", "TIME_SYSTEM", "START_TIME", "STOP_TIME",
)  # fmt: skip
"""Keys that every segment must have."""

SAME = ("OBJECT_NAME", "OBJECT_ID", "TIME_SYSTEM")
"""Keys that must have the same value in all segments."""

SHOWN = 40
"""Most characters of a line that an error shows."""

DEGREE = 7
"""Degree of the polynomials between rows of a message that names none."""

SLACK = 1e-6
"""Seconds by which an instant may be outside of the rows: more than the rounding from scale to scale."""

KEYED = re.compile(r"([A-Z_]+)\s*=\s*(.*\S)")


class Segment(NamedTuple):
    """Rows of a message between which one may interpolate. first, last: the part of it that may be used, as
    seconds from the first row; degree: of the polynomials between the rows."""

    rows: Trajectory
    first: float
    last: float
    degree: int

    def span(self) -> str:
        """The dates of the part that may be used."""
        return " to ".join(written(after(self.rows.first(), np.array([self.first, self.last]))))


class Oem(NamedTuple):
    """An Orbit Ephemeris Message. path: of its file; segments: in the order of time."""

    path: str
    object_name: str
    object_id: str
    segments: tuple[Segment, ...]

    def state(self, at: Instants) -> tuple[Float[np.ndarray, "*time 3"], Float[np.ndarray, "*time 3"]]:
        """Heliocentric position [m] and velocity [m/s] in the ecliptic of J2000 at instants in either
        scale, between rows by polynomials (Hermite). At the instant between two segments it is that of the
        earlier one. Raises SceneError for instants outside of the segments."""
        scale = self.segments[0].rows.at.scale
        at = in_scale(at, scale)
        day, second = np.atleast_1d(at.day), np.atleast_1d(at.second)
        found = np.full((2, len(day), 3), np.nan)
        for segment in reversed(self.segments):
            seconds = segment.rows.seconds(Instants(day, second, scale))
            inside = (segment.first - SLACK <= seconds) & (seconds <= segment.last + SLACK)
            if inside.any():
                chosen = Instants(day[inside], second[inside], scale)
                found[:, inside] = interpolated(segment.rows, chosen, segment.degree)
        missing = np.isnan(found).any(axis=(0, 2))
        if missing.any():
            date = written(Instants(day[missing], second[missing], scale))[0]
            spans = " and ".join(x.span() for x in self.segments)
            raise SceneError(self.path, f"hold the instant {date} {scale}", f"spans {spans}")
        position, velocity = found.reshape(2, *np.shape(at.day), 3)
        return position, velocity


class Line(NamedTuple):
    """A line of a file, with its number, from 1."""

    path: str
    number: int
    text: str

    def refuse(self, must: str, has: str) -> NoReturn:
        """Raises the error for this line: what the file must do, and what the line has instead."""
        raise SceneError(self.path, must, f"line {self.number} has {has}")

    def instant(self, text: str, scale: Scale) -> Instants:
        """The instant of a date in this line."""
        try:
            return read_instant(f"{text.removesuffix('Z')} {scale}", "date")
        except SceneError:
            self.refuse(f"have dates of {scale} such as 2027-03-01T12:00:00", shown(text))


def read_oem(path: str | os.PathLike) -> Oem:
    """The orbit of an Orbit Ephemeris Message. Raises SceneError, with the number of the line, for a file
    that is not one, and for an orbit in another frame, about another centre or in another scale."""
    lines = lines_of(path)
    first = next(lines, None)
    if first is None:
        raise SceneError(str(path), "be an OEM", "is empty")
    head = KEYED.fullmatch(first.text)
    if head is None or head[1] != "CCSDS_OEM_VERS" or head[2] not in VERSIONS:
        first.refuse(
            f"begin with CCSDS_OEM_VERS = {', '.join(VERSIONS[:-1])} or {VERSIONS[-1]}", shown(first.text)
        )
    line: Line | None = None
    for line in lines:
        if line.text == "META_START":
            break
        if KEYED.fullmatch(line.text) is None:
            line.refuse("have keys with values before META_START", shown(line.text))
    else:
        (line or first).refuse("have a segment, which begins with META_START", "the end of the file")
    segments: list[Segment] = []
    names: dict[str, str] = {}
    while line is not None:
        meta = read_meta(line, lines)
        for key in SAME:
            value = names.setdefault(key, meta[key].text)
            if value.upper() != meta[key].text.upper():
                meta[key].refuse(
                    f"have one {key}, that of the first segment: {shown(value)}", shown(meta[key].text)
                )
        segment, line = read_segment(meta, lines)
        segments.append(segment)
    return Oem(str(path), names["OBJECT_NAME"], names["OBJECT_ID"], tuple(segments))


def lines_of(path: str | os.PathLike) -> Iterator[Line]:
    """Yields the lines of a file without those that are empty or comments. Raises SceneError for a file
    that cannot be read as text."""
    try:
        text = Path(path).read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise SceneError(str(path), "be an OEM", "does not exist") from None
    except IsADirectoryError:
        raise SceneError(str(path), "be an OEM", "is a folder") from None
    except UnicodeDecodeError:
        raise SceneError(str(path), "be an OEM", "cannot be read as text") from None
    for number, content in enumerate(text.splitlines(), 1):
        words = content.strip()
        if words and not words.startswith("COMMENT"):
            yield Line(str(path), number, words)


def shown(text: str) -> str:
    """The beginning of a text, in quotes."""
    return repr(text if len(text) <= SHOWN else f"{text[:SHOWN]}...")


def read_meta(start: Line, lines: Iterator[Line]) -> dict[str, Line]:
    """The keys of a segment up to META_STOP; each value has the number of its line."""
    meta: dict[str, Line] = {}
    line = start
    for line in lines:
        if line.text == "META_STOP":
            break
        found = KEYED.fullmatch(line.text)
        if found is None or found[1] in meta:
            line.refuse("have each key once, with a value, before META_STOP", shown(line.text))
        meta[found[1]] = line._replace(text=found[2])
    else:
        line.refuse("end the keys of a segment with META_STOP", "the end of the file")
    for key in NEEDED:
        if key not in meta:
            line.refuse(f"name {key} in every segment", "META_STOP without it")
    for key, (known, why) in CHOICES.items():
        if meta[key].text.upper() not in known:
            meta[key].refuse(f"have {key} = {' or '.join(known)}, {why}", shown(meta[key].text))
    return meta


def read_segment(meta: dict[str, Line], lines: Iterator[Line]) -> tuple[Segment, Line | None]:
    """The rows of a segment, and the line of the next META_START, None at the end of the file."""
    scale: Scale = "UTC" if meta["TIME_SYSTEM"].text.upper() == "UTC" else "TDB"
    dates: list[Instants] = []
    numbers: list[list[float]] = []
    following, last, covariance = None, meta["STOP_TIME"], False
    for line in lines:
        if line.text == "META_START":
            following = line
            break
        if line.text in ("COVARIANCE_START", "COVARIANCE_STOP"):
            covariance = line.text == "COVARIANCE_START"
        elif not covariance:
            at, row = read_row(line, scale)
            if dates and seconds_between(dates[-1], at) <= 0.0:
                line.refuse("have rows in the order of time", shown(line.text))
            dates.append(at)
            numbers.append(row)
            last = line
    if len(dates) < 2:
        last.refuse("have two rows or more in every segment", f"the end of a segment of {len(dates)}")
    at = Instants(np.array([x.day for x in dates]), np.array([x.second for x in dates]), scale)
    table = to_ecliptic(1e3 * np.array(numbers).reshape(-1, 2, 3))
    rows = Trajectory(at, table[:, 0], table[:, 1])
    ends = []
    for side in ("START", "STOP"):
        named = meta.get(f"USEABLE_{side}_TIME", meta[f"{side}_TIME"])
        ends.append(named.instant(named.text, scale))
    # One cannot interpolate outside of the rows.
    first, end = np.clip([rows.seconds(x) for x in ends], 0.0, rows.seconds(at)[-1])
    return Segment(rows, float(first), float(end), degree_of(meta)), following


def read_row(line: Line, scale: Scale) -> tuple[Instants, list[float]]:
    """The date of a row, its position [km] and its velocity [km/s]."""
    date, *words = line.text.split()
    try:
        numbers = [float(x) for x in words]
    except ValueError:
        numbers = []
    if len(numbers) not in (6, 9) or not np.isfinite(numbers).all():
        line.refuse("have rows of a date and 6 or 9 numbers", shown(line.text))
    return line.instant(date, scale), numbers[:6]


def degree_of(meta: dict[str, Line]) -> int:
    """The degree of the polynomials between the rows. Rows have velocities: a polynomial of the degree that
    is named for another method, or the next odd one, is at least as near with half the rows."""
    named = meta.get("INTERPOLATION_DEGREE")
    if named is None:
        return DEGREE
    if not named.text.isdecimal() or int(named.text) < 1:
        named.refuse("have an INTERPOLATION_DEGREE of 1 or more", shown(named.text))
    return int(named.text)
