"""A call of a program behaves as a call of its function under every transformation of JAX."""

import os
import subprocess
import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

from kept_programs import derived, jax_internals, operation, transposed
from kept_programs.calls import call
from kept_programs.executables import save
from kept_programs.program import Program, TreeProgram, tree_program, type_of
from toy import pendulums

COMPILATION = "/jax/core/compile/backend_compile_duration"
"""JAX records this event for every program that it compiles."""

PARENT = Path(__file__).parents[2]
"""The folder from which `kept_programs` is imported."""

X, Y, COUNT = jnp.linspace(0.1, 1.0, 4), jnp.asarray([2.0, -1.0, 0.5, 3.0]), jnp.asarray(3)


def new_program(keeper, key="pendulums") -> TreeProgram:
    return tree_program(keeper, pendulums, tuple(map(type_of, (X, Y, COUNT))), key)


def numbers(f):
    """A function of x and y with floating-point results only."""
    return lambda x, y: {name: z for name, z in f(x, y, COUNT).items() if name != "steps"}


def energy(f):
    """A function of x and y with one number as result."""
    return lambda x, y: (f(x, y, COUNT)["angle"] ** 2).sum() + f(x, y, COUNT)["rate"]


TRANSFORMED = {
    "eager": lambda f: f(X, Y, COUNT),
    "jit": lambda f: jax.jit(f)(X, Y, COUNT),
    "types": lambda f: jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), jax.eval_shape(f, X, Y, COUNT)),
    "gradient": lambda f: jax.grad(energy(f), (0, 1))(X, Y),
    "gradient under jit": lambda f: jax.jit(jax.grad(energy(f), (0, 1)))(X, Y),
    "gradient of one result": lambda f: jax.grad(lambda x: f(x, Y, COUNT)["rate"])(X),
    "reverse mode": lambda f: jax.jacrev(numbers(f), 1)(X, Y),
    "forward mode": lambda f: jax.jacfwd(numbers(f), (0, 1))(X, Y),
    "one tangent": lambda f: jax.jvp(lambda x: numbers(f)(x, Y), (X,), (Y,)),
    "second derivative": lambda f: jax.hessian(energy(f), (0, 1))(X, Y),
    "reverse of reverse": lambda f: jax.jacrev(jax.grad(energy(f)), 1)(X, Y),
    "linear map": lambda f: jax.linearize(lambda x: numbers(f)(x, Y), X)[1](Y),
    "batch": lambda f: jax.vmap(f, (0, None, 0))(jnp.stack([X, Y]), Y, jnp.arange(2)),
    "batch along the second axis": lambda f: jax.vmap(f, (1, None, None))(jnp.stack([X, Y], 1), Y, COUNT),
    "batch of gradients": lambda f: jax.vmap(jax.grad(energy(f)), (0, None))(jnp.stack([X, Y]), Y),
    "gradient of a batch": lambda f: jax.grad(
        lambda y: jax.vmap(energy(f), (0, None))(jnp.stack([X, Y]), y).sum()
    )(Y),
    "checkpoint": lambda f: jax.grad(jax.checkpoint(energy(f)))(X, Y),
    "loop": lambda f: jax.grad(
        lambda y: lax.scan(lambda x, _: (f(x, y, COUNT)["angle"], None), X, None, length=2)[0].sum()
    )(Y),
    "numpy arguments": lambda f: f(np.asarray(X), np.asarray(Y), np.asarray(COUNT)),
}  # fmt: skip


REVERSE = {
    "residuals": {},
    "recomputed": {"recompute": True},
    "expected": {"expected": lambda result: {name: name in ("angle", "path", "rate") for name in result}},
}
"""The three ways in which reverse mode treats a call (`operation.Reverse`)."""


def first_by_default(cases, kept):
    """Cases for `parametrize`; all but `kept` are left to the night."""
    return [pytest.param(x, marks=[pytest.mark.nightly] * (x != kept)) for x in cases]


