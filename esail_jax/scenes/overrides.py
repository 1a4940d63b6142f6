"""What a scene is asked to be, from tables and overrides by key to the tables of one scene.

`EXPANDERS` says it in order: each takes a `Request` and returns one in which something that stood for
something else is written out. At the end the tables say everything; they are checked when the `Scene` is
made of them."""

from collections.abc import Callable, Mapping
from typing import Any

from esail_jax.errors import nearest
from esail_jax.scenes import rules
from esail_jax.scenes.from_files import END, with_one_epoch, with_orbit_start, with_wind_file
from esail_jax.scenes.own_terms import OWN_TERMS
from esail_jax.scenes.parts import model_of, names_of, parts_of, tables_of
from esail_jax.scenes.requests import Request
from esail_jax.scenes.rules import SceneError
from esail_jax.scenes.voltage import KEPT, OWN_LAW


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
    with_own_code, with_one_epoch, with_wind_file, with_orbit_start, with_lists, merged,
)  # fmt: skip
"""What is written out, in order. Overrides are taken before any check, so that they may give what a file
lacks."""
