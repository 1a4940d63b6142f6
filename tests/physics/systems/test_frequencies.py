"""Natural frequencies of one tether (`equilibria/modes.py`) against beam, string and chain theory."""

import itertools

import jax.numpy as jnp
import numpy as np
import pytest
from numpy.polynomial import chebyshev
from scipy.optimize import brentq
from scipy.special import jn_zeros

from esail_jax.elements.rigid_body import RigidBody
from esail_jax.equilibria.equilibrium import equilibrium
from esail_jax.equilibria.modes import modes
from esail_jax.equilibria.steady_stretch import steady_line, unstretched_line
from support.one_tether import one_tether, straight
from support.quick import jit

quick_equilibrium = jit(equilibrium)
quick_line = jit(steady_line)

NO_GRAVITY = (0.0, 0.0, 0.0)
"""With it the rotating tethers share the programs of the hanging chain, which has as many elements."""


def angular_frequencies(made, spin=0.0, direction=(0.0, 1.0, 0.0)):
    """The sorted angular frequencies of all modes [rad/s].

    The initial guess of the equilibrium is slightly stretched, because a straight cable without tension or
    bending stiffness has no transverse stiffness.
    """
    start = straight(made, direction, 1.0001 * unstretched_line(made.tethers))
    found = quick_equilibrium(made, start, jnp.array([spin, 0.0, 0.0]))
    return 2.0 * np.pi * modes(made, found).frequency


def worst(measured, exact, each=1):
    """The largest relative error of the lowest modes; every frequency occurs `each` times."""
    exact = np.repeat(exact, each)
    return np.abs(measured[: len(exact)] / exact - 1.0).max()


def roots(function, guesses):
    """The zeros between neighbouring guesses."""
    return [brentq(function, a, b) for a, b in itertools.pairwise(guesses)]


@pytest.mark.nightly
@pytest.mark.parametrize("root", ["clamped", "pinned"])
def test_beam_without_tension(root, validate):
    """Frequencies are those of Euler-Bernoulli beams, omega = (beta L)^2 sqrt(EI / (rho A L^4)).

    Clamped-free beams have cos cosh = -1; pinned-free beams have tan = tanh, and a rigid swing. EA = 1e6
    moves the stretching modes to higher frequencies. The error of the third frequency is (beta l)^4 /
    1440, 2e-5 for 20 elements.
    """
    made = one_tether(elements=20, axial=1e6, bending=1.0, line_density=1.0, clamped=root == "clamped")
    found = quick_equilibrium(made, straight(made), jnp.zeros(3))
    measured = 2.0 * np.pi * modes(made, found).frequency
    if root == "clamped":
        beta = np.array(roots(lambda b: np.cos(b) * np.cosh(b) + 1.0, [1.0, 3.0, 6.0, 9.0]))
    else:
        beta = np.array(
            roots(lambda b: np.sin(b) * np.cosh(b) - np.cos(b) * np.sinh(b), [3.5, 4.5, 8.0, 10.5])
        )
        assert (measured[:2] == 0.0).all()
        measured = measured[2:]
    number = 1 if root == "clamped" else 2
    validate(
        f"FRE-{number}", f"{root}-free beam", "Euler-Bernoulli", "three lowest frequencies",
        worst(measured, beta**2, each=2), 1e-4,
    )  # fmt: skip


@pytest.mark.nightly
def test_taut_string(validate):
    """Frequencies of a taut string are omega_n = n pi sqrt(T / rho A) / (L sqrt(lambda)), lambda the
    stretch.

    The string is under the weight of a tip mass that is too heavy to move; T = 100 N, EA = 1e4 N.
    """
    tension, axial, mass = 100.0, 1e4, 1e12
    made = one_tether(
        elements=10, axial=axial, line_density=2.0, tip_mass=mass, strain="engineering",
        gravity=[0.0, tension / mass, 0.0],
    )  # fmt: skip
    measured = angular_frequencies(made)
    # The frequencies of the heavy mass itself are far below those of the string.
    measured = measured[measured > 1.0]
    stretch = 1.0 + tension / axial
    exact = np.pi * np.arange(1, 4) * np.sqrt(tension / 2.0 / stretch)
    validate(
        "FRE-3", "taut string", "n pi sqrt(T / rho A) / L", "three lowest frequencies",
        worst(measured, exact, each=2), 1e-4,
    )  # fmt: skip


