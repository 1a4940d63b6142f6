"""The tables of a chain of rods: rods, wind, voltage, orbit and start."""

from typing import Literal

from esail_jax.scenes import declarations
from esail_jax.scenes.declarations import RootName, StrainName, declare, per_member, table, vector
from esail_jax.scenes.rules import (
    any_number,
    between,
    choice,
    non_negative,
    non_positive,
    nonzero_vector,
    positive,
    positive_integer,
    true_or_false,
)
from esail_jax.scenes.value_types import Number, PerMember, Shape, Vector, Vectors

AnchorName = Literal["fixed", "free"]


@table
class Chain:
    """Elastic rods joined end to end ([MW]), in place of hub and tethers. A number holds for all rods, a
    list has one number per rod."""

    rods: int = declare(positive_integer, unit="-", doc="Number of rods.")
    mass: PerMember = per_member(positive, unit="kg", doc="Mass of a rod.")
    length: PerMember = per_member(positive, unit="m", doc="Undeformed length of a rod.")
    area: PerMember = declarations.area_of_section()
    youngs_modulus: PerMember = per_member(
        positive, unit="Pa", doc="Young's modulus of the rod's material."
    )
    second_moment: PerMember | None = declarations.second_moment_of_area(default=None)
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
    strain: StrainName = declarations.measure_of_strain(default="engineering")
    slack_strain: Number | None = declare(
        between("(0, 1)"),
        unit="-",
        doc="Strain over which the stiffness of a slack rod rises from 0 to EA; without it rods can push.",
        default=None,
    )
    axial_damping_time: PerMember | None = declarations.time_of_axial_damping(default=None)
    bending: bool = declare(
        true_or_false,
        unit="-",
        doc="Whether the joints between rods have bending stiffness.",
        default=False,
    )
    root: RootName = declarations.joint_at_root(
        "First joint of a fixed chain: pinned, or clamped along the first rod (with `bending`).",
        default="pinned",
    )


@table
class ChainWind:
    """Solar wind at a chain: steady."""

    speed: Number = declarations.speed_of_wind(Shape.SCALAR)
    number_density: Number = declarations.density_of_wind(Shape.SCALAR)
    cutoff_voltage: Number = declare(
        any_number, unit="V", doc="Voltage V_1 below which a rod has no thrust."
    )
    thrust_factor: Number | None = declarations.factor_of_thrust()
    relative: bool = declarations.wind_relative_to_point()


@table
class ChainVoltage:
    """Voltage of a chain: constant."""

    value: PerMember = per_member(any_number, unit="V", doc="Voltage V_0 of a rod.")


@table
class Orbit:
    """Circular orbit about a centre of attraction; the chain moves in axes that turn with the orbit."""

    mean_motion: Number = declare(positive, unit="rad/s", doc="Angular rate of the orbit.")


@table
class PlasmaBrake:
    """Coulomb drag of the ionosphere on a negative chain in low orbit. In the axes of the orbit the plasma
    streams along -y."""

    voltage: PerMember = per_member(
        non_positive, unit="V", doc="Voltage of a rod; one at zero has no drag."
    )
    speed: Number = declare(
        positive, unit="m/s", doc="Speed of the chain through the plasma, about that of the orbit."
    )
    number_density: Number = declare(positive, unit="1/m^3", doc="Number density of the plasma.")
    tether_radius: Number = declare(
        positive, unit="m", doc="Radius of the wire, or effective radius of a tether of several wires."
    )
    ion_mass_u: Number = declare(
        positive,
        unit="u",
        doc="Mass of an ion in atomic mass units; that of oxygen if left out.",
        default=16.0,
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
    position: Vector | None = vector(
        unit="m", doc="Position of the first joint of a free chain; the origin if left out.", default=None
    )
    velocity: Vector | None = vector(
        unit="m/s", doc="Velocity of the first joint of a free chain; zero if left out.", default=None
    )
    heliocentric_position_au: Vector | None = vector(
        unit="au", doc="Heliocentric position of the origin, required with solar wind.", default=None
    )
