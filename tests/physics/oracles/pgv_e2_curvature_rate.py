"""[PGV] Appendix A.2, Eq. 113-119: rate of the curvature, its derivative by the velocities, the force.

The judge's bending dissipation is the package's with straight_curvature = 0, so that it is Eq. 36 as
printed; all states are bent, but for those of "113 (straight)". Derivatives of scalars are rows.
`point.a`, `.b`, `.c` are S_x^T S_x, S_xx^T S_xx, S_x^T S_xx; `point.v` is de/dt.
"""

import jax
import jax.numpy as jnp
import numpy as np

from esail_jax.elements.bending import BendingDissipation
from esail_jax.point_fields import PointFields
from oracles.ledger import Errors, fails, holds, relative_error
from oracles.pgv_c0_element import (
    cables,
    defined,
    element_error,
    integral,
    point_error,
    points,
    straight_cables,
)
from oracles.pgv_c2_bending import phi1, phi2


def phi1_t(p):
    """Eq. 114 with products in place of sums."""
    first = 2 * (p.e.T @ p.a @ p.v) * (p.e.T @ p.b @ p.e) + 2 * (p.e.T @ p.a @ p.e) * (p.e.T @ p.b @ p.v)
    return first - 2 * (p.e.T @ p.c.T @ p.v + p.e.T @ p.c @ p.v) * (p.e.T @ p.c @ p.e)


def phi2_t(p):
    """Eq. 115."""
    return 2 * p.e.T @ p.a @ p.v


def kappa_t(p):
    """Eq. 113."""
    first = 0.5 * phi1(p) ** -0.5 * phi2(p) ** -1.5 * phi1_t(p)
    return first - 1.5 * phi1(p) ** 0.5 * phi2(p) ** -2.5 * phi2_t(p)


def phi1_t_v(p):
    """Eq. 119 with products in place of sums."""
    first = 2 * (p.e.T @ p.b @ p.e) * (p.e.T @ p.a) + 2 * (p.e.T @ p.a @ p.e) * (p.e.T @ p.b)
    return first - 2 * (p.e.T @ p.c.T + p.e.T @ p.c) * (p.e.T @ p.c @ p.e)


def phi2_t_v(p):
    """Eq. 118."""
    return 2 * p.e.T @ p.a


def kappa_t_v(p):
    """Eq. 117."""
    first = 0.5 * phi1(p) ** -0.5 * phi2(p) ** -1.5 * phi1_t_v(p)
    return first - 1.5 * phi1(p) ** 0.5 * phi2(p) ** -2.5 * phi2_t_v(p)


@holds("PGV", "113", "Rate of the curvature from the rates of Phi_1 and Phi_2")
def curvature_rate():
    return point_error(kappa_t, "kappa_t")


