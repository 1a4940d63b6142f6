"""The fields at a material point of a slender member, in which terms are written, and their invariants.

Arrays have the component first and any batch after it: the same code acts on all quadrature points at once.
"""

from typing import NamedTuple

import jax

from esail_jax.array_types import Maybe, PerPoint, VectorPerPoint
from esail_jax.numerics.vectors import dot, reciprocal


class PointFields(NamedTuple):
    """The fields at a material point that terms may depend on. Also the quantities conjugate to them.

    r: position [m]; conjugate: force per length [N/m]
    r_x: slope dr/dx [-]; conjugate: axial force vector [N]
    r_xx: second derivative [1/m]; conjugate: [N m]. Present only if a term uses curvature
    """

    r: Maybe[VectorPerPoint]
    r_x: Maybe[VectorPerPoint]
    r_xx: Maybe[VectorPerPoint] = None


class Invariants(NamedTuple):
    """Rotation-invariant measures of a slender member's deformation. Also their rates, and the quantities
    conjugate to them.

    stretch_squared: s = |r_x|^2 [-]. normal_squared: m = |n|^2 [1/m^2], where n is the part of r_xx that is
    normal to r_x; None if no term uses curvature.
    """

    stretch_squared: PerPoint
    normal_squared: Maybe[PerPoint] = None


def invariants_of(fields: PointFields) -> Invariants:
    """The invariants at every point. They do not depend on the position."""
    normal = None if fields.r_xx is None else normal_squared(fields.r_x, fields.r_xx)
    return Invariants(dot(fields.r_x, fields.r_x), normal)


@jax.custom_jvp
def normal_squared(r_x: VectorPerPoint, r_xx: VectorPerPoint) -> PerPoint:
    """m = |n|^2, n = r_xx - a r_x, a = (r_x . r_xx) / (r_x . r_x).

    The equal expression |r_xx|^2 - (r_x . r_xx)^2 / |r_x|^2 would lose all digits on a nearly straight
    cable.
    """
    _, normal = split_second_derivative(r_x, r_xx)
    return dot(normal, normal)


@normal_squared.defjvp
def _normal_squared_jvp(primals, tangents):
    """dm = 2 n . (dr_xx - a dr_x). The term with da vanishes, as n . r_x = 0; autodiff cannot know that."""
    along, normal = split_second_derivative(*primals)
    return dot(normal, normal), 2.0 * dot(normal, tangents[1] - along * tangents[0])


def split_second_derivative(r_x: VectorPerPoint, r_xx: VectorPerPoint) -> tuple[PerPoint, VectorPerPoint]:
    """Splits r_xx = a r_x + n into a and the vector n normal to r_x."""
    along = dot(r_x, r_xx) * reciprocal(dot(r_x, r_x))
    return along, r_xx - along * r_x


def add_fields(parts: list[PointFields]) -> PointFields:
    """Sum of the contributions of several terms, field by field; None where no term contributes."""
    sums = []
    for values in zip(*parts, strict=True) if parts else ((),) * len(PointFields._fields):
        present = [value for value in values if value is not None]
        sums.append(sum(present[1:], present[0]) if present else None)
    return PointFields(*sums)
