"""Equilibria and modes as motions: an equilibrium stays at rest, and a mode returns after its period."""

import jax.numpy as jnp
import numpy as np
import pytest

from esail_jax.environment.solar_wind import SteadyWind
from esail_jax.equilibria.equilibrium import equilibrium
from esail_jax.equilibria.modes import modes
from esail_jax.equilibria.moving_frame import expanded
from esail_jax.equilibria.steady_stretch import steady_line, unstretched_line
from esail_jax.loads.coulomb import CoulombThrust
from esail_jax.loads.voltage import Constant
from support.elastica import TIP_ANGLE, elliptic
from support.one_tether import STEPPERS, Pulled, integrate, one_tether, straight, turning
from support.quick import jit

quick_equilibrium = jit(equilibrium)


def elastica():
    """The cantilever of `test_elastica.py` under its load."""
    load = elliptic(TIP_ANGLE)[0]
    made = one_tether(
        elements=4, axial=1e3, bending=1.0, line_density=0.2, tip_mass=1.0, clamped=True,
        gravity=[0.0, 0.0, -load],
    )  # fmt: skip
    return made, straight(made), 0.0, 0.02


def catenary():
    """A cable without bending stiffness under its weight and a force at its end."""
    made = one_tether(elements=4, length=10.0, axial=500.0, line_density=1.5, gravity=[0.0, 0.0, -9.81])
    system = Pulled.of(made, jnp.array([0.0, 60.0, 0.0]))
    start = straight(made, direction=(0.0, 0.8, -0.6), line=1.1 * unstretched_line(made.tethers))
    return system, start, 0.0, 0.02


def coning():
    """The baseline's tether at 20 kV in a wind along the axis of its frame."""
    wind = SteadyWind(*(jnp.asarray(x) for x in (4e5, 7.3e6, 1e3)), jnp.array([1.5e11, 0.0, 0.0]))
    made = one_tether(
        elements=4, length=1e4, axial=299.6, line_density=3.2755e-5, tip_mass=1.5, radius=1.0, spin=4e-3,
        loads=(CoulombThrust.of(wind, Constant(jnp.array([20e3])), 1),),
    )  # fmt: skip
    line, _ = steady_line(made.tethers, made.energies, jnp.ones(()), jnp.asarray(4e-3), jnp.zeros(()))
    return made, straight(made, line=line), 4e-3, 1.0


@pytest.mark.nightly
@pytest.mark.parametrize("case", [elastica, catenary, coning])
@pytest.mark.parametrize("stepper", STEPPERS)
def test_equilibrium_is_a_fixed_point(stepper, case, validate):
    """An equilibrium in the turning frame does not move in 40 steps; 1e-8 of the length is accepted.

    Systems at rest keep their state up to the iteration tolerance, 1e-8 m in some metres. The rotating
    system has an error of (Omega h)^2 = 1.6e-5 of the small motion of its height.
    """
    made, start, spin, step = case()
    omega = jnp.array([spin, 0.0, 0.0])
    found = quick_equilibrium(made, start, omega)
    _, q, _, _ = integrate(stepper, made, found.q, turning(found.q, omega), step, 40, 0.25)
    length = float(made.tethers.element_length[0]) * made.tethers.elements
    height = q.tether[:, 0, 0] if spin else q.tether[:, 0]
    error = np.abs(height - height[0]).max() / length
    validate(
        f"RES-{case.__name__} {stepper}", f"equilibrium, {case.__name__}", "equilibrium solver",
        "motion of the nodes / L", error, 1e-8,
    )  # fmt: skip


@pytest.mark.nightly
@pytest.mark.parametrize("stepper", STEPPERS)
def test_first_bending_mode_comes_back(stepper, validate):
    """A clamped beam released in its first mode returns after the period that `modes` gives.

    The amplitude is 1e-4 of the length. The error is of second order, (2 pi / 400)^2. The nonlinear beam
    also vibrates axially by the square of the amplitude, 1e-4 of it, which a method without numerical
    damping keeps.
    """
    made = one_tether(elements=6, axial=1e4, bending=1.0, line_density=1.0, clamped=True)
    found = quick_equilibrium(made, straight(made), jnp.zeros(3))
    first = modes(made, found)
    shape = expanded(made, jnp.asarray(first.shape[:, 0].real), derivative=1)
    q = found.q.axpy(1e-4 / jnp.abs(shape.tether[0]).max(), shape)
    period = 1.0 / first.frequency[0]
    _, q, _, _ = integrate(stepper, made, q, turning(q, np.zeros(3)), period / 400, 400, 0.9)
    error = np.abs(q.tether[-1, 0] - q.tether[0, 0])[:, -1].max() / 1e-4
    validate(
        f"RES-mode {stepper}", "clamped beam in its first mode", "period from the modes",
        "return after a period / amplitude", error, (2.0 * np.pi / 400) ** 2,
    )  # fmt: skip
