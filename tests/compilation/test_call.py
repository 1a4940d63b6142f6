"""A call of a program behaves as a call of its function under every transformation of JAX."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax
from jax.interpreters import partial_eval

from esail_jax.compilation import call, derived, store, transposed
from esail_jax.compilation.jit import jit
from esail_jax.compilation.program import Program, TreeProgram, save, tree_program, type_of
from support.compiled_nothing import COMPILATION
from support.new_process import output_of
from support.quick import quickly

X, Y, COUNT = jnp.linspace(0.1, 1.0, 4), jnp.asarray([2.0, -1.0, 0.5, 3.0]), jnp.asarray(3)


def pendulums(x, y, count):
    """Steps of pendulums: results of several types, a loop, and a result that depends on one argument."""

    def step(state, _):
        return (state[0] + 0.1 * state[1], state[1] - 0.1 * y * jnp.sin(state[0])), state[0]

    (angle, rate), path = lax.scan(step, (x, jnp.zeros_like(x)), None, length=3)
    return {"angle": angle, "path": path, "steps": count + 3, "length": 9.81 / y, "rate": rate.sum()}


def new_program(key="pendulums") -> TreeProgram:
    return tree_program(pendulums, tuple(map(type_of, (X, Y, COUNT))), key)


@pytest.fixture
def folder(tmp_path, monkeypatch, without_jax_cache):
    """The folder of an empty cache, and no derived programs in memory."""
    monkeypatch.setenv(store.VARIABLE, str(tmp_path / "programs"))
    forget()
    return tmp_path / "programs"


def forget():
    """Forgets all derived programs, as a new process does."""
    for derivation in (derived.batched, derived.pushed_forward, derived.forward, derived.tangent,
                       derived.backward, derived.pruned, derived.linearised, transposed.tangent_again,
                       transposed.pulled_back, call.remember_transpose, call.prepare):  # fmt: skip
        derivation.cache_clear()


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
"""The three ways in which reverse mode treats a call (`call.Reverse`)."""


@pytest.mark.parametrize("reverse", quickly(REVERSE))
@pytest.mark.parametrize("name", TRANSFORMED)
def test_transformations_of_a_call_are_those_of_the_function(folder, name, reverse):
    """The rules of the operation against those of JAX for the operations inside. Both compute the same
    formulas in other orders: some roundings of numbers of the order 10."""
    program = new_program()
    found = TRANSFORMED[name](lambda *x: call.call(program, *x, **REVERSE[reverse]))
    expected = TRANSFORMED[name](pendulums)
    assert jax.tree.structure(found) == jax.tree.structure(expected)
    for x, y in zip(jax.tree.leaves(found), jax.tree.leaves(expected), strict=True):
        assert x.dtype == y.dtype
        np.testing.assert_allclose(x, y, rtol=1e-13, atol=1e-13)


KEPT = ["eager", "gradient", "forward mode", "second derivative", "batch of gradients"]


@pytest.mark.drops_programs
@pytest.mark.parametrize("reverse", quickly(REVERSE))
@pytest.mark.parametrize("name", quickly(KEPT, kept=["gradient"]))
def test_a_second_process_traces_no_program(folder, monkeypatch, name, reverse):
    """Derived programs are found by keys that follow from the key of the first program."""

    def called(*x):
        return call.call(program, *x, **REVERSE[reverse])

    program = new_program()
    first = TRANSFORMED[name](called)
    forget()
    jax.clear_caches()
    monkeypatch.setattr(Program, "_made", property(lambda self: pytest.fail("a program is traced")))
    program = new_program()
    second = TRANSFORMED[name](called)
    jax.tree.map(np.testing.assert_array_equal, first, second)


DERIVATIVES = {
    "none": lambda f: lambda x, y: f(x[0], y),
    "gradient": lambda f: lambda x, y: jax.grad(f)(x[1], y),
    "batch": lambda f: jax.vmap(f, (0, None)),
}


@pytest.mark.parametrize("name", DERIVATIVES)
def test_jit_finds_its_program_without_tracing_the_programs_inside(folder, monkeypatch, name):
    derivative = DERIVATIVES[name]
    x = jnp.stack([X, Y])
    program = new_program()
    first = jit(derivative(energy(lambda *x: call.call(program, *x))))(x, Y)
    forget()
    monkeypatch.setattr(Program, "_made", property(lambda self: pytest.fail("a program is traced")))
    program = new_program()
    second = jit(derivative(energy(lambda *x: call.call(program, *x))))(x, Y)
    np.testing.assert_array_equal(first, second)


def test_a_call_follows_arguments_on_several_devices():
    """An executable of one device would refuse an array that is spread over two. A gradient therefore
    prepares no executables there, which would be compiled in vain."""
    code = """
