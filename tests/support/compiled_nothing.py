"""A fixture that fails a test in which any program is compiled. Such tests run at the end of a session."""

import contextlib
import os
import sys
from unittest import mock

import jax
import jax.monitoring
import pytest

from esail_jax.compilation.stored import STORE

COMPILATION = "/jax/core/compile/backend_compile_duration"
"""JAX records this event for every program, whether it is compiled or read from the persistent cache: for
programs of `jax.jit`, programs compiled ahead of time, and single operations on arrays."""

CONVERSIONS = ("jit(convert_element_type)", "jit(broadcast_in_dim)", "jit(stage)")
"""Programs of one operation by which JAX makes arrays of numbers. They are allowed."""


def pytest_configure(config):
    line = "drops_programs: drops the compiled programs of the process; run at the end of the session"
    config.addinivalue_line("markers", line)


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items):
    """Moves the tests that drop the programs to the end. Every test after one of them would trace its
    functions and compile its small programs anew."""
    items.sort(key=drops_programs)


def drops_programs(item):
    """Tells whether a test drops the compiled programs of the process."""
    return "nothing_compiles" in item.fixturenames or item.get_closest_marker("drops_programs") is not None


def forget_programs():
    """Drops the compiled programs of this process. A program from an earlier test would cause no event."""
    jax.clear_caches()
    for name, module in list(sys.modules.items()):
        if name.partition(".")[0] in ("esail_jax", "kept_programs"):
            for value in vars(module).values():
                if hasattr(value, "cache_clear"):  # a function with `functools.lru_cache`
                    value.cache_clear()


@contextlib.contextmanager
def no_compilation():
    """Raises AssertionError where a program is compiled, and at the end, if that first error was caught.

    The program cache is off: a program that an earlier test left there would be loaded without an event.
    """
    compiled = []

    def refuse(event, _, **details):
        if event == COMPILATION and details.get("fun_name") not in CONVERSIONS:
            compiled.append(details.get("fun_name", "a program"))
            raise AssertionError(f"{compiled[-1]} was compiled")

    forget_programs()
    jax.monitoring.register_event_duration_secs_listener(refuse)
    try:
        with mock.patch.dict(os.environ, {STORE.variable: "off"}):
            yield
    finally:
        jax.monitoring.unregister_event_duration_listener(refuse)
    assert not compiled, f"{', '.join(compiled)} compiled"


@pytest.fixture
def nothing_compiles():
    """Lets the test fail if anything is compiled during it."""
    with no_compilation():
        yield
