"""[MW] Eq. 31-32, and claims of the text about the model and both experiments.

The judges are the truss elements, Dormand and Prince's method (MATLAB's ode45) on an oscillator, and
closed forms.
"""

import jax.numpy as jnp
import numpy as np

from esail_jax.elements.tether import TetherBatch
from oracles.ledger import Errors, fails, holds, relative_error
from oracles.mw_chains import SIZES, chains, judge
from oracles.mw_rods import Rods, energies, g_matrix, mass_matrix

GRAVITY = 9.81
FIRST = Rods(np.full(20, 0.1), np.ones(20), np.full(20, 1e9 * 1e-6))
"""First experiment: 0.1 kg, 1 m, 1 GPa on 1 mm^2."""
SECTION = np.pi * 0.001**2
SECOND = Rods(np.full(11, 7801 * SECTION * 0.1), np.full(11, 0.1), np.full(11, 207e9 * SECTION))
"""Second experiment: steel, 0.1 m long, radius 1 mm."""


def straight_down(rods: Rods) -> np.ndarray:
    """Undeformed along -Y."""
    return -rods.length[:, None] * np.array([0.0, 1.0, 0.0])


@holds(
    "MW",
    "Sec. 2 joints",
    "A chain of n rods connected by n+1 joints",
    note="Counting the free end, where nothing is joined: n hinges hold, and 3n coordinates remain.",
)
def joints_and_coordinates():
    """6n coordinates of rod ends less the independent conditions of the hinges."""
    remaining = []
    for n in SIZES:
        # Rows: joints; columns: rod ends in order. The fixed point is a number, the last joint has no row.
        conditions = np.zeros((n + 1, 2 * n))
        for j in range(n):
            conditions[j, 2 * j] = 1.0
            if j:
                conditions[j, 2 * j - 1] = -1.0
        remaining.append(6 * n - 3 * np.linalg.matrix_rank(conditions))
    return relative_error(remaining, 3 * np.array(SIZES))


@holds("MW", "Sec. 3 conservative", "A conservative system: the loads' power is all that changes T + V")
def energy_is_kept():
    """Power of inertial and elastic terms against that of the loads, at accelerations that fit."""
    errors = []
    for n in SIZES:
        for chain, found in zip(chains(n), judge(n), strict=True):
            for k in (0, 1):
                kinetic = np.einsum("ix,ixjy,jy->", chain.v, found["M"][k], found["xddot"][k])
                elastic = -(chain.v * found["elastic"][k]).sum()
                power = (chain.v * found["Q"][1 - k]).sum()
                errors.append(abs(kinetic + elastic - power) / max(abs(kinetic), abs(elastic), abs(power)))
    return max(errors)


# ---- first experiment -----------------------------------------------------------------------------


@holds(
    "MW",
    "Sec. 3.1 spin",
    "Rates of 1 m/s along X turn the tether with 1 rad/s about Z",
    note='"Stretched in Y direction" means laid out along -Y: the rods are not strained.',
)
def initial_spin():
    x = straight_down(FIRST)
    assert energies(FIRST, x, x)[1] == 0.0
    return relative_error(np.tile([1.0, 0.0, 0.0], (20, 1)), np.cross([0.0, 0.0, 1.0], x))


def first_energies() -> tuple[float, float]:
    """Kinetic energy at the start, and that of gravity along the tether, zero at the held end."""
    x, g = straight_down(FIRST), np.array([0.0, -GRAVITY, 0.0])
    heights = np.cumsum(x, 0) - x / 2
    v = np.tile([1.0, 0.0, 0.0], (20, 1))
    return energies(FIRST, x, v)[0], -(FIRST.mass[:, None] * heights * g).sum()


@holds(
    "MW",
    "Sec. 3.1 scales",
    "Kinetic and potential energy are in similar scales",
    tolerance=0.5,
    note="133.3 J of motion at the start, 196.2 J of gravity from horizontal to hanging.",
)
def scales_of_energy():
    """The difference is in powers of ten; up to a half counts as the same order."""
    motion, gravity = first_energies()
    assert relative_error([motion, -gravity], [133.33, 196.2]) < 5e-5
    return abs(np.log10(motion / -gravity))


@holds(
    "MW",
    "31",
    "Relative error of the total energy",
    note="It is relative to an energy whose zero is not stated: with gravity's zero at the held end E(t_0) "
    "is -62.9 J if gravity points along the tether, 133.3 J if across; 6e-6 of it, 0.4 mJ or 0.8 mJ.",
)
def relative_energy_error():
    """The printed error is right for a known change: all rates larger by a thousandth."""
    motion, gravity = first_energies()
    assert relative_error(motion + gravity, -62.87) < 1e-4
    x, v = straight_down(FIRST), np.tile([1.0, 0.0, 0.0], (20, 1))
    changed = energies(FIRST, x, 1.001 * v)[0] + gravity
    printed = (changed - (motion + gravity)) / (motion + gravity)
    # A difference of energies 1e-3 apart: 1e-13 is lost.
    return relative_error(printed, motion * (1.001**2 - 1) / (motion + gravity))


