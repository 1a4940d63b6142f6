"""Programs of this package are kept between processes by everything that decides what they compute.

How they are kept is tested in `kept_programs/tests`."""

import dataclasses
import inspect
import json
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from unittest import mock

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from esail_jax import cli
from esail_jax.compilation import options
from esail_jax.compilation.jit import jit
from esail_jax.compilation.kept import ENVIRONMENT, program_of
from esail_jax.compilation.stored import STORE
from esail_jax.numerics.vectors import dot
from support.new_process import output_of


@pytest.fixture
def folder(tmp_path, monkeypatch, without_jax_cache):
    """The folder of an empty cache."""
    monkeypatch.setenv(STORE.variable, str(tmp_path / "programs"))
    return tmp_path / "programs"


def test_jit_finds_a_program_by_its_text(folder):
    """The text holds the constants, and so do functions of a user."""
    found = [jit(lambda x, k=k: k * jnp.sin(x))(np.ones(3)) for k in (2.0, 3.0, 2.0)]
    np.testing.assert_array_equal(found[0], found[2])
    np.testing.assert_allclose(found[1], 1.5 * found[0], rtol=1e-15)  # one rounding each
    assert len(list(folder.glob("*-executable*"))) == 2


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
    compiled, loaded = (json.loads(output_of(RUN, **{STORE.variable: str(folder)})) for _ in range(2))
    assert compiled[1] > 0
    assert loaded == [compiled[0], 0]


def test_a_dataclass_counts_by_its_fields():
    """Every field of a scene's table is part of a key."""
    from esail_jax.scenes.integration import Integrator

    table = Integrator(t_end=1.0)
    texts = {ENVIRONMENT.text_of(table), ENVIRONMENT.text_of(dataclasses.replace(table, t_end=2.0))}
    assert len(texts) == 2


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


def test_a_key_depends_on_the_compiler_options(folder):
    """Programs with other options are others."""
    x = np.ones((3, 2))
    quick = options.COMPILER_OPTIONS | {"xla_backend_optimization_level": 0}
    found = (program_of(dot, (), (x, x)), program_of(dot, (), (x, x), quick))
    assert len({made.program.key for made in found}) == 2


@pytest.mark.parametrize("name", ["off", "OFF", "0", ""])
def test_a_cache_that_is_off_is_said(name, monkeypatch, capsys):
    monkeypatch.setenv(STORE.variable, name)
    assert cli.main(["cache"]) == 0
    assert capsys.readouterr().out == "Compiled programs are not kept (ESAIL_CACHE is off).\n"


def test_the_cache_is_in_the_users_folder(tmp_path, monkeypatch):
    monkeypatch.delenv(STORE.variable, raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert STORE.location() == tmp_path / "esail_jax" / "programs"


def test_the_command_shows_and_clears_the_cache(folder, capsys):
    STORE.save("a", bytes(3 * 2**20))
    assert cli.main(["cache"]) == 0
    shown = capsys.readouterr().out
    assert str(folder) in shown and "files     1\n" in shown and "3.0 MiB (at most 1.0 GiB)" in shown
    assert cli.main(["cache", "--clear"]) == 0
    assert "removed   1" in capsys.readouterr().out
    assert STORE.usage() == (0, 0)


def test_a_key_depends_on_the_source_of_the_package_and_on_threads():
    """What a program computes follows from the source; XLA divides its loops among the threads."""
    assert ENVIRONMENT.source.name == "esail_jax" and (ENVIRONMENT.source / "system.py").exists()
    assert "NPROC=" in ENVIRONMENT.text and "XLA_FLAGS=" in ENVIRONMENT.text
