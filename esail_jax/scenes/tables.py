"""The tables of a scene file, one frozen dataclass each, and what every key may hold.

Fields say `Any` because a table may hold anything until a `Scene` is made of it: that is where values
are checked.
"""

import dataclasses
from collections.abc import Container
from typing import Any

import numpy as np

from esail_jax.scenes import rules
from esail_jax.scenes.rules import declare


@dataclasses.dataclass(frozen=True)
class Hub:
    """Rigid cylinder about X_B ([PGV] Table 1)."""

    height: Any = declare(rules.positive())  # m
    radius: Any = declare(rules.positive())  # m
    density: Any = declare(rules.positive())  # kg/m^3


@dataclasses.dataclass(frozen=True)
class Tethers:
    """Main tethers, one number for all or a list with one per tether."""

    count: Any = declare(rules.count())
    length: Any = declare(rules.positive("member"))  # m, undeformed
    area: Any = declare(rules.positive("member"))  # m^2
    density: Any = declare(rules.positive("member"))  # kg/m^3
    youngs_modulus: Any = declare(rules.positive("member"))  # Pa
    second_moment: Any = declare(rules.positive("member"), None)  # m^4, needed for bending
    element: Any = declare(rules.choice("cable", "truss"), "cable")
    elements: Any = declare(rules.count(), 5)
    strain: Any = declare(rules.choice("green-lagrange", "engineering"), "green-lagrange")
    bending: Any = declare(rules.switch(), False)
    axial_damping_time: Any = declare(rules.non_negative("member"), None)  # s
    bending_damping_time: Any = declare(rules.non_negative("member"), None)  # s, with bending
    straight_turn: Any = declare(rules.positive(), None)  # rad, with bending_damping_time
    root: Any = declare(rules.choice("pinned", "clamped"), "pinned")


@dataclasses.dataclass(frozen=True)
class Chain:
    """Elastic rods joined end to end ([MW]): instead of hub and tethers. One number for all rods or
    a list with one per rod."""

    rods: Any = declare(rules.count())
    mass: Any = declare(rules.positive("member"))  # kg of a rod
    length: Any = declare(rules.positive("member"))  # m, undeformed
    area: Any = declare(rules.positive("member"))  # m^2
    youngs_modulus: Any = declare(rules.positive("member"))  # Pa
    second_moment: Any = declare(rules.positive("member"), None)  # m^4, needed for bending
    tip_mass: Any = declare(rules.non_negative(), 0.0)  # kg
    base_mass: Any = declare(rules.non_negative(), None)  # kg, at the first joint of a free chain
    anchor: Any = declare(rules.choice("fixed", "free"), "fixed")
    strain: Any = declare(rules.choice("green-lagrange", "engineering"), "engineering")
    slack_strain: Any = declare(
        rules.between("lie in (0, 1)", lambda x: bool(((x > 0.0) & (x < 1.0)).all())), None
    )  # rods that do not push: `TensionOnlyEnergy`
    axial_damping_time: Any = declare(rules.non_negative("member"), None)  # s
    bending: Any = declare(rules.switch(), False)
    root: Any = declare(rules.choice("pinned", "clamped"), "pinned")  # clamped: needs bending


@dataclasses.dataclass(frozen=True)
class RemoteUnits:
    """Point masses at the tips."""

    mass: Any = declare(rules.non_negative("member"))  # kg


@dataclasses.dataclass(frozen=True)
class SolarWind:
    """Local values at the sail ([PGV] after Eq. 28); with `time`, speed and density at those instants. In a
    file, `file` may name a CSV file with these three columns (`scenes/wind_file.py`)."""

    speed: Any = declare(rules.positive("series"))  # m/s
    number_density: Any = declare(rules.non_negative("series"))  # 1/m^3
    cutoff_voltage: Any = declare(rules.any_number())  # V, V_1
    time: Any = declare(rules.increasing(), None)  # s


LAWS = {
    "constant": ("value",),
    "harmonic": ("value", "cosine", "sine", "maximum", "slew_rate"),
    "piecewise-linear": ("value", "time", "table", "maximum", "slew_rate"),
    "on-off": ("value", "on", "off", "rise_time", "maximum", "slew_rate"),
    "feedback": ("value", "gain", "target_sailing_angle_deg", "maximum", "slew_rate"),
    "planar-cone": ("coning_angle_deg", "spin_rate", "maximum", "slew_rate"),
}
"""Modulation laws and the keys of each."""

MAY_LACK = ("cosine", "sine", "off", "maximum", "slew_rate")
"""Keys that a law can do without."""


@dataclasses.dataclass(frozen=True)
class Voltage:
    """Tether voltage V_0, and its modulation (`loads/voltage.py`)."""

    value: Any = declare(rules.any_number("member"), None)  # V
    law: Any = declare(rules.choice(*LAWS), "constant")
    maximum: Any = declare(rules.positive(), None)  # V
    slew_rate: Any = declare(rules.positive(), None)  # V/s
    cosine: Any = declare(rules.any_number("grid"), None)  # parts of V_0, a row per harmonic
    sine: Any = declare(rules.any_number("grid"), None)
    time: Any = declare(rules.increasing(), None)  # s
    table: Any = declare(rules.non_negative("grid"), None)  # parts of V_0, a row per instant
    on: Any = declare(rules.any_number("member"), None)  # s
    off: Any = declare(rules.any_number("member"), None)  # s
    rise_time: Any = declare(rules.positive(), None)  # s
    gain: Any = declare(rules.any_number(), None)
    target_sailing_angle_deg: Any = declare(rules.any_number(), None)
    coning_angle_deg: Any = declare(
        rules.between("lie in (-90, 90)", lambda x: bool((np.abs(x) < 90.0).all())), None
    )
    spin_rate: Any = declare(rules.any_number(), None)  # rad/s


