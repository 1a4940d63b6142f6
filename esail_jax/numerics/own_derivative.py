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

from esail_jax.compilation.jit import traced_once
from kept_programs.masks import chosen, merged, not_

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
        return jax.tree.unflatten(jax.tree.structure(results), whole_call().bind(*leaves, function=closed))


custom_jvp = jax.custom_jvp if RULES_ARE_KEPT else WholeCall


@functools.cache
def whole_call():
    """The operation that stands for the call of a function. `function`, its parameter, is what
    `jax.make_jaxpr` returns."""
    from kept_programs.jax_internals import Rules, function_of, operation

    def compute(*leaves, function):
        return function_of(function)(*leaves)

    def push_forward(primals, tangents, _, function):
        """The rule of the function inside. Arguments without a tangent stay without one."""
        moving = tuple(x is not None for x in tangents)
        fixed = chosen(primals, not_(moving))

        def of_moving(*x):
            return compute(*merged(moving, x, fixed), function=function)

        results, moved = jax.jvp(of_moving, chosen(primals, moving), chosen(tangents, moving))
        return results, [None if x.dtype == jax.dtypes.float0 else x for x in moved]

    def batch(size, leaves, axes, function):
        """The function of a batch is one call again."""
        whole = jax.make_jaxpr(jax.vmap(function_of(function), axes, axis_size=size))(*leaves)
        return made.bind(*leaves, function=whole), [0] * len(whole.out_avals)

    def inside(function):
        # JAX would print all operations of what `function_of` returns, to name its place in the code.
        return lambda *leaves: compute(*leaves, function=function)

    rules = Rules(compute, lambda function: function.out_avals, batch, push_forward, inside)
    made = operation("whole_call", rules)
    return made
