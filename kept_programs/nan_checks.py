"""Programs run without JAX's checks for NaN and infinity (`JAX_DEBUG_NANS`), which stop at healthy results.

Places of a buffer that no instant has reached, and rows after a failure, are NaN on purpose. A failed run
says so by its result."""

from collections.abc import Callable
from typing import Any

import jax


def unchecked(function: Callable, *arguments: Any) -> Any:
    """The result of a function that JAX does not check."""
    if not (jax.config.jax_debug_nans or jax.config.jax_debug_infs):
        return function(*arguments)
    with jax.debug_nans(False), jax.debug_infs(False):
        return function(*arguments)
