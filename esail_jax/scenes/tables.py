"""The tables of a scene by name, for each model.

Each table is a frozen dataclass; its fields are the table's keys, each with its type, rule, unit and
description (`declarations.py`)."""

import dataclasses
from collections.abc import Container
from typing import Any

from esail_jax.scenes import (
    chain_tables,
    common_tables,
    orbit_table,
    sail_tables,
    thermal_table,
    tip_tables,
)

SAIL_TABLES = {
    "hub": sail_tables.Hub,
    "tethers": sail_tables.Tethers,
    "auxiliary_tethers": tip_tables.AuxiliaryTethers,
    "remote_units": tip_tables.RemoteUnits,
    "solar_wind": sail_tables.SolarWind,
    "voltage": sail_tables.Voltage,
    "tip_thrust": tip_tables.TipThrust,
    "thermal": thermal_table.Thermal,
    "gravity": common_tables.Gravity,
    "orbit": orbit_table.HeliocentricOrbit,
    "initial": sail_tables.Initial,
    "integrator": common_tables.Integrator,
    "event": sail_tables.Event,
    "output": common_tables.Output,
}
"""Tables of a sail, by name."""

CHAIN_TABLES = {
    "chain": chain_tables.Chain,
    "solar_wind": chain_tables.ChainWind,
    "voltage": chain_tables.ChainVoltage,
    "gravity": common_tables.Gravity,
    "orbit": chain_tables.Orbit,
    "plasma_brake": chain_tables.PlasmaBrake,
    "initial": chain_tables.ChainInitial,
    "integrator": common_tables.Integrator,
    "output": common_tables.Output,
}
"""Tables of a chain, by name."""

TABLES = tuple(dict.fromkeys((*SAIL_TABLES, *CHAIN_TABLES)))
"""Names of all tables."""

REPEATED = ("event",)
"""Tables that a file may have several times."""


def tables_of(names: Container[str]) -> dict[str, type]:
    """The tables that a scene with the named ones may have: those of a chain if `chain` is among the names,
    otherwise those of a sail."""
    return CHAIN_TABLES if "chain" in names else SAIL_TABLES


def names_of(table: type) -> list[str]:
    """Names of a table's keys."""
    return [field.name for field in dataclasses.fields(table)]


def given(content: Any) -> dict[str, Any]:
    """The keys of a table that have a value."""
    return {name: value for name, value in vars(content).items() if value is not None}
