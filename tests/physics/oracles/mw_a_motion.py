"""[MW] Eq. 13-21: loads and the equations of motion.

`mw_chains.py` has the judges; Eq. 21 is also compared with whole chains of the package's truss elements,
with the package's assembly and solver.
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np

from esail_jax.coordinates import Coordinates
from esail_jax.elements.axial import AxialEnergy
from esail_jax.elements.tether import TetherBatch, per_element
from esail_jax.joints.roots import FrameRoots
from esail_jax.loads.fields import UniformGravity
from esail_jax.steppers.consistent import consistent_acceleration
from esail_jax.system import System
from oracles.ledger import Errors, fails, holds, relative_error
from oracles.mw_chains import FRACTIONS, SIZES, Chain, chains, judge, on_every_chain, q_f, worst
from oracles.mw_rods import (
    QUICKLY,
    Rods,
    load_resultants,
    mass_matrix,
    o_n_acceleration,
    stiffness,
    weight,
)

GAUSS, WEIGHTS = (lambda x, w: ((x + 1) / 2, w / 2))(*np.polynomial.legendre.leggauss(4))

# ---- loads ----------------------------------------------------------------------------------------


@holds(
    "MW",
    "13",
    "Position of the point R at distance l along the deformed rod",
    note="Exact, not approximate: the rod is straight. Approximate is Eq. 15's use of it, l/l_i the same "
    "for a material point at all times: even strain, as in Eq. 2.",
)
def point_of_the_deformed_rod():
    def points(chain):
        placed = []
        for i in range(1, chain.n + 1):
            l_i = chain.current[i - 1]
            along = FRACTIONS * l_i
            placed.append(chain.x[: i - 1].sum(0) + (along / l_i)[:, None] * chain.x[i - 1])
        return placed

    def distance_error(chain):
        """The error of the distance of the points."""
        start = np.cumsum(chain.x, 0) - chain.x
        away = np.linalg.norm(np.array(points(chain)) - start[:, None], axis=2)
        return relative_error(away, FRACTIONS * chain.current[:, None])

    return max(worst(points, "points"), on_every_chain(distance_error))


@fails(
    "MW",
    "13 text",
    "What l is in Eq. 13",
    printed='"a point R in the rod, with distance l from P to O_{i-1}"; P is the point of Eq. 2',
    right="with distance l from R to O_{i-1}",
    consequence="A letter. With the distance of P, Eq. 13 would be the position of P.",
)
def which_point_is_at_distance_l():
    """R at four fifths of the rod, P at three tenths."""

    def error(chain, fraction):
        start = np.cumsum(chain.x, 0) - chain.x
        r = start + 0.8 * chain.x
        distance = fraction * chain.current
        return relative_error(start + (distance / chain.current)[:, None] * chain.x, r)

    every = [chain for n in SIZES for chain in chains(n)]
    return Errors(min(error(c, 0.3) for c in every), max(error(c, 0.8) for c in every))


def resultants(chain: Chain) -> tuple[np.ndarray, np.ndarray]:
    """F and F* of Eq. 14 in all axes, integrated over l."""
    f, f_star = [], []
    for i in range(chain.n):
        l_i = chain.current[i]
        along, dl = GAUSS * l_i, WEIGHTS * l_i
        density = sum(chain.load[i, p] * (along / l_i)[:, None] ** p for p in range(3))
        f.append(dl @ density)
        f_star.append(dl @ (density * along[:, None] / l_i))
    return np.array(f), np.array(f_star)


@holds(
    "MW",
    "14",
    "Resultants F and F* of a load per current length",
    note="F* is what the load puts on the rod's outer end, F - F* on its inner one.",
)
def load_on_a_rod():
    """One rod: Q is F*. Also the forms of `mw_rods.py`, and what gravity makes of them."""

    def error(chain):
        gravity = np.array([0.3, -1.0, 0.4])
        line = np.zeros((chain.n, 3, 3))
        line[:, 0] = chain.rods.mass[:, None] * gravity / chain.current[:, None]
        pairs = zip(resultants(chain), load_resultants(chain.load, chain.x), strict=True)
        heavy = zip(resultants(chain._replace(load=line)), weight(chain.rods.mass, gravity), strict=True)
        return max(relative_error(*pair) for pair in (*pairs, *heavy))

    alone = worst(lambda chain: resultants(chain)[1], "Q", (1,))
    return max(alone, on_every_chain(error))


@holds(
    "MW",
    "15",
    "Virtual work of a change of x_i",
    note="The first two lines leave out dl, to be read after the scalar product.",
)
def virtual_work():
    """For a unit change along each axis, the sum over all rods, over the outer rods, and by Eq.
    14."""

    def works_of(chain):
        f, f_star = resultants(chain)
        found = np.zeros((3, chain.n, 3))
        for i in range(1, chain.n + 1):
            for axis in range(3):
                works = []
                for j in range(1, chain.n + 1):
                    l_j = chain.current[j - 1]
                    along, dl = GAUSS * l_j, WEIGHTS * l_j
                    density = sum(chain.load[j - 1, p] * (along / l_j)[:, None] ** p for p in range(3))
                    change = np.zeros((len(along), 3))
                    change[:, axis] = 0.0 if j < i else 1.0 if j > i else along / l_j
                    works.append(dl @ (density * change).sum(1))
                beyond = sum(f[j - 1, axis] for j in range(i + 1, chain.n + 1))
                members = sum(works), works[i - 1] + sum(works[i:]), f_star[i - 1, axis] + beyond
                found[:, i - 1, axis] = members
        return found

    return max(worst(lambda chain, k=k: works_of(chain)[k], "Q") for k in range(3))


def generalised_force(chain: Chain) -> np.ndarray:
    """Eq. 16 in all axes."""
    f, f_star = resultants(chain)
    return np.array([f_star[i] + f[i + 1 :].sum(0) for i in range(chain.n)])


@holds("MW", "16", "Generalised force of a rod vector")
def force_of_a_rod_vector():
    return worst(generalised_force, "Q")


# ---- equations of motion --------------------------------------------------------------------------


def sides(chain: Chain, xddot: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Both sides of Eq. 18 and 19, axes as columns."""
    f, f_star = resultants(chain)
    k = np.diag(stiffness(chain.rods, chain.x))
    left = mass_matrix(chain.rods.mass) @ xddot + k @ chain.x
    return left, q_f(chain.n) @ f + f_star


