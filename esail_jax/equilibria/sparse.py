"""Sparse matrices of the linearised equations of a sail, in a time proportional to its number of nodes.

The tethers of a sail meet at the hub only, and a node of a tether is coupled with its two neighbours.
Nodes that are three apart on a tether, and the same node of all tethers, therefore have columns without a
common row (but those of the hub) and can be differentiated together: one derivative along the sum of their
directions gives all their columns (Curtis, Powell and Reid 1974). A cable needs 18 such derivatives, its
hub twelve columns and twelve rows more, whatever the number of tethers and elements.
"""

from typing import NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
import scipy.sparse as sp

from esail_jax.array_types import Array, Float
from esail_jax.compilation.options import START_OPTIONS
from esail_jax.compilation.program import program_of
from esail_jax.coordinates import Multipliers
from esail_jax.equilibria.moving_frame import MovingFrame, forces
from esail_jax.system import System

Host = np.ndarray

Sparse: TypeAlias = sp.sparray | sp.spmatrix
"""A sparse matrix of any format."""

NODE_COLOURS = 3
"""Number of groups of nodes along a tether: nodes of a group have no common neighbour."""


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
    """Returns residuals at rest in the frame, and their derivatives along the given directions."""
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


def indices(system: System) -> tuple[Host, Host]:
    """Returns the places of the tethers' coordinates in y, (coef, xyz, node, tether) with -1 for the roots'
    positions, and those of the hub, which is empty without one."""
    tethers = system.tethers
    k, n, p = tethers.coefs, tethers.elements, tethers.count
    cuts = (3 * k * n * p, 3 * (k * n + k - 1) * p)
    places = np.full((k, 3, n + 1, p), -1)
    places[:, :, 1:] = np.arange(cuts[0]).reshape(k, 3, n, p)
    places[1:, :, 0] = np.arange(*cuts).reshape(k - 1, 3, p)
    return places, np.arange(cuts[1], cuts[1] + (12 if system.hub is not None else 0))


def linearised_sparse(
    system: System, frame: MovingFrame, y: Float[Host, " n"], lam: Multipliers
) -> SparseMatrices:
    """Returns the matrices of the linearised equations at rest in a frame, and the residuals there.

    Raises ValueError if the system has couplings that the sparsity does not provide for: the products with
    a random vector are compared."""
    places, hub = indices(system)
    k, _, nodes, _ = places.shape
    size, groups = len(y), min(NODE_COLOURS, nodes)
    probe = np.random.default_rng(0).standard_normal(size)
    seeds = [np.zeros(size) for _ in range(groups * k * 3)]
    for c, direction in enumerate(seeds):
        group, coef, axis = np.unravel_index(c, (groups, k, 3))
        chosen = places[coef, axis, group::NODE_COLOURS]
        direction[chosen[chosen >= 0]] = 1.0
    units = np.eye(size)[hub] if len(hub) else np.zeros((0, size))
    directions = np.stack([*seeds, *units, probe])
    arguments = jax.tree.map(jnp.asarray, (system, frame, y, lam, directions, units))
    samples = jax.tree.map(
        np.asarray, program_of(sampled, (), arguments, START_OPTIONS, fused=False)(*arguments)
    )
    parts = []
    for columns, rows in zip(samples.columns, samples.rows, strict=True):
        matrix = assembled(places, hub, columns[:-1], rows)
        difference = np.abs(matrix @ probe - columns[-1])
        scale = abs(matrix) @ np.abs(probe)
        if (difference > 1e-9 * scale + 1e-14 * scale.max()).any():
            raise ValueError("the tethers must be coupled by the hub only, but are coupled otherwise")
        parts.append(matrix)
    constraint = assembled_constraints(places, hub, samples.constraints[:-1])
    return SparseMatrices(parts[2], parts[1], parts[0], constraint, samples.balance, samples.violation)


def assembled(places: Host, hub: Host, columns: Host, rows: Host) -> Sparse:
    """Returns a sparse matrix from its derivatives along the directions of `linearised_sparse`."""
    coefs, _, nodes, _ = places.shape
    groups = min(NODE_COLOURS, nodes)
    found = []
    for c, values in enumerate(columns[: groups * coefs * 3]):
        group, coef, axis = np.unravel_index(c, (groups, coefs, 3))
        for node in range(group, nodes, NODE_COLOURS):
            column = places[coef, axis, node]
            near = places[:, :, max(0, node - 1) : node + 2]
            pairs = np.broadcast_arrays(near, column)
            used = (pairs[0] >= 0) & (pairs[1] >= 0)
            row = pairs[0][used]
            found.append((values[row], row, pairs[1][used]))
    size = columns.shape[1]
    for place, values in zip(hub, columns[groups * coefs * 3 :], strict=True):
        row = np.flatnonzero(values)
        found.append((values[row], row, np.full(len(row), place)))
    for place, values in zip(hub, rows, strict=True):
        column = np.flatnonzero(values[: hub[0]])
        found.append((values[column], np.full(len(column), place), column))
    data, row, column = (np.concatenate(part) for part in zip(*found, strict=True))
    return sp.csr_matrix((data, (row, column)), shape=(size, size))


def assembled_constraints(places: Host, hub: Host, columns: Host) -> Sparse:
    """Returns Phi_y. A hub's conditions read the hub's coordinates; those of a clamped root read them and
    the coordinates of its own tether."""
    coefs, _, nodes, count = places.shape
    groups, size = min(NODE_COLOURS, nodes), len(hub) + (places >= 0).sum()
    held = columns.shape[1]
    found = [(np.zeros(0), np.zeros(0, int), np.zeros(0, int))]
    own = 6 if len(hub) else 0
    for c, values in enumerate(columns[: groups * coefs * 3]):
        group, coef, axis = np.unravel_index(c, (groups, coefs, 3))
        column = places[coef, axis, group]  # the conditions read the root node, group 0
        if group or (column < 0).any():
            continue
        clamps = values[own:].reshape(-1, count)
        for j, of_tether in enumerate(clamps):
            found.append((of_tether, own + j * count + np.arange(count), column))
    for place, values in zip(hub, columns[groups * coefs * 3 :], strict=True):
        row = np.flatnonzero(values)
        found.append((values[row], row, np.full(len(row), place)))
    data, row, column = (np.concatenate(part) for part in zip(*found, strict=True))
    return sp.csr_matrix((data, (row, column)), shape=(held, size))
