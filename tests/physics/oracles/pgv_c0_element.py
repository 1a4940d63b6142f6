"""One cable element on random states: the printed forms' ingredients, and the judge.

Printed forms are NumPy with matrices as they stand: e is 12 x 1, a derivative of a scalar by e is a
row (1 x 12) as [PGV] Eq. 25, 88 and 103 have it, a scalar is 1 x 1. Where the print adds a scalar to a
matrix, it is added to every entry, as NumPy and MATLAB do. The judge is automatic differentiation of
the package's densities at the package's Gauss points, and the package's own forces and tangent.
"""

import functools
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from esail_jax import iteration_matrix
from esail_jax.coordinates import Coordinates, Multipliers
from esail_jax.elements.axial import AxialDissipation, AxialEnergy, axial_strain
from esail_jax.elements.bending import BendingDissipation, BendingEnergy, curvature_squared
from esail_jax.elements.tether import TetherBatch
from esail_jax.joints.roots import FrameRoots
from esail_jax.numerics.vectors import dot
from esail_jax.point_fields import PointFields, invariants_of
from esail_jax.system import System
from esail_jax.terms import SummedDeformations, find_term
from oracles.ledger import relative_error

GAUSS = 5
"""Points per element: exact for the axial terms; the rational bending ones take the package's number."""

STATES = 5


class Cable(NamedTuple):
    """An element and its state. axial EA [N], bending EI [N m^2], the two damping times [s]."""

    e: np.ndarray
    v: np.ndarray
    length: float
    axial: float
    bending: float
    axial_time: float
    bending_time: float


class Point(NamedTuple):
    """A point of an element: e, de/dt (12 x 1); S_x, S_xx (3 x 12) of [PGV] Eq. 17-18."""

    e: np.ndarray
    v: np.ndarray
    s_x: np.ndarray
    s_xx: np.ndarray

    @property
    def a(self):
        """S_x^T S_x."""
        return self.s_x.T @ self.s_x

    @property
    def b(self):
        """S_xx^T S_xx."""
        return self.s_xx.T @ self.s_xx

    @property
    def c(self):
        """S_x^T S_xx."""
        return self.s_x.T @ self.s_xx


def shape_derivatives(xi: float, length: float) -> tuple[np.ndarray, np.ndarray]:
    """S_x and S_xx, Eq. 18 differentiated by hand."""
    first = [6 * xi**2 - 6 * xi, length * (1 - 4 * xi + 3 * xi**2), 6 * xi - 6 * xi**2]
    first.append(length * (3 * xi**2 - 2 * xi))
    second = [12 * xi - 6, length * (6 * xi - 4), 6 - 12 * xi, length * (6 * xi - 2)]
    rows = np.array(first)[None] / length, np.array(second)[None] / length**2
    return np.kron(rows[0], np.eye(3)), np.kron(rows[1], np.eye(3))


def points(cable: Cable) -> list[Point]:
    """The Gauss points of an element."""
    nodes = (np.polynomial.legendre.leggauss(GAUSS)[0] + 1) / 2
    return [Point(cable.e, cable.v, *shape_derivatives(xi, cable.length)) for xi in nodes]


def integral(cable: Cable, integrand: Callable[[Point], np.ndarray]) -> np.ndarray:
    """Integral over 0 ... l of a function of a point."""
    weights = np.polynomial.legendre.leggauss(GAUSS)[1] * cable.length / 2
    return sum(w * integrand(p) for w, p in zip(weights, points(cable), strict=True))


@functools.cache
def cables() -> tuple[Cable, ...]:
    """Bent by a radian and more, twisted, stretched, moving; every number of order one."""
    rng = np.random.default_rng(2023)
    found = []
    for _ in range(STATES):
        length, turn = rng.uniform(0.7, 1.5), rng.uniform(0.8, 1.6)
        left, right = ([np.cos(angle), np.sin(angle), 0.0] for angle in (-turn / 2, turn / 2))
        chord = [length * np.sinc(turn / 2 / np.pi), 0.0, 0.0]
        e = 1.2 * np.concatenate([np.zeros(3), left, chord, right]) + 0.1 * rng.normal(size=12)
        numbers = rng.uniform(0.5, 2.0, size=4)
        found.append(Cable(e[:, None], rng.normal(size=(12, 1)), length, *numbers))
    return tuple(found)


