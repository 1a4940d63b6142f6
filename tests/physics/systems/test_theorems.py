"""Theorems of momentum, angular momentum and energy, for a free sail and a swinging cable."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from esail_jax.coordinates import Coordinates
from esail_jax.elements.rigid_body import RigidBody
from support.one_tether import STEPPERS, integrate, one_tether, straight, turning
from support.quick import jit, quickly

GRAVITY = np.array([0.3, -0.2, 0.5])


def energy_of(made, q, v):
    """The kinetic and elastic energy [J] of the tether, without the weight of its tip mass."""
    kinetic = 0.5 * jnp.vdot(v.tether, made.tethers.inertia(v.tether))
    fields = made.tethers.interpolate(q.tether)
    return kinetic + made.integrate(sum(term.density(fields) for term in made.energies))


@pytest.fixture(scope="module", params=quickly(STEPPERS, ("energy-momentum",)))
def falling(request):
    """A run of 2 s in 200 steps: a hub with one cable that spins about a skew axis in uniform gravity."""
    hub = RigidBody(jnp.asarray(1.0), jnp.asarray(0.4), jnp.asarray(2.0))
    made = one_tether(
        elements=4, length=2.0, axial=300.0, bending=0.5, line_density=0.4, tip_mass=0.6, radius=0.4,
        hub=hub, gravity=GRAVITY,
    )  # fmt: skip
    q = straight(made)
    return request.param, made, *integrate(request.param, made, q, turning(q, [1.0, 0.2, 0.1]), 0.01, 200)


def test_centre_of_mass_falls_on_a_parabola(falling, validate):
    """P(t) = P(0) + M g t to rounding, because constant accelerations are integrated exactly."""
    stepper, made, time, _, v, _ = falling
    momentum = jit(jax.vmap(made.momentum))(v)
    everywhere = jnp.array([1.0, 0.0, 0.0])
    uniform = Coordinates(made.tethers.uniform(everywhere), jnp.tile(everywhere, (4, 1)))
    mass = made.momentum(uniform)[0]
    exact = momentum[0] + mass * GRAVITY * time[:, None]
    error = np.abs(momentum - exact).max() / np.abs(exact).max()
    validate(
        f"THE-1 {stepper}", "spinning hub and cable in gravity", "P(0) + M g t", "momentum", error, 1e-12
    )


def test_angular_momentum_about_the_centre(falling, validate):
    """The angular momentum about the centre of mass is constant, because uniform gravity has no moment
    about it.

    The error is of second order: (omega h)^2 = 1e-4 times the bending and stretching of the cable.
    """
    stepper, made, _, q, v, _ = falling

    def about_centre(q, v):
        p_tether, p_hub = made.tethers.inertia(v.tether), made.hub.mass_matrix @ v.hub
        m_tether = made.tethers.inertia(made.tethers.uniform(jnp.ones(3)))
        m_hub = made.hub.mass_matrix @ jnp.ones(4)
        mass = m_tether[0, 0].sum() + m_hub.sum()
        centre = ((q.tether * m_tether[:, :1]).sum((0, 2, 3)) + m_hub @ q.hub) / mass
        total = p_tether[0].sum((1, 2)) + p_hub.sum(0)
        moment = jnp.cross(q.tether, p_tether, axis=1).sum((0, 2, 3)) + jnp.cross(q.hub, p_hub).sum(0)
        return moment - jnp.cross(centre, total)

    moment = jit(jax.vmap(about_centre))(q, v)
    error = np.abs(moment - moment[0]).max() / np.linalg.norm(moment[0])
    validate(
        f"THE-2 {stepper}",
        "spinning hub and cable in gravity",
        "conservation",
        "angular momentum about the centre",
        error,
        1e-4,
    )


@pytest.mark.nightly
@pytest.mark.parametrize("stepper", STEPPERS)
def test_energy_band_without_constraints(stepper, validate):
    """The energy of a swinging cable stays in a band of second order, without drift (rho_inf = 1).

    The soft cable swings from a fixed root for 2000 steps. Without drift the mean is the same over both
    halves.
    """
    made = one_tether(
        elements=3,
        length=2.0,
        axial=200.0,
        bending=0.2,
        line_density=0.4,
        tip_mass=0.6,
        gravity=[0.0, -9.81, 0.0],
    )
    q = straight(made, direction=(0.0, -np.cos(0.5), np.sin(0.5)))
    _, q, v, _ = integrate(stepper, made, q, turning(q, np.zeros(3)), 0.005, 2000, 1.0)
    weight = 9.81 * made.tethers.inertia(made.tethers.uniform(jnp.array([0.0, 1.0, 0.0])))

    @jit
    @jax.vmap
    def energies(q, v):
        kinetic = 0.5 * jnp.vdot(v.tether, made.tethers.inertia(v.tether))
        return energy_of(made, q, v) + jnp.vdot(weight, q.tether), kinetic

    energy, kinetic = energies(q, v)
    kinetic = kinetic.max()
    change = np.asarray(energy - energy[0]) / kinetic
    case, reference = "swinging cable, rho_inf = 1", "conservation"
    validate(
        f"THE-3 {stepper}",
        case,
        reference,
        "band of the energy / largest kinetic energy",
        np.abs(change).max(),
        1e-3,
    )
    drift = abs(change[1000:].mean() - change[:1000].mean())
    validate(f"THE-4 {stepper}", case, reference, "drift of its mean between halves", drift, 1e-5)