# ---- second experiment ----------------------------------------------------------------------------


def dormand_prince(z: complex) -> complex:
    """Factor of one step of the fifth-order method for x' = (z / step) x."""
    return 1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24 + z**5 / 120 + z**6 / 600


def fastest(rods: Rods) -> float:
    """Highest frequency [rad/s] of equal rods in a straight line, undeformed: waves on a chain of
    two-node bars, w^2 = 6 EA (1 - cos p) / (m l (2 + cos p)), the last but half of n wave numbers."""
    n = len(rods.mass)
    p = (2 * n - 1) * np.pi / (2 * n)
    rate = rods.axial[0] / (rods.mass[0] * rods.length[0])
    squared = 6 * rate * (1 - np.cos(p)) / (2 + np.cos(p))
    lowest_mass = np.linalg.eigvalsh(mass_matrix(rods.mass)).min()
    assert relative_error(rods.axial[0] / rods.length[0] / lowest_mass, squared) < 1e-10
    return np.sqrt(squared)


@fails(
    "MW",
    "Sec. 3.2 time step",
    "Time step of the second experiment, with ode45",
    printed='"the time step is still 0.0001 s"',
    right="0.0001 s between outputs; steps of at most 5.6e-6 s",
    consequence="The steel rods' axial motion, up to 1.8e5 rad/s, leaves no explicit Runge-Kutta step of "
    "1e-4 s: ode45's formula would multiply it by 4.9e4 in each. One second takes 180 000 steps or more. "
    "The first experiment's fastest motion is 346 rad/s, and steps up to 2.8e-3 s are stable there.",
)
def time_step():
    """Growth of the fastest axial motion in one step; right: just inside the limit, and the limit is
    where it is said to be."""
    first, second = fastest(FIRST), fastest(SECOND)
    assert relative_error([first, second], [345.6, 1.771e5]) < 2e-4

    def growth(frequency, step):
        return max(0.0, abs(dormand_prince(1j * frequency * step)) - 1)

    assert growth(second, 5.7e-6) > 0.0 and growth(first, 2.9e-3) > 0.0
    return Errors(growth(second, 1e-4), max(growth(second, 5.6e-6), growth(first, 2.8e-3)))


@holds("MW", "Sec. 3.2 length", "8e-3 m is less than 1 % of the tether's length", note="0.73 % of 1.1 m.")
def location_error_over_length():
    share = 8e-3 / SECOND.length.sum()
    assert round(1e4 * share) == 73
    return max(0.0, share - 0.01)


@holds("MW", "32", "Location error of the free end")
def location_error():
    """Distance between the free ends of two tethers, each the sum of its rod vectors."""
    errors = []
    for n in SIZES:
        one, other = (chain.x.sum(0) for chain in chains(n))
        truth = [found["points"][1, -1, -1] for found in judge(n)]
        printed = np.sqrt(((one - other) ** 2).sum())
        errors.append(relative_error(printed, np.linalg.norm(truth[0] - truth[1])))
    return max(errors)


# ---- conclusions ----------------------------------------------------------------------------------


@holds(
    "MW",
    "Sec. 4 element",
    "The rod can be regarded as a special kind of low order finite element",
    note="It is the two-node truss, nothing else: G is its assembled mass matrix, and the accelerations "
    "are the same (Eq. 21). So finite elements do deal with large rigid motion here.",
)
def rod_is_a_truss_element():
    """Textbook element, m/6 (2 1; 1 2), assembled; and the package's."""
    errors, element = [], np.array([[2.0, 1.0], [1.0, 2.0]]) / 6
    one = jnp.ones(1)
    package = TetherBatch(one, one, 0.0 * one, 1, "truss", ("r_x",)).mass_table
    for n in SIZES:
        for chain in chains(n):
            for matrix in (element, package):
                assembled = np.zeros((n + 1, n + 1))
                for i in range(n):
                    assembled[i : i + 2, i : i + 2] += chain.rods.mass[i] * matrix
                errors.append(relative_error(assembled[1:, 1:], g_matrix(chain.rods.mass)))
    return max(errors)


@fails(
    "MW",
    "Sec. 4 bending",
    "From what terms for flexural rigidity could be derived",
    printed="the second derivative of the spatial vectors (the rod vectors, as defined in Sec. 2)",
    right="their first differences: a rod vector is itself the first difference of positions",
    consequence="Of a circle of radius R the second differences give 1/R^2 in place of the curvature 1/R.",
)
def curvature_from_rods():
    """Rods of length l as chords of a circle; the differences of their directions are exact."""
    radius, turn = 2.5, 0.3
    angles = turn * np.arange(6)
    rods = np.diff(radius * np.stack([np.cos(angles), np.sin(angles)], 1), axis=0)
    length = np.linalg.norm(rods[0])
    directions = rods / length
    first, second = (np.linalg.norm(np.diff(directions, k, axis=0), axis=1) / length**k for k in (1, 2))
    return Errors(relative_error(second[0], 1 / radius), relative_error(first, np.full(4, 1 / radius)))
