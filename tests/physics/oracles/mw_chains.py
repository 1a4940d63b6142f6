"""Random chains of rods, and the results of two judges for them.

`direct` differentiates T and V of straight rods automatically (`mw_rods.py`). `package` uses truss
elements with engineering strain, a tether of one element per rod; the ends are written as sums of rod
vectors. Both results are in rod vectors (rod, xyz).
"""

import functools
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from esail_jax.elements.axial import AxialEnergy
from esail_jax.elements.tether import TetherBatch
from esail_jax.point_fields import PointFields
from oracles.ledger import relative_error
from oracles.mw_rods import (
    QUICKLY,
    Rods,
    dense_solution,
    lagrange_direct,
    lagrange_parts,
    positions,
    rod_energies,
)

SIZES = (1, 2, 3, 7)
STATES = 2
FRACTIONS = np.array([0.0, 0.21, 0.5, 0.83, 1.0])
"""Points along a rod at which positions are compared."""


class Chain(NamedTuple):
    """Rods in a state: rod vectors x, their rates v, arbitrary second and third derivatives a, and a load
    per current length (`mw_rods.load_resultants`)."""

    rods: Rods
    x: np.ndarray
    v: np.ndarray
    a: np.ndarray
    load: np.ndarray

    @property
    def n(self) -> int:
        return len(self.x)

    @property
    def current(self) -> np.ndarray:
        """l_i."""
        return np.linalg.norm(self.x, axis=-1)


@functools.cache
def chains(n: int) -> tuple[Chain, ...]:
    """What both judges find: arrays (size, state, judge, ...) of chains padded to the longest.

    Outer rods without mass, stiffness and load do not change the inner rods, so that one program serves
    all sizes.
    """
    rng = np.random.default_rng(2019 + n)
    found = []
    for _ in range(STATES):
        rods = Rods(*rng.uniform(0.5, 2.0, size=(3, n)))
        direction = rng.normal(size=(n, 3))
        direction /= np.linalg.norm(direction, axis=1)[:, None]
        stretch = 1 + rng.choice([-1, 1], n) * rng.uniform(0.15, 0.5, n)
        x = (rods.length * stretch)[:, None] * direction
        found.append(Chain(rods, x, *rng.normal(size=(2, n, 3)), rng.normal(size=(n, 3, 3))))
    return tuple(found)


def direct(rods: Rods, x, v, a, load) -> dict:
    """Straight rods, differentiated."""
    kinetic, elastic = rod_energies(rods, x, v)
    found = lagrange_direct(rods, x, v, a, load)
    residual = found["inertial"] - found["elastic"] - found["Q"]
    return found | {
        "T_i": kinetic,
        "T_i_v": jax.jacfwd(lambda v: rod_energies(rods, x, v)[0])(v),
        "V_i": elastic,
        "residual": residual,
        "points": positions(x, FRACTIONS),
    }


def package(rods: Rods, x, v, a, load) -> dict:
    """The package's truss elements. `residual` is assembled by the package's own functions, the rest
    comes from its energies; M from its element matrices."""
    mass, length, axial = rods
    tethers = TetherBatch(length, mass / length, 0.0 * mass, 1, "truss", ("r", "r_x"))
    energy = AxialEnergy(axial, "engineering")
    weights, zero = tethers.weights[:, None], jnp.zeros(())

    def nodal(x):
        ends = jnp.cumsum(x, 0)
        return jnp.stack([ends - x, ends]).transpose(2, 0, 1)[None]

    def pull_back(forces):
        return jax.vjp(nodal, x)[1](forces)[0]

    def kinetic(x, v):
        return 0.5 * (nodal(v) * tethers.inertia(nodal(v))).sum((0, 1, 2))

    def elastic(x, v):
        density = energy.density(tethers.interpolate(nodal(x)))
        return (weights * density * tethers.lengths).sum(0)

    def per_undeformed_length(x):
        s = (np.polynomial.legendre.leggauss(2)[0] + 1) / 2  # the package's points; exact up to s^3
        density = jnp.einsum("irx,pr->xpi", load, s[:, None] ** np.arange(3))
        return density * (jnp.sqrt((x**2).sum(-1)) / length)

    def force(x):
        return pull_back(tethers.nodal_forces(PointFields(per_undeformed_length(x), None)))

    fields = tethers.interpolate(nodal(x))
    stress = energy.point_forces(zero, fields, fields).r_x
    conjugates = PointFields(-per_undeformed_length(x), stress)
    ends = jax.jacobian(nodal)(x)[0]  # (axis, end, rod; rod', axis')
    blocks = tethers.mass_elements().reshape(2, 3, 2, 3, -1)
    found = lagrange_parts(
        lambda x, v: kinetic(x, v).sum(), lambda x, v: elastic(x, v).sum(), force, x, v, a
    )
    return found | {
        "T_i": kinetic(x, v),
        "T_i_v": jax.jacfwd(kinetic, 1)(x, v),
        "V_i": elastic(x, v),
        "residual": pull_back(tethers.nodal_forces(conjugates, nodal(a))),
        "M": jnp.einsum("aeijx,eafbi,bfikz->jxkz", ends, blocks, ends),
        "points": jnp.einsum("sc,cxi->isx", tethers.shape_table(FRACTIONS, 0), nodal(x)[0].swapaxes(0, 1)),
    }


