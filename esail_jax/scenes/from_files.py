"""What files give in place of numbers: a measured wind, and where an orbit about the Sun starts. What they
give depends on the date of t = 0."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from esail_jax.calendar.frames import TO_EQUATOR
from esail_jax.calendar.instants import EPOCH, read_instant
from esail_jax.constants import ASTRONOMICAL_UNIT
from esail_jax.scenes import rules
from esail_jax.scenes.declarations import rule_of
from esail_jax.scenes.integration import Integrator
from esail_jax.scenes.requests import Request, given_value, without
from esail_jax.scenes.rules import SceneError
from esail_jax.wind_files.csv_rows import MUST
from esail_jax.wind_files.in_run import table_of_run
from esail_jax.wind_files.opening import read_rows
from esail_jax.wind_files.rows import COLUMNS, LARGEST_GAP, TIMES, WIND_FILE

END = rule_of(Integrator.__dataclass_fields__["t_end"])
"""The rule of `integrator.t_end`."""

GAP = replace(rules.positive, structure=True)
"""The rule of `solar_wind.largest_gap`: which rows there are cannot be traced."""

START_AT, KERNEL, OEM, FRAME = "orbit.start_at", "orbit.kernel", "orbit.oem", "orbit.frame"
POSITION_KM, VELOCITY_KM_S = "orbit.position_km", "orbit.velocity_km_s"
POSITION, VELOCITY = "orbit.position_au", "orbit.velocity"

STARTS = (START_AT, KERNEL, OEM, FRAME, POSITION_KM, VELOCITY_KM_S)
"""Keys that stand for `position_au` and `velocity` of [orbit]."""

FRAMES = ("ecliptic", "equatorial")


def with_one_epoch(request: Request) -> Request:
    """The request itself. Raises SceneError if another date takes the place of one to which the times of a
    wind, or the start of an orbit, belong, while these stay."""
    initial = request.tables.get("initial")
    before = initial.get("epoch") if isinstance(initial, Mapping) else None
    if before is None or request.overrides.get(EPOCH, before) == before:
        return request
    for key, others in ((TIMES, (WIND_FILE,)), (POSITION, (START_AT, OEM, POSITION_KM))):
        table, _, name = key.partition(".")
        content = request.tables.get(table)
        given = isinstance(content, Mapping) and content.get(name) is not None
        if given and not any(x in request.overrides for x in (key, *others)):
            raise SceneError(EPOCH, f"be changed together with `{key}`, which belongs to it", "is alone")
    return request


def with_wind_file(request: Request) -> Request:
    """The numbers of a wind file, or of several, take the place of its name and of the largest gap. Names
    in an override replace those in the tables, and start from the working folder. Raises SceneError."""
    file, largest_gap = given_value(request, WIND_FILE), given_value(request, LARGEST_GAP)
    wind = request.tables.get("solar_wind")
    result = without(request, (WIND_FILE, LARGEST_GAP))
    if file is None:
        if largest_gap is not None:
            raise SceneError(LARGEST_GAP, f"be left out without `{WIND_FILE}`", "is given")
        return result
    tables, overrides = dict(result.tables), dict(result.overrides)
    overridden = WIND_FILE in request.overrides
    given_twice = [key for key in COLUMNS if isinstance(wind, Mapping) and "file" in wind and key in wind]
    if overridden:
        given_twice += [key for key in COLUMNS if overrides.get(f"solar_wind.{key}") is not None]
    if given_twice:
        raise SceneError(f"solar_wind.{given_twice[0]}", f"be left out with `{WIND_FILE}`", "is given")
    columns = wind_of(request, file, Path() if overridden else request.folder, largest_gap)
    if overridden:
        overrides |= {f"solar_wind.{key}": value for key, value in columns.items()}
    else:
        tables["solar_wind"] = dict(tables["solar_wind"]) | columns
    return result._replace(tables=tables, overrides=overrides)


def wind_of(request: Request, given: Any, folder: Path, largest_gap: Any) -> dict[str, list[float]]:
    """The columns of the files that a scene names, as far as its run needs them. folder: where relative
    names start. Raises SceneError."""
    names = list(given) if isinstance(given, list | tuple) else [given]
    if not names or not all(isinstance(name, str) for name in names):
        raise SceneError(WIND_FILE, MUST, rules.describe(given))
    if largest_gap is not None:
        largest_gap = rules.check_value(LARGEST_GAP, largest_gap, GAP, None)
    text, end = given_value(request, EPOCH), given_value(request, "integrator.t_end")
    if end is not None:
        end = rules.check_value("integrator.t_end", end, END, None)
    epoch = None if text is None else read_instant(rules.check_date(EPOCH, text), EPOCH)
    table = table_of_run([read_rows(name, folder) for name in names], epoch, end, largest_gap)
    return {key: column.tolist() for key, column in table.items()}


def with_orbit_start(request: Request) -> Request:
    """Position and velocity at the start of an orbit take the place of what stands for them: a planet, a
    message, or numbers in other units or axes. A start in the overrides replaces that in the tables. Raises
    SceneError."""
    keys, content = (*STARTS, POSITION, VELOCITY), request.tables.get("orbit")
    in_tables = {key: content.get(key[6:]) for key in keys} if isinstance(content, Mapping) else {}
    overridden = any(request.overrides.get(key) is not None for key in STARTS)
    source = request.overrides if overridden else in_tables
    given = {key: source[key] for key in keys if source.get(key) is not None}
    if not any(key in given for key in STARTS):
        return without(request, STARTS)
    folder = Path() if overridden else request.folder
    position, velocity = start_of_orbit(given, given_value(request, EPOCH), folder)
    rest = without(request, keys)
    orbit = dict(rest.tables.get("orbit") or {}) | {"position_au": position, "velocity": velocity}
    return rest._replace(tables=dict(rest.tables) | {"orbit": orbit})


WAYS = {
    START_AT: (START_AT, KERNEL),
    OEM: (OEM,),
    POSITION_KM: (POSITION_KM, VELOCITY_KM_S),
    POSITION: (POSITION, VELOCITY),
}
"""The ways to say where an orbit starts, and the keys that each one needs."""


def start_of_orbit(given: Mapping[str, Any], date: Any, folder: Path) -> tuple[Any, Any]:
    """Position [au] and velocity [m/s] at the start, in the ecliptic. given: the keys of the start; date:
    that of t = 0, None if it has none. Raises SceneError."""
    way = next((key for key in WAYS if key in given), None)
    if way is None:
        key = next(iter(given))
        raise SceneError(key, "be left out without the start that it belongs to", "is given")
    of_vectors = way in (POSITION_KM, POSITION)
    for key in given:
        if key not in WAYS[way] and not (of_vectors and key == FRAME):
            raise SceneError(key, f"be left out with `{way}`", "is given")
    for key in WAYS[way]:
        if key not in given:
            raise SceneError(key, f"be given with `{way}`", "is missing")
    if not of_vectors:
        return of_date(given, way, date, folder)
    position, velocity = (vector_of(key, given[key]) for key in WAYS[way])
    if way == POSITION_KM:
        position, velocity = position * (1e3 / ASTRONOMICAL_UNIT), velocity * 1e3
    frame = given.get(FRAME, FRAMES[0])
    if frame not in FRAMES:
        raise SceneError(FRAME, 'be "ecliptic" or "equatorial"', rules.describe(frame))
    return (position, velocity) if frame == FRAMES[0] else (position @ TO_EQUATOR, velocity @ TO_EQUATOR)


def vector_of(key: str, value: Any) -> Any:
    """Three numbers, which may be traced. Raises SceneError."""
    rule = replace(rules.nonzero_vector, shape=rules.Shape.VECTOR)
    value = rules.check_value(key, value, rule, None)
    return np.array(value) if isinstance(value, tuple) else value


def of_date(given: Mapping[str, Any], way: str, date: Any, folder: Path) -> tuple[Any, Any]:
    """Position [au] and velocity [m/s] of a planet, or of a message, at the date of t = 0. Raises
    SceneError."""
    if date is None:
        raise SceneError(EPOCH, f"be given with `{way}`", "is missing")
    for key in WAYS[way]:
        if not isinstance(given[key], str):
            raise SceneError(key, "be a text", rules.describe(given[key]))
    epoch = read_instant(rules.check_date(EPOCH, date), EPOCH)
    if way == OEM:
        from esail_jax.messages.reading import read_oem

        position, velocity = read_oem(folder / given[OEM]).state(epoch)
    else:
        from esail_jax.calendar.ephemeris import heliocentric

        position, velocity = heliocentric(folder / given[KERNEL], given[START_AT], epoch, START_AT)
    return position / ASTRONOMICAL_UNIT, velocity
