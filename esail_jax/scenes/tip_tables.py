"""The tables of a sail's tips: auxiliary tethers, remote units and their thrust."""

from typing import Literal

from esail_jax.scenes import declarations
from esail_jax.scenes.declarations import ElementName, StrainName, declare, per_member, table
from esail_jax.scenes.rules import any_number, between, choice, non_negative, positive, positive_integer
from esail_jax.scenes.value_types import Number, PerMember

DirectionName = Literal["tangential", "axial", "radial"]


@table
class AuxiliaryTethers:
    """Tethers that join the tips of neighbouring main tethers into a ring: segment i those of the tethers i
    and i + 1, the last one those of the last tether and the first. A number holds for all segments, a list
    has one number per segment."""

    length: PerMember = per_member(positive, unit="m", doc="Undeformed length of a segment.")
    area: PerMember = declarations.area_of_section()
    density: PerMember = per_member(positive, unit="kg/m^3", doc="Density of a segment's material.")
    youngs_modulus: PerMember = per_member(
        positive, unit="Pa", doc="Young's modulus of a segment's material."
    )
    axial_damping_time: PerMember | None = declarations.time_of_axial_damping(default=None)
    element: ElementName = declare(
        choice(ElementName),
        unit="-",
        doc="Kind of finite element: linear truss or cubic ANCF cable.",
        default="truss",
    )
    elements: int = declare(positive_integer, unit="-", doc="Number of elements per segment.", default=1)
    strain: StrainName | None = declare(
        choice(StrainName),
        unit="-",
        doc="Measure of axial strain; without it that of the main tethers.",
        default=None,
    )
    slack_strain: PerMember | None = per_member(
        between("(0, 1)"),
        unit="-",
        doc="Strain over which the stiffness of a slack segment rises from 0 to EA; without it segments "
        "can push.",
        default=None,
    )


@table
class RemoteUnits:
    """Point masses at the tips of the tethers."""

    mass: PerMember = per_member(non_negative, unit="kg", doc="Mass of the remote unit at a tether's tip.")


@table
class TipThrust:
    """Thrust at the tips: a force on every remote unit. With X_B the spin axis and d the unit vector along
    the chord from root to tip, less its part along X_B, a tangential force is along X_B x d, an axial one
    along X_B and a radial one along d. Without `on`, `off` and `rise_time` it always acts."""

    force: PerMember = per_member(
        any_number, unit="N", doc="Force on a remote unit; a negative one has the opposite direction."
    )
    direction: DirectionName = declare(
        choice(DirectionName), unit="-", doc="Direction of the force.", default="tangential"
    )
    on: PerMember | None = per_member(
        any_number, unit="s", doc="Instant at which the force begins to rise.", default=None
    )
    off: PerMember | None = per_member(
        any_number, unit="s", doc="Instant at which the force begins to fall, after `on`.", default=None
    )
    rise_time: Number | None = declare(
        positive, unit="s", doc="Duration of the rise and of the fall.", default=None
    )
