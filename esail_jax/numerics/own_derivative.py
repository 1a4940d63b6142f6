"""Functions that bring their own derivative, and keep it inside loops that are differentiated twice.

`custom_jvp` is `jax.custom_jvp`. JAX before 0.12 loses its rule in one place: a `lax.scan` that is
differentiated in reverse mode is divided into what changes in the loop and what does not, and there the
function itself takes the place of the call (jax/_src/interpreters/partial_eval.py,
`JaxprTrace.process_custom_jvp_call`). A first derivative is right all the same, since the rule was applied
before. A second one differentiates the function without its rule, and is wrong in silence. With such a
version of JAX the call is put into an operation of its own, which JAX does not take apart.
"""

import functools
from collections.abc import Callable
from typing import Any

import jax
from jax.extend.core import Primitive, jaxpr_as_fun
from jax.interpreters import ad, batching, mlir

from esail_jax.compilation.derived import chosen, merged, not_
from esail_jax.compilation.jit import traced_once

RULES_ARE_KEPT = jax.__version_info__ >= (0, 12)
"""True if JAX keeps the rules inside loops."""


class WholeCall:
    """A function as `custom_jvp` returns it with a version of JAX that loses rules."""

    def __init__(self, function: Callable):
        functools.update_wrapper(self, function)
        self._function = jax.custom_jvp(function)
        self._traced = traced_once()(self._function)

    def defjvp(self, rule: Callable, symbolic_zeros: bool = False) -> Callable:
        """Sets the rule of the derivative, as `jax.custom_jvp.defjvp` does."""
        return self._function.defjvp(rule, symbolic_zeros)

    def __call__(self, *arguments: Any) -> Any:
        leaves, tree = jax.tree.flatten(arguments)
        closed, results = jax.make_jaxpr(
            lambda *leaves: self._traced(*jax.tree.unflatten(tree, leaves)), return_shape=True
        )(*leaves)
        return jax.tree.unflatten(jax.tree.structure(results), whole_p.bind(*leaves, function=closed))


custom_jvp = jax.custom_jvp if RULES_ARE_KEPT else WholeCall

whole_p = Primitive("whole_call")
whole_p.multiple_results = True


@whole_p.def_impl
def _compute(*leaves, function):
    return jaxpr_as_fun(function)(*leaves)


@whole_p.def_abstract_eval
def _types(*_, function):
    return list(function.out_avals)


def _push_forward(primals, tangents, *, function):
    """The rule of the function inside. Arguments without a tangent stay without one."""
    moving = tuple(not isinstance(x, ad.Zero) for x in tangents)
    fixed = chosen(primals, not_(moving))

    def of_moving(*x):
        return jaxpr_as_fun(function)(*merged(moving, x, fixed))

    results, moved = jax.jvp(of_moving, chosen(primals, moving), chosen(tangents, moving))
    return results, [
        ad.Zero(jax.typeof(x).to_tangent_aval()) if y.dtype == jax.dtypes.float0 else y
        for x, y in zip(results, moved, strict=True)
    ]


def _batch(leaves, axes, *, function):
    """The function of a batch is one call again."""
    size = next(x.shape[axis] for x, axis in zip(leaves, axes, strict=True) if axis is not None)
    whole = jax.make_jaxpr(jax.vmap(jaxpr_as_fun(function), axes, axis_size=size))(*leaves)
    return whole_p.bind(*leaves, function=whole), [0] * len(whole.out_avals)


def _lower(context, *leaves, function):
    # JAX would print all operations of what `jaxpr_as_fun` returns, to name its place in the code.
    def whole(*leaves):
        return jaxpr_as_fun(function)(*leaves)

    return mlir.lower_fun(whole, multiple_results=True)(context, *leaves)


ad.primitive_jvps[whole_p] = _push_forward
batching.primitive_batchers[whole_p] = _batch
mlir.register_lowering(whole_p, _lower)
