"""The tables of a scene, one frozen dataclass each: every key with its type, rule, unit and description.

Written in a TOML file or made in Python, a table may hold any value until a `Scene` is made of it: that is
where values are checked. The annotations say what will pass."""

import dataclasses
from collections.abc import Container, Sequence
from typing import Any, Literal

from esail_jax.scenes.methods import MethodName
from esail_jax.scenes.rules import (
    any_number,
    between,
    choice,
    declare,
    increasing,
    non_negative,
    nonzero_vector,
    positive,
    positive_integer,
    table,
    true_or_false,
)
from esail_jax.scenes.value_types import Grid, Number, PerMember, Series, Shape, Vector, Vectors

ElementName = Literal["cable", "truss"]
StrainName = Literal["green-lagrange", "engineering"]
RootName = Literal["pinned", "clamped"]
AnchorName = Literal["fixed", "free"]
ElongationName = Literal["steady", "paper"]
LawName = Literal["constant", "harmonic", "piecewise-linear", "on-off", "feedback", "planar-cone"]


@table
class Hub:
    """Rigid cylinder about X_B ([PGV] Table 1)."""

    height: Number = declare(positive, unit="m", doc="Height of the cylinder.")
    radius: Number = declare(positive, unit="m", doc="Radius of the cylinder.")
    density: Number = declare(positive, unit="kg/m^3", doc="Density of the cylinder.")


@table
class Tethers:
    """Main tethers. A number holds for all tethers, a list has one number per tether."""

    count: int = declare(positive_integer, unit="-", doc="Number of tethers.")
    length: PerMember = declare(
        positive, shape=Shape.MEMBER, unit="m", doc="Undeformed length of a tether."
    )
    area: PerMember = declare(positive, shape=Shape.MEMBER, unit="m^2", doc="Area of the cross section.")
    density: PerMember = declare(
        positive, shape=Shape.MEMBER, unit="kg/m^3", doc="Density of the tether's material."
    )
    youngs_modulus: PerMember = declare(
        positive, shape=Shape.MEMBER, unit="Pa", doc="Young's modulus of the tether's material."
    )
    second_moment: PerMember | None = declare(
        positive,
        shape=Shape.MEMBER,
        unit="m^4",
        doc="Second moment of area of the cross section; required with `bending`.",
        default=None,
    )
    element: ElementName = declare(
        choice(ElementName),
        unit="-",
        doc="Kind of finite element: cubic ANCF cable or linear truss.",
        default="cable",
    )
    elements: int = declare(positive_integer, unit="-", doc="Number of elements per tether.", default=5)
    strain: StrainName = declare(
        choice(StrainName), unit="-", doc="Measure of axial strain.", default="green-lagrange"
    )
    bending: bool = declare(
        true_or_false, unit="-", doc="Whether tethers have bending stiffness (cables only).", default=False
    )
    axial_damping_time: PerMember | None = declare(
        non_negative,
        shape=Shape.MEMBER,
        unit="s",
        doc="Time constant of axial damping; without it there is none.",
        default=None,
    )
    bending_damping_time: PerMember | None = declare(
        non_negative,
        shape=Shape.MEMBER,
        unit="s",
        doc="Time constant of bending damping, used with `bending`; without it there is none.",
        default=None,
    )
    straight_turn: Number | None = declare(
        positive,
        unit="rad",
        doc="End-to-end turn of a tether below which bending damping fades out, used with that damping.",
        default=None,
    )
    root: RootName = declare(
        choice(RootName),
        unit="-",
        doc="Joint at a tether's root: spherical, or clamped (cables only).",
        default="pinned",
    )


@table
class Chain:
    """Elastic rods joined end to end ([MW]), in place of hub and tethers. A number holds for all rods, a
    list has one number per rod."""

    rods: int = declare(positive_integer, unit="-", doc="Number of rods.")
    mass: PerMember = declare(positive, shape=Shape.MEMBER, unit="kg", doc="Mass of a rod.")
    length: PerMember = declare(positive, shape=Shape.MEMBER, unit="m", doc="Undeformed length of a rod.")
    area: PerMember = declare(positive, shape=Shape.MEMBER, unit="m^2", doc="Area of the cross section.")
    youngs_modulus: PerMember = declare(
        positive, shape=Shape.MEMBER, unit="Pa", doc="Young's modulus of the rod's material."
    )
    second_moment: PerMember | None = declare(
        positive,
        shape=Shape.MEMBER,
        unit="m^4",
        doc="Second moment of area of the cross section; required with `bending`.",
        default=None,
    )
    tip_mass: Number = declare(
        non_negative, unit="kg", doc="Point mass at the end of the last rod.", default=0.0
    )
    base_mass: Number | None = declare(
        non_negative, unit="kg", doc="Point mass at the first joint of a free chain.", default=None
    )
    anchor: AnchorName = declare(
        choice(AnchorName),
        unit="-",
        doc="Whether the first joint is held at the origin or moves freely.",
        default="fixed",
    )
    strain: StrainName = declare(
        choice(StrainName), unit="-", doc="Measure of axial strain.", default="engineering"
    )
    slack_strain: Number | None = declare(
        between("(0, 1)"),
        unit="-",
        doc="Strain over which the stiffness of a slack rod rises from 0 to EA; without it rods can push.",
        default=None,
    )
    axial_damping_time: PerMember | None = declare(
        non_negative,
        shape=Shape.MEMBER,
        unit="s",
        doc="Time constant of axial damping; without it there is none.",
        default=None,
    )
    bending: bool = declare(
        true_or_false,
        unit="-",
        doc="Whether the joints between rods have bending stiffness.",
        default=False,
    )
    root: RootName = declare(
        choice(RootName),
        unit="-",
        doc="First joint of a fixed chain: pinned, or clamped along the first rod (with `bending`).",
        default="pinned",
    )