@dataclasses.dataclass(frozen=True)
class ChainWind:
    """The wind on a chain: steady."""

    speed: Any = declare(rules.positive())  # m/s
    number_density: Any = declare(rules.non_negative())  # 1/m^3
    cutoff_voltage: Any = declare(rules.any_number())  # V, V_1


@dataclasses.dataclass(frozen=True)
class ChainVoltage:
    """The voltage of a chain: constant."""

    value: Any = declare(rules.any_number("member"))  # V


@dataclasses.dataclass(frozen=True)
class Gravity:
    """Uniform gravity in the inertial frame."""

    acceleration: Any = declare(rules.any_number("vector"))  # m/s^2


@dataclasses.dataclass(frozen=True)
class Orbit:
    """Circular orbit about a centre of attraction; the chain moves in its turning axes."""

    mean_motion: Any = declare(rules.positive())  # rad/s


@dataclasses.dataclass(frozen=True)
class Initial:
    """State at t = 0 ([PGV] Sec. 4.1)."""

    spin_rate: Any = declare(rules.any_number())  # rad/s about X_B
    sailing_angle_deg: Any = declare(
        rules.between("lie in (-180, 180]", lambda x: bool(((x > -180.0) & (x <= 180.0)).all())),
        0.0,
    )
    heliocentric_position_au: Any = declare(
        rules.any_number("vector"), (0.7071067811865476, 0.7071067811865476, 0.0)
    )
    elongation: Any = declare(rules.choice("steady", "paper"), "steady")
    coning_angle_deg: Any = declare(
        rules.between("lie in (-90, 90)", lambda x: bool((np.abs(x) < 90.0).all())), 0.0
    )


@dataclasses.dataclass(frozen=True)
class ChainInitial:
    """State of a chain at t = 0: one vector for all rods, or one per rod."""

    rod_vector: Any = declare(rules.nonzero_vectors())  # m
    rod_rate: Any = declare(rules.any_number("vectors"), (0.0, 0.0, 0.0))  # m/s
    position: Any = declare(rules.any_number("vector"), None)  # m, first joint of a free chain
    velocity: Any = declare(rules.any_number("vector"), None)  # m/s
    heliocentric_position_au: Any = declare(rules.any_number("vector"), None)  # of the origin


@dataclasses.dataclass(frozen=True)
class Integrator:
    """Time integration. What is not given is chosen: `scenes/method_choice.py`."""

    t_end: Any = declare(rules.positive(structure=True))  # s
    method: Any = declare(
        rules.choice("generalized-alpha", "energy-momentum", "collocation", "tsit5", "dopri5", "dopri8"),
        None,
    )
    step: Any = declare(rules.positive(structure=True), None)  # s
    spectral_radius: Any = declare(
        rules.between("lie in [0, 1]", lambda x: bool(((x >= 0.0) & (x <= 1.0)).all())), None
    )
    tolerance: Any = declare(
        rules.between("lie in (0, 1)", lambda x: bool(((x > 0.0) & (x < 1.0)).all())), None
    )


@dataclasses.dataclass(frozen=True)
class Event:
    """What happens in the midst of a run, an entry each: at `time` the tether `release` is let go at its
    root (tethers count from 1). In a file: [[event]] tables."""

    time: Any = declare(rules.listed(rules.positive()))  # s
    release: Any = declare(rules.listed(rules.count()))


@dataclasses.dataclass(frozen=True)
class Output:
    """What is kept."""

    interval: Any = declare(rules.positive(structure=True))  # s


SAIL_TABLES = {
    "hub": Hub,
    "tethers": Tethers,
    "remote_units": RemoteUnits,
    "solar_wind": SolarWind,
    "voltage": Voltage,
    "gravity": Gravity,
    "initial": Initial,
    "integrator": Integrator,
    "event": Event,
    "output": Output,
}

CHAIN_TABLES = {
    "chain": Chain,
    "solar_wind": ChainWind,
    "voltage": ChainVoltage,
    "gravity": Gravity,
    "orbit": Orbit,
    "initial": ChainInitial,
    "integrator": Integrator,
    "output": Output,
}

TABLES = tuple(dict.fromkeys((*SAIL_TABLES, *CHAIN_TABLES)))
"""Names of all tables."""


REPEATED = ("event",)
"""Tables that a file may have several times."""


def tables_of(names: Container[str]) -> dict[str, type]:
    """The tables of a scene that has the named ones: those of a chain if `chain` is among them."""
    return CHAIN_TABLES if "chain" in names else SAIL_TABLES


def names_of(table: type) -> list[str]:
    """Keys of a table."""
    return [field.name for field in dataclasses.fields(table)]


def given(content: Any) -> dict[str, Any]:
    """The keys of a table that have a value."""
    return {name: value for name, value in vars(content).items() if value is not None}
