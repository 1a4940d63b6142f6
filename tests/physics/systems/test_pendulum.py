"""One stiff truss element with a tip mass is a rigid rod: J = (m_u + m_t/3) L^2 about its root."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import ellipj, ellipk

from esail_jax.equilibria.equilibrium import equilibrium
from esail_jax.equilibria.modes import modes
from support.one_tether import STEPPERS, integrate, one_tether, straight, turning
from support.quick import jit, quickly

ROD, TIP, LENGTH = 0.6, 1.5, 2.0
"""Masses of rod and tip [kg], length [m]."""


def rod(axial, **options):
    return one_tether(
        kind="truss", elements=1, length=LENGTH, axial=axial, line_density=ROD / LENGTH, tip_mass=TIP,
        **options,
    )  # fmt: skip


def test_spinning_pendulum_frequencies(validate):
    """A spinning rod hinged at radius R has the frequencies behind [PGV] Eq. 83-85.

    omega^2 = Omega^2 (1 + eps) out of plane and Omega^2 eps in plane, with eps = 3 R (2 m_u + m_t) / (2 L
    (3 m_u + m_t)). EA = 1e8 m Omega^2 L: the stretch, with its Coriolis coupling, changes them by 4e-8,
    and rounding in the stiffness by as much; 1e-6 is accepted.
    """
    spin, radius = 1.3, 0.3
    made = rod(1e8 * TIP * spin**2 * LENGTH, radius=radius, spin=spin)
    found = jit(equilibrium)(made, straight(made), jnp.array([spin, 0.0, 0.0]))
    measured = np.sort(2.0 * np.pi * modes(made, found).frequency)[:2] / spin
    eps = 1.5 * radius / LENGTH * (2.0 * TIP + ROD) / (3.0 * TIP + ROD)
    case, reference = "spinning rigid rod", "closed form"
    for k, (name, exact) in enumerate((("in plane", eps**0.5), ("out of plane", (1.0 + eps) ** 0.5))):
        error = abs(measured[k] / exact - 1.0)
        validate(f"PEN-{k + 1}", case, reference, f"frequency {name}", error, 1e-6)


@pytest.mark.parametrize("stepper", quickly(STEPPERS, ("generalized-alpha",)))
def test_large_swing(stepper, validate):
    """A swing of 1 rad under gravity is sin(theta/2) = k sn(K(k) - omega t, k), k = sin(1/2).

    omega^2 = g L (m_u + m_t/2) / J. The rod is stiff (axial frequency 3000 omega) and does not start in
    axial equilibrium; rho_inf = 0.25 damps the axial vibration. A phase error of 2 pi (omega h)^2 is
    accepted.
    """
    gravity, swing = 9.81, 1.0
    omega = np.sqrt(gravity * (TIP + ROD / 2.0) / ((TIP + ROD / 3.0) * LENGTH))
    made = rod(1e7, gravity=[0.0, -gravity, 0.0])
    q = straight(made, direction=(0.0, -np.cos(swing), np.sin(swing)))
    steps = 800
    time, q, _, _ = integrate(
        stepper, made, q, turning(q, np.zeros(3)), 2.0 * np.pi / omega / steps, steps, 0.25
    )
    k = np.sin(swing / 2.0)
    sine = k * ellipj(ellipk(k**2) - omega * time, k**2)[0]
    angle = np.arctan2(q.tether[:, 0, 2, -1, 0], -q.tether[:, 0, 1, -1, 0])
    error = np.abs(angle - 2.0 * np.arcsin(sine)).max()
    validate(
        f"PEN-3 {stepper}", "rigid pendulum, 1 rad", "Jacobi elliptic functions",
        "angle over 0.94 periods, 800 steps", error, 4e-4, "rad",
    )  # fmt: skip
