"""A sail of order-one sizes in the package, and its equations in the coordinates of [PGV] Eq. 4.

Three tethers of three nodes, each of its own length and mass, with everything the package can put on
them. The roots are nodes of their own here, as in the paper: held by multipliers, not identified.
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from esail_jax.constants import PROTON_MASS, VACUUM_PERMITTIVITY
from esail_jax.coordinates import Coordinates, Multipliers
from esail_jax.elements.axial import AxialDissipation, AxialEnergy
from esail_jax.elements.bending import BendingEnergy
from esail_jax.elements.rigid_body import RigidBody
from esail_jax.elements.tether import TetherBatch
from esail_jax.environment.solar_wind import SteadyWind
from esail_jax.joints.roots import HubRoots
from esail_jax.loads.coulomb import CoulombThrust
from esail_jax.loads.voltage import Constant
from esail_jax.steppers.consistent import consistent_acceleration
from esail_jax.steppers.generalized_alpha import GeneralizedAlpha
from esail_jax.system import System

from . import pgv_a_forms as forms
from .dense import Dense

P, N = 3, 3
"""Tethers, and nodes of each."""

M = 12 + 6 * N * P
"""Coordinates."""

HUB = (1.3, 0.8, 0.9)
"""Height, radius, density."""

LENGTHS, LINE_DENSITY, TIP_MASS = np.array([0.9, 0.7, 1.1]), np.array([0.8, 1.2, 0.6]), (0.3, 0.5, 0.4)
"""Element lengths, line densities and tip masses, tether by tether."""

SPEED, ORIGIN, VOLTAGE, CUTOFF = 1.7, np.array([2.1, -1.6, 1.9]), np.array([3.0, 0.5, 2.4]), 1.1
"""Tether 2 is below the cut-off voltage."""

DENSITY = 2.0 / (VACUUM_PERMITTIVITY * PROTON_MASS)
"""So that sqrt(eps_0 m_i n_0) is of order one."""

ANCHORS = np.array([[0.2, -0.4, 0.5], [0.7, 0.1, -0.3], [0.3, 0.6, -0.5]])
"""Rows: a root in each column, from the centre of the hub, in the body frame."""

ABC = forms.greek(*HUB[:2])

LOCAL = ANCHORS + np.array([[0.5 * HUB[0]], [0.0], [0.0]])
"""The roots as seen from base point A: x_i of Eq. 53."""

QUICKLY = {"xla_backend_optimization_level": 0, "xla_llvm_disable_expensive_passes": True}
"""Programs that run a few times: compiled quickly, not well."""


@functools.cache
def sail() -> System:
    """Built once, with numbers even if first asked for while a function is compiled."""
    with jax.ensure_compile_time_eval():
        return build()


def build() -> System:
    """Everything on but damped bending, whose derivatives have rows of their own."""
    ones = jnp.ones((N - 1) * P)
    hub = RigidBody(*(jnp.asarray(x) for x in HUB))
    wind = SteadyWind(*(jnp.asarray(x) for x in (SPEED, DENSITY, CUTOFF, ORIGIN)))
    fields = ("r", "r_x", "r_xx")
    return System(
        tethers=TetherBatch(
            *(jnp.asarray(x) for x in (LENGTHS, LINE_DENSITY, TIP_MASS)), N - 1, "cable", fields
        ),
        roots=HubRoots(hub.weights(jnp.asarray(ANCHORS)), None),
        hub=hub,
        energies=(AxialEnergy(1.9 * ones, "green-lagrange"), BendingEnergy(0.7 * ones)),
        dissipations=(AxialDissipation(1.9 * ones, 0.6 * ones, "green-lagrange"),),
        loads=(CoulombThrust.of(wind, Constant(jnp.asarray(VOLTAGE)), N - 1),),
    )


def flat(x: Coordinates) -> jax.Array:
    """Coordinates in the order of Eq. 4: hub points, then tether by tether, node by node, position
    and slope."""
    return jnp.concatenate([x.hub.reshape(-1), x.tether.transpose(3, 2, 0, 1).reshape(-1)])


def unflat(q: jax.Array) -> Coordinates:
    """The inverse of `flat`."""
    return Coordinates(q[12:].reshape(P, N, 2, 3).transpose(2, 3, 1, 0), q[:12].reshape(4, 3))


class State(NamedTuple):
    """Flat q, v and vdot, and six multipliers of the hub in the package's scaling."""

    q: np.ndarray
    v: np.ndarray
    vdot: np.ndarray
    lam: np.ndarray


