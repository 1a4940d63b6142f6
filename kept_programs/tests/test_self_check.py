"""The check of the operation, tried by breaking each of its rules."""

import operator
import sys
import warnings

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.interpreters import ad, batching, mlir
from jax.interpreters import partial_eval as pe

from kept_programs import call, program_of, self_check
from kept_programs.jax_internals import batching_rule
from kept_programs.operation import RULES, program_p
from toy import square


def other_arguments(*_, **__):
    raise TypeError("takes 2 positional arguments but 3 were given")


def scaled(rule, part):
    """A rule whose results, or a part of them, are twice what they should be."""

    def wrong(*arguments, **parameters):
        results = rule(*arguments, **parameters)
        if part is None:
            return [None if x is None else 2.0 * x for x in results]
        return tuple([2.0 * x for x in y] if k == part else y for k, y in enumerate(results))

    return wrong


BATCH = batching_rule(RULES)

TABLES = {
    "batch": batching.primitive_batchers,
    "forward mode": ad.primitive_jvps,
    "reverse mode": ad.primitive_transposes,
    "unused results": pe.dce_rules,
    "checkpoint": pe.partial_eval_jaxpr_custom_rules,
}
"""Where JAX looks for the rules of an operation."""


def over_the_first_axis(rule):
    """A rule of batches that takes every axis as the first one."""

    def wrong(arguments, axes, **parameters):
        return rule(arguments, [None if axis is None else 0 for axis in axes], **parameters)

    return wrong


def wrong_at_last(rule):
    """A rule of reverse mode that is wrong in the last of several cotangents."""

    def wrong(*arguments, **parameters):
        results = list(rule(*arguments, **parameters))
        places = [k for k, x in enumerate(results) if x is not None]
        if len(places) > 1:
            results[places[-1]] = 2.0 * results[places[-1]]
        return results

    return wrong


WRONG = {
    ("batch", "is wrong"): lambda rule: scaled(rule, 0),
    ("batch", "is that of the first axis"): over_the_first_axis,
    ("forward mode", "is wrong"): lambda rule: scaled(rule, 1),
    ("reverse mode", "is wrong"): lambda rule: scaled(rule, None),
    ("reverse mode", "is wrong at last"): wrong_at_last,
}
"""Rules that give wrong numbers."""

BROKEN = [*((name, "fails") for name in TABLES), *WRONG]


def transformed(f):
    """Derivatives and batches of a function of one number."""
    x = jnp.asarray([1.0, 3.0])
    checked = jax.grad(jax.checkpoint(f))
    return jax.grad(f)(3.0), jax.vmap(jax.grad(f))(x), jax.jacfwd(jax.grad(f))(3.0), checked(3.0), f(3.0)


@pytest.mark.parametrize(("name", "how"), BROKEN)
def test_a_broken_rule_costs_time_and_no_derivative(new_keeper, request, name, how):
    """As a new version of JAX may break it, by other arguments or in silence: results are right, and one
    line says what happened."""
    rule = BATCH if name == "batch" else TABLES[name][program_p]
    broken = other_arguments if how == "fails" else WRONG[name, how](rule)
    TABLES[name][program_p] = broken
    request.addfinalizer(lambda: operator.setitem(TABLES[name], program_p, rule))
    program = program_of(new_keeper(), square, (2.0,), (jnp.asarray(1.0),))
    with pytest.warns(UserWarning, match="derivatives are compiled anew in every process") as said:
        results = transformed(lambda x: call(program, x))
    assert len(said) == 1 and "\n" not in str(said[0].message)
    for x, expected in zip(results, (12.0, [4.0, 12.0], 4.0, 12.0, 18.0), strict=True):
        np.testing.assert_array_equal(x, expected)


def test_lowering_that_fails_is_found(new_keeper, monkeypatch):
    """Lowering puts the operations of a program into that of the user."""
    monkeypatch.setattr(mlir, "lower_fun", other_arguments)
    assert self_check.fault(new_keeper()).endswith(": TypeError")


def test_a_right_operation_is_checked_once(new_keeper, monkeypatch):
    """The verdict is in the store. It says nothing to the user."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert not self_check.fault(new_keeper())
    monkeypatch.setattr(self_check, "by_executables", lambda *_: pytest.fail("checked again"))
    assert not self_check.fault(new_keeper())


def test_a_name_that_is_missing_is_found(new_keeper, monkeypatch):
    """A version of JAX without a name that the operation imports."""
    monkeypatch.setitem(sys.modules, "kept_programs.operation", None)
    assert self_check.fault(new_keeper()) == "import: ModuleNotFoundError"
