"""The caches of compiled programs that a session of tests uses: one of JAX, which outlives the session, and
one of the package, which does not."""

import contextlib
import hashlib
import os
import platform
import shutil
import tempfile
from pathlib import Path

import jax

CACHE, PROGRAMS = "JAX_COMPILATION_CACHE_DIR", "ESAIL_CACHE"
LEAST_SECONDS = 0.3
"""Least compile time [s] of a program that is written to JAX's compilation cache."""

LARGEST = 2e9
"""Largest size [B] of JAX's compilation cache between two sessions. All tests need 0.3 GB."""

CPU = Path("/proc/cpuinfo")


def pytest_configure(config):
    """Sets the folders of both caches.

    All processes of a session share them, also those that tests start, so that each program is compiled
    once. JAX's compilation cache serves the next session, too: its key is the whole program that XLA
    compiles, with the version and the flags of XLA. The package's own cache is new in every session,
    because the tests must trace the package. To compile everything anew, set the environment variable
    JAX_COMPILATION_CACHE_DIR to an empty folder.
    """
    if not hasattr(config, "workerinput"):
        session = tempfile.mkdtemp(prefix="esail_programs_")
        config.add_cleanup(lambda: shutil.rmtree(session, ignore_errors=True))
        os.environ.setdefault(PROGRAMS, os.path.join(session, "esail"))
        if CACHE not in os.environ:
            lasting = lasting_folder()
            try:
                lasting.mkdir(parents=True, exist_ok=True)
                config.add_cleanup(lambda: remove_oldest(lasting, LARGEST))
            except OSError:  # there is no home folder that can be written
                lasting = Path(session, "jax")
            os.environ[CACHE] = str(lasting)
        os.environ["JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS"] = str(LEAST_SECONDS)
        os.environ["JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES"] = "-1"
    jax.config.update("jax_compilation_cache_dir", os.environ[CACHE])
    jax.config.update("jax_persistent_cache_min_compile_time_secs", LEAST_SECONDS)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)


def lasting_folder() -> Path:
    """The user's folder for JAX's compilation cache of the tests.

    Every kind of processor has its own: a program may use instructions that another processor lacks."""
    lines = CPU.read_text().splitlines() if CPU.exists() else []
    features = [line for line in lines if line.startswith(("flags", "Features"))][:1]
    name = hashlib.sha256(f"{platform.machine()} {features}".encode()).hexdigest()
    parent = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(parent, "esail_jax_tests", name[:16])


def remove_oldest(folder: Path, largest: float) -> None:
    """Removes the files that have not been used for the longest time, until the folder has at most the
    given size [B]."""
    files = []
    for path in folder.glob("*"):
        with contextlib.suppress(OSError):  # another session removes files at the same time
            found = path.stat()
            files.append((max(found.st_atime, found.st_mtime), found.st_size, path))
    size = sum(taken for _, taken, _ in files)
    for _, taken, path in sorted(files):
        if size <= largest:
            break
        path.unlink(missing_ok=True)
        size -= taken
