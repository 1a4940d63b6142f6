"""[MW] Eq. 22-30: factors of the mass matrix and the O(n) solution.

The judge of G is the truss elements' mass matrix in the positions of the joints; `mw_chains.py` has the
judges of solutions, dense solves.
"""

import numpy as np

from oracles.ledger import Errors, fails, holds, relative_error
from oracles.mw_a_motion import resultants
from oracles.mw_chains import SIZES, Chain, chains, epsilon, judge, on_every_chain, phi, q_f, worst
from oracles.mw_rods import factors, g_matrix, o_n_acceleration, stiffness


def identity(chain: Chain) -> np.ndarray:
    """I."""
    return np.eye(chain.n)


@holds("MW", "22", "eps Phi = Phi eps = Phi - I")
def shift_of_phi():
    def error(chain):
        p, e, one = phi(chain.n), epsilon(chain.n), identity(chain)
        return max(np.abs(e @ p - (p - one)).max(), np.abs(p @ e - (p - one)).max())

    return on_every_chain(error)


@holds("MW", "after 22", "I = Phi - eps Phi, Phi^-1 = I - eps")
def inverse_of_phi():
    def error(chain):
        p, e, one = phi(chain.n), epsilon(chain.n), identity(chain)
        return max(relative_error(p - e @ p, one), relative_error(one - e, np.linalg.inv(p)))

    return on_every_chain(error)


@holds("MW", "23", "Phi - I/2 as a product")
def phi_less_half():
    def error(chain):
        p, e, one = phi(chain.n), epsilon(chain.n), identity(chain)
        members = (p - 1 / 2 * (p - e @ p), 1 / 2 * (one + e) @ p)
        return max(relative_error(member, p - 1 / 2 * one) for member in members)

    return on_every_chain(error)


def one_axis(n: int) -> list[np.ndarray]:
    """The judges' mass matrix of one axis, for each state."""
    return [found["M"][1][:, 0, :, 0] for found in judge(n)]


def against_mass(form, sizes=SIZES) -> float:
    """Largest error of a form of M over all states."""
    pairs = [pair for n in sizes for pair in zip(chains(n), one_axis(n), strict=True)]
    return max(relative_error(form(chain), matrix) for chain, matrix in pairs)


@holds("MW", "24", "M = Phi^T G Phi: all six members, and G by products")
def congruence():
    def members(chain):
        d, p, e, one = np.diag(chain.rods.mass), phi(chain.n), epsilon(chain.n), identity(chain)
        half, shifted, difference = p - one / 2, one / 2 + e / 2, one - e
        product, back = 1 / 2 * (one + e) @ p, p - e @ p
        g = d / 3 + e.T @ d / 6 + d @ e / 6 + e.T @ d @ e / 3
        return [
            half.T @ d @ half + d / 12,
            product.T @ d @ product + back.T @ d @ back / 12,
            p.T @ shifted.T @ d @ shifted @ p + p.T @ difference.T @ d @ difference @ p / 12,
            p.T @ (shifted.T @ d @ shifted + difference.T @ d @ difference / 12) @ p,
            p.T @ g @ p,
            p.T @ g_matrix(chain.rods.mass) @ p,
        ]

    return max(against_mass(lambda chain, k=k: members(chain)[k]) for k in range(6))


def judged_g(chain: Chain, mass: np.ndarray) -> np.ndarray:
    """The judge's mass matrix in the positions of the joints, r_i = sum of the first i rod vectors."""
    to_rods = np.linalg.inv(phi(chain.n))
    return to_rods.T @ mass @ to_rods


def printed_g(m: np.ndarray, first_of_sum: int) -> np.ndarray:
    """Eq. 25. The general row has m_{i + first_of_sum} + m_{i+1} on the diagonal; n >= 2."""
    n = len(m)
    g = np.zeros((n, n))
    g[0, 0], g[-1, -1] = (m[0] + m[1]) / 3, m[-1] / 3
    for i in range(2, n):
        g[i - 1, i - 1] = (m[i - 1 + first_of_sum] + m[i]) / 3
    for i in range(1, n):
        g[i - 1, i] = g[i, i - 1] = m[i] / 6
    return g


