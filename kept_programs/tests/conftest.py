"""Fixtures of the tests of `kept_programs`, which need no other package of this project.

python -m pytest kept_programs                        with what else is installed
KEPT_PROGRAMS_ALONE=1 python -m pytest kept_programs  with `esail_jax` not importable
"""

import os
import sys
from pathlib import Path

import jax
import pytest

import toy
from kept_programs import Environment, Keeper, Store
from kept_programs.self_check import verdict_of

if "KEPT_PROGRAMS_ALONE" in os.environ:
    sys.modules["esail_jax"] = None  # type: ignore[assignment]  # importing it raises ModuleNotFoundError

jax.config.update("jax_enable_x64", True)


def pytest_configure(config):
    config.addinivalue_line("markers", "drops_programs: drops the compiled programs of the process")


VARIABLE = "TOY_CACHE"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The folder of an empty store. JAX's own cache is off: an executable from there is not kept."""
    monkeypatch.setenv(VARIABLE, str(tmp_path / "programs"))
    before = jax.config.jax_enable_compilation_cache
    jax.config.update("jax_enable_compilation_cache", False)
    reset()
    yield tmp_path / "programs"
    jax.config.update("jax_enable_compilation_cache", before)
    reset()


def reset():
    """Lets JAX read the settings of its cache anew."""
    from jax.experimental.compilation_cache.compilation_cache import reset_cache

    reset_cache()


@pytest.fixture
def new_keeper(folder):
    """A function that returns a new keeper for the folder: nothing of it is in memory, as in a new
    process."""

    def make():
        store = Store("toy/programs", VARIABLE, b"toy program\n")
        environment = Environment("toy", Path(toy.__file__).parent, store)
        return Keeper(store, environment, switch="TOY_PRIMITIVE", remedy="clear it by hand")

    return make


@pytest.fixture
def keeper(new_keeper):
    """A keeper for which the operation has been checked."""
    made = new_keeper()
    made.store.save(verdict_of(made), b"")
    return made
