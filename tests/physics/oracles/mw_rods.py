"""The right forms of [MW] for a chain of elastic rods from a fixed point, in plain NumPy.

Coordinates are the rod vectors x_i = O_{i-1} O_i, arrays (rod, xyz). A rod stays straight and is strained
evenly; its energy is EA (|x| - l)^2 / (2 l). `o_n_acceleration` is the paper's Eq. 27 and 30.
`lagrange_acceleration` shares nothing with it: it differentiates T and V automatically and solves a dense
system.
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

QUICKLY = {"xla_backend_optimization_level": 0}
"""Every program runs once or twice: compiling is all it costs."""

POINTS = np.polynomial.legendre.leggauss(3)
"""Three Gauss points per rod: exact for a velocity that is linear along it and a load quadratic in it."""


class Rods(NamedTuple):
    """mass [kg], undeformed length [m] and EA [N] of every rod, the held one first."""

    mass: np.ndarray
    length: np.ndarray
    axial: np.ndarray


# ---- matrices -------------------------------------------------------------------------------------


def mass_matrix(m: np.ndarray) -> np.ndarray:
    """M of one axis (Eq. 8): m_i/3 on the diagonal, m_j/2 beside it (j the outer rod), and in both all
    mass farther out."""
    i, j = np.indices((len(m), len(m)))
    outer = np.maximum(i, j)
    beyond = np.cumsum(m[::-1])[::-1] - m
    return np.where(i == j, m[outer] / 3, m[outer] / 2) + beyond[outer]


def g_matrix(m: np.ndarray) -> np.ndarray:
    """G of M = Phi^T G Phi (Eq. 24): tridiagonal, (m_i + m_{i+1})/3 and m_{i+1}/6. It is the mass matrix
    in the positions of the joints."""
    following = np.append(m[1:], 0.0)
    return np.diag((m + following) / 3) + np.diag(m[1:] / 6, 1) + np.diag(m[1:] / 6, -1)


def factors(m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Diagonal a and subdiagonal b of the lower bidiagonal B in G = B^T B (Eq. 27), for any n."""
    n = len(m)
    a, b = np.zeros(n), np.zeros(n)  # the last b is that of no rod
    for i in reversed(range(n)):
        following = m[i + 1] if i + 1 < n else 0.0
        a[i] = np.sqrt((m[i] + following) / 3 - b[i] ** 2)
        if i:
            b[i - 1] = m[i] / (6 * a[i])
    return a, b[:-1]


# ---- forces ---------------------------------------------------------------------------------------


def stiffness(rods: Rods, x: np.ndarray) -> np.ndarray:
    """k_i of the elastic force -k_i x_i (Eq. 12); negative in a rod shorter than undeformed."""
    return rods.axial / rods.length - rods.axial / np.linalg.norm(x, axis=-1)


