"""[MW] Eq. 1-12: kinetic and elastic energy of a chain of elastic rods, and their Lagrange terms.

Printed forms are loops and sums as they stand, with indices from 1. `mw_chains.py` has the judges.
"""

import numpy as np

from oracles.ledger import Errors, fails, holds, relative_error
from oracles.mw_chains import FRACTIONS, Chain, chains, judge, least, phi, worst
from oracles.mw_rods import mass_matrix, stiffness

GAUSS, WEIGHTS = (lambda x, w: ((x + 1) / 2, w / 2))(*np.polynomial.legendre.leggauss(4))


def inner(vectors: np.ndarray, i: int) -> np.ndarray:
    """Sum over j = 1 ... i - 1."""
    return vectors[: i - 1].sum(0)


def rods_of(chain: Chain) -> range:
    """i = 1 ... n."""
    return range(1, chain.n + 1)


def at(array: np.ndarray, i: int):
    """Entry i, counted from 1."""
    return array[i - 1]


# ---- kinetic energy -------------------------------------------------------------------------------


@holds(
    "MW",
    "1",
    "Lagrange's equations, L = T - V, Q the virtual work per coordinate",
    note="q is listed rod by rod here and axis by axis from Eq. 20 on.",
)
def lagrange_equations():
    """Left minus right side, differentiated from T and V, against the truss elements' own residual at
    arbitrary accelerations; the dense solution must leave none."""
    errors = []
    for n in (1, 2, 3, 7):
        for found in judge(n):
            residual = found["inertial"] - found["elastic"] - found["Q"]
            balance = np.einsum("ixjy,jy->ix", found["M"][1], found["xddot"][0]) - found["Q"][1]
            errors.append(relative_error(residual[0], found["residual"][1]))
            errors.append(relative_error(balance, found["elastic"][1]))
    return max(errors)


@holds(
    "MW",
    "2",
    "Position of the point P at original distance l_0 along a rod",
    note="Exact where the rod is strained evenly; see the next row.",
)
def material_point():
    def points(chain):
        placed = []
        for i in rods_of(chain):
            l_0 = FRACTIONS * at(chain.rods.length, i)
            share = l_0 / at(chain.rods.length, i)
            placed.append(inner(chain.x, i) + share[:, None] * at(chain.x, i))
        return placed

    return worst(points, "points")


