"""Functions at zero whose value and first derivative vanish, but not their second one: x^2/(2 c), x y/2.

Their values are zero whatever the values of x and y, which are zero but for rounding. The coefficients of
their derivatives have rules of their own (`jax.custom_jvp`): first derivatives multiply a tangent by a
coefficient that is zero, second ones by the derivative of that coefficient.

`vanishing` leaves such terms out of every program that does not compute a second derivative: it neither
traces nor compiles them there.
"""

import dataclasses
import functools
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp

from esail_jax.array_types import Array, Float, Scalar
from esail_jax.compilation.kept import KEEPER
from esail_jax.numerics.own_derivative import custom_jvp
from esail_jax.numerics.symbolic_zeros import is_symbolic, linear_zero, nothing_of
from kept_programs.calls import is_one_operation
from kept_programs.masks import chosen, merged, not_
from kept_programs.remembered import remembered

Numbers = Float[Array, "*any"]


def vanishing(like: Callable) -> Callable:
    """A decorator of functions whose values and first derivatives are known to be zero, and are not
    computed. like: for the same arguments, numbers of the shapes and types of the values."""

    def decorated(function):
        @custom_jvp
        def nothing(*arguments):
            # A number of every member of a batch, as in `zero_of`.
            zero = linear_zero([x for x in jax.tree.leaves(arguments) if jnp.issubdtype(x.dtype, float)])
            return jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype) + zero, like(*arguments))

        @functools.partial(nothing.defjvp, symbolic_zeros=True)
        def _nothing_jvp(primals, tangents):
            leaves, tree = jax.tree.flatten(primals)
            moves = jax.tree.leaves(tangents, is_leaf=is_symbolic)
            moving = tuple(not is_symbolic(x) for x in moves)
            zero, out = jax.tree.flatten(nothing(*primals))
            if not any(moving):
                return jax.tree.unflatten(out, zero), jax.tree.unflatten(out, zero)
            derivative = Derivative.of(function, tree, moving)
            moves = chosen(moves, moving)
            if is_one_operation(KEEPER):
                moved = zero_product(derivative, leaves, moves, zero)
            else:
                moved = derivative.along(leaves, moves)  # compiled, and zero
            return jax.tree.unflatten(out, zero), jax.tree.unflatten(out, moved)

        return functools.wraps(function)(lambda *arguments: nothing(*arguments))

    return decorated


@dataclasses.dataclass(frozen=True)
class Derivative:
    """The derivative of a function of arrays as a linear map, D(x) d, and its transpose, D(x)^T w. Both are
    functions of the list of x and of the list of d or of w."""

    along: Callable[[Sequence[Any], Sequence[Any]], Sequence[Any]]
    back: Callable[[Sequence[Any], Sequence[Any]], Sequence[Any]]

    @classmethod
    @remembered(maxsize=64)
    def of(cls, function: Callable, tree: Any, moving: tuple[bool, ...]) -> "Derivative":
        """The derivative of a function of a tree of arrays with respect to the moving ones."""

        def of_moving(x):
            def values(*some):
                rest = iter(some)
                leaves = [next(rest) if is_moving else y for y, is_moving in zip(x, moving, strict=True)]
                return jax.tree.leaves(function(*jax.tree.unflatten(tree, leaves)))

            return values, [y for y, is_moving in zip(x, moving, strict=True) if is_moving]

        def along(x, d):
            values, at = of_moving(x)
            return jax.jvp(values, at, list(d))[1]

        def back(x, w):
            values, at = of_moving(x)
            return list(jax.vjp(values, *at)[1](list(w)))

        return cls(along, back)

    @property
    def transposed(self) -> "Derivative":
        """The transpose as a linear map."""
        return Derivative(self.back, self.along)

    def of_batch(self, axes: Sequence[int | None]) -> "Derivative":
        """The maps of a batch. axes: the members' axis in every x, None if it has none; in d and w it is
        the first one."""

        def over(function):
            members = jax.vmap(lambda x, d: list(function(x, d)), (list(axes), 0))
            return lambda x, d: members(list(x), list(d))

        return Derivative(over(self.along), over(self.back))


