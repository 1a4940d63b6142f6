"""Shared scenes. Compiling is most of a test's time: tests share structures where they can, and the
processes of a session the compiled programs."""

import gc
import os
import shutil
import tempfile
from pathlib import Path

import jax
import pytest

pytest_plugins = ["support.compiled_nothing", "support.validation_record"]

MAPS = Path("/proc/self/maps")
MOST_MAPS = 25_000
"""Mapped regions of memory of one process. Every compiled program adds dozens, Linux allows 65,530, and
beyond that the next compilation ends the process: some hundred tests get there."""


CACHE = "JAX_COMPILATION_CACHE_DIR"
LEAST_SECONDS = 0.3
"""Compile time from which a program is worth a file."""

LESS_OFTEN = 100_000, 50, 100
"""Collection of garbage: tracing makes millions of objects that live on, and looking through them every 700
takes a tenth of a test's time."""


def pytest_configure(config):
    """A cache of compiled programs that the processes of this session share, those which tests start
    included, and which ends with it: a session compiles each program once, and finds none of another's."""
    gc.set_threshold(*LESS_OFTEN)
    if not hasattr(config, "workerinput") and CACHE not in os.environ:
        folder = tempfile.mkdtemp(prefix="esail_programs_")
        config.add_cleanup(lambda: shutil.rmtree(folder, ignore_errors=True))
        # The name that the command gives its own cache, where it is told to use this one.
        os.environ[CACHE] = os.path.join(folder, "esail_jax")
        os.environ["JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS"] = str(LEAST_SECONDS)
        os.environ["JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES"] = "-1"
    jax.config.update("jax_compilation_cache_dir", os.environ[CACHE])
    jax.config.update("jax_persistent_cache_min_compile_time_secs", LEAST_SECONDS)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)


@pytest.fixture(scope="session")
def small():
    """Overrides of the baseline that most tests share: three tethers of two elements, 20 s, the method of
    [PGV]."""
    size = {"tethers.count": 3, "tethers.elements": 2, "integrator.t_end": 20.0}
    return size | {"integrator.method": "generalized-alpha"}


@pytest.fixture(autouse=True)
def _room_for_programs():
    """Drops compiled programs before there are too many."""
    if MAPS.exists() and MAPS.read_bytes().count(b"\n") > MOST_MAPS:
        jax.clear_caches()
