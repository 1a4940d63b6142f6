"""Condensation of the segments of a ring on their ends.

A segment is a chain of blocks 0 ... n between two tips. The first three rows of the blocks 0 and n are the
positions of these tips, which are unknowns of the tethers; all other rows are the segment's own. The own
unknowns are eliminated, in O(blocks), and a coupling of the two ends remains,

    [ K_11  K_12 ] [ x_i     ]
    [ K_21  K_22 ] [ x_{i+1} ]

A segment of one truss element has no unknowns of its own.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from esail_jax.array_types import Array, Float, Inexact
from esail_jax.numerics import block_tridiagonal as chains
from esail_jax.numerics.small_matrices import inverse, matmul, matvec

END = 3
"""Number of rows of an end: its position."""

Vectors = Inexact[Array, "block row *column segment"]


class Segments(NamedTuple):
    """Matrices of all segments as block-tridiagonal chains (`block_tridiagonal`), ends included."""

    diag: Inexact[Array, "block row row segment"]
    upper: Inexact[Array, "link row row segment"]
    lower: Inexact[Array, "link row row segment"]

    @property
    def own(self) -> bool:
        """Tells whether segments have unknowns of their own."""
        return self.diag.shape[0] > 2 or self.diag.shape[1] > END


class SegmentFactors(NamedTuple):
    """Factors of the own unknowns. port: inverse of the Schur complement of block 0. response: the segment
    for unit displacements of its ends. first, last: rows of the two ends in the blocks next to them."""

    chain: chains.ChainFactors
    port: Inexact[Array, "row row segment"]
    response: Inexact[Array, "block row end segment"]
    first: tuple[Array, Array]
    last: tuple[Array, Array]


def own_rows(segments: Segments) -> Float[np.ndarray, "block row"]:
    """1 for the segment's own rows, 0 for the rows of its ends."""
    rows = np.ones(segments.diag.shape[:2])
    rows[0, :END] = rows[-1, :END] = 0.0
    return rows


def factor(segments: Segments) -> tuple[SegmentFactors | None, Inexact[Array, "end end segment"]]:
    """The factors (None without own unknowns) and the coupling of the ends."""
    diag, upper, lower = segments
    if not segments.own:
        rows = [jnp.concatenate(pair, axis=1) for pair in ((diag[0], upper[0]), (lower[0], diag[1]))]
        return None, jnp.concatenate(rows)
    n, m, p = diag.shape[0] - 1, diag.shape[1], diag.shape[-1]
    own = own_rows(segments)
    row, column = own[:, :, None, None], own[:, None, :, None]
    held = (1.0 - own)[:, :, None] * np.eye(m)
    chain, schur = chains.factor(
        row * column * diag + held[..., None], row[:-1] * column[1:] * upper, row[1:] * column[:-1] * lower
    )
    port = inverse(schur)
    unit = np.zeros((n + 1, m, 2 * END, p))
    unit[0, :END, :END] = unit[-1, :END, END:] = np.eye(END)[..., None]
    links = jnp.zeros((1, m, 2 * END, p), diag.dtype)
    by_ends = jax.vmap(matmul)(diag, jnp.asarray(unit, diag.dtype))
    by_ends = by_ends + jnp.concatenate([jax.vmap(matmul)(upper, unit[1:]), links])
    by_ends = by_ends + jnp.concatenate([links, jax.vmap(matmul)(lower, unit[:-1])])
    factors = SegmentFactors(
        chain, port, by_ends, (diag[0, :END], upper[0, :END]), (diag[-1, :END], lower[-1, :END])
    )
    inside = jax.vmap(lambda x: solve_own(factors, x), 2, 2)(-own[:, :, None, None] * by_ends)
    factors = factors._replace(response=inside + unit)
    return factors, jax.vmap(lambda x: end_rows(factors, x), 2, 1)(factors.response)


def solve_own(factors: SegmentFactors, rhs: Inexact[Array, "block row segment"]) -> Array:
    """The own unknowns if the ends do not move. The rows of the ends in `rhs` must be zero."""
    own, port = chains.reduce_to_port(factors.chain, rhs)
    return chains.substitute_from_port(factors.chain, own, matvec(factors.port, port))


def end_rows(factors: SegmentFactors, x: Inexact[Array, "block row segment"]) -> Array:
    """The rows (end, segment) of both ends for a displacement of the segment."""
    first = matvec(factors.first[0], x[0]) + matvec(factors.first[1], x[1])
    last = matvec(factors.last[0], x[-1]) + matvec(factors.last[1], x[-2])
    return jnp.concatenate([first, last])


def with_ends(factors: SegmentFactors, own: Array, ends: Inexact[Array, "end segment"]) -> Array:
    """The displacement of the segment for that of its ends."""
    return own + (factors.response * ends).sum(2)
