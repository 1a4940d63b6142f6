"""The elastic catenary: a cable without bending stiffness under its weight and a force at its end.

The cable is linear elastic, T = EA (|r_x| - 1). With the components H and V(s) = V_L + w (L - s) of the
tension,

    x(s) = H s / EA + (H / w) (asinh(V(0)/H) - asinh(V(s)/H))
    z(s) = (V_L s + w (L s - s^2/2)) / EA + (T(0) - T(s)) / w,      T = sqrt(H^2 + V^2)

(Irvine, Cable Structures, 1981); z points downwards from the support.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from esail_jax.equilibria.equilibrium import equilibrium
from esail_jax.equilibria.steady_stretch import unstretched_line
from support.one_tether import Pulled, one_tether, straight
from support.quick import jit

LENGTH, AXIAL, DENSITY, GRAVITY = 10.0, 500.0, 1.5, 9.81


@jit
def hanging(made, pull):
    """The node positions (2, node), horizontal and down [m]."""
    system = Pulled.of(made, pull)
    # The start is stretched, because a straight cable without tension has no transverse stiffness.
    start = straight(made, direction=(0.0, 0.8, -0.6), line=1.1 * unstretched_line(made.tethers))
    found = equilibrium(system, start, jnp.zeros(3))
    return found.q.tether[0, 1:, :, 0] * jnp.array([[1.0], [-1.0]])


def closed_form(s, pull):
    """The node positions (2, node) for an end force (H, V_L), V_L downwards."""
    h, end = pull
    w = DENSITY * GRAVITY
    v = end + w * (LENGTH - s)
    v0 = end + w * LENGTH
    x = h * s / AXIAL + h / w * (jnp.arcsinh(v0 / h) - jnp.arcsinh(v / h))
    z = (end * s + w * (LENGTH * s - s**2 / 2.0)) / AXIAL + (jnp.hypot(h, v0) - jnp.hypot(h, v)) / w
    return jnp.stack([x, z])


@pytest.mark.parametrize(
    ("kind", "elements", "bound"),
    [("cable", 16, 1e-6), pytest.param("truss", 64, 2.5e-4, marks=pytest.mark.nightly)],
)
def test_elastic_catenary(kind, elements, bound, validate):
    """The shape and its derivative by H agree with the closed form. The truss has an error of order
    (1/64)^2."""
    made = one_tether(
        kind=kind, elements=elements, length=LENGTH, axial=AXIAL, line_density=DENSITY,
        strain="engineering", gravity=[0.0, 0.0, -GRAVITY],
    )  # fmt: skip
    s = jnp.linspace(0.0, LENGTH, elements + 1)
    point = (jnp.array([60.0, 0.0]), jnp.array([1.0, 0.0]))
    exact, slope = jax.jvp(lambda p: closed_form(s, p), (point[0],), (point[1],))
    shape, change = jax.jvp(
        lambda p: hanging(made, jnp.stack([0.0 * p[0], p[0], -p[1]])), (point[0],), (point[1],)
    )
    case, reference = f"elastic catenary, {elements} {kind} elements", "closed form (Irvine)"
    number = 1 if kind == "cable" else 3
    validate(f"CAT-{number}", case, reference, "nodes / L", np.abs(shape - exact).max() / LENGTH, bound)
    error = np.abs(change - slope).max() / np.abs(slope).max()
    validate(f"CAT-{number + 1}", case, reference, "d nodes / d pull", error, 10.0 * bound)
