"""A small sail with numbers of order one in random states, in the package's and in the paper's coordinates.

The paper's coordinates are q = (d_1 ... d_4 | e_11 ... e_1n | ... | e_p1 ... e_pn), e = (r, r_x), [PGV]
Eq. 4. The sail has four different tethers of two cables: every term of a formula counts, the mean plane of
the tips is a fit, and interior nodes exist. Table 1's numbers use the same compiled functions.
"""

import functools
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from esail_jax.compilation.options import COMPILER_OPTIONS
from esail_jax.constants import ASTRONOMICAL_UNIT, PROTON_MASS, VACUUM_PERMITTIVITY
from esail_jax.coordinates import Coordinates
from esail_jax.observables import make_instant, observe
from esail_jax.scenes.build import Model, build
from esail_jax.scenes.loading import parse
from esail_jax.scenes.structure import split
from esail_jax.system import Power, System
from oracles.ledger import Errors

COMPILER = COMPILER_OPTIONS | {"xla_backend_optimization_level": 0}
"""These programs run once or twice: compiling is all they cost."""

P, NODES, STATES = 4, 3, 3
HEIGHT, RADIUS, HUB_DENSITY = 0.9, 0.7, 1.3
LENGTH, TIP_MASS = np.array([1.3, 1.7, 2.1, 1.5]), np.array([0.5, 0.8, 0.4, 0.7])
LINE_DENSITY, AXIAL = 0.6 * 0.8, 0.6 * 5.0
WORK, START_ENERGY = (0.3, 0.2), 0.7
"""Work done and energy lost before the states, and the energy there was [J]."""

SPIN, ORIGIN = 0.3, np.array([3.0, -2.0, 1.5])

TEXT = f"""
[hub]
height = {HEIGHT}
radius = {RADIUS}
density = {HUB_DENSITY}
[tethers]
count = {P}
length = {LENGTH.tolist()}
area = 0.6
density = 0.8
youngs_modulus = 5.0
elements = {NODES - 1}
axial_damping_time = 0.3
[remote_units]
mass = {TIP_MASS.tolist()}
[solar_wind]
speed = 2.0
number_density = {1.0 / (VACUUM_PERMITTIVITY * PROTON_MASS)!r}
cutoff_voltage = 1.0
[voltage]
value = [6.0, 5.0, 7.0, 4.0]
[initial]
spin_rate = {SPIN}
sailing_angle_deg = 25.0
heliocentric_position_au = {(ORIGIN / ASTRONOMICAL_UNIT).tolist()}
[integrator]
t_end = 1.0
"""

TABLE_1 = {
    "hub.height": 2.0,
    "hub.radius": 1.0,
    "hub.density": 884.0,
    "tethers.length": 10e3,
    "tethers.area": 4.28e-9,
    "tethers.density": 7653.0,
    "tethers.youngs_modulus": 70e9,
    "tethers.axial_damping_time": 1.0,
    "remote_units.mass": 1.5,
    "solar_wind.speed": 4e5,
    "solar_wind.number_density": 7.3e6,
    "solar_wind.cutoff_voltage": 1e3,
    "voltage.value": 20e3,
    "initial.spin_rate": 4e-3,
    "initial.heliocentric_position_au": [0.5**0.5, 0.5**0.5, 0.0],
}
"""[PGV] Table 1 and Sec. 2.2.3, 4.1, but for the number of tethers."""

B_P = np.hstack([np.eye(3), np.zeros((3, 3))])
B_S = np.hstack([np.zeros((3, 3)), np.eye(3)])
SIZE = 12 + 6 * NODES * P


def node(i: int, j: int) -> np.ndarray:
    """B_ij of Eq. 6, tether i and node j counted from 1."""
    return np.eye(SIZE)[12 + 6 * (NODES * (i - 1) + j - 1) :][:6]


def base(k: int) -> np.ndarray:
    """B_k^r of Eq. 7, base point k from 1."""
    return np.eye(SIZE)[3 * (k - 1) :][:3]


def azimuth(i: int) -> float:
    """zeta_i of Sec. 3.1, tether i from 1."""
    return 2.0 * np.pi * (i - 1) / P


def body_to_local(zeta: float) -> np.ndarray:
    """C_B^Z as printed in Eq. 57."""
    c, s = np.cos(zeta), np.sin(zeta)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]])


def skew(w: np.ndarray) -> np.ndarray:
    """Cross-product matrix."""
    return np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])


def about(axis: int, angle: float) -> np.ndarray:
    """Active rotation about a coordinate axis: columns are the turned axes."""
    a, b = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[a, a] = matrix[b, b] = np.cos(angle)
    matrix[b, a], matrix[a, b] = np.sin(angle), -np.sin(angle)
    return matrix


def orbital_axes(position: np.ndarray) -> np.ndarray:
    """Columns i_O, j_O, k_O at a heliocentric position, by the words of Sec. 2.1 and Eq. 44."""
    k = position / np.linalg.norm(position)
    i = np.cross([0.0, 0.0, 1.0], k)
    i /= np.linalg.norm(i)
    return np.column_stack([i, np.cross(k, i), k])


class State(NamedTuple):
    """One random state.

    q, v: coordinates and velocities, Eq. 4; turn, omega: C_B^I and omega^B with which the hub was placed;
    seen: the package's observables, and what `look` adds.
    """

    q: np.ndarray
    v: np.ndarray
    turn: np.ndarray
    omega: np.ndarray
    seen: dict[str, np.ndarray]

    @property
    def centre(self) -> np.ndarray:
        """r_OB, Eq. 43."""
        return 0.5 * (base(1) + base(2)) @ self.q

    @property
    def orbital(self) -> np.ndarray:
        """Columns X_O, Y_O, Z_O."""
        return orbital_axes(ORIGIN + self.centre)

    @property
    def anchor_to_tip(self) -> np.ndarray:
        """rho_i^I, Eq. 56: (tether, xyz)."""
        return np.array([B_P @ (node(i, NODES) - node(i, 1)) @ self.q for i in range(1, P + 1)])


