"""Rod chains at rest and in small vibration: bending, tension-only rods, equilibrium in orbit."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq

from esail_jax.elements.axial import AxialEnergy, TensionOnlyEnergy
from esail_jax.point_fields import PointFields
from esail_jax.rod_chain import RodState, fastest_rate
from esail_jax.scenes.build import build_chain
from esail_jax.scenes.loading import parse
from esail_jax.scenes.structure import split
from support.quick import jit

BEAM = """
[chain]
rods = {n}
mass = {mass}
length = {length}
area = 1.0
youngs_modulus = 1e4
second_moment = 1e-4
bending = true
root = "clamped"
tip_mass = {tip}
[gravity]
acceleration = [0.0, {weight}, 0.0]
[initial]
rod_vector = [{length}, 0.0, 0.0]
[integrator]
t_end = 1.0
"""
"""A cantilever along x of length 1 m with EI = 1 N m^2. With EA = 1e4 N its stretch is negligible."""


def built(text, overrides=None):
    """The chain and the initial state of a scene."""
    scene = parse(text, "test")
    scene = scene.replace(overrides or {})
    structure, numbers = split(scene)
    return build_chain(structure, numbers)


def beam(n, mass=1.0, tip=0.0, weight=0.0):
    return built(BEAM.format(n=n, mass=mass / n, length=1.0 / n, tip=tip, weight=weight))


@jit
def newton(chain, x):
    """The state after one dense Newton step towards rest."""

    def acceleration(flat):
        return chain(jnp.zeros(()), RodState(flat.reshape(x.shape), 0 * x, None)).v.reshape(-1)

    flat = x.reshape(-1)
    change = jnp.linalg.solve(jax.jacfwd(acceleration)(flat), acceleration(flat))
    return (flat - change).reshape(x.shape)


def at_rest(chain, x, steps=8):
    for _ in range(steps):
        x = newton(chain, x)
    return np.asarray(x)


def test_cantilever(validate):
    """A force at the tip deflects it by F L^3 / (3 EI).

    The deflection, 1e-4 of the length, is small enough to be linear. Springs between rods have an error of
    second order, so that n = 8 and 16 are extrapolated.
    """
    deflection = []
    for n in (8, 16):
        chain, state = beam(n, mass=1e-9, tip=1.0, weight=3e-4)
        deflection.append(at_rest(chain, state.x)[1].sum())
    coarse, fine = (d / 1e-4 - 1.0 for d in deflection)
    np.testing.assert_allclose(coarse / fine, 4.0, rtol=0.01)
    validate(
        "ROD-1", "cantilever of rods", "F L^3 / (3 EI)", "deflection, n = 8, 16 extrapolated",
        abs((4.0 * fine - coarse) / 3.0), 1e-6,
    )  # fmt: skip


@pytest.mark.nightly
def test_large_deflection_of_a_cantilever(validate):
    """With F L^2 / EI = 1 the elastica's tip is at 0.30172 L across (Bisshopp & Drucker 1945; here by
    shooting).

    n = 8 and 16 are extrapolated; an error of fourth order and a stretch of 1e-4 remain.
    """
    angle = elastica_tip_angle(1.0)
    s = np.linspace(0.0, 1.0, 4001)
    exact = np.trapezoid(np.sin(angle(s)), s)
    found = []
    for n in (8, 16):
        chain, state = beam(n, mass=1e-9, tip=1.0, weight=1.0)
        found.append(at_rest(chain, state.x, 15)[1].sum())
    extrapolated = (4.0 * found[1] - found[0]) / 3.0
    validate(
        "ROD-2", "elastica of rods", "theta'' = -cos(theta)", "tip across, n = 8, 16 extrapolated",
        abs(extrapolated / exact - 1.0), 2e-4,
    )  # fmt: skip


def elastica_tip_angle(load):
    """Solves theta'' = -load cos(theta), theta(0) = 0, theta'(1) = 0 by shooting and returns theta(s)."""
    from scipy.integrate import solve_ivp

    def shoot(kappa):
        return solve_ivp(
            lambda s, y: [y[1], -load * np.cos(y[0])], (0, 1), [0.0, kappa], rtol=1e-11, atol=1e-12,
            dense_output=True,
        )  # fmt: skip

    kappa = brentq(lambda k: shoot(k).y[1, -1], 0.1, 2.0, xtol=1e-13)
    return lambda s: shoot(kappa).sol(s)[0]


@pytest.mark.nightly
def test_vibrating_beam(validate):
    """The two lowest transverse frequencies of a clamped-free beam satisfy cos cosh = -1.

    n = 8 and 16 are extrapolated; an error of fourth order remains.
    """
    exact = (
        np.array([brentq(lambda b: np.cos(b) * np.cosh(b) + 1, *pair) for pair in ((1, 3), (3, 6))]) ** 2
    )
    found = []
    for n in (8, 16):
        chain, state = beam(n)
        stiffness = jit(jax.jacfwd(lambda x, c=chain, y=state: c(jnp.zeros(()), y._replace(x=x)).v))(
            state.x
        )
        across = -np.asarray(stiffness)[1, :, 1, :]
        found.append(np.sort(np.sqrt(np.linalg.eigvals(across).real))[:2])
    errors = np.array(found) / exact - 1.0
    extrapolated = (4.0 * errors[1] - errors[0]) / 3.0
    np.testing.assert_allclose(errors[0] / errors[1], 4.0, rtol=0.1)
    validate(
        "ROD-3", "vibrating beam of rods", "cos cosh = -1", "two frequencies, n = 8, 16 extrapolated",
        np.abs(extrapolated).max(), 2e-3,
    )  # fmt: skip


