"""The tables of a sail's tethers: main and auxiliary tethers, remote units and their thrust, temperature,
and releases."""

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np

from esail_jax.scenes import declarations, rules
from esail_jax.scenes.declarations import ElementName, RootName, StrainName, declare, per_member, table
from esail_jax.scenes.rules import (
    History,
    Number,
    PerMember,
    SceneError,
    Series,
    Shape,
    any_number,
    between,
    choice,
    increasing,
    non_negative,
    positive,
    positive_integer,
    true_or_false,
)

LEAST_RING = 3
"""Least number of tethers that can be joined in a ring."""


DirectionName = Literal["tangential", "axial", "radial"]


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
    strength: PerMember | None = per_member(
        positive,
        unit="Pa",
        doc="Tensile strength; with it a run warns of tethers under more stress, and says by how much.",
        default=None,
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


@table
class Thermal:
    """Temperature of the tethers, which expand with it: their elastic strain is the strain less expansion
    times (T - reference_temperature). Auxiliary tethers are not heated. With `time` the temperature is
    given at those instants and changes linearly between them; it is constant before the first and after the
    last. In Python, the functions of `esail_jax.environment.thermal` compute such a series for an
    eclipse."""

    expansion: Number = declare(any_number, unit="1/K", doc="Coefficient of thermal expansion.")
    reference_temperature: Number = declare(
        non_negative, unit="K", doc="Temperature at which a tether has its undeformed length."
    )
    temperature: History = declare(
        non_negative,
        shape=Shape.HISTORY,
        unit="K",
        doc="Temperature T of the tethers; with `time` one row per instant, a number or one per tether.",
    )
    time: Series | None = declare(
        increasing,
        shape=Shape.SERIES,
        unit="s",
        doc="Instants of the rows of `temperature`.",
        default=None,
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


def check_tethers(scene: Any) -> None:
    """Checks the keys of the main tethers. Raises SceneError."""
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
    if tethers.wire_radius is not None and scene.solar_wind is None:
        raise SceneError("tethers.wire_radius", "be left out without [solar_wind]", "is given")
    if tethers.wires is not None and tethers.wire_radius is None:
        raise SceneError("tethers.wires", "be left out without `tethers.wire_radius`", "is given")


def check_events(scene: Any) -> None:
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


def check_auxiliary_tethers(scene: Any) -> None:
    """Checks that there are enough tethers for a ring. Raises SceneError."""
    if scene.tethers.count < LEAST_RING:
        must = f"be {LEAST_RING} or more with [auxiliary_tethers]"
        raise SceneError("tethers.count", must, f"is {scene.tethers.count}")


def check_tip_thrust(scene: Any) -> None:
    """Checks that a force at the tips is switched by three keys or by none, and on before off. Raises
    SceneError."""
    table = scene.tip_thrust
    given = [name for name in ("on", "off", "rise_time") if getattr(table, name) is not None]
    for name in ("on", "off", "rise_time") if given else ():
        if name not in given:
            raise SceneError(f"tip_thrust.{name}", f"be given with `tip_thrust.{given[0]}`", "is missing")
    on, off = (None if x is None else rules.known(x) for x in (table.on, table.off))
    if on is not None and off is not None and (on >= off).any():
        must = f"be after `tip_thrust.on` ({rules.describe(table.on).removeprefix('is ')})"
        raise SceneError("tip_thrust.off", must, rules.describe(table.off))


def check_thermal(scene: Any) -> None:
    """Checks that temperatures have one number per tether or, with `time`, one row per instant, and that
    the start takes them into account. Raises SceneError."""
    table, members, elongation = scene.thermal, scene.members, scene.initial.elongation
    key, shape = "thermal.temperature", np.shape(table.temperature)
    has = f"has {shape[0]} entries" if shape else rules.describe(table.temperature)
    if table.time is None:
        if len(shape) > 1 or shape not in ((), (members.count,)):
            without = " without `thermal.time`"
            must = f"be a number or a list of {members.count} (`{members.key}`){without}"
            raise SceneError(key, must, "is a table" if len(shape) > 1 else has)
    else:
        check_rows(table, shape, has, members)
    if elongation != "steady":
        raise SceneError("initial.elongation", 'be "steady" with [thermal]', f'is "{elongation}"')


def check_rows(table: Any, shape: tuple[int, ...], has: str, members: rules.Members) -> None:
    """Checks that a table of temperatures has as many rows as instants, and that each is a number or has
    one per tether. Raises SceneError."""
    key = "thermal.temperature"
    if np.ndim(table.time) == 0:
        raise SceneError("thermal.time", "increase", rules.wrong_shape(table.time))
    count = np.shape(table.time)[0]
    if not shape or shape[0] != count:
        must = f"have as many rows as `thermal.time` has instants ({count})"
        raise SceneError(key, must, has.replace("entries", "rows"))
    if len(shape) == 2 and shape[1] != members.count:
        must = f"have rows of {members.count} (`{members.key}`)"
        raise SceneError(key, must, f"has rows of {shape[1]}")
