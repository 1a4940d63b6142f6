"""The elastic stretch of a steadily spinning cable with a tip mass, in closed form.

With engineering strain, EA (r' - 1) is the tension and (EA r')' = -rho A Omega^2 r, so that with
k = Omega sqrt(rho A / EA)

    r(x) = R cos(k x) + B sin(k x),      EA (r'(L) - 1) = m Omega^2 r(L).
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from esail_jax.equilibria.equilibrium import equilibrium
from esail_jax.equilibria.steady_stretch import steady_line
from support.one_tether import STEPPERS, integrate, one_tether, straight, turning
from support.quick import jit, quickly

LENGTH, AXIAL, DENSITY, TIP, RADIUS, SPIN = 2.0, 50.0, 0.8, 1.5, 0.3, 1.2
"""Numbers of a soft cable, which is stretched by 20 %."""


def closed_form(x, spin):
    """r(x) [m]."""
    k = spin * jnp.sqrt(DENSITY / AXIAL)
    s, c = jnp.sin(k * LENGTH), jnp.cos(k * LENGTH)
    pull = TIP * spin**2
    b = (AXIAL * (1.0 + RADIUS * k * s) + pull * RADIUS * c) / (AXIAL * k * c - pull * s)
    return RADIUS * jnp.cos(k * x) + b * jnp.sin(k * x)


def system(spin=SPIN, elements=8):
    return one_tether(
        elements=elements, length=LENGTH, axial=AXIAL, line_density=DENSITY, tip_mass=TIP,
        strain="engineering", radius=RADIUS, spin=spin,
    )  # fmt: skip


@jit
def stretched(spin):
    """The node radii [m] of the steady initial stretch and of the relative equilibrium."""
    made = system(spin=1.0, elements=16)
    line, _ = steady_line(made.tethers, made.energies, jnp.asarray(RADIUS), spin, jnp.zeros(()))
    found = equilibrium(made, straight(made), jnp.array([1.0, 0.0, 0.0]) * spin)
    return jnp.stack([RADIUS + line[0, :, 0], found.q.tether[0, 1, :, 0]])


def test_steady_stretch_and_its_derivative(validate):
    """Both computations of the equilibrium, and d r(L) / d Omega through them, agree with the closed form.

    The derivative uses the implicit function theorem. Sixteen cubic elements have errors below 1e-9.
    """
    x = jnp.linspace(0.0, LENGTH, 17)
    exact, slope = jax.jvp(lambda w: closed_form(x, w), (SPIN,), (1.0,))
    radii, change = jax.jvp(stretched, (jnp.asarray(SPIN),), (jnp.ones(()),))
    case, reference = "rotating cable with tip mass", "closed form, linear elastic"
    for row, name in enumerate(("start", "equilibrium")):
        error = np.abs(radii[row] - exact).max() / exact[-1]
        validate(f"ROT-{2 * row + 1}", case, reference, f"node radii ({name})", error, 1e-9)
        error = np.abs(change[row] - slope).max() / slope[-1]
        validate(f"ROT-{2 * row + 2}", case, reference, f"d radii / d spin ({name})", error, 1e-8)


@pytest.mark.parametrize("stepper", quickly(STEPPERS, ("collocation",)))
def test_steady_rotation_stays_steady(stepper, validate):
    """A cable that starts from the closed form rotates as a rigid body.

    A second-order method has a phase error of 2 pi c (Omega h)^2 per turn, c about 0.1; (Omega h)^2 is
    accepted.
    """
    x = np.linspace(0.0, LENGTH, 9)
    radius = closed_form(x, SPIN)
    slope = jax.vmap(jax.grad(lambda x: closed_form(x, SPIN)))(x)
    made = system()
    q = straight(made, line=jnp.stack([radius - RADIUS, slope])[:, :, None])
    turn = 2.0 * np.pi / SPIN
    time, q, _, _ = integrate(stepper, made, q, turning(q, [SPIN, 0.0, 0.0]), turn / 260, 260, 0.25)
    tip = np.asarray(q.tether[:, 0, :, -1, 0])
    angle = SPIN * time
    exact = radius[-1] * np.stack([0.0 * angle, np.cos(angle), np.sin(angle)], axis=1)
    error = np.abs(tip - exact).max() / radius[-1]
    validate(
        f"ROT-5 {stepper}", "rotating cable with tip mass", "closed form, linear elastic",
        "tip path over a turn, 260 steps", error, (2.0 * np.pi / 260) ** 2,
    )  # fmt: skip
