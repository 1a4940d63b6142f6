"""Programs are kept between processes by everything that decides what they compute."""

import dataclasses
import functools
import inspect
import json
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple
from unittest import mock

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from esail_jax.compilation import keys, options, program, store
from esail_jax.compilation.cache_hits import HITS
from esail_jax.compilation.jit import jit
from esail_jax.compilation.keys import Unkeyed, key_of, text_of
from esail_jax.compilation.program import Program
from esail_jax.numerics.vectors import dot, norm
from esail_jax.scenes.value_types import Kind
from support.new_process import output_of


class Mine(NamedTuple):
    """A type that is defined outside the package."""

    x: int


@pytest.fixture
def folder(tmp_path, monkeypatch, without_jax_cache):
    """The folder of an empty cache, and programs that are not yet in memory."""
    monkeypatch.setenv(store.VARIABLE, str(tmp_path / "programs"))
    program._program_of.cache_clear()
    return tmp_path / "programs"


@pytest.mark.parametrize(
    "one, other",
    [
        (1, 1.0), (1, True), (0.1, 0.1 + 1e-16), ("1", 1), ((1, 2), [1, 2]), ((1, (2, 3)), (1, 2, 3)),
        (np.zeros(2), np.zeros((2, 1))), (np.zeros(2), np.zeros(2, int)), (np.zeros(2), np.ones(2)),
        (0.0, -0.0), (dot, norm), ({"a": 1}, {"a": 2}), (Kind.NUMBER, Kind.INTEGER), (None, "None"),
        (functools.partial(dot, 1), functools.partial(dot, 2)),
    ],
)  # fmt: skip
def test_texts_of_different_values_differ(one, other):
    assert text_of(one) != text_of(other)


def test_text_does_not_depend_on_order_or_identity():
    assert text_of({"a": 1, "b": 2}) == text_of({"b": 2, "a": 1})
    assert text_of(frozenset("abc")) == text_of(frozenset("cba"))
    assert text_of(np.arange(6.0).reshape(2, 3).T) == text_of(np.arange(6.0).reshape(2, 3).T.copy())
    assert text_of(jnp.ones(2)) == text_of(np.ones(2))


@pytest.mark.parametrize("x", [lambda x: x, Mine, Mine(1), object(), np.array([object()]), (1, [Mine(2)])])
def test_what_is_defined_elsewhere_has_no_key(x):
    """Its source is not part of the key."""
    with pytest.raises(Unkeyed):
        text_of(x)
    assert key_of(x) is None


def test_a_key_depends_on_settings_and_environment(monkeypatch):
    here = key_of(1)
    with jax.default_matmul_precision("float32"):
        assert key_of(1) != here
    assert key_of(1) == here
    monkeypatch.setattr(keys, "environment", lambda: "another processor")
    assert key_of(1) != here


def test_a_program_is_loaded_without_tracing(folder):
    """The second process has neither the traced function nor the types of its results."""
    x, y = np.arange(6.0).reshape(3, 2), np.ones((3, 2))
    first = program.program_of(dot, (), (x, y))
    expected = first(x, y)
    program._program_of.cache_clear()
    second = program.program_of(dot, (), (x, y))
    second.program._make = None
    assert second.result == jax.ShapeDtypeStruct((2,), float)
    np.testing.assert_array_equal(second(x, y), expected)
    with pytest.raises(TypeError, match="must have the structure"):
        second(x)


