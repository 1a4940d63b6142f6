"""The tables of a sail: hub, tethers, wind, voltage, start and events. Those of its tips are in
`tip_tables.py`."""

from collections.abc import Sequence
from typing import Any, Literal

from esail_jax.scenes import declarations
from esail_jax.scenes.declarations import (
    ElementName,
    RootName,
    StrainName,
    declare,
    per_member,
    table,
    vector,
)
from esail_jax.scenes.law_keys import LawName, ThrustLawName
from esail_jax.scenes.rules import (
    any_number,
    between,
    choice,
    increasing,
    non_negative,
    positive,
    positive_integer,
    true_or_false,
)
from esail_jax.scenes.value_types import Grid, Matrix, Number, PerMember, Series, Shape, Vector, Vectors

ElongationName = Literal["steady", "paper"]
MeasuredAxisName = Literal["hub", "angular-momentum"]


def amplitudes(function: str) -> Any:
    """Declares the amplitudes of a harmonic law. function: `cosine` or `sine`."""
    doc = f"Law harmonic: {function} amplitudes as fractions of V_0, one row per harmonic."
    return declare(any_number, shape=Shape.GRID, unit="-", doc=doc, default=None)


@table
class Hub:
    """Rigid hub: a cylinder about X_B ([PGV] Table 1), by `height`, `radius` and `density`, or a spacecraft
    of any shape, by `mass` and `inertia`. Roots lie at `radius` from the axis, evenly in the plane through
    the hub centre, or where `roots` says."""

    height: Number | None = declare(positive, unit="m", doc="Height of the cylinder.", default=None)
    radius: Number | None = declare(
        positive, unit="m", doc="Radius of the cylinder, or of the circle of the roots.", default=None
    )
    density: Number | None = declare(positive, unit="kg/m^3", doc="Density of the cylinder.", default=None)
    mass: Number | None = declare(positive, unit="kg", doc="Mass of a spacecraft.", default=None)
    inertia: Matrix | None = declare(
        any_number,
        shape=Shape.MATRIX,
        unit="kg m^2",
        doc="Inertia tensor of a spacecraft about its centre of mass, in B.",
        default=None,
    )
    centre: Vector | None = vector(
        unit="m", doc="Centre of mass of a spacecraft from the hub centre, in B.", default=None
    )
    roots: Vectors | None = declare(
        any_number,
        shape=Shape.VECTORS,
        unit="m",
        doc="Positions of the roots on a spacecraft from the hub centre, in B, in place of `radius`.",
        default=None,
    )


