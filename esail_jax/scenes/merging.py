"""The tables of a scene's file, merged with overrides by key."""

from collections.abc import Mapping
from typing import Any

from esail_jax.errors import nearest
from esail_jax.scenes import rules
from esail_jax.scenes.common_tables import Integrator
from esail_jax.scenes.declarations import rule_of
from esail_jax.scenes.own_law import KEY
from esail_jax.scenes.own_terms import KEY as OWN_TERMS
from esail_jax.scenes.rules import SceneError
from esail_jax.scenes.tables import REPEATED, names_of, tables_of


def unknown(key: str, tables: Mapping[str, type]) -> SceneError:
    """The error for a key that these tables do not have; it names the nearest key that they do have."""
    known = [f"{table}.{name}" for table, content in tables.items() for name in names_of(content)]
    for own, what in ((KEY, "law"), (OWN_TERMS, "terms")):
        if key.partition(".")[0] == own:
            must = f"be a number of the {what} that `{own}` takes as a whole"
            return SceneError(key, must, "is a key of its own")
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


def with_lists(tables: Mapping[str, Any]) -> dict[str, Any]:
    """The tables of a file, with each table that stands there several times as one table whose keys are
    lists. Raises SceneError."""
    result = dict(tables)
    for table in REPEATED:
        entries = tables.get(table)
        if not isinstance(entries, list) or not all(isinstance(x, Mapping) for x in entries):
            continue
        names = list(dict.fromkeys(name for entry in entries for name in entry))
        for name in names:
            if not all(name in entry for entry in entries):
                raise SceneError(f"{table}.{name}", f"be given in every [[{table}]]", "is missing in one")
        result[table] = {name: [entry[name] for entry in entries] for name in names}
    return result


def merged(tables: Mapping[str, Any], overrides: Mapping[str, Any]) -> dict[str, Any]:
    """The tables with other values, by key.

    None removes a key, and with its last key the table. An interval that neither gives stays that of the
    tables' own t_end, so that a run can be continued to a later one. Raises SceneError."""
    result = {name: dict(x) if isinstance(x, Mapping) else x for name, x in with_lists(tables).items()}
    kinds = tables_of([*tables, *(key.partition(".")[0] for key in overrides)])
    for key, value in overrides.items():
        table, _, name = key.partition(".")
        if table not in kinds or name not in names_of(kinds[table]):
            raise unknown(key, kinds)
        content = result.setdefault(table, {})
        if not isinstance(content, dict):
            raise SceneError(table, "be a table", rules.describe(content))
        content[name] = value
        if value is None:
            del content[name]
        if not content:
            del result[table]
    schedule = tables.get("integrator")
    if "output" not in result and isinstance(schedule, Mapping) and "t_end" in schedule:
        rule = rule_of(Integrator.__dataclass_fields__["t_end"])
        t_end = rules.check_value("integrator.t_end", schedule["t_end"], rule, None)
        result["output"] = {"interval": t_end / 1000.0}
    return result