@functools.cache
def states() -> tuple[State, State]:
    """Hub and tethers bent out of shape, but the roots on their anchors, where the package has them."""
    found = []
    for seed in (1, 2):
        random = np.random.default_rng(seed)
        turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
        turn = turn * np.linalg.det(turn)
        hub = forms.local_base(*HUB[:2]) @ turn.T + 0.1 * random.normal(size=(4, 3))
        outward = turn @ np.array([np.zeros(P), np.cos(2.1 * np.arange(P)), np.sin(2.1 * np.arange(P))])
        steps = LENGTHS * np.arange(N)[:, None]
        straight = np.stack([outward[:, None] * (0.8 + steps), np.repeat(outward[:, None], N, 1)])
        nodes = straight + 0.2 * random.normal(size=straight.shape)
        q = np.concatenate([hub.ravel(), nodes.transpose(3, 2, 0, 1).ravel()])
        motion = [put_roots(x) for x in (q, *random.normal(size=(2, M)))]
        found.append(State(*motion, random.normal(size=6)))
    return tuple(found)


def put_roots(q: np.ndarray) -> np.ndarray:
    """The roots, their velocities or accelerations, on the hub: r_i1 = G(x_i) d."""
    q = q.copy()
    for i in range(P):
        first = 12 + 6 * N * i
        q[first : first + 3] = forms.hub_shape_matrix(LOCAL[:, i], ABC) @ q[:12]
    return q


def nodal(conjugates) -> jax.Array:
    """Generalized forces, flat, of what acts at the points."""
    return flat(Coordinates(-sail().tethers.nodal_forces(conjugates), jnp.zeros((4, 3))))


def part(terms: tuple, q, v) -> jax.Array:
    """Generalized force of some of the terms: Q_e, Q_d or Q_c."""
    tethers = sail().tethers
    fields, rates = (tethers.interpolate(unflat(x).tether) for x in (q, v))
    return sum(nodal(term.point_forces(jnp.zeros(()), fields, rates)) for term in terms)


def residual(q, v, vdot, lam) -> jax.Array:
    """Left-hand side M vdot - Q + C_r^T lam, without the joints."""
    everything = (unflat(x) for x in (q, v, vdot))
    return flat(sail().residual(jnp.zeros(()), *everything, Multipliers(lam, None))[0].forces)


class Parts(NamedTuple):
    """Generalized forces and the left-hand side of the equations of motion."""

    elastic: np.ndarray
    coulomb: np.ndarray
    damping: np.ndarray
    residual: np.ndarray


def all_parts(q, v, vdot, lam) -> Parts:
    terms = (sail().energies, sail().loads, sail().dissipations)
    return Parts(*(part(t, q, v) for t in terms), residual(q, v, vdot, lam))


class Derivatives(NamedTuple):
    """Values, and derivatives in q, v, vdot, each of all parts: the last axis is the direction."""

    value: Parts
    q: Parts
    v: Parts
    vdot: Parts


@functools.partial(jax.jit, compiler_options=QUICKLY)
def _derivatives(*state) -> tuple[Parts, Parts]:
    """Values, and derivatives in (q, v, vdot) one after the other."""

    def parts(motion):
        found = all_parts(*jnp.split(motion, 3), state[3])
        return found, found

    return jax.jacfwd(parts, has_aux=True)(jnp.concatenate(state[:3]))[::-1]


@functools.cache
def derivatives(index: int) -> Derivatives:
    """Automatic derivatives of the package's functions at state number `index`."""
    value, by_motion = _derivatives(*(jnp.asarray(x) for x in states()[index]))
    columns = (Parts(*(np.asarray(x)[:, k * M : (k + 1) * M] for x in by_motion)) for k in range(3))
    return Derivatives(Parts(*(np.asarray(x) for x in value)), *columns)


