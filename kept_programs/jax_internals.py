"""All that this package takes from JAX beyond its public interface, in one place.

JAX promises nothing about `jax.extend`, `jax.interpreters` and `jax.core` (but `Tracer`): their names may
change with every release. A release that changes one of these concerns this module only, and
`self_check.py` finds it: programs are then called through plain `jax.jit`, until the module is mended.

| our rule | JAX's names | last changed in |
|---|---|---|
| an operation with results | `jax.extend.core.Primitive`, `def_impl`, `def_abstract_eval` | - |
| types of its results | `jax.core.ShapedArray` | - |
| `Rules.batch` | `batching.primitive_batchers` | - |
| `Rules.push_forward` | `ad.primitive_jvps`, `ad.Zero`, `pe.JaxprTracer`, `to_tangent_aval` | 0.7 |
| `Rules.transpose` | `ad.primitive_transposes`, `ad.is_undefined_primal`, `ad.Zero` | - |
| `Rules.prune` | `pe.dce_rules` (0.12 has one more argument) | 0.12 |
| `Rules.split` | `pe.partial_eval_jaxpr_custom_rules`, `jax.extend.core.Literal` | - |
| `Rules.function` | `mlir.register_lowering`, `mlir.lower_fun` | - |
| `Rules.name`, `named` | `mlir.LoweringParameters`, `lower(_private_parameters=)` | 0.5 |
| `function_of` | `jax.extend.core.jaxpr_as_fun` | - |
| `without_unused` | `jax.extend.core.ClosedJaxpr`, `pe.dce_jaxpr` | - |
| `all_settings` | `jax.config.values` | - |
| `connect_lapack` | `jaxlib.lapack` | 0.7 |

Zero tangents and cotangents are None on our side.
"""

import hashlib
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import numpy as np
from jax.core import ShapedArray
from jax.extend.core import ClosedJaxpr, Literal, Primitive, jaxpr_as_fun
from jax.interpreters import ad, batching, mlir
from jax.interpreters import partial_eval as pe

Mask = Sequence[bool]


class Pruning(NamedTuple):
    """An operation without some of its results. needed: which arguments remain; used: which results;
    parameters: of the operation that computes them."""

    needed: Mask
    used: Mask
    parameters: dict[str, Any]


class Division(NamedTuple):
    """An operation in two parts, for the reverse mode of `jax.checkpoint`. The first one has the first
    `arguments` arguments and gives the known results; later: which results the second one gives."""

    parameters: dict[str, Any]
    arguments: int
    later: Mask


class Rules(NamedTuple):
    """What an operation does. All functions take the operation's parameters by name.

    run(*arrays): its results; types(): types of its results; batch(size, arguments, axes): results and
    axes; push_forward(arguments, tangents, unknown): results and tangents, where `unknown` is true if the
    tangents have no values yet, so that the results must be computed without them; transpose(cotangents,
    arguments, linear): cotangents of all arguments, where `linear` is the mask of those in which the
    operation is linear and which have no value; prune(used): a `Pruning`; split(unknown): a `Division`,
    None if the operation is not divided; function(): a function that JAX traces into the program that is
    being compiled; name(): a text in place of the operation, None if it has none. Without `transpose`,
    `prune`, `split` or `name` (None) the operation has no such rule."""

    run: Callable[..., Sequence]
    types: Callable[..., Sequence]
    batch: Callable[..., tuple[Sequence, Sequence]]
    push_forward: Callable[..., tuple[Sequence, Sequence]]
    function: Callable[..., Callable]
    transpose: Callable[..., Sequence] | None = None
    prune: Callable[..., Pruning] | None = None
    split: Callable[..., Division | None] | None = None
    name: Callable[..., str | None] | None = None


def operation(name: str, rules: Rules) -> Primitive:
    """A new operation of JAX. `operation.bind(*arguments, **parameters)` gives its results."""
    made = Primitive(name)
    made.multiple_results = True
    made.def_impl(rules.run)

    @made.def_abstract_eval
    def types(*_, **parameters):
        return [ShapedArray(x.shape, x.dtype, weak_type=x.weak_type) for x in rules.types(**parameters)]

    def push_forward(arguments, tangents, **parameters):
        unknown = any(isinstance(x, pe.JaxprTracer) for x in tangents)
        tangents_in = [None if isinstance(x, ad.Zero) else x for x in tangents]
        results, tangents_out = rules.push_forward(arguments, tangents_in, unknown, **parameters)
        pairs = zip(results, tangents_out, strict=True)
        return results, [zero_tangent(x) if tangent is None else tangent for x, tangent in pairs]

    def lower(context, *arguments, **parameters):
        function = rules.function(**parameters)
        return mlir.lower_fun(function, multiple_results=True)(context, *arguments)

    batching.primitive_batchers[made] = batching_rule(rules)
    ad.primitive_jvps[made] = push_forward
    mlir.register_lowering(made, lower)
    if rules.transpose is not None:
        ad.primitive_transposes[made] = transposition(rules)
    if rules.prune is not None:
        pe.dce_rules[made] = lambda used, *rest: pruned(rules, used, rest[-1])
    if rules.split is not None:
        pe.partial_eval_jaxpr_custom_rules[made] = division(rules)
    return made


