"""Conditions that several keys of a scene must satisfy together."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from esail_jax.scenes import rules
from esail_jax.scenes.hub import check_hub
from esail_jax.scenes.law_keys import LAWS, OPTIONAL_LAW_KEYS
from esail_jax.scenes.methods import METHODS, SAIL_METHOD, SAIL_STEP_METHOD, takes
from esail_jax.scenes.orbit_checks import check_off_axis, check_orbit
from esail_jax.scenes.own_law import check_own_law
from esail_jax.scenes.own_terms import check_own_terms
from esail_jax.scenes.parts import Parts
from esail_jax.scenes.rules import SceneError
from esail_jax.scenes.tables import names_of, tables_of
from esail_jax.scenes.thermal_table import check_thermal
from esail_jax.scenes.tip_tables import TipThrust
from esail_jax.scenes.wind_checks import check_list, check_thin, check_wind

LEAST_RING = 3
"""Least number of tethers that can be joined in a ring."""


def method_name(scene: Parts) -> str | None:
    """The method that a scene names, or the default of sails. None for a chain that names no method: its
    method is chosen when it is run, as are step and tolerance (`scenes/method_choice.py`)."""
    table = scene.integrator
    if table.method is not None or scene.chain is not None:
        return table.method
    stepped = table.step is not None or table.spectral_radius is not None
    return SAIL_STEP_METHOD if stepped else SAIL_METHOD


def quoted(names: Iterable[str]) -> str:
    """Names in words: `"a" or "b"`."""
    return " or ".join(f'"{name}"' for name in names)


def check_together(scene: Parts) -> None:
    """Checks all conditions of a scene. Raises SceneError for the first one that does not hold."""
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
    if scene.voltage_law is not None:
        check_law_of_user(scene)
    check_own_terms(scene)
    check_integrator(scene)
    check_off_axis("initial.heliocentric_position_au", scene.initial.heliocentric_position_au)


def check_law_of_user(scene: Parts) -> None:
    """Checks that a voltage law in Python stands in a scene that can have it. Raises SceneError."""
    table = scene.voltage
    if scene.chain is not None:
        raise SceneError("voltage_law", "be left out with a chain", "is given")
    if table is None:
        raise SceneError("voltage_law", "be left out without [solar_wind]", "is given")
    if table.law != "python":
        raise SceneError("voltage.law", 'be "python" with `voltage_law`', f'is "{table.law}"')
    check_own_law(scene.voltage_law, table.slew_rate)


def check_integrator(scene: Parts) -> None:
    """Checks that the method takes the keys of [integrator] that are given. Raises SceneError."""
    table, method = scene.integrator, method_name(scene)
    if table.tolerance is not None and method is not None and not takes(method, "tolerance"):
        raise SceneError("integrator.tolerance", f"be left out with {method}", "is given")
    if table.spectral_radius is not None and (method is None or not takes(method, "spectral_radius")):
        others = " or ".join(name for name in METHODS if takes(name, "spectral_radius"))
        raise SceneError("integrator.spectral_radius", f"be left out without {others}", "is given")
    if table.tolerance is not None and table.step is not None:
        raise SceneError("integrator.tolerance", "be left out with a fixed `integrator.step`", "is given")


def check_sail(scene: Parts) -> None:
    """Checks the keys of a sail. Raises SceneError."""
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
    if scene.auxiliary_tethers is not None and tethers.count < LEAST_RING:
        must = f"be {LEAST_RING} or more with [auxiliary_tethers]"
        raise SceneError("tethers.count", must, f"is {tethers.count}")
    name = method_name(scene)
    method = METHODS.get(name)
    if method is not None and not method.sails:
        must = f"be {quoted(x for x, other in METHODS.items() if other.sails)} for a sail"
        raise SceneError("integrator.method", must, rules.describe(name))
    if method is not None and scene.event is not None and not method.events:
        must = f"be {quoted(x for x, other in METHODS.items() if other.events)} with events"
        raise SceneError("integrator.method", must, rules.describe(name))
    radius = scene.integrator.spectral_radius
    limited = radius is not None and (scene.hub is not None or clamped)
    if limited and rules.known(radius) is not None and rules.known(radius) >= 1.0:
        raise SceneError(
            "integrator.spectral_radius", "be below 1 with constraints", rules.describe(radius)
        )
    if scene.hub is not None:
        check_hub(scene.hub)
        if scene.hub.roots is not None and scene.auxiliary_tethers is not None:
            raise SceneError("hub.roots", "be left out with [auxiliary_tethers]", "is given")
        if scene.hub.roots is not None and scene.initial.elongation == "paper":
            raise SceneError("hub.roots", 'be left out with `initial.elongation` = "paper"', "is given")
    if scene.event is not None:
        check_events(scene)
    if tethers.wire_radius is not None and scene.solar_wind is None:
        raise SceneError("tethers.wire_radius", "be left out without [solar_wind]", "is given")
    if tethers.wires is not None and tethers.wire_radius is None:
        raise SceneError("tethers.wires", "be left out without `tethers.wire_radius`", "is given")
    if scene.tip_thrust is not None:
        check_tip_thrust(scene.tip_thrust)
    if scene.thermal is not None:
        check_thermal(scene.thermal, scene.initial.elongation, scene.members)
    check_orbit(scene)


def check_voltage(scene: Parts) -> None:
    """Checks that the modulation law has the keys it needs and no others, and that their sizes agree.
    Raises SceneError."""
    table = scene.voltage
    used = LAWS[table.law]
    for name in used:
        if table.law == "python":
            continue  # `value` is the reference of a design and of the default tolerance
        if getattr(table, name) is None and name not in OPTIONAL_LAW_KEYS:
            with_law = "" if table.law == "constant" else f" with the law {table.law}"
            raise SceneError(f"voltage.{name}", "be given" + with_law, "is missing")
    for name in names_of(type(table)):
        if name not in (*used, "law", "power_limit") and getattr(table, name) is not None:
            raise SceneError(f"voltage.{name}", f"be left out with the law {table.law}", "is given")
    if table.power_limit is not None and scene.tethers.wire_radius is None:
        raise SceneError("tethers.wire_radius", "be given with `voltage.power_limit`", "is missing")
    if table.limit_blend is not None and table.maximum is None:
        raise SceneError("voltage.maximum", "be given with `voltage.limit_blend`", "is missing")
    if table.law == "phase-window":
        check_window(table)
    if table.law == "harmonic":
        rows = {name: np.shape(getattr(table, name)) for name in ("cosine", "sine")}
        if not rows["cosine"] and not rows["sine"]:
            raise SceneError("voltage.cosine", "be given with the law harmonic", "is missing")
        if rows["cosine"] and rows["sine"] and rows["cosine"][0] != rows["sine"][0]:
            must = f"have as many harmonics as `voltage.cosine` ({rows['cosine'][0]})"
            raise SceneError("voltage.sine", must, f"has {rows['sine'][0]}")
    if table.law == "piecewise-linear":
        check_list("voltage.time", table.time)
        instants = np.shape(table.time)[0]
        if np.shape(table.table)[0] != instants:
            must = f"have as many rows as `voltage.time` has instants ({instants})"
            raise SceneError("voltage.table", must, f"has {np.shape(table.table)[0]}")
    if table.measured_axis == "angular-momentum":
        reason = "without [hub]" if scene.hub is None else "with [[event]]"
        if scene.hub is None or scene.event is not None:
            raise SceneError("voltage.measured_axis", f'be "hub" {reason}', f'is "{table.measured_axis}"')
    if table.law == "planar-cone" and scene.hub is not None:
        raise SceneError("voltage.law", "not be planar-cone with a hub", 'is "planar-cone"')
    if table.law == "planar-cone" and scene.solar_wind is not None:
        law = scene.solar_wind.thrust_law
        if law != "linear":
            raise SceneError("solar_wind.thrust_law", "be linear with the law planar-cone", f'is "{law}"')


def check_window(table: Any) -> None:
    """Checks that the window of the law phase-window is neither empty nor a whole turn. Raises
    SceneError."""
    on, off = rules.known(table.on_phase_deg), rules.known(table.off_phase_deg)
    if on is not None and off is not None and (np.mod(off - on, 360.0) == 0.0).any():
        must = "differ from `voltage.on_phase_deg` by more or less than whole turns"
        raise SceneError("voltage.off_phase_deg", must, rules.describe(table.off_phase_deg))


def check_events(scene: Parts) -> None:
    """Checks the events of a sail. Raises SceneError."""
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


def check_tip_thrust(table: TipThrust) -> None:
    """Checks that a force at the tips is switched by three keys or by none, and on before off. Raises
    SceneError."""
    given = [name for name in ("on", "off", "rise_time") if getattr(table, name) is not None]
    for name in ("on", "off", "rise_time") if given else ():
        if name not in given:
            raise SceneError(f"tip_thrust.{name}", f"be given with `tip_thrust.{given[0]}`", "is missing")
    on, off = (None if x is None else rules.known(x) for x in (table.on, table.off))
    if on is not None and off is not None and (on >= off).any():
        must = f"be after `tip_thrust.on` ({rules.describe(table.on).removeprefix('is ')})"
        raise SceneError("tip_thrust.off", must, rules.describe(table.off))


def check_chain(scene: Parts) -> None:
    """Checks the keys of a chain. Raises SceneError."""
    chain, start, free = scene.chain, scene.initial, scene.chain.anchor == "free"
    if chain.bending and chain.second_moment is None:
        raise SceneError("chain.second_moment", "be given with `chain.bending`", "is missing")
    if chain.root == "clamped" and (free or not chain.bending):
        why = "at a free end" if free else "without `chain.bending`"
        raise SceneError("chain.root", f'be "pinned" {why}', 'is "clamped"')
    name = scene.integrator.method
    method = METHODS.get(name)
    if method is not None and not method.chains:
        implicit = quoted(x for x, other in METHODS.items() if other.chains and not other.explicit)
        must = f"be {implicit} or an explicit one for a chain"
        raise SceneError("integrator.method", must, f'is "{name}"')
    if chain.bending and method is not None and not method.chain_bending:
        must = "be an explicit one with `chain.bending`"
        raise SceneError("integrator.method", must, f'is "{name}"')
    held = {"chain.base_mass": chain.base_mass, "initial.position": start.position}
    held |= {"initial.velocity": start.velocity}
    for key, value in held.items():
        if value is not None and not free:
            raise SceneError(key, 'be left out unless `chain.anchor` is "free"', "is given")
    if scene.plasma_brake is not None and scene.orbit is None:
        raise SceneError("orbit.mean_motion", "be given with [plasma_brake]", "is missing")
    if scene.plasma_brake is not None:
        table = scene.plasma_brake
        volts = rules.known(table.voltage)
        least = None if volts is None else np.abs(np.where(volts < 0.0, volts, np.inf)).min()
        check_thin("plasma_brake", table.tether_radius, least, table.number_density)
    if scene.solar_wind is not None and start.heliocentric_position_au is None:
        raise SceneError("initial.heliocentric_position_au", "be given with [solar_wind]", "is missing")
    if scene.solar_wind is None and start.heliocentric_position_au is not None:
        raise SceneError("initial.heliocentric_position_au", "be left out without [solar_wind]", "is given")
    if scene.solar_wind is not None and scene.solar_wind.relative and scene.orbit is not None:
        # The axes of the orbit turn: velocities in them are not those in inertial axes.
        raise SceneError("solar_wind.relative", "be false with [orbit]", "is true")
