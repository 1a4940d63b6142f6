"""A program is traced and compiled once, and comes back from the store."""

import threading
from concurrent.futures import ThreadPoolExecutor

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from kept_programs import Program, call, program_of, tree_program, type_of
from kept_programs.cache_hits import HITS
from kept_programs.executables import compile_and_save, is_kept, load_executable
from kept_programs.program import compile_plainly
from kept_programs.store import SUFFIX
from toy import cube, dot, inverse, power


def test_a_program_is_loaded_without_tracing(new_keeper):
    """The second process has neither the traced function nor the types of its results."""
    x, y = np.arange(6.0).reshape(3, 2), np.ones((3, 2))
    expected = program_of(new_keeper(), dot, (), (x, y))(x, y)
    second = program_of(new_keeper(), dot, (), (x, y))
    second.program._make = None
    assert second.result == jax.ShapeDtypeStruct((3,), float)
    np.testing.assert_array_equal(second(x, y), expected)
    with pytest.raises(TypeError, match="must have the structure"):
        second(x)


@pytest.mark.parametrize("damage", ["cut", "other pickle", "other executable"])
def test_a_file_that_cannot_be_loaded_is_replaced(new_keeper, folder, damage):
    """It may come from another version of a library."""
    x = np.arange(6.0).reshape(3, 2)
    keeper = new_keeper()
    expected = program_of(keeper, dot, (), (x, x))(x, x)
    (path,) = folder.glob("*-executable*")
    name, good = path.name.removesuffix(SUFFIX), path.read_bytes()
    if damage == "cut":
        path.write_bytes(good[: len(good) // 2])
    else:
        keeper.store.save(name, b"no pickle" if damage == "other pickle" else b"\x80\x04K\x01.")
    np.testing.assert_array_equal(program_of(new_keeper(), dot, (), (x, x))(x, x), expected)
    assert load_executable(keeper.store, name.removesuffix("-executable")) is not None


def test_a_program_of_a_users_function_is_compiled_but_not_kept(keeper, folder):
    x = np.ones((3, 2))
    program = program_of(keeper, lambda a: 2.0 * a, (), (x,))
    np.testing.assert_array_equal(program(x), 2.0 * x)
    assert not list(folder.glob("*-executable*"))


def test_two_programs_are_compiled_at_the_same_time(keeper):
    """Each compilation waits for the other one to begin. With a lock for all programs, as
    `functools.cached_property` of Python 3.11 has, they would wait for ever."""
    both = threading.Barrier(2, timeout=300.0)

    def compiled_beside_another(lowered):
        both.wait()
        return lowered.compile()

    def program(factor):
        traced = jax.jit(lambda x: [factor * x]).trace(1.0)
        return Program(keeper, lambda: (traced, None), None, compiled_beside_another)

    programs = program(2.0), program(3.0)
    with ThreadPoolExecutor(2) as pool:
        executables = list(pool.map(lambda made: made.executable, programs))
    assert [run(np.asarray(5.0))[0] for run in executables] == [10.0, 15.0]


def test_a_key_depends_on_how_a_program_is_compiled(keeper):
    """The way of compiling is a function or an object with fields; one without a lasting name has no
    key."""
    x = np.ones((3, 2))
    plainly = program_of(keeper, dot, (), (x, x), compile_plainly).program.key
    assert plainly is not None
    assert program_of(keeper, dot, (), (x, x), jax.stages.Lowered.compile).program.key != plainly
    assert program_of(keeper, dot, (), (x, x), lambda lowered: lowered.compile()).program.key is None


def test_a_program_from_the_cache_of_jax_is_not_kept(keeper):
    """XLA serialises such an executable without some of its functions. Without that hit it is kept."""
    lowered = jax.jit(jnp.sin).lower(np.ones(3))

    def from_jax():
        HITS.listen("/jax/compilation_cache/cache_hits")
        return lowered.compile()

    compile_and_save(keeper.store, "a" * 64, from_jax)
    assert not is_kept(keeper.store, "a" * 64)
    compile_and_save(keeper.store, "a" * 64, lowered.compile)
    assert is_kept(keeper.store, "a" * 64)


def test_equal_static_values_of_another_kind_are_other_programs(keeper):
    """2 == 2.0 and 0.0 == -0.0, but results differ in type and in sign."""
    one, two = (program_of(keeper, power, (x,), (np.asarray(3),))(np.asarray(3)) for x in (2, 2.0))
    assert (one.dtype, two.dtype) == (int, float)
    signs = (program_of(keeper, inverse, (x,), (np.asarray(1.0),))(np.asarray(1.0)) for x in (0.0, -0.0))
    assert [float(x) for x in signs] == [np.inf, -np.inf]


@pytest.mark.parametrize("given", [np.ones(5), np.ones(3, int), np.ones((1, 3))])
@pytest.mark.parametrize("how", [lambda f: f, jax.jit])
def test_arguments_of_other_types_are_refused(keeper, how, given):
    program = program_of(keeper, cube, (), (np.ones(3),))
    with pytest.raises(TypeError, match=r"must be float64\[3\], but is"):
        how(lambda x: call(program, x))(given)


def test_a_program_that_is_traced_with_other_settings_is_not_kept(keeper, folder):
    """Its key is that of the settings with which it was asked for."""
    with jax.default_matmul_precision("float32"):
        program = program_of(keeper, cube, (), (np.ones(3),))
    program(np.ones(3))
    assert not list(folder.glob("*-executable*"))


def test_the_first_program_may_be_called_while_another_one_is_traced(new_keeper):
    """With an empty store the check of the operation runs then, and compiles in a thread. The two do not
    wait for each other."""
    keeper = new_keeper()
    inner = program_of(keeper, cube, (), (np.ones(3),))
    outer = tree_program(keeper, lambda x: call(inner, 2.0 * x), (type_of(np.ones(3)),), None)
    results = []
    worker = threading.Thread(target=lambda: results.append(outer(np.ones(3))), daemon=True)
    worker.start()
    worker.join(120.0)
    np.testing.assert_array_equal(results[0], 8.0 * np.ones(3))


def test_without_jit_a_program_is_its_function(keeper):
    program = program_of(keeper, cube, (), (np.ones(3),))
    with jax.disable_jit():
        np.testing.assert_array_equal(program(2.0 * np.ones(3)), 8.0 * np.ones(3))
        slope = jax.grad(lambda x: call(program, x).sum())(jax.numpy.ones(3))
    np.testing.assert_array_equal(slope, 3.0 * np.ones(3))
