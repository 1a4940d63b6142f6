"""Memory that compiling leaves behind goes back to the operating system."""

import ctypes
import os
from pathlib import Path

import pytest

from kept_programs.memory import returning_freed_memory, trim_function


def resident() -> float:
    """The memory [MB] that the process occupies."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


@pytest.mark.skipif(trim_function() is None, reason="the C library of this system has no malloc_trim")
def test_freed_memory_is_returned():
    """Of 200 MB in blocks of 2 kB all but a few are freed, so that the C library keeps the memory. At least
    half of it is returned."""
    with returning_freed_memory():
        blocks = [bytes(2000) for _ in range(100_000)]
        kept = blocks[::1000]
        del blocks
        before = resident()
    assert len(kept) == 100 and before - resident() > 100.0


def test_a_c_library_without_the_function_is_no_error(monkeypatch):
    """On other systems nothing happens."""
    trim_function.cache_clear()

    def missing(_):
        raise OSError("no such library")

    monkeypatch.setattr(ctypes, "CDLL", missing)
    with returning_freed_memory():
        pass
    assert trim_function() is None
    trim_function.cache_clear()
