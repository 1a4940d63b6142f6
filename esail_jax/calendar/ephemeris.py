"""Planets about the Sun, from a kernel of SPICE such as de421.bsp.

A kernel (SPK) holds segments, each with the motion of one body about another one, its centre, as Chebyshev
polynomials of TDB. The way from a planet to the Sun is the sum of the segments from both to the barycentre
of the solar system. Kernels of planets are at
https://naif.jpl.nasa.gov/pub/naif/generic_kernels/spk/planets; the library jplephem, which the extra
`flight` installs, reads them.

Mercury and Venus have no moon. Mars and the planets beyond are the barycentres of planet and moons, which
is what such a kernel holds: 0.2 m from the centre of Mars, 200 km from that of Jupiter."""

import os
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from esail_jax.calendar.frames import to_ecliptic
from esail_jax.calendar.instants import DAY, Instants, after, in_scale, seconds_between, written
from esail_jax.errors import SceneError, nearest

BODIES = {
    "mercury": 1, "venus": 2, "earth-moon barycentre": 3, "mars": 4, "jupiter": 5, "saturn": 6,
    "uranus": 7, "neptune": 8, "moon": 301, "earth": 399,
}  # fmt: skip
"""SPICE's numbers of the bodies."""

BARYCENTRE, SUN = 0, 10

EPOCH = Instants(np.array(51544), np.array(43200.0), "TDB")
"""J2000, from which the seconds of a kernel are counted."""

JULIAN = 2400000.5
"""Julian Date minus Modified Julian Date."""

EQUATORIAL, CHEBYSHEV = 1, 2
"""SPICE's numbers of the frame J2000, and of the kind of segment that has polynomials of the position."""

Segment = Any
"""A segment of jplephem, which has no types."""


class State(NamedTuple):
    """Position [m] and velocity [m/s] with respect to the Sun, in the ecliptic of J2000."""

    position: Float[np.ndarray, "*time 3"]
    velocity: Float[np.ndarray, "*time 3"]


def heliocentric(kernel: str | os.PathLike, body: str, at: Instants, name: str = "body") -> State:
    """Position [m] and velocity [m/s] of a body of BODIES about the Sun, in the ecliptic of J2000.

    kernel: path of an SPK file; at: one instant or several; name: what the body is called in an error.
    They are geometric: light time and aberration are not in them. Raises SceneError for an unknown body,
    for a file that is not such a kernel or lacks the body, for instants outside of it, and if jplephem is
    missing."""
    if body not in BODIES:
        raise SceneError(name, f"be one of {', '.join(BODIES)}", f"is {body!r}{nearest(body, BODIES)}")
    try:
        from jplephem.daf import DAF
        from jplephem.spk import SPK
    except ImportError:
        got = "that is missing: `pip install 'esail_jax[flight]'` installs it"
        raise SceneError(str(kernel), "be read with jplephem", got) from None
    at = in_scale(at, "TDB")
    if not Path(kernel).is_file():
        raise SceneError(str(kernel), "be an SPK kernel", "is no file")
    try:
        with open(kernel, "rb") as file:
            return relative(SPK(DAF(file)).segments, kernel, body, at)
    except SceneError:
        raise
    except (ValueError, TypeError, struct.error) as error:
        raise SceneError(str(kernel), "be an intact SPK kernel", f"is not: {error}") from error


def relative(segments: list[Segment], kernel: str | os.PathLike, body: str, at: Instants) -> State:
    """The state of a body minus that of the Sun, of the segments of a kernel. Raises SceneError if they
    lack one of them."""
    ways = [list(way(segments, code)) for code in (BODIES[body], SUN)]
    ends = [
        steps[-1][-1].center if steps else code
        for steps, code in zip(ways, (BODIES[body], SUN), strict=True)
    ]
    if ends[0] != ends[1] or not ways[0]:
        known = [name for name, code in BODIES.items() if any(x.target == code for x in segments)]
        raise SceneError(
            str(kernel),
            f"hold the motion of {body} and the Sun",
            f"holds {', '.join(known) or 'no planet'}",
        )
    total = np.zeros((2, *np.shape(at.day), 3))
    for sign, steps in zip((1.0, -1.0), ways, strict=True):
        for step in steps:
            total += sign * evaluated(step, kernel, at)
    return State(*to_ecliptic(total))


def way(segments: list[Segment], code: int) -> Iterator[list[Segment]]:
    """Yields the segments of a body, those of their centre, and so on to the barycentre of the solar system
    or to a centre without segments. The centre of a body is that of its last segment, which has
    precedence."""
    while code != BARYCENTRE and (steps := [x for x in segments if x.target == code]):
        code = steps[-1].center
        yield [x for x in steps if x.center == code]


def evaluated(
    step: list[Segment], kernel: str | os.PathLike, at: Instants
) -> Float[np.ndarray, "2 *time 3"]:
    """Position [m] and velocity [m/s] in EME2000 of a body about its centre, from its segments, of which
    the last one that covers an instant counts. Raises SceneError for instants that none covers, and for
    segments in another form."""
    seconds = np.atleast_1d(seconds_between(EPOCH, at))
    day, second = (np.broadcast_to(x, seconds.shape) for x in (at.day, at.second))
    total = np.full((2, 3, *seconds.shape), np.nan)
    for segment in step:
        if (segment.frame, segment.data_type) != (EQUATORIAL, CHEBYSHEV):
            must = "hold Chebyshev polynomials of positions (type 2) in the frame J2000 (1)"
            raise SceneError(str(kernel), must, f"has type {segment.data_type} in frame {segment.frame}")
        inside = (segment.start_second <= seconds) & (seconds <= segment.end_second)
        if inside.any():
            position, velocity = segment.compute_and_differentiate(
                day[inside] + JULIAN, second[inside] / DAY
            )
            total[:, :, inside] = 1e3 * position, 1e3 / DAY * velocity
    missing = np.isnan(total).any(axis=(0, 1))
    if missing.any():
        first = written(Instants(day[missing], second[missing], "TDB"))[0]
        ends = [after(EPOCH, np.array([x.start_second, x.end_second])) for x in step]
        spans = " and ".join(" to ".join(text[:10] for text in written(x)) for x in ends)
        raise SceneError(str(kernel), f"hold the instant {first} TDB", f"spans {spans}")
    return np.moveaxis(total, 1, -1).reshape(2, *np.shape(at.day), 3)
