"""What keys of a scene demand of each other: what no single key can show."""

from typing import Protocol, runtime_checkable

import numpy as np

from esail_jax.scenes import rules
from esail_jax.scenes.rules import SceneError
from esail_jax.scenes.tables import (
    LAWS,
    MAY_LACK,
    Chain,
    ChainInitial,
    ChainVoltage,
    ChainWind,
    Event,
    Hub,
    Initial,
    Integrator,
    SolarWind,
    Tethers,
    Voltage,
    names_of,
    tables_of,
)

SAIL_METHOD = "collocation"
"""The method of a sail that names none: its error is controlled."""

STEP_METHOD = "generalized-alpha"
"""The method of a sail that gives a step or a spectral radius but names none."""

FIXED_STEP = ("generalized-alpha", "energy-momentum")
"""Methods with one step size and no error control."""

SAIL_METHODS = (*FIXED_STEP, "collocation")


@runtime_checkable
class Parts(Protocol):
    """What is read of a `Scene`."""

    main: str
    initial: Initial | ChainInitial
    integrator: Integrator
    tethers: Tethers | None
    chain: Chain | None
    hub: Hub | None
    solar_wind: SolarWind | ChainWind | None
    voltage: Voltage | ChainVoltage | None
    event: Event | None


def method_of(scene: Parts) -> str | None:
    """The method a scene names, or that of sails. A chain without one gets it when it is run, as step and
    tolerance always do (`scenes/method_choice.py`)."""
    table = scene.integrator
    if table.method is not None or scene.chain is not None:
        return table.method
    stepped = table.step is not None or table.spectral_radius is not None
    return STEP_METHOD if stepped else SAIL_METHOD


def check_together(scene: Parts) -> None:
    """Raises SceneError."""
    method = method_of(scene)
    if scene.chain is None:
        check_sail(scene)
    else:
        check_chain(scene)
    if scene.voltage is not None and scene.chain is None:
        check_voltage(scene)
    if scene.solar_wind is not None and scene.chain is None:
        check_wind(scene)
    if (scene.voltage is None) != (scene.solar_wind is None):
        have, lack = ("solar_wind", "voltage") if scene.voltage is None else ("voltage", "solar_wind")
        first = names_of(tables_of([scene.main])[lack])[0]
        raise SceneError(f"{lack}.{first}", f"be given with [{have}]", "is missing")
    if method in FIXED_STEP and scene.integrator.tolerance is not None:
        raise SceneError("integrator.tolerance", f"be left out with {method}", "is given")
    if method != "generalized-alpha" and scene.integrator.spectral_radius is not None:
        raise SceneError("integrator.spectral_radius", "be left out without generalized-alpha", "is given")
    if scene.integrator.tolerance is not None and scene.integrator.step is not None:
        raise SceneError("integrator.tolerance", "be left out with a fixed `integrator.step`", "is given")
    position = scene.initial.heliocentric_position_au
    position = None if position is None else rules.known(position)
    if position is not None and position[0] == position[1] == 0.0:
        raise SceneError(
            "initial.heliocentric_position_au",
            "not lie on the ecliptic's axis",
            rules.describe(position),
        )


def check_sail(scene: Parts) -> None:
    """What belongs together in a sail."""
    tethers, clamped = scene.tethers, scene.tethers.root == "clamped"
    if tethers.element == "truss" and tethers.bending:
        raise SceneError("tethers.bending", "be false for truss elements", "is true")
    if tethers.element == "truss" and clamped:
        raise SceneError("tethers.root", 'be "pinned" for truss elements', 'is "clamped"')
    if tethers.bending and tethers.second_moment is None:
        raise SceneError("tethers.second_moment", "be given with `tethers.bending`", "is missing")
    if tethers.straight_turn is not None and tethers.bending_damping_time is None:
        must = "be left out without `tethers.bending_damping_time`"
        raise SceneError("tethers.straight_turn", must, "is given")
    if method_of(scene) not in SAIL_METHODS:
        known = "be " + " or ".join(f'"{name}"' for name in SAIL_METHODS) + " for a sail"
        raise SceneError("integrator.method", known, rules.describe(method_of(scene)))
    radius = scene.integrator.spectral_radius
    limited = radius is not None and (scene.hub is not None or clamped)
    if limited and rules.known(radius) is not None and rules.known(radius) >= 1.0:
        raise SceneError(
            "integrator.spectral_radius", "be below 1 with constraints", rules.describe(radius)
        )
    if scene.event is not None:
        check_events(scene)