def batching_rule(rules: Rules) -> Callable:
    """The rule of `jax.vmap`."""

    def batch(arguments, axes, **parameters):
        pairs = zip(arguments, axes, strict=True)
        size = next(x.shape[axis] for x, axis in pairs if axis is not None)
        return rules.batch(size, arguments, axes, **parameters)

    return batch


def zero_tangent(x: Any) -> ad.Zero:
    """The tangent zero of an array."""
    return ad.Zero(jax.typeof(x).to_tangent_aval())


def transposition(rules: Rules) -> Callable:
    """The rule of reverse mode."""

    def transpose(cotangents, *arguments, **parameters):
        linear = tuple(ad.is_undefined_primal(x) for x in arguments)
        given = [None if isinstance(x, ad.Zero) else x for x in cotangents]
        return rules.transpose(given, arguments, linear, **parameters)

    return transpose


def pruned(rules: Rules, used: Mask, equation: Any) -> tuple[list[bool], Any]:
    """The rule for results that are not used."""
    if not any(used):
        return [False] * len(equation.invars), None
    pruning = rules.prune(used, **equation.params)
    return list(pruning.needed), equation.replace(
        invars=[x for x, is_needed in zip(equation.invars, pruning.needed, strict=True) if is_needed],
        outvars=[x for x, is_used in zip(equation.outvars, pruning.used, strict=True) if is_used],
        params=pruning.parameters,
    )


def division(rules: Rules) -> Callable:
    """The rule for an operation of which some arguments are known and others are not."""

    def split(_, unknown, instantiated, equation):
        count = len(equation.outvars)
        missing = [x for x, has in zip(equation.invars, instantiated, strict=True) if not has]
        new = [x for x in missing if not isinstance(x, Literal)]
        if not any(unknown):
            return equation, None, [False] * count, [False] * count, []
        parts = rules.split(unknown, **equation.params)
        if parts is None:
            return None, equation, [True] * count, [True] * count, new
        outvars = [x for x, is_later in zip(equation.outvars, parts.later, strict=True) if not is_later]
        invars = equation.invars[: parts.arguments]
        known = equation.replace(invars=invars, outvars=outvars, params=parts.parameters)
        _, staged = pruned(rules, parts.later, equation)
        return known, staged, list(parts.later), list(parts.later), new

    return split


# ---- functions as data --------------------------------------------------------------------------


def function_of(closed: ClosedJaxpr) -> Callable[..., Sequence]:
    """A function of leaves whose operations are known (`jax.stages.Traced.jaxpr`)."""
    return jaxpr_as_fun(closed)


def without_unused(
    closed: ClosedJaxpr, used: Mask, instantiate: bool = False
) -> tuple[jax.stages.Traced, tuple[bool, ...]]:
    """The traced function of the used results, and the mask of the arguments that remain: all if
    `instantiate`, otherwise those on which the results depend."""
    shorter, needed = pe.dce_jaxpr(closed.jaxpr, used, instantiate)
    kept = (x for x, is_needed in zip(closed.in_avals, needed, strict=True) if is_needed)
    types = (jax.ShapeDtypeStruct(x.shape, x.dtype) for x in kept)
    return jax.jit(jaxpr_as_fun(ClosedJaxpr(shorter, closed.consts))).trace(*types), tuple(needed)


def order_of_results(closed: ClosedJaxpr) -> str:
    """A checksum of the operations of a function, without those inside loops, and of which of them
    give its results."""
    made = {id(x): (i, j) for i, e in enumerate(closed.eqns) for j, x in enumerate(e.outvars)}
    operations = [e.primitive.name for e in closed.eqns]
    results = [(made.get(id(x)), str(x.aval)) for x in closed.jaxpr.outvars]
    return hashlib.sha256(repr((operations, results)).encode()).hexdigest()


def named(traced: jax.stages.Traced, primitive: Primitive, rules: Rules) -> jax.stages.Lowered:
    """Lowers a function with the name of each operation in its place (`Rules.name`). The text of the result
    identifies the function; it cannot be compiled."""

    def lower(context, *arguments, **parameters):
        name = rules.name(**parameters)
        if name is None:
            function = rules.function(**parameters)
            return mlir.lower_fun(function, multiple_results=True)(context, *arguments)
        return jax.ffi.ffi_lowering("kept_program")(context, *arguments, key=name)

    how = mlir.LoweringParameters(override_lowering_rules=((primitive, lower),))
    return traced.lower(_private_parameters=how)


# ---- other things -------------------------------------------------------------------------------


def all_settings() -> list[tuple[str, Any]]:
    """Names and values of JAX's settings, as they are in the current context."""
    values = jax.config.values  # of the process; an attribute is the value in the context
    return [(name, getattr(jax.config, name, values[name])) for name in sorted(values)]


def connect_lapack() -> None:
    """Gives jaxlib the addresses of SciPy's LAPACK. JAX does so when it lowers a program that needs them.
    An executable that is loaded without them ends the process."""
    from jaxlib import lapack

    lapack.prepare_lapack_call("getrf_ffi", np.dtype(float))