@table
class Tethers:
    """Main tethers. A number holds for all tethers, a list has one number per tether."""

    count: int = declare(positive_integer, unit="-", doc="Number of tethers.")
    length: PerMember = per_member(positive, unit="m", doc="Undeformed length of a tether.")
    area: PerMember = declarations.area_of_section()
    density: PerMember = per_member(positive, unit="kg/m^3", doc="Density of the tether's material.")
    youngs_modulus: PerMember = per_member(
        positive, unit="Pa", doc="Young's modulus of the tether's material."
    )
    second_moment: PerMember | None = declarations.second_moment_of_area(default=None)
    element: ElementName = declare(
        choice(ElementName),
        unit="-",
        doc="Kind of finite element: cubic ANCF cable or linear truss.",
        default="cable",
    )
    elements: int = declare(positive_integer, unit="-", doc="Number of elements per tether.", default=5)
    strain: StrainName = declarations.measure_of_strain(default="green-lagrange")
    bending: bool = declare(
        true_or_false, unit="-", doc="Whether tethers have bending stiffness (cables only).", default=False
    )
    axial_damping_time: PerMember | None = declarations.time_of_axial_damping(default=None)
    bending_damping_time: PerMember | None = per_member(
        non_negative,
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
    root: RootName = declarations.joint_at_root(
        "Joint at a tether's root: spherical, or clamped (cables only).", default="pinned"
    )
    wire_radius: PerMember | None = per_member(
        positive,
        unit="m",
        doc="Radius of one wire of a tether; with it current and electric power are reported.",
        default=None,
    )
    wires: int | None = declare(
        positive_integer,
        unit="-",
        doc="Number of wires of a tether, 1 if left out; used with `wire_radius`.",
        default=None,
    )


@table
class SolarWind:
    """Solar wind at the sail ([PGV] after Eq. 28). With `time`, speed and density are given at those
    instants and change linearly between them. In a file, `file` may name a CSV file whose first line is
    time,speed,number_density, and which has a line of numbers per instant."""

    speed: Series = declarations.speed_of_wind(Shape.SERIES)
    number_density: Series = declarations.density_of_wind(Shape.SERIES)
    cutoff_voltage: Number | None = declare(
        any_number,
        unit="V",
        doc="Law linear: voltage V_1 below which a tether has no thrust.",
        default=None,
    )
    thrust_law: ThrustLawName = declare(
        choice(ThrustLawName),
        unit="-",
        doc="Law of the thrust: that of [PGV], or that of the electron sheath's size.",
        default="linear",
    )
    thrust_factor: Number | None = declarations.factor_of_thrust()
    electron_temperature_ev: Number | None = declare(
        positive, unit="eV", doc="Law debye-sheath: temperature of the wind's electrons.", default=None
    )
    tether_radius: Number | None = declare(
        positive,
        unit="m",
        doc="Law debye-sheath: radius of the wire, or effective radius of a tether of several wires.",
        default=None,
    )
    time: Series | None = declare(
        increasing,
        shape=Shape.SERIES,
        unit="s",
        doc="Instants at which lists of `speed` and `number_density` are given.",
        default=None,
    )
    relative: bool = declarations.wind_relative_to_point()
    reference_distance_au: Number | None = declare(
        positive,
        unit="au",
        doc="Distance of the Sun at which speed and density are given, 1 if left out; used with [orbit].",
        default=None,
    )


@table
class Voltage:
    """Voltage V_0 of the tethers, and the law by which it is modulated: in time, with the rotation of the
    sail, or by feedback. Each law has keys of its own."""

    value: PerMember | None = per_member(any_number, unit="V", doc="Voltage V_0 of a tether.", default=None)
    law: LawName = declare(choice(LawName), unit="-", doc="Modulation law.", default="constant")
    maximum: Number | None = declare(
        positive, unit="V", doc="Upper limit of the voltage; without it there is none.", default=None
    )
    limit_blend: Number | None = declare(
        between("(0, 0.5]"),
        unit="-",
        doc="Half width, as a fraction of `maximum`, of the ranges in which the voltage bends smoothly "
        "towards 0 and `maximum`, for derivatives; without it both limits are exact.",
        default=None,
    )
    slew_rate: Number | None = declare(
        positive,
        unit="V/s",
        doc="Upper limit of the voltage's rate; without it there is none.",
        default=None,
    )
    power_limit: Number | None = declare(
        positive,
        unit="W",
        doc="Upper limit of the electric power of all tethers; all voltages are reduced alike to keep it.",
        default=None,
    )
    cosine: Grid | None = amplitudes("cosine")
    sine: Grid | None = amplitudes("sine")
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
    on: PerMember | None = per_member(
        any_number, unit="s", doc="Law on-off: instant at which the voltage begins to rise.", default=None
    )
    off: PerMember | None = per_member(
        any_number,
        unit="s",
        doc="Law on-off: instant at which the voltage begins to fall; without it the voltage stays on.",
        default=None,
    )
    rise_time: Number | None = declare(
        positive, unit="s", doc="Law on-off: duration of the rise and of the fall.", default=None
    )
    on_phase_deg: PerMember | None = per_member(
        any_number,
        unit="deg",
        doc="Law phase-window: phase at which the voltage begins to rise.",
        default=None,
    )
    off_phase_deg: PerMember | None = per_member(
        any_number,
        unit="deg",
        doc="Law phase-window: phase at which the voltage begins to fall.",
        default=None,
    )
    rise_phase_deg: PerMember | None = per_member(
        between("(0, 360]"),
        unit="deg",
        doc="Law phase-window: angle of the rise and of the fall.",
        default=None,
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
    measured_axis: MeasuredAxisName | None = declare(
        choice(MeasuredAxisName),
        unit="-",
        doc='Law feedback: what is measured as the spin axis, "hub" if left out.',
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
    thrust: Number | None = declare(
        positive, unit="N", doc="Law constant-thrust: size of the sail's thrust.", default=None
    )


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
    heliocentric_position_au: Vector | None = vector(
        unit="au",
        doc="Heliocentric position R_0 of the inertial frame's origin, left out with [orbit]; without both "
        "(0.7071067811865476, 0.7071067811865476, 0).",
        default=None,
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


ORIGIN_AU = (0.7071067811865476, 0.7071067811865476, 0.0)
"""Heliocentric position [au] of the origin of a sail that has neither a position nor an orbit."""


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
