"""The O(n) acceleration of a rod chain against a dense solution of Lagrange's equations.

The reference shares only the numbers with `rod_chain.py`: T and V of the rods are written in rod vectors
and differentiated, and the equations are solved with a full mass matrix. Chains are random, with one to
seven unequal rods, strains of up to 0.5, and all numbers of order one.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from esail_jax import iteration_matrix
from esail_jax.coordinates import Coordinates
from esail_jax.elements.axial import AxialDissipation, AxialEnergy
from esail_jax.elements.hinges import Hinges
from esail_jax.elements.tether import TetherBatch
from esail_jax.environment.circular_orbit import CircularOrbit
from esail_jax.joints.roots import FrameRoots
from esail_jax.loads.fields import OrbitalField, UniformGravity
from esail_jax.numerics import bordered
from esail_jax.rod_chain import RodChain, RodState
from esail_jax.steppers.consistent import consistent_acceleration
from esail_jax.system import Power, System
from esail_jax.terms import Load, find_term
from support.quick import jit

GRAVITY, MOTION, DAMPING = np.array([0.3, -0.7, 0.2]), 0.6, 0.4


class Shear(Load):
    """The load f = A r + b + c (along the rod), which depends on all fields that a load may depend on."""

    matrix: jax.Array

    name = "shear"
    depends_on = ("r", "r_x")

    def force(self, time, fields, rates):
        r = jnp.tensordot(self.matrix, fields.r, 1)
        return r + fields.r_x * (1.0 + time)


def numbers(n, seed=1):
    """The numbers of the rods and a random state."""
    rng = np.random.default_rng(100 * n + seed)
    data = {key: rng.uniform(0.5, 2.0, n) for key in ("mass", "length", "axial", "bending")}
    direction = rng.normal(size=(3, n + 1))
    direction /= np.linalg.norm(direction, axis=0)
    stretch = 1.0 + rng.choice([-1, 1], n) * rng.uniform(0.15, 0.5, n)
    data["x"] = direction[:, 1:] * data["length"] * stretch
    data["v"] = rng.normal(size=(3, n))
    data["first"], data["first_v"] = direction[:, :1], rng.normal(size=(3, 1))
    data["shear"] = rng.normal(size=(3, 3))
    return data, rng.uniform(0.5, 2.0, 2)


PARTS = {
    "everything": ("gravity", "orbit", "load", "damping", "hinges"),
    "clamped": ("gravity", "hinges", "clamp"),
}
CLAMP = np.array([0.6, 0.0, 0.8])


def package(data, ends, free, parts):
    """The package's chain."""
    column = {key: jnp.asarray(data[key])[:, None] for key in ("mass", "length")}
    axial = jnp.asarray(data["axial"])
    base, tip = (jnp.asarray([end]) for end in ends)
    loads = (Shear(jnp.asarray(data["shear"])),) if "load" in parts else ()
    fields = ("r",) * bool(loads) + ("r_x",)
    tethers = TetherBatch(
        column["length"], column["mass"] / column["length"], tip, data["mass"].size, "rod", fields,
        base if free else None,
    )  # fmt: skip
    damping = ()
    if "damping" in parts:
        damping = (AxialDissipation(axial, jnp.full_like(axial, DAMPING), "engineering"),)
    system = System(
        tethers=tethers,
        roots=None if free else FrameRoots(jnp.eye(3), jnp.zeros(()), jnp.zeros((3, 1)), None),
        hub=None,
        energies=(AxialEnergy(axial, "engineering"),),
        dissipations=damping,
        loads=loads,
        fields=(
            *([UniformGravity(jnp.asarray(GRAVITY))] if "gravity" in parts else []),
            *([OrbitalField(CircularOrbit(jnp.asarray(MOTION)))] if "orbit" in parts else []),
        ),
    )
    hinges = None
    if "hinges" in parts:
        direction = jnp.asarray(CLAMP) if "clamp" in parts else None
        hinges = Hinges.of(jnp.asarray(data["bending"]), jnp.asarray(data["length"]), direction)
    x, v = data["x"], data["v"]
    if free:
        x, v = np.hstack([data["first"], x]), np.hstack([data["first_v"], v])
    chain = jit(RodChain.of)(system, hinges)
    work = Power(jnp.zeros(()), jnp.zeros(())) if chain.has_work else None
    return chain, RodState(jnp.asarray(x), jnp.asarray(v), work)


