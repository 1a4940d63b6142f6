"""The tables of a scene file, one frozen dataclass each, and what every key may hold.

Fields say `Any` because a table may hold anything until a `Scene` is made of it: that is where values
are checked.
"""

import dataclasses
from collections.abc import Container
from typing import Any

import numpy as np

from esail_jax.scenes import keys
from esail_jax.scenes.keys import declare


@dataclasses.dataclass(frozen=True)
class Hub:
    """Rigid cylinder about X_B ([PGV] Table 1)."""

    height: Any = declare(keys.positive())  # m
    radius: Any = declare(keys.positive())  # m
    density: Any = declare(keys.positive())  # kg/m^3


@dataclasses.dataclass(frozen=True)
class Tethers:
    """Main tethers, one number for all or a list with one per tether."""

    count: Any = declare(keys.count())
    length: Any = declare(keys.positive("member"))  # m, undeformed
    area: Any = declare(keys.positive("member"))  # m^2
    density: Any = declare(keys.positive("member"))  # kg/m^3
    youngs_modulus: Any = declare(keys.positive("member"))  # Pa
    second_moment: Any = declare(keys.positive("member"), None)  # m^4, needed for bending
    element: Any = declare(keys.choice("cable", "truss"), "cable")
    elements: Any = declare(keys.count(), 5)
    strain: Any = declare(keys.choice("green-lagrange", "engineering"), "green-lagrange")
    bending: Any = declare(keys.switch(), False)
    axial_damping_time: Any = declare(keys.non_negative("member"), None)  # s
    bending_damping_time: Any = declare(keys.non_negative("member"), None)  # s, with bending
    root: Any = declare(keys.choice("pinned", "clamped"), "pinned")


@dataclasses.dataclass(frozen=True)
class Chain:
    """Elastic rods joined end to end ([MW]): instead of hub and tethers. One number for all rods or
    a list with one per rod."""

    rods: Any = declare(keys.count())
    mass: Any = declare(keys.positive("member"))  # kg of a rod
    length: Any = declare(keys.positive("member"))  # m, undeformed
    area: Any = declare(keys.positive("member"))  # m^2
    youngs_modulus: Any = declare(keys.positive("member"))  # Pa
    second_moment: Any = declare(keys.positive("member"), None)  # m^4, needed for bending
    tip_mass: Any = declare(keys.non_negative(), 0.0)  # kg
    base_mass: Any = declare(keys.non_negative(), None)  # kg, at the first joint of a free chain
    anchor: Any = declare(keys.choice("fixed", "free"), "fixed")
    strain: Any = declare(keys.choice("green-lagrange", "engineering"), "engineering")
    slack_strain: Any = declare(
        keys.between("lie in (0, 1)", lambda x: bool(((x > 0.0) & (x < 1.0)).all())), None
    )  # rods that do not push: `TensionOnlyEnergy`
    axial_damping_time: Any = declare(keys.non_negative("member"), None)  # s
    bending: Any = declare(keys.switch(), False)
    root: Any = declare(keys.choice("pinned", "clamped"), "pinned")  # clamped: needs bending


@dataclasses.dataclass(frozen=True)
class RemoteUnits:
    """Point masses at the tips."""

    mass: Any = declare(keys.non_negative("member"))  # kg


@dataclasses.dataclass(frozen=True)
class SolarWind:
    """Local values at the sail ([PGV] after Eq. 28); with `time`, speed and density at those instants. In a
    file, `file` may name a CSV file with these three columns (`scenes/series.py`)."""

    speed: Any = declare(keys.positive("series"))  # m/s
    number_density: Any = declare(keys.non_negative("series"))  # 1/m^3
    cutoff_voltage: Any = declare(keys.any_number())  # V, V_1
    time: Any = declare(keys.increasing(), None)  # s


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

    value: Any = declare(keys.any_number("member"), None)  # V
    law: Any = declare(keys.choice(*LAWS), "constant")
    maximum: Any = declare(keys.positive(), None)  # V
    slew_rate: Any = declare(keys.positive(), None)  # V/s
    cosine: Any = declare(keys.any_number("grid"), None)  # parts of V_0, a row per harmonic
    sine: Any = declare(keys.any_number("grid"), None)
    time: Any = declare(keys.increasing(), None)  # s
    table: Any = declare(keys.non_negative("grid"), None)  # parts of V_0, a row per instant
    on: Any = declare(keys.any_number("member"), None)  # s
    off: Any = declare(keys.any_number("member"), None)  # s
    rise_time: Any = declare(keys.positive(), None)  # s
    gain: Any = declare(keys.any_number(), None)
    target_sailing_angle_deg: Any = declare(keys.any_number(), None)
    coning_angle_deg: Any = declare(
        keys.between("lie in (-90, 90)", lambda x: bool((np.abs(x) < 90.0).all())), None
    )
    spin_rate: Any = declare(keys.any_number(), None)  # rad/s