@fails(
    "MW",
    "25",
    "Elements of G",
    printed="diagonal (m_{i+1} + m_{i+1})/3 in the general row",
    right="diagonal (m_i + m_{i+1})/3, as in the first row and in Eq. 27; for n = 1, m_1/3",
    consequence="Nothing for equal rods, and Eq. 27 has it right. Of three rods of 1, 2 and 3 kg the "
    "middle element would be 2 kg instead of 1.67 kg.",
)
def elements_of_g():
    def errors(first_of_sum, sizes):
        pairs = [pair for n in sizes for pair in zip(chains(n), one_axis(n), strict=True)]
        found = [(printed_g(c.rods.mass, first_of_sum), judged_g(c, mass)) for c, mass in pairs]
        return [relative_error(*pair) for pair in found]

    def form(chain):
        p = phi(chain.n)
        return p.T @ g_matrix(chain.rods.mass) @ p

    return Errors(min(errors(1, (3, 7))), max(*errors(0, (2, 3, 7)), against_mass(form)))


def matrix_b(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """B of Eq. 26: lower bidiagonal."""
    return np.diag(a) + np.diag(b, -1)


def printed_factors(m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Eq. 27, indices from 1; n >= 2."""
    n = len(m)
    m, a, b = np.r_[np.nan, m], np.full(n + 1, np.nan), np.full(n + 1, np.nan)
    a[n] = np.sqrt(m[n] / 3)
    b[n - 1] = m[n] / (6 * a[n])
    for i in range(n - 1, 1, -1):
        a[i] = np.sqrt((m[i] + m[i + 1]) / 3 - b[i] ** 2)
        b[i - 1] = m[i] / (6 * a[i])
    a[1] = np.sqrt((m[1] + m[2]) / 3 - b[1] ** 2)
    return a[1:], b[1:n]


@holds(
    "MW",
    "26",
    "G = B^T B with B lower bidiagonal",
    note="Upper times lower, from the last row up: not the L L^T of a library's Cholesky decomposition.",
)
def factorisation():
    """Such a B exists: it follows column by column, and from L L^T with the rows in reverse order."""

    def error(chain):
        g = g_matrix(chain.rods.mass)
        b = np.linalg.cholesky(g[::-1, ::-1])[::-1, ::-1].T
        inside = np.tril(b) - np.tril(b, -2)
        found = matrix_b(*factors(chain.rods.mass))
        return max(relative_error(b.T @ b, g), relative_error(inside, b), relative_error(found, b))

    return on_every_chain(error)


@holds(
    "MW",
    "27",
    "Recursion for the elements of B",
    note="For two rods or more: one rod has a_1 = sqrt(m_1/3), and the last line asks for a second mass. "
    "The loop runs down; typed into MATLAB it needs n-1:-1:2.",
)
def recursion_of_the_factors():
    def form(chain):
        b, p = matrix_b(*printed_factors(chain.rods.mass)), phi(chain.n)
        return p.T @ b.T @ b @ p

    def same(chain):
        pairs = zip(printed_factors(chain.rods.mass), factors(chain.rods.mass), strict=True)
        return max(relative_error(*pair) for pair in pairs)

    return max(against_mass(form, (2, 3, 7)), on_every_chain(same, (2, 3, 7)))


@holds("MW", "after 27", "M = Phi^T B^T B Phi")
def factored_mass_matrix():
    def form(chain):
        b, p = matrix_b(*factors(chain.rods.mass)), phi(chain.n)
        return p.T @ b.T @ b @ p

    return against_mass(form)


@holds("MW", "28", "Solution of M x = b by the factors, in the printed order")
def solution_by_factors():
    errors = []
    for n in SIZES:
        for chain, mass in zip(chains(n), one_axis(n), strict=True):
            b, shift = matrix_b(*factors(chain.rods.mass)), np.eye(n) - epsilon(n)
            inverse = np.linalg.inv(b)
            x = shift @ inverse @ inverse.T @ shift.T @ chain.a
            errors.append(relative_error(x, np.linalg.solve(mass, chain.a)))
    return max(errors)


@holds(
    "MW",
    "29",
    "The solution in six steps",
    note="eta holds the accelerations of the joints: the chain in nodal coordinates, where G is the mass.",
)
def six_steps():
    def eta_and_xddot(chain):
        f, f_star = resultants(chain)
        shift, b = np.eye(chain.n) - epsilon(chain.n), matrix_b(*factors(chain.rods.mass))
        alpha = q_f(chain.n) @ f
        beta = alpha + f_star - np.diag(stiffness(chain.rods, chain.x)) @ chain.x
        gamma = (np.eye(chain.n) - epsilon(chain.n).T) @ beta
        lam = np.linalg.solve(b.T, gamma)
        eta = np.linalg.solve(b, lam)
        return eta, shift @ eta

    def joints(chain):
        eta, xddot = eta_and_xddot(chain)
        return relative_error(eta, np.cumsum(xddot, 0))

    return max(worst(lambda chain: eta_and_xddot(chain)[1], "xddot"), on_every_chain(joints))


def two_loops(a, b, k, x, f, f_star) -> list:
    """Eq. 30 for one axis, indices from 1; numbers of any kind."""
    n = len(x)
    a, b, k, x, f, f_star = ([None, *values] for values in (a, b, k, x, f, f_star))
    alpha, beta, gamma, lam, eta, xddot = ([None] * (n + 1) for _ in range(6))
    alpha[n] = 0
    beta[n] = alpha[n] + f_star[n] - k[n] * x[n]
    gamma[n] = beta[n]
    lam[n] = gamma[n] / a[n]
    for i in range(n - 1, 0, -1):
        alpha[i] = f[i + 1] + alpha[i + 1]
        beta[i] = alpha[i] + f_star[i] - k[i] * x[i]
        gamma[i] = beta[i] - beta[i + 1]
        lam[i] = (gamma[i] - b[i] * lam[i + 1]) / a[i]
    eta[1] = lam[1] / a[1]
    xddot[1] = eta[1]
    for i in range(1, n):
        eta[i + 1] = (lam[i + 1] - b[i] * eta[i]) / a[i + 1]
        xddot[i + 1] = -eta[i] + eta[i + 1]
    return xddot[1:]


@holds(
    "MW",
    "30",
    "The solution in two loops",
    note="F_{i+1} of Loop 1 is F_{x,i+1}. Loop 1 runs down; typed into MATLAB it needs n-1:-1:1.",
)
def solution_in_two_loops():
    def printed(chain):
        (f, f_star), k = resultants(chain), stiffness(chain.rods, chain.x)
        by_axis = zip(chain.x.T, f.T, f_star.T, strict=True)
        return np.array([two_loops(*factors(chain.rods.mass), k, *axis) for axis in by_axis]).T

    def module(chain):
        return o_n_acceleration(chain.rods, chain.x, *resultants(chain))

    return max(worst(printed, "xddot"), worst(module, "xddot"))


class Counted(float):
    """A number that counts the operations done with it."""

    done = 0


def count(name: str):
    def operation(self, *other):
        Counted.done += 1
        return Counted(getattr(float, name)(self, *other))

    return operation


for name in ("add", "radd", "sub", "rsub", "mul", "rmul", "truediv", "rtruediv", "neg"):
    setattr(Counted, f"__{name}__", count(f"__{name}__"))


@holds(
    "MW",
    "after 30",
    "The solution takes O(n) operations",
    note="Thirteen per rod and axis. The comparison with O(n^3) is not quite fair: M is constant, a dense "
    "solver factors it once and then takes O(n^2) a step; in nodal coordinates it is tridiagonal at once.",
)
def number_of_operations():
    numbers = np.random.default_rng(5)

    def operations(n):
        parts = [[Counted(value) for value in numbers.uniform(1, 2, n)] for _ in range(6)]
        Counted.done = 0
        two_loops(*parts)
        return Counted.done

    sizes = np.array([2, 3, 7, 20, 100])
    return relative_error([operations(n) for n in sizes], 13.0 * sizes - 8.0)