@table
class RemoteUnits:
    """Point masses at the tips of the tethers."""

    mass: PerMember = declare(
        non_negative, shape=Shape.MEMBER, unit="kg", doc="Mass of the remote unit at a tether's tip."
    )


@table
class SolarWind:
    """Solar wind at the sail ([PGV] after Eq. 28). With `time`, speed and density are given at those
    instants and change linearly between them. In a file, `file` may name a CSV file with these three
    columns (`scenes/wind_file.py`)."""

    speed: Series = declare(positive, shape=Shape.SERIES, unit="m/s", doc="Speed u of the wind.")
    number_density: Series = declare(
        non_negative, shape=Shape.SERIES, unit="1/m^3", doc="Number density n_0 of the wind."
    )
    cutoff_voltage: Number = declare(
        any_number, unit="V", doc="Voltage V_1 below which a tether has no thrust."
    )
    time: Series | None = declare(
        increasing,
        shape=Shape.SERIES,
        unit="s",
        doc="Instants at which lists of `speed` and `number_density` are given.",
        default=None,
    )


LAWS: dict[LawName, tuple[str, ...]] = {
    "constant": ("value",),
    "harmonic": ("value", "cosine", "sine", "maximum", "slew_rate"),
    "piecewise-linear": ("value", "time", "table", "maximum", "slew_rate"),
    "on-off": ("value", "on", "off", "rise_time", "maximum", "slew_rate"),
    "feedback": ("value", "gain", "target_sailing_angle_deg", "maximum", "slew_rate"),
    "planar-cone": ("coning_angle_deg", "spin_rate", "maximum", "slew_rate"),
}
"""Modulation laws of the voltage, and the keys that each law takes."""

OPTIONAL_LAW_KEYS = ("cosine", "sine", "off", "maximum", "slew_rate")
"""Keys that a law takes but does not require."""


@table
class Voltage:
    """Voltage V_0 of the tethers, and its modulation (`loads/voltage.py`)."""

    value: PerMember | None = declare(
        any_number, shape=Shape.MEMBER, unit="V", doc="Voltage V_0 of a tether.", default=None
    )
    law: LawName = declare(choice(LawName), unit="-", doc="Modulation law.", default="constant")
    maximum: Number | None = declare(
        positive, unit="V", doc="Upper limit of the voltage; without it there is none.", default=None
    )
    slew_rate: Number | None = declare(
        positive,
        unit="V/s",
        doc="Upper limit of the voltage's rate; without it there is none.",
        default=None,
    )
    cosine: Grid | None = declare(
        any_number,
        shape=Shape.GRID,
        unit="-",
        doc="Law harmonic: cosine amplitudes as fractions of V_0, one row per harmonic.",
        default=None,
    )
    sine: Grid | None = declare(
        any_number,
        shape=Shape.GRID,
        unit="-",
        doc="Law harmonic: sine amplitudes as fractions of V_0, one row per harmonic.",
        default=None,
    )
    time: Series | None = declare(
        increasing,
        shape=Shape.SERIES,
        unit="s",
        doc="Law piecewise-linear: instants of the rows of `table`.",
        default=None,
    )
    table: Grid | None = declare(
        non_negative,
        shape=Shape.GRID,
        unit="-",
        doc="Law piecewise-linear: voltages as fractions of V_0, one row per instant.",
        default=None,
    )
    on: PerMember | None = declare(
        any_number,
        shape=Shape.MEMBER,
        unit="s",
        doc="Law on-off: instant at which the voltage begins to rise.",
        default=None,
    )
    off: PerMember | None = declare(
        any_number,
        shape=Shape.MEMBER,
        unit="s",
        doc="Law on-off: instant at which the voltage begins to fall; without it the voltage stays on.",
        default=None,
    )
    rise_time: Number | None = declare(
        positive, unit="s", doc="Law on-off: duration of the rise and of the fall.", default=None
    )
    gain: Number | None = declare(
        any_number, unit="-", doc="Law feedback: gain of the attitude error.", default=None
    )
    target_sailing_angle_deg: Number | None = declare(
        any_number,
        unit="deg",
        doc="Law feedback: sailing angle that defines the target of the spin axis.",
        default=None,
    )
    coning_angle_deg: Number | None = declare(
        between("(-90, 90)"), unit="deg", doc="Law planar-cone: coning angle to be held.", default=None
    )
    spin_rate: Number | None = declare(
        any_number,
        unit="rad/s",
        doc="Law planar-cone: mean spin rate omega_0 of the tethers.",
        default=None,
    )