def test_hanging_chain(validate):
    """A hanging chain has omega_n = j_{0,n} sqrt(g / L) / 2 (Bernoulli), j the zeros of Bessel's J_0.

    EA = 1e7 rho A g L.
    """
    made = one_tether(elements=12, axial=1e7, line_density=1.0, gravity=[0.0, 1.0, 0.0])
    validate(
        "FRE-4", "hanging chain", "zeros of Bessel J0", "three lowest frequencies",
        worst(angular_frequencies(made), 0.5 * jn_zeros(0, 3), each=2), 1e-4,
    )  # fmt: skip


def test_rotating_string_without_tip_mass(validate):
    """The modes are Legendre polynomials: (omega / Omega)^2 = k (k + 1) / 2 out of plane, one less in
    plane.

    k = 1, 3, 5; the first mode in plane is the rotation itself.
    """
    made = one_tether(elements=12, axial=1e7, line_density=1.0, spin=1.0, gravity=NO_GRAVITY)
    measured = angular_frequencies(made, spin=1.0)
    k = np.array([1.0, 3.0, 5.0])
    out, within = np.sqrt(k * (k + 1.0) / 2.0), np.sqrt(k[1:] * (k[1:] + 1.0) / 2.0 - 1.0)
    exact = np.sort(np.concatenate([out, within]))
    case, reference = "rotating string", "Legendre polynomials"
    validate("FRE-5", case, reference, "in and out of plane", worst(measured[1:], exact), 1e-4)


def rotating_string(spin, radius, length, axial, density, tip, points=32):
    """The frequencies of a stretched rotating string with a tip mass in the turning frame [rad/s].

    The steady state, (n(lambda))' = -Omega^2 rho A r with n = EA (lambda^2 - 1) lambda / 2, is found by
    Picard iteration, the modes by Chebyshev collocation in the material coordinate. With u along, w across
    in plane and z out of plane, k = dn / dlambda and t = n / lambda,

        rho A (u'' - 2 Omega w' - Omega^2 u) = (k u_x)_x,
        rho A (w'' + 2 Omega u' - Omega^2 w) = (t w_x)_x,
        rho A z'' = (t z_x)_x,

    with zero displacement at the root. At the tip the mass m replaces rho A, and the right-hand sides are
    minus the forces k u_x, t w_x.
    """
    nodes = np.cos(np.pi * np.arange(points + 1) / points)[::-1]
    basis = np.eye(points + 1)
    slopes = np.stack([chebyshev.chebval(nodes, chebyshev.chebder(c)) for c in basis], axis=1)
    derivative = slopes @ np.linalg.inv(chebyshev.chebvander(nodes, points)) * 2.0 / length
    integral = np.linalg.inv(np.vstack([derivative[1:], basis[:1]]))

    def from_root(values):
        return integral @ np.concatenate([values[1:], [0.0]])

    r = radius + 0.5 * (nodes + 1.0) * length
    stretch = np.ones_like(r)
    for _ in range(60):
        inner = from_root(r)
        pull = spin**2 * (density * (inner[-1] - inner) + tip * r[-1])
        left = 0.5 * axial * (stretch**2 - 1.0) * stretch - pull
        stretch = stretch - left / (0.5 * axial * (3.0 * stretch**2 - 1.0))
        r = radius + from_root(stretch)

    def stiffness(modulus):
        """-(modulus y_x)_x inside and modulus y_x at the tip, without the root's row and column."""
        rows = -derivative @ np.diag(modulus) @ derivative
        rows[-1] = modulus[-1] * derivative[-1]
        return rows[1:, 1:]

    mass = density * np.eye(points)
    mass[-1, -1] = tip
    along = stiffness(0.5 * axial * (3.0 * stretch**2 - 1.0))
    across = stiffness(0.5 * axial * (stretch**2 - 1.0))
    none = np.zeros_like(mass)
    static = np.block([[along - spin**2 * mass, none], [none, across - spin**2 * mass]])
    coriolis = 2.0 * spin * np.block([[none, -mass], [mass, none]])
    inertia = np.block([[mass, none], [none, mass]])
    state = np.block(
        [
            [np.zeros_like(inertia), np.eye(2 * points)],
            [-np.linalg.solve(inertia, static), -np.linalg.solve(inertia, coriolis)],
        ]
    )
    within = np.linalg.eigvals(state).imag
    outside = np.sqrt(np.linalg.eigvals(np.linalg.solve(mass, across)).real)
    return np.sort(np.concatenate([within[within > 0.0], outside]))


