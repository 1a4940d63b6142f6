"""Array types with named axes.

The axis names are the same words in signatures, run files and plots:

`member`  ensemble member          `tether`  index of the tether, 0 ... p-1
`time`    saved instant            `node`    node of a tether, root first
`elem`    finite element           `point`   quadrature point of an element
`element` one of all elements of all tethers; e p + i is element e of tether i
`state`   one of several states of motion that are evaluated at once
`coef`    nodal vector of a node (position, slope) or of an element (four of them for a cable)
`xyz`     Cartesian component

Arrays of physical points have `xyz` first and `element` last, so that a density written for one point acts
on all points of all elements of all tethers at once. The elements of all tethers share one long axis
because the compiler unrolls loops over a short axis, such as twelve tethers, and does not vectorise them,
which takes four times as long.
"""

from typing import TYPE_CHECKING, Any, TypeVar, Union

from jaxtyping import Array, Bool, Complex, Float, Inexact, Int

T = TypeVar("T")

Scalar = Float[Array, ""]
Instants = Float[Array, "..."]
"""A time, or one per state of motion, in a shape that broadcasts to the points."""
Vector = Float[Array, "3"]
Rotation = Float[Array, "3 3"]
PerTether = Float[Array, " tether"]
PerMember = Float[Array, "*elem tether"]
"""One number per tether, or one per element of each tether."""
PerElement = Float[Array, "*state #element"]
"""One number per element, for one or several states of motion; or one number for all elements."""
PerPoint = Float[Array, "*point"]
VectorPerPoint = Float[Array, "xyz *point"]
"""One vector per point, components first: x, y, z, or those of two vectors (`energy_momentum.Secant`)."""
Nodal = Float[Array, "coef 3 *state node tether"]
"""Nodal vectors of one or several states of motion."""
HubPoints = Float[Array, "4 3"]

if TYPE_CHECKING:
    Maybe = Union[T, Any]  # noqa: UP007 - with `|` mypy does not take it for an alias
else:

    class Maybe:
        """`Maybe[X]` is `X | None`: a part of the model, or what belongs to it, which is None where the
        scene lacks the part.

        The structure of a scene decides which parts there are, which no type checker can follow. It takes
        them as present; whoever may meet an absent one asks first."""

        def __class_getitem__(cls, kind: Any) -> Any:
            return kind | None


__all__ = [
    "Array",
    "Bool",
    "Complex",
    "Float",
    "HubPoints",
    "Inexact",
    "Instants",
    "Int",
    "Maybe",
    "Nodal",
    "PerElement",
    "PerMember",
    "PerPoint",
    "PerTether",
    "Rotation",
    "Scalar",
    "Vector",
    "VectorPerPoint",
]