def imbalance(derivative: str, balance) -> list[float]:
    """Relative difference of both sides with a derivative of x found by the judges."""
    errors = []
    for n in SIZES:
        for chain, found in zip(chains(n), judge(n), strict=True):
            errors += [max(relative_error(*balance(chain, value)) for value in found[derivative])]
    return errors


@holds("MW", "17", "Equation of motion of one rod vector", note="The sign of k_i x_i is right, see Eq. 12.")
def equation_of_a_rod():
    def balance(chain, xddot):
        m, k = mass_matrix(chain.rods.mass), stiffness(chain.rods, chain.x)
        left = [sum(m[i, j] * xddot[j] for j in range(chain.n)) + k[i] * chain.x[i] for i in range(chain.n)]
        return left, generalised_force(chain)

    return max(imbalance("xddot", balance))


@holds(
    "MW",
    "18",
    "Equations of motion along x, in matrices",
    note="K is diagonal as said, but depends on all axes. Q_F is constant.",
)
def equations_along_x():
    def balance(chain, xddot):
        left, right = sides(chain, xddot)
        return left[:, 0], right[:, 0]

    return max(imbalance("xddot", balance))


@fails(
    "MW",
    "19",
    "Equations of motion along y and z",
    printed="M d^3y/dt^3 + K y = Q_F F_y + F_y^*: three dots over y (two over z)",
    right="M d^2y/dt^2 + K y = Q_F F_y + F_y^*",
    consequence="An equation of third order, without a physical meaning. Eq. 20 and 21 have two dots.",
)
def equations_along_y_and_z():
    def along(axes):
        def balance(chain, derivative):
            left, right = sides(chain, derivative)
            return left[:, axes], right[:, axes]

        return balance

    return Errors(min(imbalance("xdddot", along([1]))), max(imbalance("xddot", along([1, 2]))))


