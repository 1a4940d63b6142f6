"""Direct solver for a cyclic chain of 3 x 3 blocks, in O(blocks).

The unknowns x_i of the p places of a ring, i = 0 ... p - 1 modulo p, satisfy

    x_i + A_i x_{i+1} + B_i x_{i-1} = t_i.

The ring is opened at place 0: the places 1 ... p - 1 form a block-tridiagonal chain, whose ends are coupled
to place 0. There is no pivoting, because the leading blocks of the matrices in `ring.py` are regular.
"""

from typing import NamedTuple

import jax.numpy as jnp

from esail_jax.array_types import Array, Inexact
from esail_jax.numerics import block_tridiagonal as chains
from esail_jax.numerics.small_matrices import inverse, matmul, matvec

Couplings = Inexact[Array, "3 3 place"]


class CyclicFactors(NamedTuple):
    """Factors of the ring. The first axis of the chain's arrays counts the places 1 ... p - 1.

    port: inverse of the chain's Schur complement at place 1. response: the chain's solution for unit values
    at place 0. closing: inverse of the equations of place 0. after, before: A_0 and B_0
    """

    chain: chains.ChainFactors
    port: Inexact[Array, "3 3"]
    response: Inexact[Array, "place 3 3"]
    closing: Inexact[Array, "3 3"]
    after: Inexact[Array, "3 3"]
    before: Inexact[Array, "3 3"]


def solve_open(chain: chains.ChainFactors, port: Array, rhs: Inexact[Array, "place 3 *column"]) -> Array:
    """The solution of the open chain, for one right-hand side or several columns."""
    columns = (jnp.broadcast_to(x[..., None], (*x.shape, rhs.shape[-1])) for x in chain)
    several = chains.ChainFactors(*columns) if rhs.ndim == 3 else chain
    own, reduced = chains.reduce_to_port(several, rhs)
    first = matmul(port, reduced) if rhs.ndim == 3 else matvec(port, reduced)
    return chains.substitute_from_port(several, own, first)


def factor(after: Couplings, before: Couplings) -> CyclicFactors:
    """Factors of the ring with the couplings A = `after` and B = `before`, of three places or more."""
    a, b = (jnp.moveaxis(x, -1, 0) for x in (after, before))
    places = a.shape[0] - 1
    unit = jnp.broadcast_to(jnp.eye(3, dtype=a.dtype), (places, 3, 3))
    chain, schur = chains.factor(unit, a[1:-1], b[2:])
    port = inverse(schur)
    to_first = jnp.zeros((places, 3, 3), a.dtype).at[0].set(b[1]).at[-1].add(a[-1])
    response = -solve_open(chain, port, to_first)
    closing = inverse(jnp.eye(3) + matmul(a[0], response[0]) + matmul(b[0], response[-1]))
    return CyclicFactors(chain, port, response, closing, a[0], b[0])


def solve(factors: CyclicFactors, rhs: Inexact[Array, "3 place"]) -> Inexact[Array, "3 place"]:
    """The solution x for the right-hand sides t."""
    others = solve_open(factors.chain, factors.port, rhs[:, 1:].T)
    left = rhs[:, 0] - matvec(factors.after, others[0]) - matvec(factors.before, others[-1])
    first = matvec(factors.closing, left)
    others = others + (factors.response * first).sum(-1)
    return jnp.concatenate([first[None], others]).T