def zero_product(
    derivative: Derivative, x: Sequence[Any], d: Sequence[Any], zero: Sequence[Any]
) -> Sequence[Any]:
    """The product D(x) d of a derivative that is zero as one operation, which does not even trace
    D. zero: numbers of the types of the result."""
    types = tuple(jax.ShapeDtypeStruct(y.shape, y.dtype) for y in zero)
    return product_operation().bind(*x, *d, derivative=derivative, points=len(x), results=types)


@functools.cache
def product_operation() -> Any:
    """The operation of `zero_product`: it is zero, and linear in d, but its derivative with respect to x is
    not zero. Its parameters are the derivative, the number of arrays of x, and the types of the results."""
    from kept_programs.jax_internals import Rules, operation

    def zeros(*_, results, **__):
        return nothing_of(list(results))

    def push_forward(arguments, tangents, _, derivative, points, results):
        x, d = arguments[:points], arguments[points:]
        again = functools.partial(zero_product, derivative, zero=results)
        moving = tuple(y is not None for y in tangents[:points])
        parts = []
        if any(moving):
            fixed = chosen(x, not_(moving))

            def of_moving(*some):
                return list(derivative.along(merged(moving, some, fixed), d))

            parts.append(jax.jvp(of_moving, chosen(x, moving), chosen(tangents[:points], moving))[1])
        if any(y is not None for y in tangents[points:]):
            pairs = zip(tangents[points:], d, strict=True)
            parts.append(again(x, [jnp.zeros_like(y) if move is None else move for move, y in pairs]))
        return again(x, d), [sum(some) for some in zip(*parts, strict=True)]

    def transpose(cotangents, arguments, _, derivative, points, results):
        x, d = arguments[:points], [y.aval for y in arguments[points:]]
        pairs = zip(cotangents, results, strict=True)
        w = [nothing_of(like) if y is None else y for y, like in pairs]
        return [*(None for _ in x), *zero_product(derivative.transposed, x, w, d)]

    def batch(size, arguments, axes, derivative, points, results):
        pairs = zip(arguments[points:], axes[points:], strict=True)
        d = [
            jnp.broadcast_to(y, (size, *y.shape)) if axis is None else jnp.moveaxis(y, axis, 0)
            for y, axis in pairs
        ]
        like = [jax.ShapeDtypeStruct((size, *y.shape), y.dtype) for y in results]
        products = zero_product(derivative.of_batch(axes[:points]), arguments[:points], d, like)
        return products, [0] * len(products)

    def inside(**parameters):
        return functools.partial(zeros, **parameters)

    rules = Rules(zeros, lambda results, **_: results, batch, push_forward, inside, transpose)
    return operation("zero_product", rules)


def zero_of(x: Numbers) -> Numbers:
    """Zero as a number of every member of a batch: JAX 0.10 fails where a function's derivative is
    different for the members, and its value is not."""
    return jnp.where(x == x, 0.0, 0.0)


@custom_jvp
def half_square(x: Numbers, c: Numbers) -> Numbers:
    """x^2 / (2 c) at x = 0, with its first two derivatives with respect to x; the third one is NaN.
    It is zero where c is zero. c carries no derivative."""
    return zero_of(x)


@half_square.defjvp
def _half_square_jvp(primals, tangents):
    return half_square(*primals), ratio(*primals) * tangents[0]


@custom_jvp
def ratio(x: Numbers, c: Numbers) -> Numbers:
    """x/c at x = 0: zero, with its first derivative."""
    return zero_of(x)


@ratio.defjvp
def _ratio_jvp(primals, tangents):
    return ratio(*primals), slope(*primals) * tangents[0]


@custom_jvp
def slope(x: Numbers, c: Numbers) -> Numbers:
    """1/c, zero where c is zero. Its derivative is NaN: what it stands for is known to second order
    only."""
    return jnp.where(c == 0.0, zero_of(x), 1.0 / jnp.where(c == 0.0, 1.0, c))


@slope.defjvp
def _slope_jvp(primals, tangents):
    inverse = slope(*primals)
    return inverse, jnp.where(inverse == 0.0, 0.0, jnp.nan) * tangents[0]


def half_product(x: Scalar, y: Numbers) -> Numbers:
    """x y / 2 at x = y = 0, with its first two derivatives; the third one is NaN."""
    one = jnp.ones_like(y)
    return 0.25 * (half_square(x + y, one) - half_square(x - y, one))