def check_voltage(scene: Parts) -> None:
    """Which keys the modulation law needs and has, and that its numbers fit each other and the limits."""
    table = scene.voltage
    used = LAWS[table.law]
    for name in used:
        if getattr(table, name) is None and name not in MAY_LACK:
            with_law = "" if table.law == "constant" else f" with the law {table.law}"
            raise SceneError(f"voltage.{name}", "be given" + with_law, "is missing")
    for name in names_of(type(table)):
        if name not in (*used, "law") and getattr(table, name) is not None:
            raise SceneError(f"voltage.{name}", f"be left out with the law {table.law}", "is given")
    if table.law == "harmonic":
        rows = {name: np.shape(getattr(table, name)) for name in ("cosine", "sine")}
        if not rows["cosine"] and not rows["sine"]:
            raise SceneError("voltage.cosine", "be given with the law harmonic", "is missing")
        if rows["cosine"] and rows["sine"] and rows["cosine"][0] != rows["sine"][0]:
            must = f"have as many harmonics as `voltage.cosine` ({rows['cosine'][0]})"
            raise SceneError("voltage.sine", must, f"has {rows['sine'][0]}")
    if table.law == "piecewise-linear":
        instants = np.shape(table.time)[0]
        if np.shape(table.table)[0] != instants:
            must = f"have as many rows as `voltage.time` has instants ({instants})"
            raise SceneError("voltage.table", must, f"has {np.shape(table.table)[0]}")
    if table.law == "planar-cone" and scene.hub is not None:
        raise SceneError("voltage.law", "not be planar-cone with a hub", 'is "planar-cone"')


def check_wind(scene: Parts) -> None:
    """Of a wind that varies in time: a value for every instant, from the start to the end."""
    table = scene.solar_wind
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


def check_events(scene: Parts) -> None:
    """What belongs together in the events of a sail."""
    event, count = scene.event, scene.tethers.count
    if len(event.release) != len(event.time):
        must = f"have as many entries as `event.time` ({len(event.time)})"
        raise SceneError("event.release", must, f"has {len(event.release)}")
    for tether in event.release:
        if tether > count:
            raise SceneError("event.release", f"be at most {count} (`tethers.count`)", f"is {tether}")
        if event.release.count(tether) > 1:
            raise SceneError("event.release", "name a tether once", f"names {tether} again")
    if scene.tethers.root == "clamped":
        raise SceneError("tethers.root", 'be "pinned" with `event.release`', 'is "clamped"')


def check_chain(scene: Parts) -> None:
    """What belongs together in a chain."""
    chain, start, free = scene.chain, scene.initial, scene.chain.anchor == "free"
    if chain.bending and chain.second_moment is None:
        raise SceneError("chain.second_moment", "be given with `chain.bending`", "is missing")
    if chain.root == "clamped" and (free or not chain.bending):
        why = "at a free end" if free else "without `chain.bending`"
        raise SceneError("chain.root", f'be "pinned" {why}', 'is "clamped"')
    if scene.integrator.method in ("energy-momentum", "collocation"):
        raise SceneError(
            "integrator.method",
            'be "generalized-alpha" or an explicit one for a chain',
            f'is "{scene.integrator.method}"',
        )
    if chain.bending and scene.integrator.method == "generalized-alpha":
        raise SceneError(
            "integrator.method", "be an explicit one with `chain.bending`", 'is "generalized-alpha"'
        )
    held = {"chain.base_mass": chain.base_mass, "initial.position": start.position}
    held |= {"initial.velocity": start.velocity}
    for key, value in held.items():
        if value is not None and not free:
            raise SceneError(key, 'be left out unless `chain.anchor` is "free"', "is given")
    if scene.solar_wind is not None and start.heliocentric_position_au is None:
        raise SceneError("initial.heliocentric_position_au", "be given with [solar_wind]", "is missing")
    if scene.solar_wind is None and start.heliocentric_position_au is not None:
        raise SceneError("initial.heliocentric_position_au", "be left out without [solar_wind]", "is given")
