"""What a scene is asked to be, from tables and overrides by key to the tables of one scene.

`EXPANDERS` says it in order: each takes a `Request` and returns one in which something that stood for
something else is written out. At the end the tables say everything; they are checked when the `Scene` is
made of them."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from esail_jax.calendar.frames import TO_EQUATOR
from esail_jax.calendar.instants import EPOCH, read_instant
from esail_jax.constants import ASTRONOMICAL_UNIT
from esail_jax.errors import nearest
from esail_jax.scenes import rules
from esail_jax.scenes.declarations import rule_of
from esail_jax.scenes.integration import Integrator
from esail_jax.scenes.own_terms import OWN_TERMS
from esail_jax.scenes.parts import model_of, names_of, parts_of, tables_of
from esail_jax.scenes.rules import SceneError
from esail_jax.scenes.voltage import KEPT, OWN_LAW
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


class Request(NamedTuple):
    """A scene that is asked for.

    tables: of the file, or of the scene that is changed; overrides: other values, by key; folder: where
    relative names of files in the tables start; voltage_law, terms: those of the user."""

    tables: Mapping[str, Any]
    overrides: Mapping[str, Any]
    folder: Path
    voltage_law: Any = None
    terms: Any = ()


def given_value(request: Request, key: str) -> Any:
    """The value that a request gives for a key: that of the overrides, otherwise that of the tables, None
    if neither has it."""
    if key in request.overrides:
        return request.overrides[key]
    table, _, name = key.partition(".")
    content = request.tables.get(table)
    return content.get(name) if isinstance(content, Mapping) else None


def without(request: Request, keys: tuple[str, ...]) -> Request:
    """The request without some keys, in tables and overrides."""
    overrides = {key: value for key, value in request.overrides.items() if key not in keys}
    tables = {
        table: {name: x for name, x in content.items() if f"{table}.{name}" not in keys}
        if isinstance(content, Mapping)
        else content
        for table, content in request.tables.items()
    }
    return request._replace(tables=tables, overrides=overrides)


def unknown(key: str, model: str) -> SceneError:
    """The error for a key that the tables of a model do not have; it names the nearest key that they do
    have."""
    tables = tables_of(model)
    known = [f"{table}.{name}" for table, content in tables.items() for name in names_of(content)]
    for own, what in ((OWN_LAW, "numbers of a law"), (OWN_TERMS, "numbers of terms")):
        if key.partition(".")[0] == own:
            must = f"be left out: the {what} are given as a whole, by the argument `{own}`"
            return SceneError(key, must, "is given")
    if key in tables:
        return SceneError(key, "be followed by a key of the table", "is the table's name")
    return SceneError(key, "be a known key" + nearest(key, [*known, *tables]), "is not")


def check_overrides(name: str, given: Any, with_law: str) -> None:
    """Raises SceneError unless an argument is a dictionary of values by scene key. with_law: how a voltage
    law is given, which is what somebody may have put there."""
    if not isinstance(given, Mapping):
        law = hasattr(given, "commanded") or hasattr(given, "update")
        hint = f" (a law is given as {with_law})" if law else ""
        raise SceneError(name, "be a dictionary by scene key", f"is a {type(given).__name__}{hint}")
    for key in given:
        if not isinstance(key, str):
            raise SceneError(name, "have texts as keys", f"has {key!r}")


# ---- the expanders ----------------------------------------------------------------------------


def with_lists(request: Request) -> Request:
    """A table that stands in a file several times becomes one table whose keys are lists. Raises
    SceneError."""
    tables = dict(request.tables)
    for part in parts_of(model_of(tables)).values():
        entries = tables.get(part.name)
        if not part.repeated or not isinstance(entries, list):
            continue
        if not all(isinstance(x, Mapping) for x in entries):
            continue  # refused by later checks
        names = list(dict.fromkeys(name for entry in entries for name in entry))
        for name in names:
            if not all(name in entry for entry in entries):
                must = f"be given in every [[{part.name}]]"
                raise SceneError(f"{part.name}.{name}", must, "is missing in one")
        tables[part.name] = {name: [entry[name] for entry in entries] for name in names}
    return request._replace(tables=tables)


def with_files(request: Request) -> Request:
    """What files give takes the place of their names: a measured wind, and where an orbit about the Sun
    starts. Both depend on the date of t = 0. Raises SceneError."""
    check_one_date(request)
    return with_orbit_start(with_wind_file(request))


def check_one_date(request: Request) -> None:
    """Raises SceneError if another date takes the place of one to which the times of a wind, or the start
    of an orbit, belong, while these stay."""
    initial = request.tables.get("initial")
    before = initial.get("epoch") if isinstance(initial, Mapping) else None
    after = request.overrides.get(EPOCH)
    if before is None or after is None or is_same_date(before, after):
        return
    for key, others in ((TIMES, (WIND_FILE,)), (POSITION, (START_AT, OEM, POSITION_KM))):
        table, _, name = key.partition(".")
        content = request.tables.get(table)
        given = isinstance(content, Mapping) and content.get(name) is not None
        if given and not any(x in request.overrides for x in (key, *others)):
            raise SceneError(EPOCH, f"be changed together with `{key}`, which belongs to it", "is alone")


def is_same_date(first: Any, second: Any) -> bool:
    """Tells whether two dates are the same instant in the same time scale. Raises SceneError."""
    one, other = (read_instant(rules.check_date(EPOCH, x), EPOCH) for x in (first, second))
    return one.scale == other.scale and (one.day, one.second) == (other.day, other.second)


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
    """Position and velocity at the start of an orbit of a sail take the place of what stands for them: a
    planet, a message, or numbers in other units or axes. A start in the overrides replaces that in the
    tables as a whole. Raises SceneError."""
    keys, content = (*STARTS, POSITION, VELOCITY), request.tables.get("orbit", {})
    if "chain" in request.tables or not isinstance(content, Mapping):
        return request  # refused by later checks
    tables = {f"orbit.{name}": x for name, x in content.items() if f"orbit.{name}" not in request.overrides}
    if not any(source.get(key) is not None for source in (tables, request.overrides) for key in STARTS):
        return without(request, STARTS)
    overridden = any(request.overrides.get(key) is not None for key in keys)
    source = request.overrides if overridden else tables
    given = {key: source[key] for key in keys if source.get(key) is not None}
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


def with_own_code(request: Request) -> Request:
    """Terms and a voltage law of a user among the overrides take the place of those before. A law also
    takes that of the law in [voltage], of which the keys KEPT stay; None takes a user's law away."""
    overrides = dict(request.overrides)
    request = request._replace(terms=overrides.pop(OWN_TERMS, request.terms), overrides=overrides)
    if OWN_LAW not in overrides:
        return request
    law, tables = overrides.pop(OWN_LAW), dict(request.tables)
    table = tables.pop("voltage", {})
    if "chain" in tables or not isinstance(table, Mapping):
        return request._replace(voltage_law=law)  # refused by later checks
    if law is None:
        kept = {name: x for name, x in table.items() if name != "law" or x != "python"}
    else:
        kept = {name: table[name] for name in KEPT if name in table} | {"law": "python"}
    return request._replace(tables=tables | ({"voltage": kept} if kept else {}), voltage_law=law)