import esail_jax, jax, jax.numpy as jnp
from jax.sharding import Mesh, NamedSharding, PartitionSpec
from esail_jax.compilation.call import call
from esail_jax.compilation.program import Program, tree_program
Program.prepare = None
f = lambda x: call(tree_program(lambda x: (x**3).sum(), (jax.ShapeDtypeStruct((4,), float),), "cubes"), x)
x = jax.device_put(jnp.arange(4.0), NamedSharding(Mesh(jax.devices(), "i"), PartitionSpec("i")))
print(len(x.sharding.device_set), float(f(x)), *jax.grad(f)(x).tolist())
"""
    found = output_of(code, ESAIL_CACHE="off", XLA_FLAGS="--xla_force_host_platform_device_count=2")
    assert [float(x) for x in found.split()] == [2.0, 36.0, 0.0, 3.0, 12.0, 27.0]


def test_keys_distinguish_derived_programs(folder):
    """A program that is found by a wrong key computes something else."""
    base = new_program().program
    programs = [
        base, new_program("other").program, derived.batched(base, 2, (0, None, None)),
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
    assert derived.batched(new_program(None).program, 2, (0, None, None)).key is None


def test_results_that_are_not_used_are_not_computed():
    """The length depends on one argument alone, and needs no loop."""
    program = new_program(None)
    traced = jax.jit(lambda x, y: call.call(program, x, y, COUNT)["length"]).trace(X, Y).jaxpr
    shorter, needed = partial_eval.dce_jaxpr(traced.jaxpr, [True])
    (operation,) = shorter.eqns
    assert needed == [False, True]
    assert "scan" not in str(operation.params["program"].traced.jaxpr)
    assert not partial_eval.dce_jaxpr(traced.jaxpr, [False])[0].eqns


def prepared_by(gradient, monkeypatch):
    """The programs that a gradient loads or compiles ahead, and the gradient."""
    ahead = []
    prepare = Program.prepare
    with monkeypatch.context() as patch:
        patch.setattr(Program, "prepare", lambda self: (ahead.append(self), prepare(self)))
        found = gradient()
    return ahead, found


def test_a_second_process_loads_the_transpose_of_a_gradient_ahead(folder, monkeypatch):
    """The transpose is loaded in a thread before the forward program runs, so that both are loaded side by
    side. The gradient is the same."""

    def gradient():
        program = new_program()
        return jax.grad(lambda x: energy(lambda *z: call.call(program, *z))(x, Y))(X)

    expected = gradient()
    forget()
    monkeypatch.setattr(Program, "_compiled", lambda self: pytest.fail("a program was compiled again"))
    (_, transpose), found = prepared_by(gradient, monkeypatch)
    np.testing.assert_array_equal(found, expected)
    assert transpose._executable is not None


@pytest.mark.parametrize("result", ["angle", "length"])
def test_the_transpose_for_expected_cotangents_is_compiled_ahead(monkeypatch, result):
    """It serves for every gradient that needs no other cotangents; the angle's cotangent is expected, the
    length's is not. Both gradients are those of the function."""
    program, compiled = new_program(None), []
    compile_now = Program._compiled
    monkeypatch.setattr(Program, "_compiled", lambda self: (compiled.append(self), compile_now(self))[1])
    reverse = REVERSE["expected"]

    def gradient():
        return jax.grad(lambda y: call.call(program, X, y, COUNT, **reverse)[result].sum())(Y)

    (_, transpose), found = prepared_by(gradient, monkeypatch)
    assert len(compiled) == (2 if result == "angle" else 3)
    assert transpose in compiled
    expected = jax.grad(lambda y: pendulums(X, y, COUNT)[result].sum())(Y)
    np.testing.assert_allclose(found, expected, rtol=1e-13)


def test_a_gradient_compiles_only_its_programs():
    """Arguments go into a program as they are, and cotangents that are zero are made by NumPy. For JAX each
    would be a small program of its own. No other test has arrays of seven numbers; what a gradient compiles
    for single numbers is compiled before."""
    compiled = []

    def gradient(x, y):
        program = tree_program(pendulums, tuple(map(type_of, (x, y, COUNT))), None)
        jax.grad(lambda x: call.call(program, x, y, COUNT, **REVERSE["expected"])["rate"])(x)

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


def test_recomputed_tangents_save_no_residuals_and_differentiate_one_result():
    """The transpose of a recomputed call takes the arguments of the call. The length needs no loop."""
    program = new_program(None)
    linear = transposed.tangent_again(program.program, (True, True, False))
    given = tuple(x == "length" for x in program.result if x != "steps")
    found = transposed.transposed(linear, (False, False, False, True, True), given)
    assert found.reached == (False, False, False, False, True)
    assert found.arguments == (False, True, False, False, False)
    assert "scan" not in str(found.program.traced.jaxpr)


def test_a_kept_derivative_of_other_operations_is_refused(folder):
    """Residuals have no names: the linear map of this process takes those of a kept `forward` only if that
    has the same operations."""
    moving = (True, False, False)
    base = new_program(None).program
    base.key = "a" * 64
    made = derived.forward(base, moving)
    save(made.key, "facts", made.facts._replace(about="other operations"))
    derived.forward.cache_clear()
    derived.tangent.cache_clear()
    with pytest.raises(RuntimeError, match="the program cache holds another derivative"):
        derived.tangent(base, moving).traced  # noqa: B018