def system_of(length, axial, bending, axial_time, bending_time) -> System:
    """One tether of one element with the four material terms, its bending damping as printed."""
    one = jnp.ones(1)
    tethers = TetherBatch(length * one, one, 0.0 * one, 1, "cable", ("r_x", "r_xx"))
    energies = AxialEnergy(axial * one, "green-lagrange"), BendingEnergy(bending * one)
    dissipations = (
        AxialDissipation(axial * one, axial_time * one, "green-lagrange"),
        BendingDissipation(bending * one, bending_time * one, 0.0 * one),
    )
    roots = FrameRoots(jnp.eye(3), jnp.zeros(()), jnp.zeros((3, 1)), None)
    return System(tethers, roots, None, energies, dissipations, ())


def nodal(e):
    """(12,) as the package keeps it: (coef, xyz, node, tether)."""
    return e.reshape(2, 2, 3).transpose(1, 2, 0)[..., None]


def judge_of_points(system: System, e, v) -> dict:
    """Strain, curvature, Phi_1 and Phi_2 at the Gauss points, and all their derivatives."""
    names = "strain", "kappa", "phi1", "phi2"

    def quantities(e):
        fields = system.tethers.interpolate(nodal(e))
        shape = invariants_of(fields)
        stretch, squared = shape.stretch_squared, curvature_squared(shape)
        strain = axial_strain(stretch, "green-lagrange")
        return jnp.stack([strain, jnp.sqrt(squared), squared * stretch**3, stretch])[:, :, 0]

    def rate(e, v):
        return jax.jvp(quantities, (e,), (v,))[1]

    all_of = {
        "": quantities(e)[..., None, None],
        "_e": jax.jacfwd(quantities)(e)[..., None, :],
        "_ee": jax.hessian(quantities)(e),
        "_t": rate(e, v)[..., None, None],
        "_t_e": jax.jacfwd(rate)(e, v)[..., None, :],
        "_t_v": jax.jacfwd(rate, 1)(e, v)[..., None, :],
        "_t_v_e": jax.jacfwd(jax.jacrev(rate, 1))(e, v),
    }
    found = {name + end: values[i] for end, values in all_of.items() for i, name in enumerate(names)}
    fields = system.tethers.interpolate(nodal(e))
    slopes, seconds = fields.r_x[:, :, 0].T, fields.r_xx[:, :, 0].T
    engineering = axial_strain(dot(slopes.T, slopes.T), "engineering")[:, None, None]

    @jax.vmap
    def half_hessian(slope, second):
        """The matrix of Phi_1, which is a quadratic form in r_xx."""

        def half(w):
            return (
                0.5 * curvature_squared(invariants_of(PointFields(None, slope, w))) * dot(slope, slope) ** 3
            )

        return jax.hessian(half)(second)

    found |= {"engineering": engineering, "phi1_matrix": half_hessian(slopes, seconds)}
    return found | {"cross": jnp.cross(slopes, seconds)[:, :, None]}


def judge_of_element(system: System, e, v) -> dict:
    """Energies U, dissipation functions R, generalised forces and 12 x 12 Jacobians of each term."""
    interpolate = system.tethers.interpolate

    def energies(e):
        densities = [term.density(interpolate(nodal(e))) for term in system.energies]
        return jnp.stack([system.integrate(density) for density in densities])

    def rayleigh(e, v):
        at = interpolate(nodal(e)), interpolate(nodal(v))
        return jnp.stack([system.integrate(term.density(*at)) for term in system.dissipations])

    viscous = jax.jacrev(rayleigh, 1)
    all_of = {
        "U_{}": energies(e)[:, None, None],
        "Q_e{}": -jax.jacrev(energies)(e)[..., None],
        "Q_e{}_e": -jax.hessian(energies)(e),
        "R_{}": rayleigh(e, v)[:, None, None],
        "Q_d{}": -viscous(e, v)[..., None],
        "Q_d{}_e": -jax.jacfwd(viscous)(e, v),
        "Q_d{}_v": -jax.jacfwd(viscous, 1)(e, v),
    }
    return {name.format(end): values[i] for name, values in all_of.items() for i, end in enumerate("xb")}


