"""The parts of a scene: `PARTS`, one entry for every table.

All that depends on which tables there are is derived from it: the keys, the fields of a `Scene`, the
merging of overrides, checks, switch times, what observables need, and what is built.

Each table is a frozen dataclass; its fields are the table's keys, each with its type, rule, unit and
description (`declarations.py`)."""

import dataclasses
import functools
import operator
from collections.abc import Callable, Container
from typing import Any

from esail_jax.scenes import chain, deployment, hub, integration, plasma, start_and_place, tethers, voltage
from esail_jax.scenes.rules import count_of

SAIL, CHAIN = "sail", "chain"
"""The models: a sail of tethers, and a chain of rods."""

BUILD = "esail_jax.scenes.build_parts"
"""Module of the functions that build what acts. It imports JAX, and a scene is read without."""


@dataclasses.dataclass(frozen=True)
class Part:
    """A part of a scene, which is there if its table is.

    name: of the table; table: its class; models: those that may have it; required: whether every scene of
    these models has it. check: raises SceneError for a scene whose table, or what else it needs, is wrong.
    switches: keys of instants at which the motion has a kink, so that the stepper starts anew; every: an
    interval [s] after which it does so, too. terms: the function that builds what acts from structure and
    numbers, as `module:function`; empty if that is built together with other parts (`build.py`). repeated:
    whether a file has one table per entry. in_words: names the part among those of a scene; None for its
    name, and an empty text for what is no part of the model."""

    name: str
    table: type
    models: tuple[str, ...]
    required: bool = False
    check: Callable[[Any], None] | None = None
    switches: tuple[str, ...] = ()
    every: float | None = None
    terms: str = ""
    repeated: bool = False
    in_words: Callable[[Any], str] | None = None

    def named(self, content: Any) -> str:
        """The part in words. content: its table."""
        return self.name.replace("_", " ") if self.in_words is None else self.in_words(content)


def tethers_in_words(content: Any) -> str:
    """The main part of a sail: how many tethers of which elements."""
    elements = count_of(content.elements, f"{content.element} element")
    return f"{count_of(content.count, 'tether')} of {elements}"


def chain_in_words(content: Any) -> str:
    """The main part of a chain: how many rods, and whether its first joint is held."""
    return f"{content.anchor} chain of {count_of(content.rods, 'rod')}"


def no_part(content: Any) -> str:
    """An empty text for a table that says how to run a scene."""
    return ""


PARTS = (
    Part("hub", hub.Hub, (SAIL,), check=hub.check_hub, terms=f"{BUILD}:hub_torque"),
    Part("tethers", tethers.Tethers, (SAIL,), check=tethers.check_tethers, in_words=tethers_in_words),
    Part("auxiliary_tethers", tethers.AuxiliaryTethers, (SAIL,), check=tethers.check_auxiliary_tethers),
    Part("remote_units", tethers.RemoteUnits, (SAIL,)),
    Part("chain", chain.Chain, (CHAIN,), check=chain.check_chain, in_words=chain_in_words),
    Part("solar_wind", plasma.SolarWind, (SAIL,), check=plasma.check_wind, terms=f"{BUILD}:solar_wind"),
    Part(
        "solar_wind",
        plasma.ChainWind,
        (CHAIN,),
        check=plasma.check_chain_wind,
        terms=f"{BUILD}:solar_wind_at_chain",
    ),
    Part("voltage", voltage.Voltage, (SAIL,), check=voltage.check_voltage, switches=("on", "off")),
    Part("voltage", voltage.ChainVoltage, (CHAIN,), check=voltage.check_has_wind),
    Part(
        "tip_thrust",
        tethers.TipThrust,
        (SAIL,),
        check=tethers.check_tip_thrust,
        switches=("on", "off"),
        terms=f"{BUILD}:tip_thrust",
    ),
    Part(
        "deployment", deployment.Deployment, (SAIL,), check=deployment.check_deployment, switches=("time",)
    ),
    Part(
        "deployment",
        deployment.ChainDeployment,
        (CHAIN,),
        check=deployment.check_chain_deployment,
        switches=("time",),
    ),
    Part("thermal", tethers.Thermal, (SAIL,), check=tethers.check_thermal, switches=("time",)),
    Part("gravity", start_and_place.Gravity, (SAIL, CHAIN), terms=f"{BUILD}:gravity"),
    Part(
        "orbit",
        start_and_place.HeliocentricOrbit,
        (SAIL,),
        check=start_and_place.check_orbit,
        every=start_and_place.RECTIFIED_EVERY,
        terms=f"{BUILD}:heliocentric_orbit",
    ),
    Part("orbit", start_and_place.Orbit, (CHAIN,), terms=f"{BUILD}:circular_orbit"),
    Part(
        "initial",
        start_and_place.Initial,
        (SAIL,),
        required=True,
        check=start_and_place.check_start,
        in_words=no_part,
    ),
    Part(
        "initial",
        start_and_place.ChainInitial,
        (CHAIN,),
        required=True,
        check=start_and_place.check_chain_start,
        in_words=no_part,
    ),
    Part(
        "integrator",
        integration.Integrator,
        (SAIL, CHAIN),
        required=True,
        check=integration.check_integrator,
        in_words=no_part,
    ),
    Part(
        "event",
        tethers.Event,
        (SAIL,),
        check=tethers.check_events,
        switches=("time",),
        repeated=True,
        in_words=lambda content: count_of(len(content.time), "event"),
    ),
    Part("output", integration.Output, (SAIL, CHAIN), in_words=no_part),
    Part(
        "plasma_brake",
        plasma.PlasmaBrake,
        (CHAIN,),
        check=plasma.check_brake,
        terms=f"{BUILD}:plasma_brake",
    ),
)
"""All parts, in the order in which run files hold their tables and in which they are checked."""


def table_names() -> tuple[str, ...]:
    """Names of all tables."""
    return tuple(dict.fromkeys(part.name for part in PARTS))


def field_of(table: str) -> tuple[Any, ...]:
    """Name, type and default of a table as the field of a `Scene` that holds it."""
    parts = [part for part in PARTS if part.name == table]
    kinds = functools.reduce(operator.or_, (part.table for part in parts))
    if any(part.required for part in parts):
        return table, kinds
    return table, kinds | None, dataclasses.field(default=None)


def parts_of(model: str) -> dict[str, Part]:
    """The parts that a scene of a model may have, by name."""
    return {part.name: part for part in PARTS if model in part.models}


def model_of(names: Container[str]) -> str:
    """The model of a scene with the named tables: a chain if `chain` is among them, otherwise a sail."""
    return CHAIN if CHAIN in names else SAIL


def tables_of(model: str) -> dict[str, type]:
    """The classes of the tables that a scene of a model may have, by name."""
    return {name: part.table for name, part in parts_of(model).items()}


def names_of(table: type) -> list[str]:
    """Names of a table's keys."""
    return [field.name for field in dataclasses.fields(table)]


def given(content: Any) -> dict[str, Any]:
    """The keys of a table that have a value."""
    return {name: value for name, value in vars(content).items() if value is not None}
