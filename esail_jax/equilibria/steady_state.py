"""Relative equilibrium of a sail of any size, by Newton's method with the sparse matrices of `sparse.py`.

It is the equilibrium of `equilibrium.py`: the shape that rotates at Omega and, with a hub, accelerates
uniformly along the axis. That function is differentiable and its matrix dense; here a step costs a time
proportional to the number of nodes.

    [ K       Phi_y^T   M t   R ] [ dy   ]     [ forces      ]
    [ Phi_y                     ] [ dlam ]  =  [ constraints ]
    [ t^T                       ] [ da   ]   - [ 0           ]
    [ R^T                       ] [ tau  ]     [ 0           ]

t is the translation along the axis and a the acceleration along it. R are the rotations about the axis that
no force opposes: that of the whole sail with a hub or a ring, that of each pinned tether without either.
The steps keep t^T y and R^T y as they are; tau is the moment that the steady spin needs, zero in an
equilibrium.
"""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from esail_jax.array_types import Array, Float, Vector
from esail_jax.compilation.kept import program_of
from esail_jax.compilation.options import START_OPTIONS
from esail_jax.coordinates import Coordinates, Multipliers
from esail_jax.equilibria.couplings import indices
from esail_jax.equilibria.equilibrium import (
    MAX_ITERATIONS,
    MAX_SLOPE_CHANGE,
    STEP_TOLERANCE,
    Equilibrium,
)
from esail_jax.equilibria.moving_frame import MovingFrame, expanded, independent, rotation_about
from esail_jax.equilibria.sparse import Sparse, SparseMatrices, linearised_sparse
from esail_jax.system import System

Host = np.ndarray

BALANCE_TOLERANCE = 1e-9
"""Largest remaining force, relative to the largest centrifugal force of a node, of an equilibrium."""


def steady_state(
    system: System, start: Coordinates, spin: Vector
) -> tuple[Equilibrium, SparseMatrices, Float[Host, " n"]]:
    """Solves for the relative equilibrium from the coordinates `start`.

    spin: angular velocity Omega [rad/s], inertial components; its axis goes through the origin.

    Returns the equilibrium, the matrices of the linearised equations there, and its y. `converged` of the
    equilibrium is false if none was found; nothing is raised.
    """
    y = np.asarray(computed(independent, system, start))
    lam, acceleration = system.no_multipliers(), np.zeros(3)
    axis = np.asarray(spin) / np.linalg.norm(spin)
    settled, converged = False, False
    for _ in range(MAX_ITERATIONS):
        frame = MovingFrame(jnp.asarray(spin), jnp.asarray(acceleration))
        matrices = linearised_sparse(system, frame, y, lam)
        limit = BALANCE_TOLERANCE * np.abs(matrices.mass @ y).max() * float(spin @ spin)
        converged = settled and bool(np.abs(matrices.balance).max() <= limit)
        if settled or not np.isfinite(matrices.balance).all():
            break
        change, multipliers, gain = newton_step(system, matrices, y, axis)
        if not np.isfinite(change).all():
            break
        settled = bool(np.abs(change).max() <= STEP_TOLERANCE * np.abs(y).max())
        share = min(1.0, MAX_SLOPE_CHANGE / largest_slope(system, change))
        y, acceleration = y + share * change, acceleration + share * gain * axis
        lam = added(lam, share * multipliers)
    at = Equilibrium(
        q=computed(expanded, system, jnp.asarray(y)),
        lam=lam,
        frame=MovingFrame(jnp.asarray(spin), jnp.asarray(acceleration)),
        unbalanced=jnp.asarray(np.abs(matrices.balance).max()),
        converged=jnp.asarray(converged),
    )
    return at, matrices, y


def computed(function: Callable, *arguments: Any) -> Any:
    """`function(*arguments)`, computed by a kept program. One after the other, JAX would compile
    every operation of it in every process, which took longer than all the rest."""
    return program_of(function, (), arguments, START_OPTIONS)(*arguments)


def displaced(system: System, change: Float[Array, " n"]) -> Coordinates:
    """The coordinates that belong to a displacement of y."""
    return expanded(system, change, derivative=1)


