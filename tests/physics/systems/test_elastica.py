"""The elastica: large deflection of a clamped cable under a dead load at its tip.

For an inextensible cable, with alpha = sqrt(P L^2 / EI), k^2 = (1 + sin theta_L) / 2,
sin phi_0 = 1 / (k sqrt 2) and the angle theta_L of the tip from the unloaded direction,

    alpha = K(k) - F(phi_0, k),    down = 1 - 2 (E(k) - E(phi_0, k)) / alpha,
    along = sqrt(2 sin theta_L) / alpha

in units of L (Bisshopp and Drucker 1945). An extensible cable with the element's energy per undeformed
length, EA ((lambda^2 - 1)/2)^2 / 2 + EI (theta'/lambda)^2 / 2, obeys an ordinary differential equation for
theta and the moment EI theta'/lambda^2, which is solved here by shooting. The load is the weight of a tip
mass on a cable without mass.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from esail_jax.equilibria.equilibrium import equilibrium
from support.elastica import TIP_ANGLE, elliptic
from support.one_tether import one_tether, straight
from support.quick import jit

pytestmark = pytest.mark.nightly


def shooting(load, axial):
    """The tip (along, down) of the extensible cable with EI = L = 1."""

    def stretch(turn, tension):
        """Solves EA (lambda^2 - 1) lambda / 2 - turn^2 lambda = tension for lambda.

        With EI = 1, turn is the moment and theta' = moment lambda^2.
        """
        stretch = 1.0
        for _ in range(30):
            value = 0.5 * axial * (stretch**2 - 1.0) * stretch - turn**2 * stretch - tension
            stretch -= value / (0.5 * axial * (3.0 * stretch**2 - 1.0) - turn**2)
        return stretch

    def slope(x, state):
        theta, moment = state[:2]
        size = stretch(moment, load * np.sin(theta))
        along, down = size * np.cos(theta), size * np.sin(theta)
        return [moment * size**2, -load * along, along, down]

    def end(root_moment):
        options = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13}
        return solve_ivp(slope, (0.0, 1.0), [0.0, root_moment, 0.0, 0.0], **options).y[:, -1]

    root = brentq(lambda moment: end(moment)[1], 0.1 * load, 1.1 * load, xtol=1e-13)
    return end(root)[2:]


@jit
def tip_under(made, load):
    """The tip (along, down) under a load P [N]."""
    made = eqx.tree_at(lambda s: s.fields[0].vector, made, jnp.array([0.0, 0.0, -1.0]) * load)
    found = equilibrium(made, straight(made), jnp.zeros(3))
    return found.q.tether[0, 1:, -1, 0] * jnp.array([1.0, -1.0])


def cantilever(elements, axial):
    """A clamped cable with EI = L = 1 and a unit tip mass."""
    return one_tether(
        elements=elements, axial=axial, bending=1.0, tip_mass=1.0, clamped=True, gravity=[0.0, 0.0, 0.0]
    )


def test_elliptic_integrals(validate):
    """The tip of the inextensible limit and its derivative by the load agree with elliptic integrals.

    The limit is extrapolated from 32 elements with EA = 1e5 and 2e5, whose error is 3.4/EA. The derivative
    uses the implicit function theorem.
    """
    load, exact = elliptic(TIP_ANGLE)
    soft, hard = (
        jax.jvp(lambda p, ea=ea: tip_under(cantilever(32, ea), p), (jnp.asarray(load),), (jnp.ones(()),))
        for ea in (1e5, 2e5)
    )
    tip, change = (2.0 * np.asarray(b) - np.asarray(a) for a, b in zip(soft, hard, strict=True))
    case, reference = "elastica cantilever, tip at 50 deg", "elliptic integrals"
    validate("ELA-1", case, reference, "tip position / L", np.abs(tip - exact).max(), 1e-6)
    h = 1e-5
    (p0, x0), (p1, x1) = (elliptic(TIP_ANGLE + d) for d in (-h, h))
    slope = (x1 - x0) / (p1 - p0)
    validate(
        "ELA-2", case, reference, "d tip / d load", np.abs(change - slope).max() / np.abs(slope).max(), 1e-5
    )


def test_order_of_the_cable_element(validate):
    """The error against shooting is of fourth order in the element length, at EA = 100.

    At EA = 1e4 membrane locking hides the order up to 64 elements.
    """
    load, _ = elliptic(TIP_ANGLE)
    exact = shooting(load, 100.0)
    errors = [np.abs(np.asarray(tip_under(cantilever(n, 100.0), load)) - exact).max() for n in (16, 32)]
    order = np.log2(errors[0] / errors[1])
    case, reference = "extensible elastica", "shooting, rtol 1e-12"
    validate("ELA-3", case, reference, "tip position / L, 32 elements", errors[1], 1e-8)
    validate("ELA-4", case, reference, "order of convergence, distance from 4", abs(order - 4.0), 0.1)