@pytest.mark.parametrize("reverse", first_by_default(REVERSE, "residuals"))
@pytest.mark.parametrize("name", TRANSFORMED)
def test_transformations_of_a_call_are_those_of_the_function(keeper, name, reverse):
    """The rules of the operation against those of JAX for the operations inside. Both compute the same
    formulas in other orders: some roundings of numbers of the order 10."""
    program = new_program(keeper)
    result = TRANSFORMED[name](lambda *x: call(program, *x, **REVERSE[reverse]))
    expected = TRANSFORMED[name](pendulums)
    assert jax.tree.structure(result) == jax.tree.structure(expected)
    for x, y in zip(jax.tree.leaves(result), jax.tree.leaves(expected), strict=True):
        assert x.dtype == y.dtype
        np.testing.assert_allclose(x, y, rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize("name", TRANSFORMED)
def test_without_the_operation_they_are_those_of_the_function_too(keeper, monkeypatch, name):
    """The environment variable of the keeper lets calls go through `jax.jit`. Nothing is bound."""
    monkeypatch.setenv("TOY_PRIMITIVE", "off")
    monkeypatch.setattr(operation, "bind", lambda *_, **__: pytest.fail("the operation is used"))
    program = new_program(keeper)
    result = TRANSFORMED[name](lambda *x: call(program, *x))
    expected = TRANSFORMED[name](pendulums)
    assert jax.tree.structure(result) == jax.tree.structure(expected)
    for x, y in zip(jax.tree.leaves(result), jax.tree.leaves(expected), strict=True):
        assert x.dtype == y.dtype
        np.testing.assert_allclose(x, y, rtol=1e-13, atol=1e-13)


KEPT = ["eager", "gradient", "forward mode", "second derivative", "batch of gradients"]


@pytest.mark.parametrize("reverse", first_by_default(REVERSE, "residuals"))
@pytest.mark.parametrize("name", first_by_default(KEPT, "gradient"))
def test_a_second_process_traces_no_program(new_keeper, monkeypatch, name, reverse):
    """Derived programs are found by keys that follow from the key of the first program."""

    def called(*x):
        return call(program, *x, **REVERSE[reverse])

    program = new_program(new_keeper())
    first = TRANSFORMED[name](called)
    monkeypatch.setattr(Program, "_made", property(lambda self: pytest.fail("a program is traced")))
    program = new_program(new_keeper())
    second = TRANSFORMED[name](called)
    jax.tree.map(np.testing.assert_array_equal, first, second)


DERIVATIVES = {
    "none": lambda f: lambda x, y: f(x[0], y),
    "gradient": lambda f: lambda x, y: jax.grad(f)(x[1], y),
    "batch": lambda f: jax.vmap(f, (0, None)),
}


@pytest.mark.parametrize("name", DERIVATIVES)
def test_the_text_of_a_function_has_the_keys_of_its_programs(new_keeper, monkeypatch, name):
    """A second process finds the text without tracing the programs inside; another program has another
    one."""

    def text(key):
        program = new_program(new_keeper(), key)
        f = DERIVATIVES[name](energy(lambda *x: call(program, *x)))
        return operation.text_with_keys(jax.jit(f).trace(jnp.stack([X, Y]), Y)).as_text()

    first, other = text("pendulums"), text("other")
    monkeypatch.setattr(Program, "_made", property(lambda self: pytest.fail("a program is traced")))
    assert text("pendulums") == first != other


def test_a_call_follows_arguments_on_several_devices(tmp_path):
    """An executable of one device would refuse an array that is spread over two. A gradient therefore
    prepares no executables there, which would be compiled in vain."""
    code = """
import pathlib, jax, jax.numpy as jnp
from jax.sharding import Mesh, NamedSharding, PartitionSpec
from kept_programs import Environment, Keeper, Program, Store, call, tree_program
Program.prepare = None
store = Store("toy", "TOY_CACHE", b"toy")
keeper = Keeper(store, Environment("toy", pathlib.Path("."), store))
four = (jax.ShapeDtypeStruct((4,), float),)
f = lambda x: call(tree_program(keeper, lambda x: (x**3).sum(), four, "cubes"), x)
x = jax.device_put(jnp.arange(4.0), NamedSharding(Mesh(jax.devices(), "i"), PartitionSpec("i")))
print(len(x.sharding.device_set), float(f(x)), *jax.grad(f)(x).tolist())
"""
    settings = {"XLA_FLAGS": "--xla_force_host_platform_device_count=2", "JAX_ENABLE_X64": "1"}
    environment = os.environ | settings | {"TOY_CACHE": "off", "PYTHONPATH": str(PARENT)}
    command = [sys.executable, "-c", code]
    process = subprocess.run(
        command, env=environment, capture_output=True, text=True, check=True, cwd=tmp_path
    )
    assert [float(x) for x in process.stdout.split()] == [2.0, 36.0, 0.0, 3.0, 12.0, 27.0]


def test_keys_distinguish_derived_programs(keeper):
    """A program that is found by a wrong key computes something else."""
    base = new_program(keeper).program
    programs = [
        base, new_program(keeper, "other").program, derived.batched(base, 2, (0, None, None)),
        derived.batched(base, 3, (0, None, None)), derived.batched(base, 2, (1, None, None)),
        derived.pushed_forward(base, (True, False, False)), derived.forward(base, (True, False, False)),
        derived.forward(base, (True, True, False)), derived.tangent(base, (True, False, False)),
        derived.backward(base, (True, False, False)), derived.backward(base, (True, True, False)),
        transposed.tangent_again(base, (True, False, False)),
        transposed.pulled_back(base, (True, False, False)),
        derived.pruned(base, (True,) * 5), derived.pruned(base, (True,) * 4 + (False,)),
        derived.batched(derived.forward(base, (True, False, False)), 2, (0, None, None)),
        derived.forward(derived.batched(base, 2, (0, None, None)), (True, False, False)),
    ]  # fmt: skip
    assert len({program.key for program in programs}) == len(programs)
    assert derived.batched(new_program(keeper, None).program, 2, (0, None, None)).key is None


def test_results_that_are_not_used_are_not_computed(keeper):
    """The length depends on one argument alone, and needs no loop."""
    program = new_program(keeper, None)
    traced = jax.jit(lambda x, y: call(program, x, y, COUNT)["length"]).trace(X, Y).jaxpr
    shorter, needed = jax_internals.without_unused(traced, [True])
    (equation,) = shorter.jaxpr.eqns
    assert needed == (False, True)
    assert "scan" not in str(equation.params["program"].traced.jaxpr)
    assert not jax_internals.without_unused(traced, [False])[0].jaxpr.eqns


def prepared_by(gradient, monkeypatch):
    """The programs that a gradient loads or compiles ahead, and the gradient."""
    ahead = []
    prepare = Program.prepare
    with monkeypatch.context() as patch:
        patch.setattr(Program, "prepare", lambda self: (ahead.append(self), prepare(self)))
        result = gradient()
    return ahead, result


def test_a_second_process_loads_the_transpose_of_a_gradient_ahead(new_keeper, monkeypatch):
    """The transpose is loaded in a thread before the forward program runs, so that both are loaded side by
    side. The gradient is the same."""

    def gradient():
        program = new_program(new_keeper())
        return jax.grad(lambda x: energy(lambda *z: call(program, *z))(x, Y))(X)

    expected = gradient()
    monkeypatch.setattr(Program, "_compiled", lambda self: pytest.fail("a program was compiled again"))
    (_, transpose), slope = prepared_by(gradient, monkeypatch)
    np.testing.assert_array_equal(slope, expected)
    assert transpose._executable is not None


@pytest.mark.parametrize("result", ["angle", "length"])
def test_the_transpose_for_expected_cotangents_is_compiled_ahead(keeper, monkeypatch, result):
    """It serves for every gradient that needs no other cotangents; the angle's cotangent is expected, the
    length's is not. Both gradients are those of the function."""
    program, compiled = new_program(keeper, None), []
    compile_now = Program._compiled
    monkeypatch.setattr(Program, "_compiled", lambda self: (compiled.append(self), compile_now(self))[1])
    reverse = REVERSE["expected"]

    def gradient():
        return jax.grad(lambda y: call(program, X, y, COUNT, **reverse)[result].sum())(Y)

    (_, transpose), slope = prepared_by(gradient, monkeypatch)
    assert len(compiled) == (2 if result == "angle" else 3)
    assert transpose in compiled
    expected = jax.grad(lambda y: pendulums(X, y, COUNT)[result].sum())(Y)
    np.testing.assert_allclose(slope, expected, rtol=1e-13)


def test_a_gradient_compiles_only_its_programs(keeper):
    """Arguments go into a program as they are, and cotangents that are zero are made by NumPy. For JAX each
    would be a small program of its own. No other test has arrays of seven numbers; what a gradient compiles
    for single numbers is compiled before."""
    compiled = []

    def gradient(x, y):
        program = tree_program(keeper, pendulums, tuple(map(type_of, (x, y, COUNT))), None)
        jax.grad(lambda x: call(program, x, y, COUNT, **REVERSE["expected"])["rate"])(x)

    def listen(event, _, **details):
        if event == COMPILATION:
            compiled.append(details["fun_name"])

    gradient(X, Y)
    seven = jnp.asarray(np.linspace(0.1, 1.0, 7)), jnp.asarray(np.linspace(1.0, 2.0, 7))
    jax.monitoring.register_event_duration_secs_listener(listen)
    try:
        gradient(*seven)
    finally:
        jax.monitoring.unregister_event_duration_listener(listen)
    assert compiled and set(compiled) == {"jit(function)"}


def test_recomputed_tangents_save_no_residuals_and_differentiate_one_result(keeper):
    """The transpose of a recomputed call takes the arguments of the call. The length needs no loop."""
    program = new_program(keeper, None)
    linear = transposed.tangent_again(program.program, (True, True, False))
    given = tuple(x == "length" for x in program.result if x != "steps")
    transpose = transposed.transposed(linear, (False, False, False, True, True), given)
    assert transpose.reached == (False, False, False, False, True)
    assert transpose.arguments == (False, True, False, False, False)
    assert "scan" not in str(transpose.program.traced.jaxpr)


def test_a_kept_derivative_of_other_operations_is_refused(keeper):
    """Residuals have no names: the linear map of this process takes those of a kept `forward` only if that
    has the same operations."""
    moving = (True, False, False)
    base = new_program(keeper, None).program
    base.key = "a" * 64
    made = derived.forward(base, moving)
    save(keeper.store, made.key, "facts", made.facts._replace(about="other operations"))
    derived.forward.cache_clear()
    derived.tangent.cache_clear()
    with pytest.raises(RuntimeError, match="the program cache holds another derivative; clear it by hand"):
        derived.tangent(base, moving).traced  # noqa: B018