def axis_by_axis(vectors: np.ndarray) -> np.ndarray:
    """q as stated under Eq. 20: all x, all y, all z."""
    return vectors.T.reshape(-1)


@holds("MW", "20", "All equations of motion, with q = (x_1 ... x_n, y_1 ... y_n, z_1 ... z_n)")
def equations_of_motion():
    """With q of Eq. 1, rod by rod, the blocks would fit for one rod only."""

    def balance(chain, xddot):
        f, f_star = resultants(chain)
        m, k = mass_matrix(chain.rods.mass), np.diag(stiffness(chain.rods, chain.x))
        blocks = [np.kron(np.eye(3), x) for x in (m, k, q_f(chain.n))]
        left = blocks[0] @ axis_by_axis(xddot) + blocks[1] @ axis_by_axis(chain.x)
        return left, blocks[2] @ axis_by_axis(f) + axis_by_axis(f_star)

    return max(imbalance("xddot", balance))


@functools.cache
def hanging_trusses() -> tuple[list[Rods], np.ndarray, np.ndarray, np.ndarray]:
    """Three tethers of seven truss elements each from one fixed point, in any shape under gravity: the
    rods, rod vectors and accelerations (tether, rod, xyz) of the package, and gravity."""
    rng, gravity = np.random.default_rng(11), np.array([0.4, -1.2, 0.7])
    count, n = 3, 7
    length, density, axial = rng.uniform(0.5, 2.0, size=(3, count))
    x = rng.normal(size=(count, n, 3))
    x *= (length[:, None] * rng.uniform(0.7, 1.4, (count, n)) / np.linalg.norm(x, axis=2))[..., None]
    ends = np.concatenate([np.zeros((count, 1, 3)), np.cumsum(x, 1)], 1)
    nodal = jnp.asarray(ends.transpose(2, 1, 0)[None])

    def accelerations(length, density, axial, nodal):
        tethers = TetherBatch(length, density, 0.0 * length, n, "truss", ("r_x",))
        roots = FrameRoots(jnp.eye(3), jnp.zeros(()), jnp.zeros((3, count)), None)
        energy = AxialEnergy(per_element(axial, n), "engineering")
        system = System(tethers, roots, None, (energy,), (), (), (UniformGravity(jnp.asarray(gravity)),))
        q, v = Coordinates(nodal, None), Coordinates(0.0 * nodal, None)
        return consistent_acceleration(system, jnp.zeros(()), q, v)[0].tether

    found = jax.jit(accelerations, compiler_options=QUICKLY)(length, density, axial, nodal)
    found = np.diff(np.asarray(found)[0].transpose(2, 1, 0), axis=1)
    numbers = zip(density * length, length, axial, strict=True)
    rods = [Rods(*np.outer(values, np.ones(n))) for values in numbers]
    return rods, x, found, gravity


@holds(
    "MW",
    "21",
    "Accelerations as an initial value problem",
    note='The sentence before it has "(z)" where q belongs. The same accelerations, to rounding, as '
    "two-node truss elements with engineering strain have in nodal coordinates.",
)
def accelerations():
    def explicit(rods, x, f, f_star):
        m, k = mass_matrix(rods.mass), np.diag(stiffness(rods, x))
        return np.linalg.inv(m) @ (q_f(len(x)) @ f + f_star - k @ x)

    errors = [worst(lambda chain: explicit(chain.rods, chain.x, *resultants(chain)), "xddot")]
    every, shapes, truth, gravity = hanging_trusses()
    for rods, x, xddot in zip(every, shapes, truth, strict=True):
        load = weight(rods.mass, gravity)
        errors += [relative_error(form(rods, x, *load), xddot) for form in (explicit, o_n_acceleration)]
    return max(errors)
