"""Torque-free rotation of a rigid body with three different moments of inertia.

The solution is in Jacobi's elliptic functions (Landau and Lifshitz, Mechanics, Sec. 37), from omega_2 = 0
and M^2 > 2 E I_2.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import ellipj

from esail_jax.elements.rigid_body import RigidBody, Spacecraft
from support.one_tether import STEPPERS, integrate, one_tether, straight, turning
from support.quick import quickly

EXTENTS = np.array([0.9, 0.6, 0.3])
"""Mean squares of the three body coordinates [m^2]; moments of inertia are sums of two."""

START = np.array([0.4, 0.0, 0.9])
"""omega^B(0) [rad/s]."""


MASS = 18.0
"""[kg]"""

BODY = Spacecraft.of(jnp.asarray(MASS), jnp.diag(MASS * (EXTENTS.sum() - EXTENTS)), jnp.zeros(3))
"""A hub with three different moments of inertia."""


def moments():
    """I_1 < I_2 < I_3 [kg m^2]."""
    return MASS * (EXTENTS.sum() - EXTENTS)


def closed_form(time):
    """omega^B (time, 3) [rad/s]."""
    one, two, three = moments()
    energy, square = 0.5 * moments() @ START**2, (moments() ** 2) @ START**2  # E, M^2
    high, low = 2.0 * energy * three - square, square - 2.0 * energy * one
    rate = np.sqrt((three - two) * low / (one * two * three))
    sn, cn, dn, _ = ellipj(rate * time, (two - one) * high / ((three - two) * low))
    sizes = np.sqrt(
        [high / (one * (three - one)), high / (two * (three - two)), low / (three * (three - one))]
    )
    return (sizes[:, None] * np.stack([cn, sn, dn])).T


def alone():
    """The body with a tether of 1e-30 kg and no stiffness, which has no effect."""
    made = one_tether(
        kind="truss", elements=1, axial=0.0, line_density=1e-30, tip_mass=1e-30, hub=BODY
    )  # fmt: skip
    q = straight(made)
    return made, q, turning(q, START)


@pytest.fixture(scope="module", params=quickly(STEPPERS))
def runs(request):
    """Runs of 10 s, 2.5 turns about the main axis, with two step sizes."""
    made, q, v = alone()
    found = [integrate(request.param, made, q, v, 10.0 / n, n, rows=800) for n in (400, 800)]
    return request.param, found


def test_closed_form_starts_right_and_obeys_euler():
    """The closed form satisfies I omega' = I omega x omega and has the right initial value."""
    at, h = 3.0, 1e-5
    before, now, after = closed_form(np.array([at - h, at, at + h]))
    rate = (after - before) / (2.0 * h)
    np.testing.assert_allclose(moments() * rate, np.cross(moments() * now, now), atol=1e-6)
    np.testing.assert_allclose(closed_form(np.zeros(1))[0], START, atol=1e-15)


def test_angular_velocity(runs, validate):
    """The error at the finer step is below (omega h)^2 = 1.3e-4, and a quarter of that at the coarser
    step; by collocation, of order 7, it is below 1e-10."""
    stepper, found = runs
    errors = []
    for time, q, v, _ in found:
        omega = jax.vmap(BODY.angular_velocity)(q.hub, v.hub)
        errors.append(np.abs(omega - closed_form(time)).max() / START.max())
    ratio = errors[1] / max(errors[0], 1e-12)  # a method of order 7 has only rounding errors here
    case, reference = "torque-free rigid body", "Jacobi elliptic functions"
    most = 1e-10 if stepper == "collocation" else 1.3e-4
    validate(f"RIG-1 {stepper}", case, reference, "angular velocity, h = 12.5 ms", errors[1], most)
    validate(f"RIG-2 {stepper}", case, reference, "error ratio over a halved step", ratio, 0.26)


def test_angular_momentum_and_energy(runs, validate):
    """The angular momentum in space and the energy E = omega . I omega / 2 are constant, to second
    order."""
    stepper, found = runs
    _, q, v, _ = found[1]
    momentum = jax.vmap(lambda x, u: jnp.cross(x, BODY.mass_matrix @ u).sum(0))(q.hub, v.hub)
    energy = 0.5 * jnp.einsum("tki,kl,tli->t", v.hub, BODY.mass_matrix, v.hub)
    case, reference = "torque-free rigid body", "conservation"
    drift = np.abs(momentum - momentum[0]).max() / np.linalg.norm(momentum[0])
    validate(f"RIG-3 {stepper}", case, reference, "angular momentum in space", drift, 1e-5)
    validate(f"RIG-4 {stepper}", case, reference, "energy", np.abs(energy / energy[0] - 1.0).max(), 1.3e-4)
    np.testing.assert_allclose(momentum[0], moments() * START, rtol=1e-12)  # checks the inertia tensor


def test_momenta_and_energy_of_any_body():
    """A body with products of inertia whose centre of mass is not the hub centre, in any motion: momentum
    m v_c, angular momentum m r_c x v_c + C J omega, and energy m v_c^2/2 + omega . J omega/2, to rounding.
    The cylinder as such a body has the same mass matrix in its own base points."""
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    inertia, offset = turn @ np.diag([3.0, 4.0, 5.0]) @ turn.T, np.array([0.2, -0.1, 0.3])
    body = Spacecraft.of(jnp.asarray(7.0), jnp.asarray(inertia), jnp.asarray(offset))
    attitude = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
    attitude = attitude * np.linalg.det(attitude)
    centre, velocity, omega = (
        np.array([1.0, 2.0, 3.0]),
        np.array([0.3, -0.2, 0.5]),
        np.array([0.4, 0.1, -0.7]),
    )
    base = np.asarray(body.base_points)
    points = jnp.asarray(centre + base @ attitude.T)
    rates = jnp.asarray(velocity + np.cross(omega, base) @ attitude.T)
    at = centre + attitude @ offset
    moves = velocity + attitude @ np.cross(omega, offset)
    momenta = body.mass_matrix @ rates
    np.testing.assert_allclose(momenta.sum(0), 7.0 * moves, rtol=1e-13)
    spin = 7.0 * np.cross(at, moves) + attitude @ (inertia @ omega)
    np.testing.assert_allclose(jnp.cross(points, momenta).sum(0), spin, rtol=1e-12)
    energy = 3.5 * moves @ moves + 0.5 * omega @ inertia @ omega
    assert float(0.5 * (rates * momenta).sum()) == pytest.approx(energy, rel=1e-13)
    np.testing.assert_allclose(body.angular_velocity(points, rates), omega, rtol=1e-12)
    about = inertia + 7.0 * (offset @ offset * np.eye(3) - np.outer(offset, offset))
    np.testing.assert_allclose(body.inertia, about, rtol=1e-13)
    cylinder = RigidBody(jnp.asarray(2.0), jnp.asarray(1.0), jnp.asarray(3.0))
    same = Spacecraft(cylinder.height, cylinder.radius, cylinder.mass, cylinder.inertia, jnp.zeros(3))
    np.testing.assert_allclose(same.mass_matrix, cylinder.mass_matrix, rtol=1e-13, atol=1e-14)
