"""Memory that the compiler leaves behind.

To compile a program or to load an executable, XLA allocates and frees some hundred megabytes. The C library
of Linux (glibc) keeps most of them for later allocations, of which a run has few.
"""

import contextlib
import ctypes
import functools
from collections.abc import Callable, Iterator


@contextlib.contextmanager
def returning_freed_memory() -> Iterator[None]:
    """Decorator or context: at its end freed memory is returned to the operating system, where the C
    library can."""
    try:
        yield
    finally:
        trim = trim_function()
        if trim is not None:
            trim(0)


@functools.cache
def trim_function() -> Callable[[int], int] | None:
    """The function `malloc_trim` of glibc, None where the C library has no such function."""
    with contextlib.suppress(OSError, TypeError, AttributeError):
        return ctypes.CDLL(None).malloc_trim
    return None