def judge_of_system(system: System, e, v) -> dict:
    """The package's assembled forces, tangent, dissipated power and stress resultants."""
    tethers, time = system.tethers, jnp.zeros(())
    fields, rates = tethers.interpolate(nodal(e)), tethers.interpolate(nodal(v))
    total, _, _ = system.point_forces(time, fields, rates)
    viscous = SummedDeformations(system.dissipations).point_forces(time, fields, rates)

    def generalised(conjugates):
        return -tethers.nodal_forces(conjugates)[..., 0].transpose(2, 0, 1).reshape(12, 1)

    def at_points(field):
        return field[:, :, 0].T[:, :, None]

    axial = find_term(system.energies, AxialEnergy), find_term(system.dissipations, AxialDissipation)
    elastic = jax.tree.map(jnp.subtract, total, viscous)
    in_metres = jnp.repeat(jnp.tile(jnp.stack([jnp.ones(()), tethers.element_length[0]]), 2), 3)

    @jax.vmap
    def jacobian(moving, rate_factor):
        """Elastic alone at rest; with the viscous dQ/de; with dQ/de + dQ/dv."""
        moved = jax.tree.map(lambda x: moving * x, rates)
        blocks = iteration_matrix.point_jacobian(system, time, fields, moved, rate_factor)
        return -tethers.tangent_elements(blocks)[..., 0, 0] * in_metres[:, None] * in_metres

    at_rest, by_e, by_both = jacobian(jnp.array([0.0, 1.0, 1.0]), jnp.array([0.0, 0.0, 1.0]))
    zero = Coordinates(0.0 * nodal(e), None)
    q, rate = Coordinates(nodal(e), None), Coordinates(nodal(v), None)
    _, power = system.residual(time, q, rate, zero, Multipliers(None, None))
    return {
        "Q_e": generalised(elastic),
        "Q_d": generalised(viscous),
        "Q_e_e": at_rest,
        "Q_d_e": by_e - at_rest,
        "Q_d_v": by_both - by_e,
        "power": power.dissipated[None, None],
        "r_x": at_points(fields.r_x),
        "r_xx": at_points(fields.r_xx),
        "n": at_points(sum(term.point_forces(time, fields, rates).r_x for term in axial)),
        "m": at_points(total.r_xx),
    }


# Called a few times only: optimising the compiled code would take longer than it saves.
@functools.partial(jax.jit, compiler_options={"xla_backend_optimization_level": 0})
@jax.vmap
def judge_of(e, v, numbers) -> dict:
    """Everything, of one state each."""
    system = system_of(*numbers)
    parts = judge_of_points(system, e, v), judge_of_element(system, e, v), judge_of_system(system, e, v)
    return parts[0] | parts[1] | parts[2]


def judged(states: tuple[Cable, ...]) -> dict:
    """The judge's values, by name: (state, [point,] row, column)."""
    e, v = (np.stack([getattr(s, k)[:, 0] for s in states]) for k in "ev")
    return jax.tree.map(np.asarray, judge_of(e, v, np.array([s[2:] for s in states])))


@functools.cache
def judge() -> dict:
    """The same on the random states."""
    return judged(cables())


def element_error(form: Callable[[Cable], np.ndarray], truth: str) -> float:
    """Largest relative error over the states of something of an element."""
    pairs = zip(cables(), judge()[truth], strict=True)
    return max(relative_error(form(cable), value) for cable, value in pairs)


def point_error(form: Callable[[Point], np.ndarray], truth: str) -> float:
    """Largest relative error over the states of something of a point."""
    pairs = zip(cables(), judge()[truth], strict=True)
    return max(relative_error([form(p) for p in points(cable)], values) for cable, values in pairs)


@functools.cache
def straight_cables() -> tuple[Cable, ...]:
    """The same elements along x, stretched and straight, with their velocities."""
    found = []
    for cable in cables():
        e = 1.2 * np.array([0, 0, 0, 1, 0, 0, cable.length, 0, 0, 1, 0, 0.0])
        found.append(cable._replace(e=e[:, None]))
    return tuple(found)


def defined(error: float) -> float:
    """An error, infinite where the form gave no number."""
    return error if np.isfinite(error) else float("inf")


def derivative(function: Callable[[np.ndarray], np.ndarray], at: np.ndarray) -> np.ndarray:
    """Row of derivatives of a scalar by the complex step, exact to rounding."""
    steps = 1e-30j * np.eye(12)[:, :, None]
    return np.array([[function(at + step).imag.item() * 1e30 for step in steps]])
