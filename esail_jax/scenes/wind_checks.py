"""Checks of the plasma about a tether: its law of thrust, its changes in time, and its sheath."""

from typing import Any

import numpy as np

from esail_jax.constants import DEBYE_LENGTHS, ELEMENTARY_CHARGE, VACUUM_PERMITTIVITY
from esail_jax.scenes import rules
from esail_jax.scenes.law_keys import THRUST_LAWS
from esail_jax.scenes.parts import Parts
from esail_jax.scenes.rules import SceneError


def check_wind(scene: Parts) -> None:
    """Checks that the law of thrust has its keys, and that a wind that varies in time has one value per
    instant, from the start of the run to its end. Raises SceneError."""
    table = scene.solar_wind
    for law, keys in THRUST_LAWS.items():
        for name in keys:
            if law == table.thrust_law and getattr(table, name) is None:
                with_law = "" if law == "linear" else f" with the law {law}"
                raise SceneError(f"solar_wind.{name}", "be given" + with_law, "is missing")
            if law != table.thrust_law and getattr(table, name) is not None:
                must = f"be left out with the law {table.thrust_law}"
                raise SceneError(f"solar_wind.{name}", must, "is given")
    if table.thrust_law != "linear" and table.thrust_factor is not None:
        must = f"be left out with the law {table.thrust_law}"
        raise SceneError("solar_wind.thrust_factor", must, "is given")
    least, most = table.electron_temperature_ev, table.number_density
    check_thin("solar_wind", table.tether_radius, least, most, DEBYE_LENGTHS)
    if table.time is not None:
        check_list("solar_wind.time", table.time)
    count = None if table.time is None else np.shape(table.time)[0]
    for name in ("speed", "number_density"):
        shape = np.shape(getattr(table, name))
        if count is None and shape:
            raise SceneError(
                "solar_wind.time", f"be given with a list of `solar_wind.{name}`", "is missing"
            )
        if count is not None and shape not in ((), (count,)):
            must = f"be a number or a list of {count} (`solar_wind.time`)"
            raise SceneError(f"solar_wind.{name}", must, f"has {shape[0]} entries")
    time = None if count is None else rules.known(table.time)
    if time is not None and (time[0] > 0.0 or time[-1] < scene.integrator.t_end):
        must = f"reach from 0 to `integrator.t_end` ({scene.integrator.t_end:g})"
        raise SceneError("solar_wind.time", must, f"reaches from {time[0]:g} to {time[-1]:g}")


def check_thin(table: str, radius: Any, volts: Any, density: Any, lengths: float = 1.0) -> None:
    """Checks that a tether is thinner than the sheath about it, `lengths` times sqrt(eps_0 V / (e n)):
    there the logarithms of the laws are positive. Traced numbers have no value to check. Raises
    SceneError."""
    known = [None if x is None else rules.known(x) for x in (radius, volts, density)]
    if any(x is None for x in known):
        return
    radius, volts, density = known
    sheath = lengths * np.sqrt(VACUUM_PERMITTIVITY * volts / (ELEMENTARY_CHARGE * np.max(density)))
    if radius >= sheath:
        must = f"be below the radius of the sheath ({sheath:.3g} m)"
        raise SceneError(f"{table}.tether_radius", must, rules.describe(radius))


def check_list(key: str, time: Any) -> None:
    """Refuses a single traced number in place of a list of instants; of other values the rule has seen the
    shape. Raises SceneError."""
    if np.ndim(time) == 0:
        raise SceneError(key, "increase", rules.wrong_shape(time))