@functools.cache
def judged() -> dict:
    """The results of both judges: arrays (size, state, judge, ...) of chains padded to the longest.

    Outer rods without mass, stiffness and load change nothing for those inside: one program serves all.
    """
    longest = max(SIZES)

    def padded(array):
        extra = longest - len(array)
        return np.concatenate([array, np.ones((extra, *array.shape[1:]))])

    def padded_chain(chain):
        there = np.arange(longest) < chain.n
        mass, length, axial = (padded(x) for x in chain.rods)
        x, v, a, load = (padded(x) for x in chain[1:])
        return Chain(Rods(mass * there, length, axial * there), x, v, a, load * there[:, None, None])

    def both(*state):
        return jax.tree.map(lambda *x: jnp.stack(x), direct(*state), package(*state))

    every = [padded_chain(chain) for n in SIZES for chain in chains(n)]
    stacked = jax.tree.map(lambda *x: np.stack(x), *every)
    found = jax.device_get(jax.jit(jax.vmap(both), compiler_options=QUICKLY)(*stacked))
    return {key: value.reshape(len(SIZES), STATES, *value.shape[1:]) for key, value in found.items()}


@functools.cache
def judge(n: int) -> list[dict]:
    """The results of both judges for each state, judge first; accelerations by a dense solve."""
    found = []
    for k in range(STATES):
        values = {key: value[SIZES.index(n), k] for key, value in judged().items()}
        values["M"] = values["M"][:, :n, :, :n]
        cut = {key: value[:, :n] for key, value in values.items() if value.ndim > 1 and key != "M"}
        values |= cut
        for name, forces in (("xddot", "forces"), ("xdddot", "forces_rate")):
            pairs = zip(values["M"], values[forces], strict=True)
            values[name] = np.stack([dense_solution(*pair) for pair in pairs])
        found.append(values)
    return found


def errors_of(form: Callable[[Chain], np.ndarray], truth: str, sizes=SIZES) -> list[float]:
    """Relative errors of a form in all states, to the judge it agrees with least."""
    pairs = [pair for n in sizes for pair in zip(chains(n), judge(n), strict=True)]
    return [max(relative_error(form(chain), value) for value in found[truth]) for chain, found in pairs]


def worst(form: Callable[[Chain], np.ndarray], truth: str, sizes=SIZES) -> float:
    """Largest error over all states and judges."""
    return max(errors_of(form, truth, sizes))


def least(form: Callable[[Chain], np.ndarray], truth: str, sizes=SIZES) -> float:
    """Smallest error over the states: a misprint must show in each."""
    return min(errors_of(form, truth, sizes))


def on_every_chain(error: Callable[[Chain], float], sizes=SIZES) -> float:
    """Largest of errors that need no judge's numbers."""
    return max(error(chain) for n in sizes for chain in chains(n))


# ---- matrices of Eq. 5, 18 and 22 as printed ------------------------------------------------------


def phi(n: int) -> np.ndarray:
    """Lower triangle of ones, diagonal included."""
    return np.tril(np.ones((n, n)))


def epsilon(n: int) -> np.ndarray:
    """Ones below the diagonal."""
    return np.diag(np.ones(n - 1), -1)


def q_f(n: int) -> np.ndarray:
    """Upper triangle of ones without the diagonal."""
    return np.triu(np.ones((n, n)), 1)
