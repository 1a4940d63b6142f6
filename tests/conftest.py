"""Fixtures and settings of all tests.

Most of a test's time is compile time. Tests therefore use scenes of the same structure where they can, and
share the compiled programs (`support/program_caches.py`).
"""

import gc
import os
from pathlib import Path

# NumPy reads this when it is imported. The threads of its library wait busily: on two busy cores the
# eigenvalues of 126 coordinates take 1 s of processor time, with one thread 0.01 s. XLA, too, takes more
# processor time with several threads (`esail_jax/cores.py`).
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("NPROC", "1")

import jax
import pytest
from jax.experimental.compilation_cache.compilation_cache import reset_cache

pytest_plugins = [
    "support.compiled_nothing",
    "support.durations",
    "support.gate",
    "support.program_caches",
    "support.validation_record",
]

MAPS = Path("/proc/self/maps")
MOST_MAPS = 25_000
"""Number of memory mappings of a process above which the compiled programs are dropped. Every program adds
dozens. Linux allows 65,530, which some hundred tests reach; the next compilation then ends the process. At
this number a process has about 5 GB of memory."""

FLAGS = {"--xla_cpu_use_fusion_emitters": "false"} if jax.__version_info__ < (0, 11) else {}
"""Flags of XLA for all sessions. The package compiles with this emitter, too; the many small programs of
the tests compile with it in half the time."""

UNOPTIMISED = {
    "--xla_backend_optimization_level": "0",
    "--xla_disable_hlo_passes": "while-loop-invariant-code-motion,"
    "simplify-while-loops,while-loop-constant-sinking",
    "--xla_cpu_parallel_codegen_split_count": "1",
}
"""Further flags, without the option `--optimised`. Compiling is most of the work of the tests: they take
two thirds to three quarters of the time with these flags, and only long runs take longer. The last flag
keeps XLA from dividing each program among threads, which takes up to a third more processor time and gains
nothing beside another worker."""

LESS_OFTEN = 100_000, 50, 100
"""Thresholds of the garbage collector. Tracing makes millions of objects that stay alive; a collection
every 700 objects, the default, takes a tenth of a test's time."""


def pytest_addoption(parser):
    parser.addoption("--optimised", action="store_true", help="compile with the options of the package")


def pytest_configure(config):
    """Sets the thresholds of the garbage collector and the flags of XLA."""
    gc.set_threshold(*LESS_OFTEN)
    chosen = os.environ.get("XLA_FLAGS", "")
    flags = FLAGS | ({} if config.option.optimised else UNOPTIMISED)
    added = [f"{name}={value}" for name, value in flags.items() if name not in chosen]
    os.environ["XLA_FLAGS"] = " ".join([chosen, *added]).strip()


@pytest.fixture(scope="session")
def small():
    """Overrides that make the baseline small: three tethers of two elements, 20 s, the method of [PGV]."""
    size = {"tethers.count": 3, "tethers.elements": 2, "integrator.t_end": 20.0}
    return size | {"integrator.method": "generalized-alpha"}


@pytest.fixture
def without_jax_cache(monkeypatch):
    """JAX's own compilation cache is off, also in processes that the test starts. The package does not keep
    an executable that JAX has taken from there, as it does if an earlier test or session compiled the same
    program."""
    monkeypatch.setenv("JAX_ENABLE_COMPILATION_CACHE", "0")
    jax.config.update("jax_enable_compilation_cache", False)
    reset_cache()
    yield
    jax.config.update("jax_enable_compilation_cache", True)
    reset_cache()


@pytest.fixture(autouse=True)
def _room_for_programs():
    """Drops the compiled programs, also those that the package keeps in memory, before a process has too
    many memory mappings."""
    if MAPS.exists() and MAPS.read_bytes().count(b"\n") > MOST_MAPS:
        from support.compiled_nothing import forget_programs  # a plugin, which pytest imports first

        forget_programs()
