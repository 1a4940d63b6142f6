"""A loop that ends when it likes, and whose results are kept."""

from collections.abc import Callable
from typing import TypeVar

import jax
import jax.numpy as jnp
from jax import lax

from esail_jax.array_types import Array

Carry = TypeVar("Carry")
Result = TypeVar("Result")


def repeat(
    step: Callable[[Carry], tuple[Carry, Array, Result]],
    carry: Carry,
    most: int,
    nothing: Result,
) -> tuple[Carry, Result]:
    """carry, going, result = step(carry), until not going or `most` times: the last carry, and the
    results along a new first axis of length `most`, `nothing` where there are none."""

    def once_more(state):
        carry, count, _, results = state
        carry, going, result = step(carry)
        results = jax.tree.map(lambda all, new: all.at[count].set(new), results, result)
        return carry, count + 1, going, results

    empty = jax.tree.map(lambda x: jnp.broadcast_to(x, (most, *x.shape)), nothing)
    state = (carry, jnp.zeros((), int), jnp.asarray(True), empty)
    carry, _, _, results = lax.while_loop(lambda state: state[2] & (state[1] < most), once_more, state)
    return carry, results