SCALES = np.array([2 * np.linalg.norm(x) for x in forms.edges(forms.local_base(*HUB[:2])).T])
SCALES = np.concatenate([SCALES, np.sqrt(SCALES[[1, 2, 2]] * SCALES[[0, 0, 1]]) / 2])
"""Divisors by which the package scales the rows of Eq. 45: 2 L for squares, sqrt(L_K L_L) for products."""


def joint_jacobian() -> np.ndarray:
    """Eq. 55, tether by tether: (3 p, m)."""
    rows = []
    for i in range(1, P + 1):
        g = forms.hub_shape_matrix(LOCAL[:, i - 1], ABC)
        s = forms.shape_matrix(0.0, LENGTHS[i - 1])
        rows.append(g @ forms.hub_boolean(N, P) - s @ forms.element_boolean(i, 1, N, P))
    return np.vstack(rows)


def constraint_jacobian(q: np.ndarray) -> np.ndarray:
    """C_q of both kinds, joints first as in Sec. 2: (3 p + 6, m)."""
    rigid = forms.rigidity_jacobian(q[:12].reshape(4, 3)) @ forms.hub_boolean(N, P)
    return np.vstack([joint_jacobian(), rigid])


def mass_matrix() -> np.ndarray:
    """Eq. 11 with Eq. 22 and 52, and the remote units where Sec. 2 puts them."""
    total = np.zeros((M, M))
    for i in range(1, P + 1):
        for j in range(1, N):
            b = forms.element_boolean(i, j, N, P)
            total += b.T @ forms.cable_mass(LINE_DENSITY[i - 1], LENGTHS[i - 1]) @ b
        tip = forms.node_boolean(i, N, N, P)[:3]
        total += TIP_MASS[i - 1] * tip.T @ tip
    hub = forms.hub_boolean(N, P)
    return total + hub.T @ forms.hub_mass(*HUB) @ hub


STEP, RHO = 0.9, 0.25
"""Step of order one, so that mass, damping and stiffness weigh alike, and the paper's spectral radius."""


class Solved(NamedTuple):
    """The package's results for a state.

    matrix: its iteration matrix in its independent unknowns; held: the map from these to all of
    (q, lam_r) as the paper orders them, roots on the hub; acceleration: its consistent
    (vdot, lam_r); bend: d^2 C_r/dt^2 at no acceleration. Multipliers as in Eq. 45.
    """

    matrix: np.ndarray
    held: np.ndarray
    acceleration: np.ndarray
    bend: np.ndarray


STEPPER = GeneralizedAlpha(jnp.asarray(STEP), jnp.asarray(RHO))


@functools.partial(jax.jit, compiler_options=QUICKLY)
def _solved(q, v, lam):
    time, q, v = jnp.zeros(()), unflat(q), unflat(v)
    matrix = STEPPER.factor(sail(), time, q, v, Multipliers(lam, None)).matrix
    vdot, force = consistent_acceleration(sail(), time, q, v)
    return (
        matrix,
        flat(vdot),
        force.hub,
        sail().constraint_acceleration(time, q, v, jax.tree.map(jnp.zeros_like, v)).hub,
    )


@functools.cache
def solved(index: int) -> Solved:
    """The package's results at state number `index`."""
    q, v, _, lam = (jnp.asarray(x) for x in states()[index])
    matrix, vdot, force, bend = jax.tree.map(np.asarray, _solved(q, v, lam))
    dense = Dense(matrix)
    to_paper = np.zeros((M + 6, dense.count))
    to_paper[np.arange(12), dense.border[:12]] = 1.0
    for i in range(P):
        scale = np.tile([1.0, 1.0, 1.0, *[1.0 / LENGTHS[i]] * 3], N)
        to_paper[12 + 6 * N * i + np.arange(6 * N), dense.blocks[i].reshape(-1)] = scale
    to_paper[M + np.arange(6), dense.border[12:]] = 1.0 / SCALES
    return Solved(
        dense.independent(matrix),
        to_paper @ dense.roots_held(matrix),
        np.concatenate([vdot, force / SCALES]),
        bend * SCALES,
    )
