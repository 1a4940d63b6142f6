"""Loops that end early and store results in buffers, for one run or for many runs under `jax.vmap`.

JAX's own rule for a `lax.while_loop` under `vmap` continues until the last member ends. After every
iteration it selects the old or the new value of everything the loop carries, for every member; with result
buffers in the carry this costs more than the run. The loops of this module have rules of their own
(`jax.custom_batching.custom_vmap`): the condition is true while any member is active, the selection applies
to the carry only, and a buffer is written in place if the member is active. Without `vmap` there is no
selection. The rules hold under any `vmap`, also a user's, and under nested ones. They have no reverse
derivative: the loops are used inside functions with derivative rules of their own."""

from collections.abc import Callable
from typing import Any, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.custom_batching import custom_vmap

from esail_jax.array_types import Array, Bool, Float, Int

Carry = TypeVar("Carry")
Result = TypeVar("Result")


def while_active(
    active: Callable[[Carry], Bool[Array, ""]],
    body: Callable[[Carry, Result, Bool[Array, ""]], tuple[Carry, Result]],
    carry: Carry,
    buffers: Result,
) -> tuple[Carry, Result]:
    """Repeats `carry, buffers = body(carry, buffers, is_active)` while `active(carry)`.

    The body may change the buffers by `buffer_set` with its `is_active` only: under `vmap` a member that is
    no longer active keeps its carry, but nothing protects its buffers."""

    def turn(state):
        carry, buffers = state
        is_active = active(carry)
        new, buffers = body(carry, buffers, is_active)
        return select_under_vmap(is_active, new, carry), buffers

    return lax.while_loop(lambda state: any_member(active(state[0])), turn, (carry, buffers))


def bounded_loop(
    step: Callable[[Carry], tuple[Carry, Bool[Array, ""], Result]],
    carry: Carry,
    most: int | Int[Array, ""],
    nothing: Result,
    room: int | None = None,
) -> tuple[Carry, Result]:
    """Repeats `carry, goes_on, result = step(carry)` until `goes_on` is false, `most` times at most.

    Returns the last carry and the results along a new first axis of length `room` (`most` if None), filled
    up with `nothing`. All members begin together, so that their results have one common index."""

    def is_active(state):
        _, count, goes_on, _ = state
        return goes_on & (count < most)

    def turn(state):
        carry, count, goes_on, results = state
        new, still, result = step(carry)
        old = carry, goes_on, nothing
        carry, goes_on, result = select_under_vmap(is_active(state), (new, still, result), old)
        put = lax.dynamic_update_index_in_dim
        results = jax.tree.map(lambda all, x: put(all, x, count, 0), results, result)
        return carry, count + 1, goes_on, results

    length = most if room is None else room
    empty = jax.tree.map(lambda x: jnp.broadcast_to(x, (length, *jnp.shape(x))), nothing)
    state = (carry, jnp.zeros((), int), jnp.asarray(True), empty)
    carry, _, _, results = lax.while_loop(lambda state: any_member(is_active(state)), turn, state)
    return carry, results


@custom_vmap
def any_member(condition: Bool[Array, ""]) -> Bool[Array, ""]:
    """The condition; under `vmap`, one truth value for all members: whether it holds for any."""
    return condition


@any_member.def_vmap
def _any_member(size, batched, condition):
    return any_member(condition.any(0) if batched[0] else condition), False


def cond_of_members(
    condition: Bool[Array, ""], yes: Callable[..., Result], no: Callable[..., Result], *operands: Any
) -> Result:
    """`lax.cond(condition, yes, no, *operands)`, for functions whose derivative may be batched.

    In a batch all members compute `yes` if any of them wants it, and the others drop the result. It must be
    finite for their operands, too. JAX's own rule for a condition that differs between members stops the
    gradient of the operands; within a batched rule of `jax.custom_jvp` these are tangents, and reverse mode
    (`jax.grad` of `jax.vmap`) then ends in an error."""
    chosen = lax.cond(any_member(condition), yes, no, *operands)
    return select(true_or_of_members(condition), chosen, no(*operands))


@custom_vmap
def true_or_of_members(condition: Bool[Array, ""]) -> Bool[Array, ""]:
    """true, for which the compiler removes a selection; under `vmap`, the condition."""
    return jnp.ones_like(condition)


@true_or_of_members.def_vmap
def _true_or_of_members(size, batched, condition):
    return (condition, True) if batched[0] else (true_or_of_members(condition), False)


@custom_vmap
def select_under_vmap(is_active: Bool[Array, ""], new: Carry, old: Carry) -> Carry:
    """`new`; under `vmap`, `new` for the active members and `old` for the others."""
    return new


@select_under_vmap.def_vmap
def _select_under_vmap(size, batched, is_active, new, old):
    new, old = filled(size, new, batched[1]), filled(size, old, batched[2])
    chosen = jax.vmap(select)(is_active, new, old) if batched[0] else select_under_vmap(is_active, new, old)
    return chosen, jax.tree.map(lambda _: True, chosen)


@custom_vmap
def buffer_set(buffers: Result, index: Int[Array, ""], value: Result, is_active: Bool[Array, ""]) -> Result:
    """The buffers with `value` at `index` of their first axis; under `vmap`, only the active
    members are written.

    Without `vmap` the caller is active, and the index is not checked against the length of the buffers."""
    # Not `at[index].set`, which checks the index.
    return jax.tree.map(lambda b, x: lax.dynamic_update_index_in_dim(b, x, index, 0), buffers, value)


@buffer_set.def_vmap
def _buffer_set(size, batched, buffers, index, value, is_active):
    buffers, value = filled(size, buffers, batched[0]), filled(size, value, batched[2])
    index, is_active = filled(size, index, batched[1]), filled(size, is_active, batched[3])

    def one(buffers, index, value, is_active):
        return jax.tree.map(
            lambda b, x: b.at[jnp.where(is_active, index, len(b))].set(x, mode="drop"), buffers, value
        )

    written = jax.vmap(one)(buffers, index, value, is_active)
    return written, jax.tree.map(lambda _: True, written)


def select(condition: Bool[Array, ""], new: Carry, old: Carry) -> Carry:
    """`new` if the condition holds, otherwise `old`, leaf by leaf."""
    return jax.tree.map(lambda a, b: jnp.where(condition, a, b), new, old)


def filled(size: int, values: Any, batched: Any) -> Any:
    """The values with a leading axis of length `size` for the members, which is added if
    missing."""
    return jax.tree.map(
        lambda x, has: x if has else jnp.broadcast_to(x, (size, *jnp.shape(x))), values, batched
    )


def per_member_table(table: Float[Array | np.ndarray, "row col"], like: Array) -> Float[Array, "row col"]:
    """The table; under `vmap`, one copy of it per member. like: any array that differs between
    members.

    Without the copies XLA moves the member axis behind the table's rows and transposes the arrays around
    the product. The compiler removes the selection that makes the copies."""
    # The condition says nothing: it is true for a number and false for NaN, and both choices are the table,
    # so that NaN does no harm. But it is computed from `like`, and so there is one of every member: under
    # `vmap` JAX selects, and by that copies, the table once for every member.
    token = like.reshape(-1)[0].real
    return jnp.where(token == token, table, table)