def load_resultants(load: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """F and F* (Eq. 14) of forces per current length f = sum_p load[rod, p] s^p, s = 0 ... 1 along a rod:
    the whole force, and its share at the rod's outer end. Arrays (rod, xyz)."""
    current = np.linalg.norm(x, axis=-1)[:, None]
    powers = np.arange(load.shape[1])[:, None]
    return current * (load / (powers + 1)).sum(1), current * (load / (powers + 2)).sum(1)


def weight(mass: np.ndarray, gravity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """F and F* of uniform gravity."""
    return mass[:, None] * gravity, mass[:, None] * gravity / 2


def energies(rods: Rods, x: np.ndarray, v: np.ndarray) -> tuple[float, float]:
    """Kinetic (Eq. 6) and elastic energy (Eq. 10, second line)."""
    kinetic = 0.5 * np.einsum("ix,ij,jx->", v, mass_matrix(rods.mass), v)
    excess = np.linalg.norm(x, axis=-1) - rods.length
    return kinetic, (0.5 * rods.axial / rods.length * excess**2).sum()


# ---- accelerations --------------------------------------------------------------------------------


def o_n_acceleration(rods: Rods, x: np.ndarray, force: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Accelerations of the rod vectors (Eq. 30), all axes at once. force, share: F and F*."""
    n, (a, b), k = len(x), factors(rods.mass), stiffness(rods, x)
    lam, eta, xddot = np.zeros_like(x), np.zeros_like(x), np.zeros_like(x)
    alpha, beyond = np.zeros(3), np.zeros(3)
    for i in reversed(range(n)):
        beta = alpha + share[i] - k[i] * x[i]
        lam[i] = (beta - beyond) / a[i]
        if i + 1 < n:
            lam[i] -= b[i] * lam[i + 1] / a[i]
        alpha, beyond = alpha + force[i], beta
    for i in range(n):
        before = b[i - 1] * eta[i - 1] if i else 0.0
        eta[i] = (lam[i] - before) / a[i]
        xddot[i] = eta[i] - (eta[i - 1] if i else 0.0)
    return xddot


def positions(x, s):
    """Points at fractions s of every rod: (rod, point, xyz)."""
    ends = jnp.cumsum(x, 0)
    return (ends - x)[:, None] + s[:, None] * x[:, None]


def rod_energies(rods: Rods, x, v):
    """Kinetic and elastic energy of every rod: an integral over its mass, and engineering strain."""
    s, w = (POINTS[0] + 1) / 2, POINTS[1] / 2
    velocity = jax.jvp(lambda y: positions(y, s), (x,), (v,))[1]
    strain = jnp.sqrt((x**2).sum(-1)) / rods.length - 1
    kinetic = 0.5 * rods.mass * jnp.einsum("p,ipx,ipx->i", w, velocity, velocity)
    return kinetic, 0.5 * rods.axial * rods.length * strain**2


def virtual_work(load, x, moved):
    """Work of the forces at x on the way from there to `moved`, linear in the way; `load` as in
    `load_resultants`."""
    s, w = (POINTS[0] + 1) / 2, POINTS[1] / 2
    density = jnp.einsum("irx,pr->ipx", load, s[:, None] ** np.arange(3))
    current = jnp.sqrt((x**2).sum(-1))
    way = positions(moved, s) - positions(x, s)
    return jnp.einsum("i,p,ipx,ipx->", current, w, density, way)


def lagrange_parts(kinetic, elastic, force, x, v, a) -> dict:
    """The parts of d/dt(dL/dv) - dL/dx = Q, L = T(x, v) - V(x, v), for any such functions and Q(x), and
    the rate of all forces."""

    def part(energy):
        momentum = jax.grad(energy, 1)
        return jax.jvp(momentum, (x, v), (v, a))[1] - jax.grad(energy)(x, v)

    def forces(x):
        return force(x) - jax.grad(elastic)(x, v)

    forces_at_x, rate = jax.jvp(forces, (x,), (v,))
    return {
        "T": kinetic(x, v),
        "V": elastic(x, v),
        "inertial": part(kinetic),
        "elastic": part(elastic),
        "Q": force(x),
        "M": jax.hessian(kinetic, 1)(x, v),
        "forces": forces_at_x,
        "forces_rate": rate,
    }


def lagrange_direct(rods: Rods, x, v, a, load) -> dict:
    """`lagrange_parts` of straight rods."""
    return lagrange_parts(
        lambda x, v: rod_energies(rods, x, v)[0].sum(),
        lambda x, v: rod_energies(rods, x, v)[1].sum(),
        lambda x: jax.grad(virtual_work, 2)(load, x, x),
        x,
        v,
        a,
    )


def dense_solution(mass: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """Accelerations (rod, xyz) from M (rod, xyz, rod, xyz), all coordinates at once."""
    return np.linalg.solve(mass.reshape(forces.size, -1), forces.reshape(-1)).reshape(forces.shape)


@functools.cache
def compiled_lagrange():
    """One program per number of rods."""

    def parts(rods, x, v, load):
        found = lagrange_direct(rods, x, v, 0.0 * x, load)
        return found["M"], found["forces"] - found["inertial"]

    return jax.jit(parts, compiler_options=QUICKLY)


def lagrange_acceleration(rods: Rods, x: np.ndarray, v: np.ndarray, load: np.ndarray) -> np.ndarray:
    """Accelerations of the rod vectors by automatic differentiation. load (rod, power, xyz): as in
    `load_resultants`, three powers; gravity is mass[:, None] * gravity / |x| in the first."""
    return dense_solution(*(np.asarray(part) for part in compiled_lagrange()(rods, x, v, load)))
