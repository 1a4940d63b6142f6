"""`jit` and the compiler options.

Matrix products are right for any factors, although the library that computes them is wrong if all columns
of the right factor are equal, or if it is long and transposed (`compilation/workaround.py`).
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from esail_jax import jit
from esail_jax.compilation.jit import traced_once
from esail_jax.compilation.options import COMPILER_OPTIONS, FUSION_TYPE
from esail_jax.compilation.stored import STORE
from esail_jax.compilation.workaround import PRODUCTS_ALONE, PRODUCTS_FUSED
from support.new_process import output_of

LEFT = np.random.default_rng(0).normal(size=(4, 4))

FACTORS = {
    "one number": lambda x: jnp.broadcast_to(x[0], (4, 12)),
    "one number a row": lambda x: jnp.broadcast_to(x[:4, None], (4, 12)),
    "four numbers three times a row": lambda x: jnp.broadcast_to(x[:4], (4, 3, 4)).reshape(4, 12),
    "any": lambda x: x.reshape(4, 12),
}
NUMBERS = np.random.default_rng(1).normal(size=48)


@pytest.mark.parametrize("factor", FACTORS)
@pytest.mark.parametrize("how", ["jit", "options"])
def test_product_with_any_right_factor(factor, how):
    """A B is right to rounding, also if all columns of B are equal.

    The programs are compiled by `jit`, ahead of time, or by `jax.jit` with the package's options. Entries
    are sums of four products of numbers near one.
    """

    def product(left, x):
        return left @ FACTORS[factor](x)

    if how == "jit":
        program = jit(product)
    else:
        program = jax.jit(product, compiler_options=COMPILER_OPTIONS)
    expected = LEFT @ np.asarray(FACTORS[factor](NUMBERS))
    np.testing.assert_allclose(program(LEFT, NUMBERS), expected, rtol=0, atol=1e-14)


@pytest.mark.parametrize("rows", [16384, 16385, 40000])
@pytest.mark.parametrize("size", [2, 3, 6])
def test_product_with_many_vectors(rows, size):
    """The squared lengths of |M r| are right for any number of vectors r, as rows of an array.

    JAX issue 39103: the library of jaxlib 0.10.2 is wrong for more than 16,384 of them. Squares are sums of
    at most 36 products of numbers near one."""
    matrix = np.random.default_rng(2).normal(size=(size, size))
    vectors = np.random.default_rng(3).normal(size=(rows, size))
    found = jit(jax.vmap(lambda r: jnp.sum((matrix @ r) ** 2)))(vectors)
    np.testing.assert_allclose(found, np.sum((vectors @ matrix.T) ** 2, axis=1), rtol=1e-12)


def test_workaround_has_not_expired():
    """The library is wrong for a right factor with equal columns, in jaxlib 0.10.2 and in 0.11.2.

    If this fails, jaxlib is mended: let the library compute the operations around products again."""
    alone = jax.jit(lambda left, x: left @ FACTORS["one number"](x)).lower(LEFT, NUMBERS)
    program = alone.compile(compiler_options=COMPILER_OPTIONS | {FUSION_TYPE: PRODUCTS_FUSED})
    expected = LEFT @ np.asarray(FACTORS["one number"](NUMBERS))
    wrong = [not np.allclose(program(LEFT, NUMBERS), expected, rtol=1e-12) for _ in range(100)]
    assert any(wrong)


@pytest.mark.nightly
def test_fused_products_on_request():
    """A process that asks for them compiles other programs, whose results are the same to rounding,
    as each adds the terms of a product in an order of its own."""
    code = """
