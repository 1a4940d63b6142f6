"""The orbit and the attitude of a run as messages of the CCSDS: OEM and AEM.

An orbit is that of the hub about the Sun, an attitude that of the hub, both in EME2000. Needed are the
observables `heliocentric_position` and `heliocentric_velocity`, or `rotation_IB`, and an epoch. This module
needs no JAX."""

import datetime
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from esail_jax.calendar.instants import EPOCH, Instants, Scale, after, in_scale, read_instant
from esail_jax.files.opening import RunFileError
from esail_jax.files.reading import Results, open_results
from esail_jax.messages.trajectory import Trajectory, interpolation_error
from esail_jax.messages.writing import Head, aem_text, oem_text

DEGREE = 7
"""Degree of the polynomials between rows: four rows of position and velocity."""

ORIGINATOR = "ESAIL_JAX"


class Named(NamedTuple):
    """How a message names the spacecraft, and in which time scale its dates are.

    object_name: None for the name of the run file; object_id: the international designator, or another
    name; None for that of the object."""

    object_name: str | None = None
    object_id: str | None = None
    scale: Scale = "UTC"


def write_oem(run: Any, path: Path, named: Named) -> str:
    """Writes the orbit of a run as an Orbit Ephemeris Message, and returns a sentence on the error of
    what the message says between its rows.

    run: a path, or a solution. Raises RunFileError for a run without epoch or orbit, and InputError for
    names that fit in no line."""
    with open_results(run) as results:
        at, rows = dated_rows(results, ("heliocentric_position", "heliocentric_velocity"), named.scale)
        motion, count, name = Trajectory(at, *rows), len(at.day), results.path
        if count < 2:
            raise RunFileError(f"`{name}` must have two rows or more for an orbit, but has {count}")
        degree = min(DEGREE, 2 * count - 1)
        path.write_text(oem_text(head_of(name, named), motion, degree), encoding="ascii")
    said = f"Between its rows the message holds polynomials of degree {degree} (Hermite)"
    if count < 3:
        return f"{said}."
    position, velocity = interpolation_error(motion, degree)
    return (
        f"{said}: without every second row they would be off by up to {position:.2g} m and "
        f"{velocity:.2g} m/s."
    )


def write_aem(run: Any, path: Path, named: Named) -> str:
    """Writes the attitude of the hub of a run as an Attitude Ephemeris Message, and returns a sentence
    on the largest turn between two rows.

    run: a path, or a solution. Raises RunFileError for a run without an epoch or a hub, and for rows
    between which the hub turns by half a turn or more, and InputError for names that fit in no line."""
    with open_results(run) as results:
        at, (rotation, rates) = dated_rows(results, ("rotation_IB", "angular_velocity_B"), named.scale)
        turned = turns(results.time[: len(at.day)], rates)
        if turned >= np.pi:
            got = f"turns by {np.rad2deg(turned):.0f} deg: save rows more often"
            must = "turn by less than 180 deg between two rows"
            raise RunFileError(f"`{results.path}` must {must}, but {got}")
        path.write_text(aem_text(head_of(results.path, named), at, rotation), encoding="ascii")
    return f"Between two rows the hub turns by {np.rad2deg(turned):.3g} deg at most."


def turns(times: np.ndarray, rates: np.ndarray) -> float:
    """The largest angle [rad] by which a hub turns from row to row. rates: its angular velocities in the
    rows [rad/s]."""
    steps, size = np.diff(times), np.linalg.norm(rates, axis=1)
    return float((steps * np.maximum(size[1:], size[:-1])).max()) if len(steps) else 0.0


def dated_rows(results: Results, names: tuple[str, ...], scale: Scale) -> tuple[Instants, list[np.ndarray]]:
    """The instants of a run, and rows of observables, up to a failure. Raises RunFileError if it is an
    ensemble, or lacks one of them, or an epoch."""
    epoch = read_instant(results.one_run().epoch, EPOCH)
    for name in names:
        if name not in results.observables:
            raise RunFileError(f"`{results.path}` must have the observable `{name}`, but has not")
    rows = [np.asarray(results.observables[name][()]) for name in names]
    good = np.isfinite(rows[0].reshape(len(rows[0]), -1)).all(axis=1)
    count = len(good) if good.all() else int(np.argmin(good))
    if count == 0:
        raise RunFileError(f"`{results.path}` must have a saved instant, but has none")
    at = in_scale(after(epoch, results.time[:count]), scale, EPOCH)
    return at, [x[:count] for x in rows]


def head_of(run: Path, named: Named) -> Head:
    """The head of a message that is written now. run: the path, after which the object is named if it has
    no name."""
    now = datetime.datetime.now(datetime.UTC).replace(tzinfo=None).isoformat(timespec="seconds")
    name = run.stem if named.object_name is None else named.object_name
    return Head(
        read_instant(now, "creation"),
        ORIGINATOR,
        name,
        name if named.object_id is None else named.object_id,
    )
