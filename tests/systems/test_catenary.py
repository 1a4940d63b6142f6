"""The elastic catenary: a cable without bending under its weight, pulled at its end.

Linear elastic, T = EA (|r_x| - 1): with H and V(s) = V_L + w (L - s) the components of the tension,

    x(s) = H s / EA + (H / w) (asinh(V(0)/H) - asinh(V(s)/H))
    z(s) = (V_L s + w (L s - s^2/2)) / EA + (T(0) - T(s)) / w,      T = sqrt(H^2 + V^2)

(Irvine, Cable Structures, 1981), z downwards from the support.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from quick import jit

from esail_jax.array_types import Vector
from esail_jax.equilibria import equilibrium, unstretched_line
from esail_jax.system import System
from systems.drive import one_tether, straight

LENGTH, AXIAL, DENSITY, GRAVITY = 10.0, 500.0, 1.5, 9.81


class Pulled(System):
    """With a constant force [N] at the tip. Being constant, it has no tangent."""

    pull: Vector = eqx.field(kw_only=True)

    @classmethod
    def of(cls, system: System, pull: Vector):
        return cls(*(getattr(system, name) for name in System.__dataclass_fields__), pull=pull)

    def tether_forces(self, *state):
        forces, power = super().tether_forces(*state)
        pull = self.pull.reshape(3, *(1,) * (forces.ndim - 4))  # of one state or several
        return forces.at[0, ..., -1, 0].add(-pull), power


@jit
def hanging(made, pull):
    """Node positions (2, node): horizontal and down."""
    system = Pulled.of(made, pull)
    # Stretched, for a straight cable without tension has no stiffness across.
    start = straight(made, direction=(0.0, 0.8, -0.6), line=1.1 * unstretched_line(made.tethers))
    found = equilibrium(system, start, jnp.zeros(3))
    return found.q.tether[0, 1:, :, 0] * jnp.array([[1.0], [-1.0]])


def closed_form(s, pull):
    """(2, node) for a pull (H, down V_L)."""
    h, end = pull
    w = DENSITY * GRAVITY
    v = end + w * (LENGTH - s)
    v0 = end + w * LENGTH
    x = h * s / AXIAL + h / w * (jnp.arcsinh(v0 / h) - jnp.arcsinh(v / h))
    z = (end * s + w * (LENGTH * s - s**2 / 2.0)) / AXIAL + (jnp.hypot(h, v0) - jnp.hypot(h, v)) / w
    return jnp.stack([x, z])


@pytest.mark.parametrize(("kind", "elements", "bound"), [("cable", 16, 1e-6), ("truss", 64, 2.5e-4)])
def test_elastic_catenary(kind, elements, bound, validate):
    """Shape and its derivative by the horizontal pull. The truss is of second order, (1/64)^2."""
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