def judge(data, ends, free, parts, time):
    """The acceleration of the coordinates by Lagrange's equations, and d(T + V)/dt.

    V contains neither loads, nor the field, nor damping.
    """
    n = data["mass"].size
    gauss, weight = np.polynomial.legendre.leggauss(4)
    s, w = (gauss + 1) / 2, weight / 2

    def split(x):
        return (x[:, 0], x[:, 1:]) if free else (jnp.zeros(3), x)

    def ends_of(x):
        first, rods = split(x)
        return jnp.stack([first + rods[:, :i].sum(1) for i in range(n + 1)], axis=1)

    def points(x):
        _, rods = split(x)
        return ends_of(x)[:, :-1, None] + rods[:, :, None] * s

    def kinetic(x, v):
        def energy_of(mass, velocity):
            return 0.5 * mass * (velocity**2).sum(0)

        along = energy_of(data["mass"][:, None] * w, jax.jvp(points, (x,), (v,))[1]).sum()
        joints = jax.jvp(ends_of, (x,), (v,))[1]
        base = ends[0] if free else 0.0
        return along + energy_of(base, joints[:, 0]) + energy_of(ends[1], joints[:, -1])

    def potential(x):
        _, rods = split(x)
        strain = jnp.sqrt((rods**2).sum(0)) / data["length"] - 1
        energy = (0.5 * data["axial"] * data["length"] * strain**2).sum()
        if "hinges" in parts:
            t = rods / data["length"]
            for i in range(n - 1):
                soft = data["length"][i : i + 2] / (2 * data["bending"][i : i + 2])
                energy = energy + 0.5 * ((t[:, i + 1] - t[:, i]) ** 2).sum() / soft.sum()
            if "clamp" in parts:
                soft = data["length"][0] / (2 * data["bending"][0])
                energy = energy + 0.5 * ((t[:, 0] - CLAMP) ** 2).sum() / soft
        return energy

    def masses_at(x):
        """All material points with their masses."""
        r = jnp.concatenate([points(x).reshape(3, -1), ends_of(x)[:, [0, -1]]], axis=1)
        m = np.concatenate([(data["mass"][:, None] * w).ravel(), [ends[0] if free else 0.0, ends[1]]])
        return r, m

    def work_of(x, v, moved):
        """The virtual work of all other forces."""
        (r, m), (there, _) = masses_at(x), masses_at(moved)
        velocity = jax.jvp(lambda y: masses_at(y)[0], (x,), (v,))[1]
        field = jnp.zeros_like(r)
        if "gravity" in parts:
            field = field + GRAVITY[:, None]
        if "orbit" in parts:
            k = jnp.array([0.0, 0.0, MOTION])
            spin = jnp.cross(k, velocity, axisb=0, axisc=0)
            out = jnp.cross(k, jnp.cross(k, r, axisb=0, axisc=0), axisb=0, axisc=0)
            tide = MOTION**2 * jnp.array([2.0, -1.0, -1.0])[:, None] * r
            field = field - 2 * spin - out + tide
        total = (m * (field * (there - r)).sum(0)).sum()
        _, rods = split(x)
        _, ahead = split(moved)
        slope = rods / data["length"]
        if "load" in parts:
            density = jnp.tensordot(data["shear"], points(x), 1) + slope[:, :, None] * (1.0 + time)
            way = points(moved) - points(x)
            total = total + (data["length"][:, None] * w * (density * way).sum(0)).sum()
        if "damping" in parts:
            _, rate = split(v)
            unit = rods / jnp.sqrt((rods**2).sum(0))
            lengthening = (unit * rate).sum(0)
            force = DAMPING * data["axial"] / data["length"] * lengthening
            total = total - (force * (unit * (ahead - rods)).sum(0)).sum()
        return total

    def accelerate(x, v):
        mass = jax.hessian(kinetic, 1)(x, v).reshape(x.size, x.size)
        force = jax.grad(lambda moved: work_of(x, v, moved))(x) - jax.grad(potential)(x)
        return jnp.linalg.solve(mass, force.reshape(-1)).reshape(x.shape)

    return accelerate


@pytest.mark.parametrize("parts, free", [("everything", False), ("everything", True), ("clamped", False)])
@pytest.mark.parametrize("n", [1, pytest.param(2, marks=pytest.mark.nightly), 7])
def test_acceleration_is_that_of_lagranges_equations(n, parts, free):
    """The accelerations agree to rounding; the dense mass matrix has a condition number of some hundred."""
    data, ends = numbers(n)
    chain, state = package(data, ends, free, PARTS[parts])
    found = jit(lambda c, y: c(jnp.asarray(0.7), y).v)(chain, state)
    exact = jit(judge(data, ends, free, PARTS[parts], 0.7))(state.x, state.v)
    np.testing.assert_allclose(found, exact, rtol=0, atol=1e-12 * np.abs(exact).max())


@pytest.mark.parametrize("free", [False, True], ids=["fixed", "free"])
def test_acceleration_is_that_of_truss_elements_in_absolute_coordinates(free):
    """The block-tridiagonal system in absolute joint positions gives the same motion."""
    data, ends = numbers(7)
    chain, state = package(data, ends, free, ("gravity", "orbit", "load", "damping"))
    time = jnp.asarray(0.7)
    found = jit(lambda c, y: c(time, y).v)(chain, state)

    def absolute(chain, state):
        vdot, _ = consistent_acceleration(chain.system, time, *chain.coordinates(state))
        return chain.state(vdot, vdot, None).x

    exact = jit(absolute)(chain, state)
    np.testing.assert_allclose(found, exact, rtol=0, atol=1e-12 * np.abs(exact).max())