def newton_step(
    system: System, matrices: SparseMatrices, y: Float[Host, " n"], axis: Float[Host, "3"]
) -> tuple[Float[Host, " n"], Float[Host, " c"], float]:
    """The changes of y, of the multipliers and of the acceleration along the axis."""
    turns = neutral_turns(system, y, axis)
    along = [] if system.hub is None else [translations(system) @ axis]
    forces = [matrices.mass @ t for t in along]
    size, held = len(y), matrices.constraint.shape[0]
    right = sp.hstack([matrices.constraint.T, sp.csr_matrix(columns_of([*forces, *turns], size))])
    below = sp.vstack([matrices.constraint, sp.csr_matrix(columns_of([*along, *turns], size).T)])
    matrix = sp.block_array([[matrices.stiffness, right], [below, None]], format="csc")
    left = np.zeros(matrix.shape[0])
    left[: size + held] = np.concatenate([matrices.balance, matrices.violation])
    step = scaled_solve(matrix, -left)
    return step[:size], step[size : size + held], float(step[size + held : size + held + len(along)].sum())


def scaled_solve(matrix: Sparse, right: Float[Host, " n"]) -> Float[Host, " n"]:
    """Solves with rows and columns scaled by their largest entries; NaN if the matrix is singular."""
    rows = 1.0 / np.maximum(abs(matrix).max(axis=1).toarray().ravel(), 1e-300)
    scaled = sp.diags(rows) @ matrix
    columns = 1.0 / np.maximum(abs(scaled).max(axis=0).toarray().ravel(), 1e-300)
    try:
        return columns * splu(sp.csc_matrix(scaled @ sp.diags(columns))).solve(rows * right)
    except RuntimeError:  # a factor is exactly singular
        return np.full(len(right), np.nan)


def columns_of(vectors: list[Float[Host, " n"]], size: int) -> Float[Host, "n k"]:
    """Vectors as the columns of a matrix, which may have none."""
    return np.stack(vectors, axis=1) if vectors else np.zeros((size, 0))


def translations(system: System) -> Float[Host, "n 3"]:
    """The displacements of y in the three translations of a system with a hub."""
    at = indices(system)
    displacements = np.zeros((at.size, 3))
    points = at.ring
    if system.ring is not None and system.ring.segments.coefs == 2:
        points = at.ring[:, 1:-1:2]  # between the slopes at the ends, positions and slopes take turns
    for axis in range(3):
        displacements[at.tether[0, axis, 1:].ravel(), axis] = 1.0
        displacements[at.hub.reshape(4, 3)[:, axis], axis] = 1.0
        displacements[points[axis].ravel(), axis] = 1.0
    return displacements


def neutral_turns(system: System, y: Float[Host, " n"], axis: Float[Host, "3"]) -> list[Float[Host, " n"]]:
    """The rotations about the axis that no force opposes, with unit length."""
    turn = np.asarray(computed(rotation_about, system, jnp.asarray(axis), jnp.asarray(y)))
    if system.clamped and system.hub is None:
        return []
    if system.hub is not None or system.ring is not None:
        return [turn / np.linalg.norm(turn)]
    places = indices(system).tether
    turns = []
    for tether in range(places.shape[-1]):
        own = places[..., tether]
        own = own[own >= 0]
        alone = np.zeros_like(turn)
        alone[own] = turn[own]
        turns.append(alone / np.linalg.norm(alone))
    return turns


def largest_slope(system: System, change: Float[Host, " n"]) -> float:
    """The largest change of r_x at any node, and of the chord of an element."""
    q = computed(displaced, system, jnp.asarray(change))
    parts = [(system.tethers, q.tether)]
    parts += [] if system.ring is None else [(system.ring.segments, system.ring.nodal(q))]
    slopes = []
    for batch, nodal in parts:
        vectors = np.asarray(nodal)
        lengths = np.broadcast_to(batch.element_length, (batch.elements, vectors.shape[-1]))
        slopes += [np.diff(vectors[0], axis=1) / lengths, vectors[1:]]
    return max(1e-300, *(np.abs(x).max(initial=0.0) for x in slopes))


def added(lam: Multipliers, change: Float[Host, " c"]) -> Multipliers:
    """Multipliers plus a change in the order of the constraints."""
    leaves, tree = jax.tree.flatten(lam)
    parts, at = [], 0
    for x in leaves:
        parts.append(x + jnp.asarray(change[at : at + x.size].reshape(x.shape)))
        at += x.size
    return jax.tree.unflatten(tree, parts)