@pytest.mark.parametrize("damage", ["cut", "other pickle", "other executable"])
def test_a_file_that_cannot_be_loaded_is_replaced(folder, damage):
    """It may come from another version of a library."""
    x = np.arange(6.0).reshape(3, 2)
    expected = program.program_of(dot, (), (x, x))(x, x)
    (path,) = folder.glob("*-executable*")
    name, good = path.name.removesuffix(store.SUFFIX), path.read_bytes()
    if damage == "cut":
        path.write_bytes(good[: len(good) // 2])
    else:
        store.save(name, b"no pickle" if damage == "other pickle" else b"\x80\x04K\x01.")
    program._program_of.cache_clear()
    np.testing.assert_array_equal(program.program_of(dot, (), (x, x))(x, x), expected)
    assert program.load_executable(name.removesuffix("-executable")) is not None


def test_a_program_of_a_users_function_is_compiled_but_not_kept(folder):
    x = np.ones((3, 2))
    found = program.program_of(lambda a: 2.0 * a, (), (x,))
    np.testing.assert_array_equal(found(x), 2.0 * x)
    assert not folder.exists()


def test_jit_finds_a_program_by_its_text(folder):
    """The text holds the constants, and so do functions of a user."""
    found = [jit(lambda x, k=k: k * jnp.sin(x))(np.ones(3)) for k in (2.0, 3.0, 2.0)]
    np.testing.assert_array_equal(found[0], found[2])
    np.testing.assert_allclose(found[1], 1.5 * found[0], rtol=1e-15)  # one rounding each
    assert store.usage().files == 2


RUN = """
import json, sys
import jax, numpy as np
import esail_jax as esail
traced = []
from esail_jax.steppers.collocation import Collocation
original = Collocation.block
Collocation.block = lambda *x: traced.append(1) or original(*x)
run = esail.simulate("single-tether", {"integrator.t_end": 50.0})
import hashlib
rows = hashlib.sha256(b"".join(np.asarray(run[name]).tobytes() for name in sorted(run))).hexdigest()
print(json.dumps([rows, len(traced)]))
"""
"""Prints the checksum of a run's observables and how often its step was traced."""


@pytest.mark.nightly
def test_a_second_process_loads_a_run_bit_for_bit(folder):
    """Without LAPACK's addresses, which JAX sets while lowering, the loaded program would end the
    process."""
    compiled, loaded = (json.loads(output_of(RUN, **{store.VARIABLE: str(folder)})) for _ in range(2))
    assert compiled[1] > 0
    assert loaded == [compiled[0], 0]


def test_a_dataclass_counts_by_its_fields():
    """Every field of a scene's table is part of a key."""
    from esail_jax.scenes.common_tables import Integrator

    table = Integrator(t_end=1.0)
    texts = {text_of(table), text_of(dataclasses.replace(table, t_end=2.0))}
    assert len(texts) == 2


def test_two_programs_are_compiled_at_the_same_time():
    """Each compilation waits for the other one to begin. With a lock for all programs, as
    `functools.cached_property` of Python 3.11 has, they would wait for ever."""
    both = threading.Barrier(2, timeout=300.0)

    def compiled_beside_another(lowered):
        both.wait()
        return lowered.compile()

    def program(factor):
        traced = jax.jit(lambda x: [factor * x]).trace(1.0)
        return Program(lambda: (traced, None), None, compiled_beside_another)

    programs = program(2.0), program(3.0)
    with ThreadPoolExecutor(2) as pool:
        executables = list(pool.map(lambda made: made.executable, programs))
    assert [run(np.asarray(5.0))[0] for run in executables] == [10.0, 15.0]


def test_lowering_in_two_threads_leaves_the_settings_of_jax():
    """The second thread begins while the first one lowers. The setting of tracebacks is afterwards what it
    was, although both change it."""
    first, second = threading.Event(), threading.Event()
    slow, other = (mock.Mock(spec=jax.stages.Traced) for _ in range(2))
    # Without a lock the second thread arrives while the first one waits.
    slow.lower.side_effect = lambda: (first.set(), second.wait(0.2))
    other.lower.side_effect = lambda: (second.set(), time.sleep(0.2))
    before = jax.config.jax_include_full_tracebacks_in_locations
    with ThreadPoolExecutor() as pool:
        one = pool.submit(inspect.unwrap(options.lower), slow)
        assert first.wait(300.0)
        pool.submit(inspect.unwrap(options.lower), other).result()
        one.result()
    assert before and jax.config.jax_include_full_tracebacks_in_locations


def test_environment_holds_the_source_and_the_flags_of_xla(tmp_path, monkeypatch):
    """Another source of the package, or other flags, make another environment, and so other keys."""
    source = tmp_path / "esail_jax" / "compilation" / "keys.py"
    source.parent.mkdir(parents=True)
    source.write_text("one")
    monkeypatch.setattr(keys, "__file__", str(source))
    environment = keys.environment.__wrapped__
    before = environment()
    assert environment() == before
    source.write_text("two")
    changed = environment()
    monkeypatch.setenv("XLA_FLAGS", "--xla_another=true")
    assert len({before, changed, environment()}) == 3


def test_a_key_depends_on_the_compiler_options(folder):
    """Programs with other options, or with fusion forbidden, are others."""
    x = np.ones((3, 2))
    quick = options.COMPILER_OPTIONS | {"xla_backend_optimization_level": 0}
    found = (program.program_of(dot, (), (x, x)), program.program_of(dot, (), (x, x), quick))
    alone = program.program_of(dot, (), (x, x), fused=False)
    assert len({made.program.key for made in (*found, alone)}) == 3


def test_a_program_from_the_cache_of_jax_is_not_kept(folder, monkeypatch):
    """XLA serialises such an executable without some of its functions. Without that hit it is kept."""
    lowered = options.lower(jax.jit(jnp.sin).trace(np.ones(3)))

    def from_jax():
        HITS.listen("/jax/compilation_cache/cache_hits")
        return lowered.compile()

    program.compile_and_save("a" * 64, from_jax)
    assert not program.is_kept("a" * 64)
    program.compile_and_save("a" * 64, lowered.compile)
    assert program.is_kept("a" * 64)
