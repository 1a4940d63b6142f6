"""Declarations of the keys of a scene: `declare`, what several tables declare alike, and `table`.

Written in a TOML file or made in Python, a table may hold any value until a `Scene` is made of it: that is
where values are checked. The annotations say what will pass. A key that may be absent or has a default says
so where it is declared (`default=`), because type checkers look for it there."""

import dataclasses
import typing
from typing import Any, Literal, TypeVar

from esail_jax.scenes.rules import Rule, Shape, any_number, choice, non_negative, positive, true_or_false

T = TypeVar("T")

ElementName = Literal["cable", "truss"]
RootName = Literal["pinned", "clamped"]
StrainName = Literal["green-lagrange", "engineering"]


def declare(
    rule: Rule,
    *,
    unit: str,
    doc: str,
    default: Any = dataclasses.MISSING,
    shape: Shape = Shape.SCALAR,
    structure: bool = False,
) -> Any:
    """Declares a key: a dataclass field whose metadata hold its rule, unit and description.

    unit: of the value, "-" if it has none; doc: one sentence; default: without one the key must be given,
    None means that the key may be absent; shape and structure: as in `Rule`."""
    rule = dataclasses.replace(rule, shape=shape, structure=structure or rule.structure)
    return dataclasses.field(default=default, metadata={"rule": rule, "unit": unit, "doc": doc})


def per_member(rule: Rule, *, unit: str, doc: str, default: Any = dataclasses.MISSING) -> Any:
    """Declares a key with one number for all tethers or rods, or one for each."""
    return declare(rule, unit=unit, doc=doc, default=default, shape=Shape.MEMBER)


def vector(*, unit: str, doc: str, default: Any = dataclasses.MISSING) -> Any:
    """Declares a key with three finite numbers: x, y, z."""
    return declare(any_number, unit=unit, doc=doc, default=default, shape=Shape.VECTOR)


def area_of_section() -> Any:
    """Declares the area of a tether or rod, which is required."""
    return per_member(positive, unit="m^2", doc="Area of the cross section.")


def second_moment_of_area(*, default: None) -> Any:
    """Declares the second moment of area of a tether or rod."""
    doc = "Second moment of area of the cross section; required with `bending`."
    return per_member(positive, unit="m^4", doc=doc, default=default)


def time_of_axial_damping(*, default: None) -> Any:
    """Declares the time constant of axial damping of a tether or rod."""
    doc = "Time constant of axial damping; without it there is none."
    return per_member(non_negative, unit="s", doc=doc, default=default)


def measure_of_strain(*, default: StrainName) -> Any:
    """Declares the measure of axial strain of tethers or rods."""
    return declare(choice(StrainName), unit="-", doc="Measure of axial strain.", default=default)


def joint_at_root(doc: str, *, default: RootName) -> Any:
    """Declares the joint at the root of tethers or rods."""
    return declare(choice(RootName), unit="-", doc=doc, default=default)


def speed_of_wind(shape: Shape) -> Any:
    """Declares the speed of the solar wind, which is required."""
    return declare(positive, shape=shape, unit="m/s", doc="Speed u of the wind.")


def density_of_wind(shape: Shape) -> Any:
    """Declares the number density of the solar wind, which is required."""
    return declare(non_negative, shape=shape, unit="1/m^3", doc="Number density n_0 of the wind.")


def factor_of_thrust() -> Any:
    """Declares the factor of the linear law of thrust."""
    doc = "Law linear: factor of the thrust ([PGV] Eq. 29), 0.18 if left out."
    return declare(positive, unit="-", doc=doc, default=None)


def wind_relative_to_point() -> Any:
    """Declares whether the wind is felt relative to the moving tether or rod."""
    doc = "Whether the wind is felt relative to each moving point, u - dr/dt in place of u."
    return declare(true_or_false, unit="-", doc=doc, default=False)


@typing.dataclass_transform(
    frozen_default=True,
    field_specifiers=(
        declare,
        per_member,
        vector,
        area_of_section,
        speed_of_wind,
        density_of_wind,
        wind_relative_to_point,
    ),
)
def table(cls: type[T]) -> type[T]:
    """Makes a frozen dataclass of a table.

    A table may hold any value until a `Scene` is made of it, which checks every value and names the key
    that is wrong. Checkers of types at run time (jaxtyping, beartype) must therefore leave its constructor
    alone."""
    made: Any = dataclasses.dataclass(frozen=True)(cls)
    made.__no_type_check__ = True
    return made


def rule_of(field: dataclasses.Field) -> Rule:
    """The rule that a dataclass field was declared with."""
    return field.metadata["rule"]