@pytest.mark.nightly
@pytest.mark.parametrize("free", [False, True], ids=["fixed", "free"])
def test_power_is_the_rate_of_the_energy(free):
    """d(T + U)/dt is the power of loads and fields minus the dissipated power, along the true motion.

    The power that is integrated beside the state is therefore right; it is also that of `System.residual`.
    """
    data, ends = numbers(5)
    chain, state = package(data, ends, free, ("gravity", "orbit", "load", "damping"))
    zero = jnp.zeros(())

    def energy(y):
        q, v = chain.coordinates(y)
        tethers = chain.system.tethers
        axial = find_term(chain.system.energies, AxialEnergy)
        stored = chain.system.integrate(axial.density(tethers.interpolate(q.tether)))
        return 0.5 * (v.tether * tethers.inertia(v.tether)).sum() + stored

    rate = chain(zero, state)
    change = jit(lambda y, d: jax.jvp(energy, (y,), (d,))[1])(state, rate._replace(work=state.work))
    np.testing.assert_allclose(change, rate.work.external - rate.work.dissipated, rtol=1e-12)
    q, v = chain.coordinates(state)
    rest = jax.tree.map(jnp.zeros_like, q)
    _, power = chain.system.residual(zero, q, v, rest, chain.system.no_multipliers())
    np.testing.assert_allclose(rate.work.external, power.external, rtol=1e-12)
    np.testing.assert_allclose(rate.work.dissipated, power.dissipated, rtol=1e-12)


def test_positions_and_rod_vectors_are_each_others_inverse():
    data, ends = numbers(5)
    for free in (False, True):
        chain, state = package(data, ends, free, ())
        again = chain.state(*chain.coordinates(state), None)
        np.testing.assert_allclose(again.x, state.x, atol=1e-14)
        np.testing.assert_allclose(again.v, state.v, atol=1e-14)
        joints = np.asarray(chain.coordinates(state)[0].tether[0, :, :, 0])
        first = data["first"][:, 0] if free else np.zeros(3)
        np.testing.assert_allclose(joints[:, -1], first + data["x"].sum(1), atol=1e-14)


def test_an_anchor_at_rest_in_orbit_is_an_anchor_in_the_turning_axes():
    """A vertical rod from the reference point carries the tidal force of the mass at its end."""
    data, ends = numbers(1)
    chain, _ = package(data, ends, False, ("orbit",))
    up = jnp.array([[2.0], [0.0], [0.0]])
    stretch = 2.0 / data["length"][0] - 1
    force = -data["axial"][0] * stretch + 3 * MOTION**2 * 2.0 * (data["mass"][0] / 3 + ends[1])
    acceleration = chain(jnp.zeros(()), RodState(up, 0 * up, None)).v
    np.testing.assert_allclose(
        acceleration[:, 0], [force / (data["mass"][0] / 3 + ends[1]), 0.0, 0.0], atol=1e-12
    )


def test_coordinates_keep_the_layout_of_the_system():
    data, ends = numbers(3)
    chain, state = package(data, ends, False, ())
    q, _ = chain.coordinates(state)
    assert isinstance(q, Coordinates) and q.tether.shape == (1, 3, 4, 1)


@pytest.mark.parametrize("free", [False, True], ids=["fixed", "free"])
def test_tangent_of_the_implicit_method_is_the_derivative_of_the_residual(free):
    """M + s (K + c C) is the derivative of the residual, with loads, damping and the field of an orbit.

    The field depends on position and velocity. The free port and its mass are included.
    """
    data, ends = numbers(5)
    chain, state = package(data, ends, free, ("gravity", "orbit", "load", "damping"))
    system, time, s, c = chain.system, jnp.asarray(0.3), jnp.asarray(0.05), jnp.asarray(7.0)
    q, v = chain.coordinates(state)
    rng = np.random.default_rng(5)
    change = rng.normal(size=q.tether.shape)
    change[:, :, 0] *= free
    change = Coordinates(jnp.asarray(change), None)
    none = system.no_multipliers()

    def derivative(system, q, v, change):
        moved = jax.tree.map(lambda d: s * d, change), jax.tree.map(lambda d: s * c * d, change), change
        start = (q, v, jax.tree.map(jnp.zeros_like, q))
        return jax.jvp(lambda *x: system.residual(time, *x, none)[0].forces, start, moved)[1]

    def solved(system, q, v, change):
        matrix = iteration_matrix.tangent(system, time, q, v, none, s, c)
        rhs = iteration_matrix.to_vector(system, derivative(system, q, v, change), none)
        return iteration_matrix.from_vector(system, bordered.solve(matrix, bordered.factor(matrix), rhs))[0]

    found = jit(solved)(system, q, v, change)
    np.testing.assert_allclose(found.tether, change.tether, atol=1e-10)