def flat(x: Coordinates) -> np.ndarray:
    """Coordinates of the package in the order of Eq. 4."""
    tether = np.asarray(x.tether).transpose(3, 2, 0, 1)
    return np.concatenate([np.asarray(x.hub).reshape(-1), tether.reshape(-1)])


def model(overrides: dict | None = None) -> Model:
    """The small sail as the package builds it, with some numbers changed."""
    return built(*split(parse(TEXT, "oracles", overrides)))


built = jax.jit(build, static_argnums=0, compiler_options=COMPILER)


@functools.cache
def looking():
    """Compiled: many states of one system -> observables and what they are made of."""

    def see(system: System, origin, q: Coordinates, v: Coordinates):
        zero = jnp.zeros(())
        work = Power(*(jnp.asarray(x) for x in WORK))
        instant = make_instant(system, origin, zero, q, v, work, jnp.asarray(START_ENERGY))
        rest = jax.tree.map(jnp.zeros_like, q)
        statics, _ = system.residual(zero, q, v, rest, system.no_multipliers())
        added = {
            "hub_acceleration": instant.vdot.hub,
            "load": instant.load if instant.load is None else system.tethers.of_tethers(instant.load),
            "root_slopes": first_slopes(system, q).T,
            "local": instant.local_frame(instant.tips - instant.roots).T,
            "sail_axes": instant.sail_axes(),
            "static": statics.forces,
        }
        return observe(instant) | added

    def first_slopes(system: System, q: Coordinates):
        tethers = system.tethers
        start = tethers.shape_table(np.zeros(1), 1)[0]
        first = tethers.of_tethers(tethers.element_vectors(q.tether))[:, :, 0]
        return jnp.tensordot(start, first, 1) / tethers.element_length

    return jax.jit(jax.vmap(see, in_axes=(None, None, 0, 0)), compiler_options=COMPILER)


def look(system: System, origin: np.ndarray, qs: list[Coordinates], vs: list[Coordinates]) -> list[dict]:
    """The package's observables in states of one system."""
    stacked = (jax.tree.map(lambda *x: jnp.stack(x), *batch) for batch in (qs, vs))
    seen = jax.device_get(looking()(system, jnp.asarray(origin), *stacked))
    return [jax.tree.map(lambda x, k=k: x[k], seen) for k in range(len(qs))]


def random_placement(rng: np.random.Generator, system: System) -> tuple:
    """Hub anywhere, turned anyhow and moving rigidly; tethers bent, within a right angle of outward."""
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    turn *= np.linalg.det(turn)
    omega, centre, drift = rng.normal(size=(3, 3))
    body = np.asarray(system.hub.base_points)
    hub, hub_rate = centre + body @ turn.T, drift + np.cross(omega, body) @ turn.T
    zeta = np.array([azimuth(i) for i in range(1, P + 1)])
    outward = turn @ np.array([0.0 * zeta, np.cos(zeta), np.sin(zeta)])
    along = np.linspace(0.0, 1.0, NODES)[None, :, None] * LENGTH
    place = centre[:, None, None] + (RADIUS + along) * outward[:, None]
    tether = np.stack([place, np.broadcast_to(outward[:, None], place.shape)])
    tether = tether + rng.uniform(-0.35, 0.35, size=tether.shape)
    q = system.place_roots(jnp.zeros(()), Coordinates(jnp.asarray(tether), jnp.asarray(hub)))
    rate = Coordinates(jnp.asarray(rng.normal(size=tether.shape)), jnp.asarray(hub_rate))
    return q, system.place_roots(jnp.zeros(()), rate, derivative=1), turn, omega


@functools.cache
def states() -> list[State]:
    """The random states that the oracles share."""
    rng, system = np.random.default_rng(2), model().system
    placed = [random_placement(rng, system) for _ in range(STATES)]
    seen = look(system, ORIGIN, [x[0] for x in placed], [x[1] for x in placed])
    return [State(flat(q), flat(v), turn, w, s) for (q, v, turn, w), s in zip(placed, seen, strict=True)]


@functools.cache
def starts() -> list[State]:
    """Table 1's sail as the package starts it, at sailing angles of 0, 10 and 25 deg."""
    models = [model(TABLE_1 | {"initial.sailing_angle_deg": a}) for a in (0.0, 10.0, 25.0)]
    origin = np.array([0.5**0.5, 0.5**0.5, 0.0]) * ASTRONOMICAL_UNIT
    # One look per sail, padded to the number of states so that nothing is compiled again.
    views = [look(m.system, origin, [m.q] * STATES, [m.v] * STATES)[0] for m in models]
    nothing = np.full(3, np.nan)
    return [
        State(flat(m.q), flat(m.v), s["rotation_IB"], nothing, s)
        for m, s in zip(models, views, strict=True)
    ]


def worst(error: Callable[[State], float]) -> float:
    """The largest error over the random states."""
    return max(error(state) for state in states())


def worst_of_both(errors: Callable[[State], Errors]) -> Errors:
    """The largest error of the right form and the smallest error of the printed form over the
    states.

    Every state must show the misprint.
    """
    found = [errors(state) for state in states()]
    return Errors(min(e.printed for e in found), max(e.right for e in found))
