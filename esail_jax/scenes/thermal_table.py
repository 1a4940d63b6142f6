"""The table of the tethers' temperature, and its check."""

from typing import Any

import numpy as np

from esail_jax.scenes import rules
from esail_jax.scenes.declarations import declare, table
from esail_jax.scenes.rules import SceneError, any_number, increasing, non_negative
from esail_jax.scenes.value_types import History, Number, Series, Shape


@table
class Thermal:
    """Temperature of the tethers, which expand with it: their elastic strain is the strain less expansion
    times (T - reference_temperature). Auxiliary tethers are not heated. With `time` the temperature is
    given at those instants and changes linearly between them; it is constant before the first and after the
    last. In Python, the functions of `esail_jax.environment.thermal` compute such a series for an
    eclipse."""

    expansion: Number = declare(any_number, unit="1/K", doc="Coefficient of thermal expansion.")
    reference_temperature: Number = declare(
        non_negative, unit="K", doc="Temperature at which a tether has its undeformed length."
    )
    temperature: History = declare(
        non_negative,
        shape=Shape.HISTORY,
        unit="K",
        doc="Temperature T of the tethers; with `time` one row per instant, a number or one per tether.",
    )
    time: Series | None = declare(
        increasing,
        shape=Shape.SERIES,
        unit="s",
        doc="Instants of the rows of `temperature`.",
        default=None,
    )


def check_thermal(table: Thermal, elongation: str, members: rules.Members) -> None:
    """Checks that temperatures have one number per tether or, with `time`, one row per instant, and that
    the start takes them into account. Raises SceneError."""
    key, shape = "thermal.temperature", np.shape(table.temperature)
    has = f"has {shape[0]} entries" if shape else rules.describe(table.temperature)
    if table.time is None:
        if len(shape) > 1 or shape not in ((), (members.count,)):
            without = " without `thermal.time`"
            must = f"be a number or a list of {members.count} (`{members.key}`){without}"
            raise SceneError(key, must, "is a table" if len(shape) > 1 else has)
    else:
        check_rows(table, shape, has, members)
    if elongation != "steady":
        raise SceneError("initial.elongation", 'be "steady" with [thermal]', f'is "{elongation}"')


def check_rows(table: Any, shape: tuple[int, ...], has: str, members: rules.Members) -> None:
    """Checks that a table of temperatures has as many rows as instants, and that each is a number or has
    one per tether. Raises SceneError."""
    key = "thermal.temperature"
    if np.ndim(table.time) == 0:
        raise SceneError("thermal.time", "increase", rules.wrong_shape(table.time))
    count = np.shape(table.time)[0]
    if not shape or shape[0] != count:
        must = f"have as many rows as `thermal.time` has instants ({count})"
        raise SceneError(key, must, has.replace("entries", "rows"))
    if len(shape) == 2 and shape[1] != members.count:
        must = f"have rows of {members.count} (`{members.key}`)"
        raise SceneError(key, must, f"has rows of {shape[1]}")
