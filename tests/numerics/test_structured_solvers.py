"""The structured linear solvers against dense matrices of all unknowns (`oracles/dense.py`)."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from esail_jax.numerics import block_tridiagonal, bordered, small_matrices, structured
from esail_jax.numerics.segments import Segments
from oracles.dense import Dense
from support.quick import jit

TOLERANCE = 1e-10
"""Relative error of a solution. Measured: at most 1.4e-13 over all combinations below."""

HUB_POINTS, HUB_OTHERS = 4, 6
POINT_UNKNOWNS = 3 * HUB_POINTS
BORDER = POINT_UNKNOWNS + HUB_OTHERS


def random_system(p, elements, size, hub=False, extra=0, ring=None, seed=0):
    """Matrix and right-hand side as NumPy arrays. ring: elements and block size of the segments.

    The matrix is diagonally dominant and symmetric but for a tenth. The extra unknowns have zero
    diagonals, as multipliers have.
    """
    random = np.random.default_rng(seed)

    def noise(*shape):
        return random.normal(size=shape) / size

    def chain(elements, size):
        diag = noise(elements + 1, size, size, p)
        diag = diag + np.swapaxes(diag, 1, 2) + 0.1 * noise(*diag.shape)
        upper = noise(elements, size, size, p)
        lower = np.swapaxes(upper, 1, 2) + 0.1 * noise(elements, size, size, p)
        return diag + 6.0 * np.eye(size)[:, :, None], upper, lower

    def saddle(regular, multipliers):
        n = regular + multipliers
        matrix = noise(n, n, p)
        matrix = matrix + np.swapaxes(matrix, 0, 1) + 0.1 * noise(n, n, p)
        matrix[:regular, :regular] += 4.0 * np.eye(regular)[:, :, None]
        matrix[regular:, :regular] += 2.0 * np.eye(multipliers, regular)[:, :, None]
        matrix[:regular, regular:] += 2.0 * np.eye(regular, multipliers)[:, :, None]
        matrix[regular:, regular:] = 0.0
        return matrix

    matrix = bordered.Bordered(*chain(elements, size))
    rhs = bordered.Vector(noise(elements + 1, size, p))
    if hub:
        border = saddle(POINT_UNKNOWNS, HUB_OTHERS)[:, :, 0]
        matrix = matrix._replace(weights=0.5 * random.normal(size=(HUB_POINTS, p)), border=border)
        rhs = rhs._replace(border=noise(BORDER))
    if extra:
        local = size - 3 + extra
        matrix = matrix._replace(local=saddle(size - 3, extra))
        rhs = rhs._replace(local=noise(extra, p))
        if hub:
            matrix = matrix._replace(
                local_border=noise(local, BORDER, p), border_local=noise(BORDER, local, p)
            )
    if ring is not None:
        loads = noise(ring[0] + 1, ring[1], p)
        loads[[0, -1], :3] = 0.0
        matrix, rhs = matrix._replace(segments=Segments(*chain(*ring))), rhs._replace(ring=loads)
    return matrix, rhs


def solve(matrix, rhs):
    return structured.solve(matrix, structured.factor(matrix), rhs)


@jit
def solved(matrix, rhs):
    return solve(matrix, rhs)


@jit
def derivatives(matrix, rhs, direction, weights):
    """The solution's derivative along a direction of the right-hand side, and the transposed
    derivative."""
    _, along = jax.jvp(lambda b: solve(matrix, b), (rhs,), (direction,))
    _, transposed = jax.vjp(lambda b: solve(matrix, b), rhs)
    return along, transposed(weights)[0]


def on_device(*trees):
    return jax.tree.map(jnp.asarray, trees)


def relative_error(x, exact):
    return np.abs(x - exact).max() / np.abs(exact).max()


NONE, TRUSS, TRUSSES, CABLE, CABLES = None, (1, 3), (4, 3), (1, 6), (3, 6)
"""Rings: elements and block size of a segment. A segment of one truss has no unknowns of its own."""

# (tethers, elements, block size, hub, extra local unknowns, ring)
DEFAULT = {
    (1, 1, 3, False, 0, NONE),
    (3, 5, 6, True, 2, NONE),
    (12, 40, 3, True, 0, NONE),
    (3, 5, 6, True, 2, CABLES),
    (3, 40, 3, False, 0, CABLE),
    (12, 2, 6, True, 2, TRUSSES),
}
"""Systems of the default tests."""

FIRST = DEFAULT | {
    (1, 5, 3, True, 0, NONE),
    (3, 1, 6, True, 2, NONE),
    (12, 2, 6, False, 2, NONE),
    (3, 1, 6, True, 2, TRUSS),
    (12, 5, 3, True, 0, TRUSS),
    (12, 1, 3, False, 0, CABLES),
}
"""Systems that are always among those tested; the others are found from them."""


def possible():
    """All combinations. A block of size 3 has no free rows and therefore no extra local unknowns. A
    ring needs three tethers."""
    rings = NONE, TRUSS, TRUSSES, CABLE, CABLES
    axes = (1, 2, 3, 12), (1, 2, 5, 40), (3, 6), (False, True), (0, 2), rings
    return [
        shape
        for shape in itertools.product(*axes)
        if (shape[2] > 3 or not shape[4]) and (shape[0] > 2 or shape[5] is None)
    ]


def triples(shape):
    """The values of every three properties of a system."""
    return set(itertools.combinations(enumerate(shape), 3))


def systems():
    """Yields systems such that any three properties occur together in every way that is possible: 65 of
    290 combinations. Most are marked nightly, because each takes a second or two to compile.

    Of the systems that add equally many triples, the smallest comes first."""
    left = sorted(possible(), key=lambda shape: shape[0] * shape[1])
    missing = set().union(*map(triples, left))
    chosen = sorted(FIRST, key=str)
    while missing:
        for shape in chosen:
            missing -= triples(shape)
            yield pytest.param(*shape, marks=() if shape in DEFAULT else pytest.mark.nightly)
        chosen = [max(left, key=lambda shape: len(triples(shape) & missing))]


def flat_solution(dense, solution):
    """The solution in the numbering of `dense`. A ring of single trusses only repeats the tips."""
    flat = dense.flatten(solution)
    ends, tips = dense.ends
    flat[ends] = flat[tips]
    return flat


@pytest.mark.parametrize("p, elements, size, hub, extra, ring", list(systems()))
def test_solution(p, elements, size, hub, extra, ring):
    matrix, rhs = random_system(p, elements, size, hub, extra, ring)
    dense = Dense(matrix)
    x = flat_solution(dense, solved(*on_device(matrix, rhs)))
    exact = dense.solver(matrix)(dense.flatten(rhs))
    assert relative_error(x, exact) < TOLERANCE


@pytest.mark.parametrize("p, elements, size, hub", [(3, 5, 6, True), (2, 1, 3, True), (3, 2, 3, False)])
def test_lengths_of_chains(p, elements, size, hub):
    """An unknown per chain that is coupled to all of its blocks, and not symmetrically. The transposed
    solution is that of the transposed matrix."""
    matrix, rhs = random_system(p, elements, size, hub)
    random = np.random.default_rng(7)
    shape = matrix.diag.shape[0], size, p
    column, row = 0.3 * random.normal(size=shape), 0.3 * random.normal(size=shape)
    corner = 3.0 + random.normal(size=p) / 10.0
    lengths = bordered.LengthRows(column, row, corner)
    rhs = rhs._replace(lengths=random.normal(size=p))
    matrix = matrix._replace(lengths=lengths)
    dense = Dense(matrix)
    n = dense.count
    a, e = np.zeros((n + p, n + p)), np.eye(n + p)
    a[:n, :n], a[n:, n:] = dense.matrix(matrix), np.diag(corner)
    for i in range(p):
        a[dense.blocks[i], n + i], a[n + i, dense.blocks[i]] = column[..., i], row[..., i]
    e = np.delete(e, dense.held, axis=1)
    e[:n, : -p or None] = dense.roots_held(matrix)

    def flat(vector):
        return np.concatenate([dense.flatten(vector), vector.lengths])

    inverse = e @ np.linalg.inv(e.T @ a @ e) @ e.T
    x = solved(*on_device(matrix, rhs))
    assert relative_error(flat(x), inverse @ flat(rhs)) < TOLERANCE
    weights = random_system(p, elements, size, hub, seed=2)[1]
    weights = weights._replace(local=np.zeros((0, p)), lengths=random.normal(size=p))
    _, transposed = derivatives(*on_device(matrix, rhs, rhs, weights))
    # Held rows have no right-hand side of their own: it acts on the border.
    free = np.setdiff1d(np.arange(n + p), dense.blocks[:, 0, :3])
    assert relative_error(flat(transposed)[free], (inverse.T @ flat(weights))[free]) < TOLERANCE


@pytest.mark.parametrize("ring", [NONE, CABLES])
def test_derivatives_by_the_right_hand_side(ring):
    """The solution is linear in the right-hand side: its derivative is the inverse of A, transposed that
    of A^T."""
    matrix, rhs = random_system(3, 1, 6, hub=True, extra=2, ring=ring)
    direction, weights = (
        random_system(3, 1, 6, hub=True, extra=2, ring=ring, seed=seed)[1] for seed in (1, 2)
    )
    along, transposed = derivatives(*on_device(matrix, rhs, direction, weights))
    dense = Dense(matrix)
    ends, _ = dense.ends
    own = np.setdiff1d(np.arange(dense.count), ends)
    inverse = dense.solver(matrix)(np.eye(dense.count))[:, own]
    assert relative_error(flat_solution(dense, along), inverse @ dense.flatten(direction)[own]) < TOLERANCE
    assert relative_error(dense.flatten(transposed)[own], inverse.T @ dense.flatten(weights)) < TOLERANCE


@pytest.mark.nightly
@pytest.mark.parametrize("p", [3, 4, 9])
def test_released_chains_of_a_ring(p):
    """A chain whose root is released moves with all rows of its root; the ring goes on joining its tip."""
    matrix, rhs = random_system(p, 2, 6, hub=True, ring=TRUSSES)
    released = np.arange(p) % 3 == 1
    matrix.weights[:, released] = 0.0
    x = flat_solution(dense := Dense(matrix), solved(*on_device(matrix._replace(released=released), rhs)))
    e, free = dense.roots_held(matrix), dense.blocks[released, 0, :3].reshape(-1)
    e = np.concatenate([e, np.eye(dense.count)[:, free]], axis=1)
    exact = e @ np.linalg.solve(e.T @ dense.matrix(matrix) @ e, e.T @ dense.flatten(rhs))
    assert relative_error(x, exact) < TOLERANCE


@pytest.mark.parametrize("links, batch", [(0, (2,)), (1, (2,)), (4, ()), (4, (3,)), (9, (2, 2))])
def test_chain(links, batch):
    """The Schur complement on the port and the solution of the whole chain agree with dense algebra."""
    size = 3
    chain = random_system(int(np.prod(batch)), links, size)
    diag, upper, lower = (x.reshape(*x.shape[:3], *batch) for x in chain[0][:3])
    rhs = chain[1].blocks.reshape(links + 1, size, *batch)

    @jit
    def run(diag, upper, lower, rhs):
        factors, schur = block_tridiagonal.factor(diag, upper, lower)
        own, port = block_tridiagonal.reduce_to_port(factors, rhs)
        port = small_matrices.matvec(small_matrices.inverse(schur), port)
        return schur, block_tridiagonal.substitute_from_port(factors, own, port)

    schur, x = run(*on_device(diag, upper, lower, rhs))
    for index in np.ndindex(*batch):
        at = (..., *index)
        a = np.zeros((links + 1, size, links + 1, size))
        for k in range(links + 1):
            a[k, :, k] = diag[k][at]
        for k in range(links):
            a[k, :, k + 1], a[k + 1, :, k] = upper[k][at], lower[k][at]
        a = a.reshape((links + 1) * size, -1)
        exact = np.linalg.solve(a, rhs[at].reshape(-1))
        beyond = np.linalg.solve(a[size:, size:], a[size:, :size])
        assert relative_error(x[at].reshape(-1), exact) < TOLERANCE
        assert relative_error(schur[at], a[:size, :size] - a[:size, size:] @ beyond) < TOLERANCE


@pytest.mark.parametrize("size", [1, 2, 3, 4, 5, 6, 9])
def test_inverse(size):
    """The inverse of one matrix and of batches, and the products that the solvers use, agree with NumPy."""
    random = np.random.default_rng(size)
    for batch in ((), (4,), (2, 3)):
        a = random.normal(size=(size, size, *batch)) + 4.0 * np.expand_dims(
            np.eye(size), (2, 3)[: len(batch)]
        )
        x = random.normal(size=(size, *batch))
        inverse, product, transposed = jit(
            lambda a, x: (
                small_matrices.inverse(a),
                small_matrices.matmul(a, small_matrices.transpose(a)),
                small_matrices.matvec_transposed(small_matrices.transpose(a), x),
            )
        )(*on_device(a, x))
        last = np.moveaxis(a, (0, 1), (-2, -1))
        assert relative_error(np.moveaxis(inverse, (0, 1), (-2, -1)), np.linalg.inv(last)) < TOLERANCE
        assert relative_error(product, np.einsum("im...,jm...->ij...", a, a)) < TOLERANCE
        assert relative_error(transposed, np.einsum("ij...,j...->i...", a, x)) < TOLERANCE