@dataclasses.dataclass(frozen=True)
class ChainWind:
    """The wind on a chain: steady."""

    speed: Any = declare(keys.positive())  # m/s
    number_density: Any = declare(keys.non_negative())  # 1/m^3
    cutoff_voltage: Any = declare(keys.any_number())  # V, V_1


@dataclasses.dataclass(frozen=True)
class ChainVoltage:
    """The voltage of a chain: constant."""

    value: Any = declare(keys.any_number("member"))  # V


@dataclasses.dataclass(frozen=True)
class Gravity:
    """Uniform gravity in the inertial frame."""

    acceleration: Any = declare(keys.any_number("vector"))  # m/s^2


@dataclasses.dataclass(frozen=True)
class Orbit:
    """Circular orbit about a centre of attraction; the chain moves in its turning axes."""

    mean_motion: Any = declare(keys.positive())  # rad/s


@dataclasses.dataclass(frozen=True)
class Initial:
    """State at t = 0 ([PGV] Sec. 4.1)."""

    spin_rate: Any = declare(keys.any_number())  # rad/s about X_B
    sailing_angle_deg: Any = declare(
        keys.between("lie in (-180, 180]", lambda x: bool(((x > -180.0) & (x <= 180.0)).all())),
        0.0,
    )
    heliocentric_position_au: Any = declare(
        keys.any_number("vector"), (0.7071067811865476, 0.7071067811865476, 0.0)
    )
    elongation: Any = declare(keys.choice("steady", "paper"), "steady")
    coning_angle_deg: Any = declare(
        keys.between("lie in (-90, 90)", lambda x: bool((np.abs(x) < 90.0).all())), 0.0
    )


@dataclasses.dataclass(frozen=True)
class ChainInitial:
    """State of a chain at t = 0: one vector for all rods, or one per rod."""

    rod_vector: Any = declare(keys.nonzero_vectors())  # m
    rod_rate: Any = declare(keys.any_number("vectors"), (0.0, 0.0, 0.0))  # m/s
    position: Any = declare(keys.any_number("vector"), None)  # m, first joint of a free chain
    velocity: Any = declare(keys.any_number("vector"), None)  # m/s
    heliocentric_position_au: Any = declare(keys.any_number("vector"), None)  # of the origin


@dataclasses.dataclass(frozen=True)
class Integrator:
    """Time integration. What is not given is chosen: `scenes/integration.py`."""

    t_end: Any = declare(keys.positive(structure=True))  # s
    method: Any = declare(
        keys.choice("generalized-alpha", "energy-momentum", "collocation", "tsit5", "dopri5", "dopri8"),
        None,
    )
    step: Any = declare(keys.positive(structure=True), None)  # s
    spectral_radius: Any = declare(
        keys.between("lie in [0, 1]", lambda x: bool(((x >= 0.0) & (x <= 1.0)).all())), None
    )
    tolerance: Any = declare(
        keys.between("lie in (0, 1)", lambda x: bool(((x > 0.0) & (x < 1.0)).all())), None
    )


@dataclasses.dataclass(frozen=True)
class Event:
    """What happens in the midst of a run, an entry each: at `time` the tether `release` is let go at its
    root (tethers count from 1). In a file: [[event]] tables."""

    time: Any = declare(keys.listed(keys.positive()))  # s
    release: Any = declare(keys.listed(keys.count()))


@dataclasses.dataclass(frozen=True)
class Output:
    """What is kept."""

    interval: Any = declare(keys.positive(structure=True))  # s


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
