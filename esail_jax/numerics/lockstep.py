"""Loops that end when they like, and whose results are kept; alone, or of many members in lockstep.

Under `vmap` a loop goes on until every member's has ended, and after each turn all that it carries is
chosen anew, member by member: with the results of a run among it, that costs more than the run. Where the
axis of the `vmap` is named `LOCKSTEP`, the loops below end together, choose what a member hands on, and
write a result only where a member is still going.
"""

from collections.abc import Callable
from typing import TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from esail_jax.array_types import Array, Bool, Float, Int

LOCKSTEP = "lockstep"
"""Name of the axis of members that go side by side."""

Carry = TypeVar("Carry")
Result = TypeVar("Result")


def in_lockstep() -> bool:
    """Is this being traced for members side by side?"""
    try:
        lax.axis_size(LOCKSTEP)
    except NameError:
        return False
    return True


def one_each(table: Float[Array | np.ndarray, "row col"]) -> Float[Array | np.ndarray, "row col"]:
    """A table, or one for each of those side by side. Its product with what they have would otherwise put
    its rows before the axis they go along, and turn all that stands around it."""
    if not in_lockstep():
        return table
    # Chosen by the number of each: so `vmap` takes it for theirs.
    return jnp.where(lax.axis_index(LOCKSTEP) >= 0, table, table)


def any_member(condition: Bool[Array, ""]) -> Bool[Array, ""]:
    """Does it hold for one of those side by side?"""
    return lax.pmax(condition.astype(int), LOCKSTEP) > 0 if in_lockstep() else condition


def march(
    going: Callable[[Carry], Bool[Array, ""]],
    body: Callable[[Carry, Result, Bool[Array, ""] | bool], tuple[Carry, Result]],
    carry: Carry,
    kept: Result,
) -> tuple[Carry, Result]:
    """carry, kept = body(carry, kept, active) while going(carry). Nothing may be written into `kept` unless
    active (`written`): in lockstep it is not chosen anew."""
    lockstep = in_lockstep()

    def once_more(state):
        carry, kept = state
        active = going(carry) if lockstep else True
        after, kept = body(carry, kept, active)
        return chosen(active, after, carry), kept

    return lax.while_loop(lambda state: any_member(going(state[0])), once_more, (carry, kept))


def chosen(active: Bool[Array, ""] | bool, new: Carry, old: Carry) -> Carry:
    """The new one if active."""
    return new if active is True else jax.tree.map(lambda a, b: jnp.where(active, a, b), new, old)


def written(all_of: Result, index: Int[Array, ""], one: Result, active: Bool[Array, ""] | bool) -> Result:
    """One result at its index along the first axis of all, if active."""
    if active is True:
        # Not `at[index].set`, which looks whether the index is within.
        return jax.tree.map(lambda all, x: lax.dynamic_update_index_in_dim(all, x, index, 0), all_of, one)
    return jax.tree.map(
        lambda all, x: all.at[jnp.where(active, index, len(all))].set(x, mode="drop"), all_of, one
    )


def repeat(
    step: Callable[[Carry], tuple[Carry, Array, Result]],
    carry: Carry,
    most: int,
    nothing: Result,
) -> tuple[Carry, Result]:
    """carry, going, result = step(carry), until not going or `most` times: the last carry, and the
    results along a new first axis of length `most`, `nothing` where there are none."""
    lockstep = in_lockstep()

    def once_more(state):
        carry, count, going, results = state
        active = going if lockstep else True
        after, goes_on, result = step(carry)
        after, result = chosen(active, (after, result), (carry, nothing))
        results = written(results, count, result, True)
        return after, count + 1, goes_on & active, results

    empty = jax.tree.map(lambda x: jnp.broadcast_to(x, (most, *x.shape)), nothing)
    state = (carry, jnp.zeros((), int), jnp.asarray(True), empty)
    carry, _, _, results = lax.while_loop(
        lambda state: any_member(state[2]) & (state[1] < most), once_more, state
    )
    return carry, results
