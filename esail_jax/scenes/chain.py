"""The table [chain]: elastic rods joined end to end ([MW]), in place of hub and tethers."""

from typing import Any, Literal

from esail_jax.scenes import declarations
from esail_jax.scenes.declarations import RootName, StrainName, declare, per_member, table
from esail_jax.scenes.rules import (
    Number,
    PerMember,
    SceneError,
    between,
    choice,
    non_negative,
    positive,
    positive_integer,
    true_or_false,
)

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


def check_chain(scene: Any) -> None:
    """Checks the keys of a chain. Raises SceneError."""
    chain, free = scene.chain, scene.chain.anchor == "free"
    if chain.bending and chain.second_moment is None:
        raise SceneError("chain.second_moment", "be given with `chain.bending`", "is missing")
    if chain.root == "clamped" and (free or not chain.bending):
        why = "at a free end" if free else "without `chain.bending`"
        raise SceneError("chain.root", f'be "pinned" {why}', 'is "clamped"')
    if chain.base_mass is not None and not free:
        raise SceneError("chain.base_mass", 'be left out unless `chain.anchor` is "free"', "is given")