def merged(request: Request) -> Request:
    """The overrides take the place of the tables' values; they may add a table.

    None removes a key, and with its last key the table. An interval that neither gives stays that of the
    tables' own t_end, so that a run can be continued to a later one. Raises SceneError."""
    result = {name: dict(x) if isinstance(x, Mapping) else x for name, x in request.tables.items()}
    model = model_of([*result, *(key.partition(".")[0] for key in request.overrides)])
    kinds = tables_of(model)
    for key, value in request.overrides.items():
        table, _, name = key.partition(".")
        if table not in kinds or name not in names_of(kinds[table]):
            raise unknown(key, model)
        content = result.setdefault(table, {})
        if not isinstance(content, dict):
            raise SceneError(table, "be a table", rules.describe(content))
        content[name] = value
        if value is None:
            del content[name]
        if not content:
            del result[table]
    schedule = request.tables.get("integrator")
    if "output" not in result and isinstance(schedule, Mapping) and "t_end" in schedule:
        t_end = rules.check_value("integrator.t_end", schedule["t_end"], END, None)
        result["output"] = {"interval": t_end / 1000.0}
    return request._replace(tables=result, overrides={})


EXPANDERS: tuple[Callable[[Request], Request], ...] = (
    with_own_code, with_files, with_lists, merged,
)  # fmt: skip
"""What is written out, in order. Overrides are taken before any check, so that they may give what a file
lacks."""