@pytest.mark.nightly
def test_fastest_rate_is_a_bound():
    """`fastest_rate` is above all frequencies of random stretched and bent chains, by less than ten
    times."""
    rng = np.random.default_rng(3)
    for bending, modulus, moment in ((False, 1e4, 1.0), (True, 1e4, 0.3), (True, 1.0, 3e3)):
        n = 6
        text = BEAM.format(n=n, mass=1.0, length=1.0, tip=0.3, weight=0.0)
        settings = {
            "chain.bending": bending, "chain.root": "clamped" if bending else "pinned",
            "chain.mass": rng.uniform(0.1, 2.0, n).tolist(),
            "chain.length": rng.uniform(0.5, 2.0, n).tolist(),
            "chain.second_moment": moment, "chain.youngs_modulus": modulus,
            "initial.rod_vector": [1.0, 0.0, 0.0],
        }  # fmt: skip
        chain, state = built(text, settings)
        x = state.x * (chain.system.tethers.element_length[:, 0] / state.x[0])
        stiffness = jax.jacfwd(lambda x, c=chain, y=state: c(jnp.zeros(()), y._replace(x=x)).v)(x)
        fastest = np.sqrt(np.abs(np.linalg.eigvals(-stiffness.reshape(3 * n, 3 * n))).max())
        bound = float(fastest_rate(chain))
        assert fastest <= bound <= 10.0 * fastest


# ---- tension only ---------------------------------------------------------------------------------------


def test_tension_only_law():
    """The tension-only force is zero below -w/2 and EA eps above w/2, and the derivative of the energy
    everywhere.

    In between the second derivative of the energy is continuous.
    """
    axial, width = 700.0, 1e-3
    law = TensionOnlyEnergy(jnp.asarray([axial]), jnp.asarray(width), "engineering")
    plain = AxialEnergy(jnp.asarray([axial]), "engineering")

    def energy(eps, law=law):
        stretched = jnp.array([[1.0 + eps], [0.0], [0.0]])
        return law.density(PointFields(None, stretched))[0]

    @jit
    def all_of(eps):
        functions = (energy, jax.grad(energy), jax.grad(jax.grad(energy)), lambda e: energy(e, plain))
        return [jax.vmap(f)(eps) for f in functions]

    slack = np.linspace(-0.9, -0.5001 * width, 7)
    taut = np.linspace(0.5001 * width, 0.2, 7)
    blend = np.linspace(-0.6 * width, 0.6 * width, 1201)
    found = np.array(all_of(jnp.asarray(np.concatenate([slack, taut, [0.0], blend]))))
    _, force, stiffness, _ = found[:, :7]
    assert (force == 0.0).all() and (stiffness == 0.0).all()
    stored, force, stiffness, quadratic = found[:, 7:14]
    np.testing.assert_allclose(force, axial * taut, rtol=1e-12)
    np.testing.assert_allclose(stiffness, axial, rtol=1e-9)
    # Beyond the blend the energy is quadratic, but for a constant.
    np.testing.assert_allclose(stored - quadratic, axial * width**2 / 24, rtol=1e-6)
    np.testing.assert_allclose(found[2, 14], axial / 2, rtol=1e-9)
    step = blend[1] - blend[0]
    assert np.abs(np.diff(found[2, 15:])).max() <= 1.001 * axial * step / width


# ---- orbit ----------------------------------------------------------------------------------------------


@pytest.mark.nightly
def test_tension_of_a_light_vertical_tether(validate):
    """The tension of a light vertical tether is 3 n^2 mu l with mu = m1 m2/(m1 + m2), at rest in the
    turning axes.

    The tether's mass, 4e-6 of mu, changes the tension by as much. Its stretch of 1.5e-4 is part of l.
    """
    n, length = 1.1e-3, 2e4
    text = f"""
[chain]
rods = 4
mass = 1e-4
length = {length / 4}
area = 4.8e-7
youngs_modulus = 87e9
anchor = "free"
base_mass = 500.0
tip_mass = 100.0
[orbit]
mean_motion = {n}
[initial]
rod_vector = [{length / 4}, 0.0, 0.0]
position = [{-length / 6}, 0.0, 0.0]
[integrator]
t_end = 1.0
"""
    chain, state = built(text)
    # The centre of mass may rest anywhere along the orbit, so that its lateral position is not changed.
    x = state.x

    def along(c, first):
        y = RodState(jnp.zeros_like(x).at[0].set(first), 0 * x, None)
        return c(jnp.zeros(()), y).v[0]

    step = jit(lambda c, y: y - jnp.linalg.solve(jax.jacfwd(lambda z: along(c, z))(y), along(c, y)))
    first = x[0]
    for _ in range(6):
        first = step(chain, first)
    first = np.asarray(first)
    tension = 4.8e-7 * 87e9 * (first[1:] / (length / 4) - 1.0)
    formula = 3.0 * n**2 * (500.0 * 100.0 / 600.0) * first[1:].sum()
    validate(
        "ROD-4", "tethered satellites at rest", "3 n^2 mu l", "tension of every rod",
        np.abs(tension / formula - 1.0).max(), 1e-5,
    )  # fmt: skip
