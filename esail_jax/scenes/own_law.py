"""Checks of a voltage law that a user wrote. They import no library: a scene is read without JAX."""

import math
import sys
from collections.abc import Mapping
from typing import Any

from esail_jax.scenes.rules import SceneError, known

KEY = "voltage_law"
"""Key of the law among the overrides of a scene. It is no table, and no file can have it."""

PERIOD = f"{KEY}.period"
"""Name of the control period."""

KEPT = ("value", "maximum", "slew_rate", "power_limit")
"""Keys of [voltage] that stay when a user's law takes the place of the scene's own law."""


class MissingLaw(SceneError):
    """A scene that names a law in Python without the law itself."""


def with_own_law(tables: dict[str, Any], law: Any) -> dict[str, Any]:
    """The tables of a scene with a user's law in place of their own; None takes a user's law away."""
    table = tables.get("voltage", {})
    if "chain" in tables or not isinstance(table, Mapping):
        return tables  # refused by later checks
    if law is None:
        kept = {name: x for name, x in table.items() if name != "law" or x != "python"}
    else:
        kept = {name: table[name] for name in KEPT if name in table} | {"law": "python"}
    return tables | {"voltage": kept} if kept else {k: x for k, x in tables.items() if k != "voltage"}


def check_own_law(law: Any, slew_rate: Any) -> None:
    """Raises SceneError unless a law has the methods and the period that a user's law must have."""
    equinox = sys.modules.get("equinox")
    if equinox is None or not isinstance(law, equinox.Module):
        raise SceneError(KEY, "be an equinox.Module", f"is a {type(law).__name__}")
    methods = [name for name in ("commanded", "init", "update") if callable(getattr(law, name, None))]
    if methods not in (["commanded"], ["init", "update"]):
        must = "have the method `commanded`, or the methods `init` and `update`"
        raise SceneError(KEY, must, f"{type(law).__name__} has {' and '.join(methods) or 'none of them'}")
    if not hasattr(law, "period"):
        if "update" in methods:
            raise SceneError(PERIOD, "be given for a law with `update`", "is missing")
        if slew_rate is not None:
            raise SceneError("voltage.slew_rate", f"be left out unless `{KEY}` has a `period`", "is given")
        return
    period_of(law)


def check_has_law(name: str, law: Any) -> None:
    """Raises MissingLaw for a scene of a user's law without the law itself, such as that of a run file."""
    if name == "python" and law is None:
        raise MissingLaw(KEY, 'be given with `voltage.law` = "python"', "is missing")


def period_of(law: Any) -> float | None:
    """The control period [s] of a user's law; None for a law that is not sampled. Raises SceneError."""
    if law is None or not hasattr(law, "period"):
        return None
    period = law.period
    if known(period) is None:
        must = "be a plain number (declare the field with equinox.field(static=True))"
        raise SceneError(PERIOD, must, "is a traced value")
    try:
        number = float(period)
    except (TypeError, ValueError):
        number = math.nan
    if not 0.0 < number < math.inf:
        raise SceneError(PERIOD, "be positive", f"is {period!r}")
    return number
