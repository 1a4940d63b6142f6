"""Sparse matrices of the linearised equations of a sail, in a time proportional to its number of nodes.

A node of a tether or of the ring acts on its neighbours only, and the hub on all (`couplings.py`). The
columns of nodes of one colour are found by one derivative along the sum of their directions. A sail of
cables needs 18 such derivatives, about twice as many with a ring, and its hub twelve columns and twelve
rows more, whatever the number of tethers and elements.
"""

from typing import NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
import scipy.sparse as sp

from esail_jax.array_types import Array, Float
from esail_jax.compilation.kept import program_of
from esail_jax.compilation.options import START_OPTIONS
from esail_jax.coordinates import Multipliers
from esail_jax.equilibria.couplings import NONE, Couplings, couplings, indices
from esail_jax.equilibria.moving_frame import MovingFrame, forces
from esail_jax.system import System

Host = np.ndarray

Sparse: TypeAlias = sp.sparray | sp.spmatrix
"""A sparse matrix of any format."""


class SparseMatrices(NamedTuple):
    """The linearised equations M u'' + (G + C) u' + K u + Phi_y^T mu = 0, Phi_y u = 0 as sparse matrices,
    and the residuals at the state about which they are linearised.

    mass M [kg], rate G + C [kg/s] and stiffness K [N/m] in the independent coordinates y
    (`moving_frame.py`), constraint Phi_y [-]; balance [N] conjugate to y; violation Phi [m].
    """

    mass: Sparse
    rate: Sparse
    stiffness: Sparse
    constraint: Sparse
    balance: Float[Host, " n"]
    violation: Float[Host, " c"]


class Samples(NamedTuple):
    """Residuals, and their derivatives along given directions, each of which has three entries: by y, y'
    and y''. columns: derivatives of the balance; constraints: those of the constraints by y; rows:
    transposed derivatives of the hub's balance."""

    balance: Float[Array, " n"]
    violation: Float[Array, " c"]
    columns: tuple[Float[Array, "direction n"], ...]
    constraints: Float[Array, "direction c"]
    rows: tuple[Float[Array, "row n"], ...]


def sampled(
    system: System,
    frame: MovingFrame,
    y: Float[Array, " n"],
    lam: Multipliers,
    directions: Float[Array, "direction n"],
    hub_rows: Float[Array, "row n"],
) -> Samples:
    """Residuals at rest in the frame, and their derivatives along the given directions."""
    zero = 0.0 * y

    def balance(y, rate, second):
        return forces(system, frame, y, rate, second, lam)[0]

    def constraints(y):
        leaves = jax.tree.leaves(forces(system, frame, y, zero, zero, lam)[1])
        return jnp.concatenate([x.reshape(-1) for x in leaves]) if leaves else jnp.zeros(0)

    left, along = jax.linearize(balance, y, zero, zero)
    places = ((0, 1, 2), (1, 0, 2), (1, 2, 0))  # where the direction stands among two zeros
    columns = tuple(
        jax.vmap(lambda d, k=k: along(*([d, zero, zero][place] for place in k)))(directions) for k in places
    )
    violation, turned = jax.linearize(constraints, y)
    back = jax.linear_transpose(along, y, zero, zero)
    return Samples(left, violation, columns, jax.vmap(turned)(directions), jax.vmap(back)(hub_rows))


def linearised_sparse(
    system: System, frame: MovingFrame, y: Float[Host, " n"], lam: Multipliers
) -> SparseMatrices:
    """The matrices of the linearised equations at rest in a frame, and the residuals there.

    Raises ValueError if the system has couplings that the sparsity does not provide for: the products with
    a random vector are compared."""
    at, coupled = indices(system), couplings(system)
    hub, size = at.hub, len(y)
    probe = np.random.default_rng(0).standard_normal(size)
    seeds = [np.zeros(size) for _ in coupled.seeds]
    for (colour, slot), direction in zip(coupled.seeds, seeds, strict=True):
        chosen = coupled.places[coupled.colour == colour, slot]
        direction[chosen[chosen != NONE]] = 1.0
    units = np.eye(size)[hub] if len(hub) else np.zeros((0, size))
    directions = np.stack([*seeds, *units, probe])
    arguments = jax.tree.map(jnp.asarray, (system, frame, y, lam, directions, units))
    samples = jax.tree.map(np.asarray, program_of(sampled, (), arguments, START_OPTIONS)(*arguments))
    parts = []
    for columns, rows in zip(samples.columns, samples.rows, strict=True):
        matrix = assembled(coupled, hub, columns[:-1], rows)
        difference = np.abs(matrix @ probe - columns[-1])
        scale = abs(matrix) @ np.abs(probe)
        if (difference > 1e-9 * scale + 1e-14 * scale.max()).any():
            raise ValueError("only hub and ring must couple the tethers, but they are coupled otherwise")
        parts.append(matrix)
    constraint = assembled_constraints(coupled, hub, samples.constraints[:-1])
    return SparseMatrices(parts[2], parts[1], parts[0], constraint, samples.balance, samples.violation)


def assembled(coupled: Couplings, hub: Host, columns: Host, rows: Host) -> Sparse:
    """A sparse matrix from its derivatives along the directions of `linearised_sparse`."""
    entries = []
    for (colour, slot), values in zip(coupled.seeds, columns, strict=False):
        of_colour = coupled.colour[coupled.second] == colour
        near = coupled.places[coupled.first[of_colour]]
        pairs = np.broadcast_arrays(near, coupled.places[coupled.second[of_colour], slot, None])
        used = (pairs[0] != NONE) & (pairs[1] != NONE)
        row = pairs[0][used]
        entries.append((values[row], row, pairs[1][used]))
    size = columns.shape[1]
    for place, values in zip(hub, columns[len(coupled.seeds) :], strict=True):
        row = np.flatnonzero(values)
        entries.append((values[row], row, np.full(len(row), place)))
    for place, values in zip(hub, rows, strict=True):
        column = np.setdiff1d(np.flatnonzero(values), hub)
        entries.append((values[column], np.full(len(column), place), column))
    data, row, column = (np.concatenate(part) for part in zip(*entries, strict=True))
    return sp.csr_matrix((data, (row, column)), shape=(size, size))


def assembled_constraints(coupled: Couplings, hub: Host, columns: Host) -> Sparse:
    """Phi_y. A hub's conditions read the hub's coordinates; those of a clamped root read them and
    the coordinates of its own tether's root."""
    count, held = len(coupled.roots), columns.shape[1]
    size = (coupled.places != NONE).sum() + len(hub)
    entries = [(np.zeros(0), np.zeros(0, int), np.zeros(0, int))]
    own = 6 if len(hub) else 0
    for (colour, slot), values in zip(coupled.seeds, columns, strict=False):
        column = coupled.places[coupled.roots, slot]
        chosen = np.flatnonzero((coupled.colour[coupled.roots] == colour) & (column != NONE))
        for j, of_tether in enumerate(values[own:].reshape(-1, count)):
            entries.append((of_tether[chosen], own + j * count + chosen, column[chosen]))
    for place, values in zip(hub, columns[len(coupled.seeds) :], strict=True):
        row = np.flatnonzero(values)
        entries.append((values[row], row, np.full(len(row), place)))
    data, row, column = (np.concatenate(part) for part in zip(*entries, strict=True))
    return sp.csr_matrix((data, (row, column)), shape=(held, size))
