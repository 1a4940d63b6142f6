"""Steady coning under Coulomb thrust, for small slopes.

For an inextensible tether on a hub with acceleration a along the axis, the balance of the part beyond x
gives

    y'(x) = (sigma (L - x) - a (m + rho (L - x))) / (Omega^2 (m L + rho (L^2 - x^2) / 2)),

with the thrust sigma and the mass rho per length and the tip mass m. A free sail of p tethers has
a = p sigma L / M.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad

from esail_jax.environment.solar_wind import SteadyWind
from esail_jax.equilibria.equilibrium import equilibrium
from esail_jax.equilibria.steady_stretch import steady_line
from esail_jax.loads.coulomb import CoulombThrust
from esail_jax.loads.voltage import Constant
from esail_jax.scenes.loading import load_scene
from esail_jax.scenes.structure import split
from support.one_tether import one_tether, straight
from support.quick import build_jitted, jit

LENGTH, DENSITY, TIP, SPIN = 1e4, 7653.0 * 4.28e-9, 1.5, 4e-3

quick_equilibrium = jit(equilibrium)


def tip_height(sigma, acceleration=0.0):
    """y(L) [m]."""

    def slope(x):
        beyond = LENGTH - x
        pull = SPIN**2 * (TIP * LENGTH + DENSITY * (LENGTH**2 - x**2) / 2.0)
        return (sigma * beyond - acceleration * (TIP + DENSITY * beyond)) / pull

    return quad(slope, 0.0, LENGTH, epsabs=0.0, epsrel=1e-12)[0]


def sigma_of(volts):
    """The thrust per length [N/m] in the baseline's wind ([PGV] Eq. 27-28)."""
    return 0.18 * (volts - 1e3) * np.sqrt(8.854e-12 * 1.67e-27 * 7.3e6) * 4e5


def test_small_coning_of_a_held_tether(validate):
    """The height of the tip and its derivative by the voltage, the height per volt, agree with the formula.

    The voltage is 1 V above the cut-off, which gives slopes of 1e-6; EA is a thousand times larger, which
    gives strains of 1e-6.
    """
    wind = SteadyWind(*(jnp.asarray(x) for x in (4e5, 7.3e6, 1e3)), jnp.array([1.5e11, 0.0, 0.0]))

    @jit
    def height(volts):
        made = one_tether(
            elements=20, length=LENGTH, axial=3e5, line_density=DENSITY, tip_mass=TIP, spin=SPIN,
            loads=(CoulombThrust.of(wind, Constant(volts[None]), 1),),
        )  # fmt: skip
        zero, spin = jnp.zeros(()), jnp.asarray(SPIN)
        line, _ = steady_line(made.tethers, made.energies, zero, spin, zero)
        found = equilibrium(made, straight(made, line=line), jnp.array([SPIN, 0.0, 0.0]))
        return found.q.tether[0, 0, -1, 0]

    y, change = jax.jvp(height, (jnp.asarray(1001.0),), (jnp.ones(()),))
    exact = tip_height(sigma_of(1001.0))
    case, reference = "steady coning, hub held", "closed form, small slopes"
    validate("CON-1", case, reference, "height of the tip", abs(y / exact - 1.0), 1e-5)
    validate("CON-2", case, reference, "d height / d voltage", abs(change / exact - 1.0), 1e-5)


@pytest.mark.nightly
def test_coning_of_the_free_baseline(validate):
    """In the sun-facing baseline the hub accelerates, which lowers the tips by 0.73 %.

    With the acceleration, the formula is accurate to 1e-3: it neglects the strain (9e-4) and the squared
    slopes (0.015^2).
    """
    scene = load_scene("sun-facing")
    made = build_jitted(*split(scene))
    axis = made.system.rotation(jnp.zeros(()), made.q)[:, 0]
    found = quick_equilibrium(made.system, made.q, SPIN * axis)
    height = axis @ (found.q.tether[0, :, -1] - found.q.tether[0, :, 0])
    np.testing.assert_allclose(height, height[0], rtol=1e-9)  # all tethers are alike
    sigma = sigma_of(20e3)
    mass = float(made.system.hub.mass) + 12.0 * (TIP + DENSITY * LENGTH)
    acceleration = 12.0 * sigma * LENGTH / mass
    case = "steady coning, free sun-facing baseline"
    error = abs(height[0] / tip_height(sigma) - 1.0 + 0.0073)
    validate("CON-3", case, "-0.73 % of the held one", "change of the tip's height", error, 1e-4)
    error = abs(height[0] / tip_height(sigma, acceleration) - 1.0)
    validate("CON-4", case, "closed form with hub acceleration", "height of the tip", error, 1e-3)
    error = abs(np.linalg.norm(found.frame.acceleration) / acceleration - 1.0)
    validate("CON-5", case, "p sigma L / M", "acceleration of the hub", error, 1e-3)