@table
class ChainWind:
    """Solar wind at a chain: steady."""

    speed: Number = declare(positive, unit="m/s", doc="Speed u of the wind.")
    number_density: Number = declare(non_negative, unit="1/m^3", doc="Number density n_0 of the wind.")
    cutoff_voltage: Number = declare(
        any_number, unit="V", doc="Voltage V_1 below which a rod has no thrust."
    )


@table
class ChainVoltage:
    """Voltage of a chain: constant."""

    value: PerMember = declare(any_number, shape=Shape.MEMBER, unit="V", doc="Voltage V_0 of a rod.")


@table
class Gravity:
    """Uniform gravity in the inertial frame."""

    acceleration: Vector = declare(
        any_number, shape=Shape.VECTOR, unit="m/s^2", doc="Acceleration of gravity in inertial axes."
    )


@table
class Orbit:
    """Circular orbit about a centre of attraction; the chain moves in axes that turn with the orbit."""

    mean_motion: Number = declare(positive, unit="rad/s", doc="Angular rate of the orbit.")


@table
class Initial:
    """State of a sail at t = 0 ([PGV] Sec. 4.1)."""

    spin_rate: Number = declare(any_number, unit="rad/s", doc="Angular rate about X_B.")
    sailing_angle_deg: Number = declare(
        between("(-180, 180]"),
        unit="deg",
        doc="Sailing angle alpha from the direction away from the Sun to the spin axis X_B.",
        default=0.0,
    )
    heliocentric_position_au: Vector = declare(
        any_number,
        shape=Shape.VECTOR,
        unit="au",
        doc="Heliocentric position R_0 of the inertial frame's origin.",
        default=(0.7071067811865476, 0.7071067811865476, 0.0),
    )
    elongation: ElongationName = declare(
        choice(ElongationName),
        unit="-",
        doc="Stretch of the spinning tethers: the discrete equilibrium, or [PGV] Eq. 79-80 as printed.",
        default="steady",
    )
    coning_angle_deg: Number = declare(
        between("(-90, 90)"),
        unit="deg",
        doc="Angle of the tethers from the spin plane towards X_B.",
        default=0.0,
    )


@table
class ChainInitial:
    """State of a chain at t = 0. A vector holds for all rods, a list has one vector per rod."""

    rod_vector: Vectors = declare(
        nonzero_vector, shape=Shape.VECTORS, unit="m", doc="Vector from a rod's first joint to its second."
    )
    rod_rate: Vectors = declare(
        any_number,
        shape=Shape.VECTORS,
        unit="m/s",
        doc="Time derivative of the rod vector.",
        default=(0.0, 0.0, 0.0),
    )
    position: Vector | None = declare(
        any_number,
        shape=Shape.VECTOR,
        unit="m",
        doc="Position of the first joint of a free chain; the origin if left out.",
        default=None,
    )
    velocity: Vector | None = declare(
        any_number,
        shape=Shape.VECTOR,
        unit="m/s",
        doc="Velocity of the first joint of a free chain; zero if left out.",
        default=None,
    )
    heliocentric_position_au: Vector | None = declare(
        any_number,
        shape=Shape.VECTOR,
        unit="au",
        doc="Heliocentric position of the origin, required with solar wind.",
        default=None,
    )


@table
class Integrator:
    """Time integration. Keys that are left out are chosen by `scenes/method_choice.py`."""

    t_end: float = declare(positive, structure=True, unit="s", doc="End time.")
    method: MethodName | None = declare(
        choice(MethodName), unit="-", doc="Method of time integration; chosen if left out.", default=None
    )
    step: float | None = declare(
        positive,
        structure=True,
        unit="s",
        doc="Fixed step size; methods with error control then use it in place of a tolerance.",
        default=None,
    )
    spectral_radius: Number | None = declare(
        between("[0, 1]"),
        unit="-",
        doc="Spectral radius of generalized-alpha at infinite frequency.",
        default=None,
    )
    tolerance: Number | None = declare(
        between("(0, 1)"), unit="-", doc="Relative local error of methods with error control.", default=None
    )


@table
class Event:
    """Releases of tethers during a run, one entry each: at `time` the tether `release` is let go at its
    root. In a file: one [[event]] table per release."""

    time: Sequence[float] = declare(
        positive, shape=Shape.LIST, structure=True, unit="s", doc="Instant of the release."
    )
    release: Sequence[int] = declare(
        positive_integer, shape=Shape.LIST, unit="-", doc="Number of the released tether, counted from 1."
    )


@table
class Output:
    """Instants at which observables are saved."""

    interval: float = declare(
        positive,
        structure=True,
        unit="s",
        doc="Time between saved instants; t_end/1000 without this table.",
    )


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
"""Tables of a sail, by name."""

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