@pytest.mark.nightly
def test_tether_of_the_baseline(validate):
    """The ten lowest modes of the baseline's tether agree with those of the rotating string.

    The tether is hinged on the hub's rim, without wind or damping. The first stretching mode is among the
    ten.
    """
    data = {"length": 1e4, "axial": 70e9 * 4.28e-9, "line_density": 7653.0 * 4.28e-9}
    made = one_tether(elements=12, tip_mass=1.5, radius=1.0, spin=4e-3, gravity=NO_GRAVITY, **data)
    exact = rotating_string(4e-3, 1.0, data["length"], data["axial"], data["line_density"], 1.5)[:10]
    validate(
        "FRE-6", "baseline tether, spinning", "rotating string with tip mass, Chebyshev collocation",
        "ten lowest frequencies", worst(angular_frequencies(made, spin=4e-3), exact), 1e-4,
    )  # fmt: skip


def test_damped_rod(validate):
    """A hanging rod of one truss element stretches with omega^2 = (EA / L) / (m + rho L / 3), and swings
    undamped.

    The damping ratio of the stretching mode is gamma omega / 2.
    """
    axial, time, mass, density = 900.0, 0.004, 2.0, 0.3
    made = one_tether(
        kind="truss", elements=1, axial=axial, tip_mass=mass, line_density=density, damping_time=time,
        strain="engineering", gravity=[0.0, 1e-3, 0.0],
    )  # fmt: skip
    start = straight(made, line=1.0001 * unstretched_line(made.tethers))
    found = modes(made, quick_equilibrium(made, start, jnp.zeros(3)))
    exact = np.sqrt(axial / (mass + density / 3.0))
    case, reference = "damped hanging rod", "one degree of freedom"
    error = abs(found.frequency[-1] * 2.0 * np.pi / exact - 1.0)
    validate("FRE-7", case, reference, "frequency", error, 1e-8)
    error = abs(found.damping_ratio[-1] / (0.5 * time * exact) - 1.0)
    validate("FRE-8", case, reference, "damping ratio", error, 1e-8)
    assert np.abs(found.damping_ratio[:2]).max() < 1e-8


@pytest.mark.nightly
def test_free_hub_and_cable(validate):
    """A free, spinning hub with one cable has the rigid modes of any free body in the turning frame.

    Drift along the axis and rotation about it have s = 0; drifts across the axis and tilts of it have |s|
    = Omega. There are as many pairs of eigenvalues as degrees of freedom.
    """
    hub = RigidBody(jnp.asarray(1.0), jnp.asarray(0.4), jnp.asarray(2.0))
    made = one_tether(
        elements=2, length=2.0, axial=300.0, line_density=0.4, tip_mass=0.6, radius=0.4, hub=hub
    )
    spin = jnp.asarray(1.0)
    line, _ = quick_line(made.tethers, made.energies, jnp.asarray(0.4), spin, jnp.zeros(()))
    at = quick_equilibrium(made, straight(made, line=line), jnp.array([1.0, 0.0, 0.0]))
    found = modes(made, at)
    pairs = np.where(found.eigenvalue.imag > 0.0, 1.0, 0.5)
    pairs[:2] = 1.0
    assert pairs.sum() == 6 + 3 * 5
    assert (found.frequency[:2] == 0.0).all() and found.frequency[2] > 0.0
    nearest = np.sort(np.abs(2.0 * np.pi * found.frequency - 1.0))[:3]
    case, reference = "free hub and cable", "rigid motions in the turning frame"
    validate("FRE-9", case, reference, "|s| / Omega of the rigid motions", nearest.max(), 1e-6)


def test_modes_need_an_equilibrium():
    """Modes about a state that is no equilibrium are refused with a message."""
    made = one_tether(elements=12, axial=300.0, line_density=0.4, spin=1.0, gravity=NO_GRAVITY)
    found = quick_equilibrium(made, straight(made), jnp.array([1.0, 0.0, 0.0]))
    assert found.converged
    with pytest.raises(ValueError, match="must be balanced"):
        modes(made, found._replace(converged=jnp.asarray(False)))