@fails(
    "PGV",
    "113 (straight)",
    "Rate of the curvature of a straight cable, and with it Eq. 116, 117 and 120-127",
    printed=r"$\Phi_1^{-1/2}\,\partial\Phi_1/\partial t$ is 0/0 where $\Phi_1 = 0$: $|\kappa|$ has a kink "
    "there",
    right=r"no value exists; in P_d, $\dot\kappa^2$ may become "
    r"$(\kappa\dot\kappa)^2/(\kappa^2+\kappa_0^2)$ with $\kappa\dot\kappa = "
    r"\frac12\Phi_2^{-3}\dot\Phi_1 - \frac32\Phi_1\Phi_2^{-4}\dot\Phi_2$, smooth and zero when "
    "straight",
    consequence="Eq. 79 starts every tether exactly straight: on the stretched baseline tether the "
    "bending damping is NaN from the start.",
)
def curvature_rate_when_straight():
    """The print on straight cables, its finite replacement on bent and straight ones."""
    both = cables() + straight_cables()
    owners = [(cable, p) for cable in both for p in points(cable)]

    def numbers(name):
        return jnp.array([getattr(cable, name) for cable, _ in owners])

    def field(matrix, vector):
        return jnp.array(np.hstack([getattr(p, matrix) @ getattr(p, vector) for _, p in owners]))

    small = jnp.full(len(owners), 0.7)
    term = BendingDissipation(numbers("bending"), numbers("bending_time"), small)
    fields, rates = (PointFields(None, field("s_x", x), field("s_xx", x)) for x in "ev")
    values = []
    for cable, p in owners:
        product = 0.5 * phi1_t(p) / phi2(p) ** 3 - 1.5 * phi1(p) / phi2(p) ** 4 * phi2_t(p)
        squared = product**2 / (phi1(p) / phi2(p) ** 3 + 0.7**2)
        values.append(0.5 * cable.bending_time * cable.bending * squared.item())
    straight = [p for _, p in owners[len(owners) // 2 :]]
    with np.errstate(all="ignore"):
        printed = [kappa_t(p).item() for p in straight]
    # Finite or not, what is left are rounding errors: they are not |d kappa/dt| of either side.
    beside = [np.linalg.norm((p.s_xx @ p.v)[1:]) / phi2(p).item() for p in straight]
    truth = jax.jit(lambda *at: term.density(*at))(fields, rates)
    return Errors(defined(relative_error(printed, beside)), relative_error(values, truth))


@fails(
    "PGV",
    "114",
    "Rate of Phi_1",
    printed=r"$2e^TS_x^TS_x\dot e + e^TS_{xx}^TS_{xx}e + 2e^TS_x^TS_xe + e^TS_{xx}^TS_{xx}\dot e - "
    r"\ldots$: sums of quantities of different units",
    right=r"$2(e^TS_x^TS_x\dot e)(e^TS_{xx}^TS_{xx}e) + 2(e^TS_x^TS_xe)(e^TS_{xx}^TS_{xx}\dot e) - "
    r"\ldots$",
    consequence="Depends on the unit of length. A cantilever bent by 45 deg that turns rigidly by 1 "
    "rad/s should have no rate of curvature; with kappa = 1.42 /m the print gives 1.40 /m/s, "
    "so that rigid rotation dissipates.",
)
def first_function_rate():
    def printed(p):
        a, b, c, e, v = p.a, p.b, p.c, p.e, p.v
        sums = 2 * e.T @ a @ v + e.T @ b @ e + 2 * e.T @ a @ e + e.T @ b @ v
        return sums - 2 * (e.T @ c.T @ v + e.T @ c @ v) * (e.T @ c @ e)

    return Errors(point_error(printed, "phi1_t"), point_error(phi1_t, "phi1_t"))


@holds("PGV", "115", "Rate of Phi_2", note='"The time derivative of Eq. (103)" is that of Phi_2 itself.')
def second_function_rate():
    return point_error(phi2_t, "phi2_t")


@holds("PGV", "116", "Bending damping force")
def bending_damping_force():
    def force(cable):
        integrated = integral(cable, lambda p: kappa_t(p) * kappa_t_v(p).T)
        return -cable.bending_time * cable.bending * integrated

    return element_error(force, "Q_db")


@holds("PGV", "117", "Derivative of the curvature's rate by the velocities, a row")
def curvature_rate_by_velocities():
    return point_error(kappa_t_v, "kappa_t_v")


@holds(
    "PGV",
    "118",
    "Derivative of the rate of Phi_2 by the velocities",
    note='"The derivation of Eq. (115) and Eq. (119)" is that of Eq. 115 and 114.',
)
def second_function_rate_by_velocities():
    return point_error(phi2_t_v, "phi2_t_v")


@fails(
    "PGV",
    "119",
    "Derivative of the rate of Phi_1 by the velocities",
    printed=r"$2e^TS_{xx}^TS_{xx}e + e^TS_x^TS_x + 2e^TS_x^TS_xe + e^TS_{xx}^TS_{xx} - \ldots$: numbers "
    "added to rows",
    right=r"$2(e^TS_{xx}^TS_{xx}e)e^TS_x^TS_x + 2(e^TS_x^TS_xe)e^TS_{xx}^TS_{xx} - \ldots$",
    consequence="The bending damping force is wrong by 1.2 to 1.4 times itself on a cantilever bent by "
    "45 deg, and the nodal forces of an element no longer add up to zero.",
)
def first_function_rate_by_velocities():
    def printed(p):
        a, b, c, e = p.a, p.b, p.c, p.e
        sums = 2 * e.T @ b @ e + e.T @ a + 2 * e.T @ a @ e + e.T @ b
        return sums - 2 * (e.T @ c.T + e.T @ c) * (e.T @ c @ e)

    return Errors(point_error(printed, "phi1_t_v"), point_error(phi1_t_v, "phi1_t_v"))