import esail_jax as esail
from esail_jax.compilation.options import FUSION_TYPE, STEP_OPTIONS
run = esail.simulate("baseline", {"tethers.count": 3, "tethers.elements": 1, "integrator.t_end": 11.0})
print(STEP_OPTIONS[FUSION_TYPE], float(run["coning_angle"][-1, 0]).hex())
"""
    asked, usual = (output_of(code, ESAIL_FUSED_PRODUCTS=x).split() for x in ("on", "off"))
    assert (asked[0], usual[0]) == (PRODUCTS_FUSED, PRODUCTS_ALONE)
    assert float.fromhex(asked[1]) == pytest.approx(float.fromhex(usual[1]), rel=1e-9)


# ---- jit ---------------------------------------------------------------------------------------


class Counted:
    """A function that counts how often it is traced."""

    def __init__(self, function):
        self.function, self.traces = function, 0

    def __call__(self, *args, **kwargs):
        self.traces += 1
        return self.function(*args, **kwargs)


def spring(pair, x, power=2):
    return {"energy": (pair["k"] * x**power).sum(), "x": x}


PAIR = {"k": np.linspace(1.0, 2.0, 5)}
X = np.linspace(-1.0, 1.0, 5)


def test_jit_computes_what_jax_jit_computes():
    """To rounding of a sum of five numbers near one; results are arrays in the same tree."""
    found, expected = jit(spring)(PAIR, X), jax.jit(spring)(PAIR, X)
    assert jax.tree.structure(found) == jax.tree.structure(expected)
    assert all(isinstance(x, jax.Array) for x in found.values())
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-14), found, expected)


def test_jit_compiles_once_for_arguments_of_the_same_kind():
    """Values may differ, NumPy and JAX arrays be mixed."""
    function = Counted(spring)
    compiled = jit(function)
    compiled(PAIR, X)
    assert function.traces == len(compiled._programs) == 1
    np.testing.assert_allclose(compiled(PAIR, 2.0 * X)["x"], 2.0 * X)
    compiled({"k": np.ones(5)}, X)
    assert function.traces == len(compiled._programs) == 1


def test_jit_compiles_anew_for_other_shapes_types_and_trees():
    compiled = jit(spring)
    for k, x in ((1.0, 2.0), (1.0, np.float64(2.0)), (1.0, X), (1.0, X[:3]), (1.0, X.astype(np.float32))):
        expected = jax.jit(spring)({"k": k}, x)
        for name, value in compiled({"k": k}, x).items():
            assert (value.shape, value.dtype) == (expected[name].shape, expected[name].dtype)
    assert len(compiled._programs) == 5
    compiled({"k": 1.0, "unused": None}, X)
    assert len(compiled._programs) == 6


def test_programs_of_jit_have_the_options_of_the_package(without_jax_cache, tmp_path, monkeypatch):
    """Both programs are compiled here: the text of a kept one has the lines of the source from which it was
    traced."""
    monkeypatch.setenv(STORE.variable, str(tmp_path / "programs"))
    compiled = jit(lambda a, b: a @ b)
    np.testing.assert_allclose(compiled(LEFT, LEFT), LEFT @ LEFT, rtol=1e-13)
    (program,) = compiled._programs.values()
    assert program.as_text() == compiled.lower(LEFT, LEFT).compile(COMPILER_OPTIONS).as_text()


def test_functions_that_use_other_arguments_are_other_programs(without_jax_cache, tmp_path, monkeypatch):
    """JAX leaves unused arguments out of the text of a program, which is its key here."""
    monkeypatch.setenv(STORE.variable, str(tmp_path / "programs"))
    functions = (lambda x, y: jnp.sin(x), lambda x, y: jnp.sin(y), lambda x, y: jnp.sin(y.sum()))
    found = [float(jit(f)(1.0, y)) for f, y in zip(functions, (2.0, 2.0, np.ones(3)), strict=True)]
    np.testing.assert_allclose(found, np.sin([1.0, 2.0, 3.0]), rtol=1e-15)


@pytest.mark.parametrize(
    "how", [{"static_argnums": 2}, {"static_argnums": -1}, {"static_argnames": "power"}]
)
def test_jit_takes_static_arguments_by_position_and_by_name(how, without_jax_cache):
    """Whichever way they are declared, as for `jax.jit`; every value is a program.

    If one process loads these programs from JAX's compilation cache for the third time, XLA lacks one of
    their functions (jaxlib 0.10.2)."""
    compiled = jit(spring, **how)
    for power in (2, 3, 2):
        np.testing.assert_allclose(compiled(PAIR, X, power)["energy"], (PAIR["k"] * X**power).sum())
    assert len(compiled._programs) == 2
    if how != {"static_argnums": -1}:
        np.testing.assert_allclose(compiled(PAIR, X, power=4)["energy"], (PAIR["k"] * X**4).sum())


def test_jit_tells_equal_static_values_of_different_types_apart():
    """True == 1 == 1.0, but results differ in type."""
    compiled = jit(lambda x, n: x * n, static_argnums=1)
    assert [compiled(2, n).dtype for n in (1, 1.0, True)] == [int, float, int]


def test_jit_under_grad_vmap_and_jit():
    """Called with traced arguments it is traced like any function, also where some are not."""

    def energy(x, k=PAIR["k"]):
        return (k * jnp.sin(x)).sum()

    compiled, slope = jit(energy), PAIR["k"] * np.cos(X)
    np.testing.assert_allclose(jax.grad(compiled)(X), slope, rtol=1e-14)
    np.testing.assert_allclose(jit(jax.grad(compiled))(X), slope, rtol=1e-14)
    np.testing.assert_allclose(jax.jit(jax.grad(compiled))(X), slope, rtol=1e-14)
    np.testing.assert_allclose(jax.jvp(compiled, (X,), (X,))[1], slope @ X, rtol=1e-14)
    np.testing.assert_allclose(
        jax.jacfwd(jax.grad(compiled))(X), np.diag(-PAIR["k"] * np.sin(X)), rtol=1e-14
    )
    each = [energy(x) for x in (X, 2.0 * X)]
    both = np.stack([X, 2.0 * X])
    np.testing.assert_allclose(jax.vmap(compiled)(both), each, rtol=1e-14)
    np.testing.assert_allclose(jax.jit(jax.vmap(compiled))(both), each, rtol=1e-14)
    np.testing.assert_allclose(jax.vmap(jax.jit(compiled))(both), each, rtol=1e-14)
    np.testing.assert_allclose(jax.lax.map(compiled, both), each, rtol=1e-14)
    np.testing.assert_allclose(jit(lambda x: compiled(x) + compiled(X))(X), 2.0 * each[0], rtol=1e-14)
    assert jax.eval_shape(compiled, X).shape == ()


@pytest.mark.parametrize("transform", [jax.grad, jax.jit, lambda f: lambda x: jax.vmap(f)(x[None])[0]])
def test_jit_of_a_function_that_encloses_traced_values(transform):
    """It is called with a plain number, but its body refers to a traced one."""

    def outer(x):
        inner = jit(lambda y: y * x**2)
        return inner(3.0) + inner(4.0)

    expected = 7.0 * 2.0 * 1.5 if transform is jax.grad else 7.0 * 1.5**2
    np.testing.assert_allclose(transform(outer)(jnp.asarray(1.5)), expected, rtol=1e-14)


def test_jit_refuses_what_jax_jit_refuses():
    with pytest.raises(TypeError, match="abstract array"):
        jit(lambda x: x)("text")
    with pytest.raises(ValueError, match="hashable"):
        jit(lambda x, y: x, static_argnums=1)(1.0, [])
    with pytest.raises(TypeError, match="missing"):
        jit(lambda x, y: x)(1.0)


def test_jit_as_decorator_keeps_name_and_docstring_and_works_on_methods():
    class Gain:
        def __init__(self, size):
            self.size = size

        @functools.partial(jit, static_argnums=0)
        def scaled(self, x):
            """Scales."""
            return self.size * x

    assert (Gain.scaled.__name__, Gain.scaled.__doc__) == ("scaled", "Scales.")
    np.testing.assert_array_equal(Gain(3.0).scaled(X), 3.0 * X)


def test_jit_on_another_device_is_jax_jit(monkeypatch):
    """The compiler options are those of a CPU."""
    monkeypatch.setattr("jax.default_backend", lambda: "gpu")
    compiled = jit(spring)
    np.testing.assert_array_equal(compiled(PAIR, X)["x"], X)
    assert not compiled._programs


def test_disabled_jit_and_cleared_cache():
    function = Counted(spring)
    compiled = jit(function)
    with jax.disable_jit():
        compiled(PAIR, X)
        compiled(PAIR, X)
    assert (function.traces, len(compiled._programs)) == (2, 0)
    compiled(PAIR, X)
    compiled.clear_cache()
    compiled(PAIR, X)
    assert (function.traces, len(compiled._programs)) == (4, 1)


def test_a_part_of_several_programs_is_traced_once():
    """Also inside a scan and its derivative, whose values are those of the undecorated function."""
    calls = []

    def damped(x, power):
        calls.append(x)
        return -x * jnp.abs(x) ** power

    part = traced_once(static_argnums=(1,))(damped)

    def moved(x, part):
        return jax.lax.scan(lambda x, _: (x + 0.1 * part(x, 2), None), x, None, length=3)[0]

    start = jnp.linspace(-1.0, 1.0, 5)
    found = jax.jit(moved, static_argnums=1)(start, part)
    slope = jax.jit(jax.grad(lambda x: moved(x, part).sum()))(start)
    assert len(calls) == 1
    np.testing.assert_array_equal(found, jax.jit(moved, static_argnums=1)(start, damped))
    np.testing.assert_array_equal(slope, jax.jit(jax.grad(lambda x: moved(x, damped).sum()))(start))