@holds(
    "MW",
    "2 approximately",
    "What Eq. 2 leaves out: strain that varies along a rod",
    note="A rod under its own weight is off by m g l / (8 EA) in the middle: 0.12 mm in the first "
    "experiment. The lowest axial frequency comes out too high: by 10 % for one rod (sqrt 3 for pi/2), "
    "by 0.026 % for 20.",
)
def uneven_strain():
    """The hanging rod made of many by Eq. 17 at rest; frequencies of Eq. 17 with K = EA/l."""
    mass, length, axial, many = 0.1, 1.0, 1000.0, 64
    force = 9.81 * mass / many
    tension = [force / 2 + force * (many - i) for i in range(1, many + 1)]
    joints = np.cumsum(length / many * (1 + np.array(tension) / axial))
    sag = joints[many // 2 - 1] - joints[-1] / 2
    assert round(1e3 * sag, 2) == 0.12
    for n, excess in ((1, 0.1027), (20, 0.000257)):
        heaviest = np.linalg.eigvalsh(mass_matrix(np.full(n, mass / n))).max()
        slowest = np.sqrt(axial * n / length / heaviest)
        exact = np.pi / 2 * np.sqrt(axial / (mass * length))
        assert relative_error(slowest / exact - 1, excess) < 2e-3
    return relative_error(force * many * length / (8 * axial), sag)


def kinetic_closed(chain: Chain, i: int) -> float:
    """Last line of Eq. 3."""
    middle = inner(chain.v, i) + at(chain.v, i) / 2
    return at(chain.rods.mass, i) / 2 * (middle @ middle + at(chain.v, i) @ at(chain.v, i) / 12)


@holds("MW", "3", "Kinetic energy of a rod, first, second and last line")
def kinetic_energy_of_a_rod():
    def second(chain):
        """v_P of the second line is the rate of Eq. 2."""
        found = []
        for i in rods_of(chain):
            mass, length = at(chain.rods.mass, i), at(chain.rods.length, i)
            l_0, weights = GAUSS * length, WEIGHTS * length
            v_p = inner(chain.v, i) + (l_0 / length)[:, None] * at(chain.v, i)
            found.append(0.5 * weights @ (v_p**2).sum(1) * mass / length)
        return found

    def last(chain):
        return [kinetic_closed(chain, i) for i in rods_of(chain)]

    return max(worst(second, "T_i"), worst(last, "T_i"))


@fails(
    "MW",
    "3 third line",
    "Kinetic energy of a rod, integrand of the third line",
    printed="(sum xdot_j + (l / l_i0) xdot_i)^2 integrated over dl_0; l is the distance in the deformed "
    "rod (Eq. 13)",
    right="l_0 / l_i0, as in Eq. 2 and as the last line has it",
    consequence="The stretch would enter the mass matrix, which would not be constant: a rod stretched by "
    "10 % would have up to 21 % more kinetic energy.",
)
def kinetic_integrand():
    def line(chain, stretch):
        found = []
        for i in rods_of(chain):
            mass, length = at(chain.rods.mass, i), at(chain.rods.length, i)
            distance, weights = GAUSS * length * stretch[i - 1], WEIGHTS * length
            rate = inner(chain.v, i) + (distance / length)[:, None] * at(chain.v, i)
            found.append(0.5 * mass / length * weights @ (rate**2).sum(1))
        return found

    def printed(chain):
        return line(chain, chain.current / chain.rods.length)

    def right(chain):
        return line(chain, np.ones(chain.n))

    return Errors(least(printed, "T_i"), worst(right, "T_i"))


@holds("MW", "4", "Kinetic energy of the tether, the sum over the rods")
def kinetic_energy():
    return worst(lambda chain: sum(kinetic_closed(chain, i) for i in rods_of(chain)), "T")


@holds("MW", "after 4", "The kinetic energy of rod i depends on the rates of the first i rods alone")
def kinetic_energy_looks_inward():
    """T_i has a derivative by the rates of every rod j <= i, and of no other."""
    absent = []
    for n in (1, 2, 3, 7):
        for found in judge(n):
            slopes = np.abs(found["T_i_v"][..., :n, :]).max(-1)
            assert all((np.tril(x) + np.triu(np.ones((n, n)), 1)).min() > 1e-3 for x in slopes)
            absent += [np.triu(x, 1).max() / x.max() for x in slopes]
    return max(absent)


def matrix_7(chain: Chain) -> np.ndarray:
    """Eq. 7."""
    d, shifted = np.diag(chain.rods.mass), phi(chain.n) - np.eye(chain.n) / 2
    return shifted.T @ d @ shifted + d / 12


@holds("MW", "5", "Kinetic energy in matrices, with Phi, I and D")
def kinetic_energy_in_matrices():
    def energy(chain):
        d, shifted = np.diag(chain.rods.mass), phi(chain.n) - np.eye(chain.n) / 2
        total = 0.0
        for axis in range(3):
            rate = chain.v[:, axis]
            total += 1 / 2 * (rate @ shifted.T @ d @ shifted @ rate + 1 / 12 * rate @ d @ rate)
        return total

    return worst(energy, "T")


def on_all_axes(matrix: np.ndarray) -> np.ndarray:
    """One matrix for each axis: (rod, axis, rod, axis)."""
    return np.einsum("ij,xy->ixjy", matrix, np.eye(3))


@holds("MW", "6", "Kinetic energy with the mass matrix of one axis")
def kinetic_energy_with_mass_matrix():
    def energy(chain):
        x, y, z = chain.v.T
        m = matrix_7(chain)
        return 1 / 2 * (x @ m @ x + y @ m @ y + z @ m @ z)

    return worst(energy, "T")


@holds("MW", "7", "Mass matrix of one axis")
def mass_matrix_by_products():
    return worst(lambda chain: on_all_axes(matrix_7(chain)), "M")


@holds("MW", "8", "Elements of the mass matrix; it is symmetric and constant")
def mass_matrix_by_elements():
    def matrix(chain):
        m, n = chain.rods.mass, chain.n
        entries = np.zeros((n, n))
        for i in range(1, n + 1):
            for j in range(1, n + 1):
                outer = max(i, j)
                beyond = sum(at(m, k) for k in range(outer + 1, n + 1))
                entries[i - 1, j - 1] = at(m, outer) / (3 if i == j else 2) + beyond
        assert np.array_equal(entries, entries.T)
        return on_all_axes(entries)

    # The same form in `mw_rods.py`, for those who use it.
    return max(worst(matrix, "M"), worst(lambda chain: on_all_axes(mass_matrix(chain.rods.mass)), "M"))


@holds("MW", "9", "Inertial terms of Lagrange's equations")
def inertial_terms():
    def terms(chain):
        m, n, found = chain.rods.mass, chain.n, []
        for i in rods_of(chain):
            beyond = {j: sum(at(m, k) for k in range(j + 1, n + 1)) for j in rods_of(chain)}
            total = sum((at(m, i) / 2 + beyond[i]) * at(chain.a, j) for j in range(1, i))
            total = total + (at(m, i) / 3 + beyond[i]) * at(chain.a, i)
            total = total + sum((at(m, j) / 2 + beyond[j]) * at(chain.a, j) for j in range(i + 1, n + 1))
            found.append(total)
        return found

    return worst(terms, "inertial")


# ---- elastic energy -------------------------------------------------------------------------------


def second_line_of_10(chain: Chain) -> np.ndarray:
    """Elastic energy of every rod."""
    _, length, axial = chain.rods
    return 1 / 2 * axial * (np.sqrt((chain.x**2).sum(1)) - length) ** 2 / length


@fails(
    "MW",
    "10 first line",
    "Elastic energy of a rod",
    printed="V_i = E_i A_i l_i ((l_i - l_i0)/l_i0)^2 / 2, l_i the deformed length",
    right="V_i = E_i A_i l_i0 ((l_i - l_i0)/l_i0)^2 / 2: the second line, exactly and not approximately",
    consequence="Energy too large by the factor 1 + eps, tension E A eps (1 + 3 eps/2) instead of E A eps: "
    "2.9 % more in the top rod of the first experiment's tether hanging at rest, 15 % at a strain of 10 %. "
    "Eq. 12 and all that follows use the second line.",
)
def elastic_energy_of_a_rod():
    def line(chain, factor):
        _, length, axial = chain.rods
        return 1 / 2 * axial * factor * ((chain.current - length) / length) ** 2

    return Errors(
        least(lambda chain: line(chain, chain.current), "V_i"),
        worst(lambda chain: line(chain, chain.rods.length), "V_i"),
    )


@holds(
    "MW",
    "10",
    "Elastic energy of a rod, second line",
    note="Engineering strain; a rod shorter than undeformed pushes.",
)
def elastic_energy_in_rod_vectors():
    return worst(second_line_of_10, "V_i")


@holds("MW", "11", "Elastic energy of the tether, the sum over the rods")
def elastic_energy():
    return worst(lambda chain: second_line_of_10(chain).sum(), "V")


@holds(
    "MW",
    "12",
    "Elastic terms d/dt(dV/dxdot_i) - dV/dx_i = -k_i x_i",
    note="The minus is right: L = T - V turns it into the + k_i x_i of Eq. 17. k_i depends on the state "
    "and is negative in a rod shorter than undeformed.",
)
def elastic_terms():
    def force(chain):
        _, length, axial = chain.rods
        k = axial / length - axial / np.sqrt((chain.x**2).sum(1))
        assert relative_error(stiffness(chain.rods, chain.x), k) < 1e-14
        return -(axial / length - axial / np.sqrt((chain.x**2).sum(1)))[:, None] * chain.x

    slack = [chain.current < chain.rods.length for n in (3, 7) for chain in chains(n)]
    assert np.concatenate(slack).any()
    return worst(force, "elastic")
