"""[PGV] Sec. 2.2 and 2.2.1: interpolation and inertia of a cable element, Eq. 16-22."""

import functools

import jax
import jax.numpy as jnp
import numpy as np

from esail_jax.scenes.build import tethers_of
from esail_jax.scenes.loading import load_scene
from esail_jax.scenes.structure import split

from . import pgv_a_forms as forms
from . import pgv_a_sail as sail
from .ledger import holds, relative_error

N, P = sail.N, sail.P
ELEMENTS = [(i, j) for i in range(1, P + 1) for j in range(1, N)]
GAUSS = 0.5 + 0.5 * np.polynomial.legendre.leggauss(5)[0]
"""Points at which the package evaluates an element, as fractions of its length."""


def element_vector(q: np.ndarray, i: int, j: int) -> np.ndarray:
    """e_ij of Eq. 8."""
    return forms.element_boolean(i, j, N, P) @ q


@functools.cache
def at_points() -> tuple[np.ndarray, np.ndarray]:
    """The package's r at the Gauss points, from q and from v: (element, point, xyz)."""
    found = []
    for x in sail.states()[0][:2]:
        tethers = sail.sail().tethers
        r = np.asarray(tethers.of_tethers(tethers.interpolate(sail.unflat(jnp.asarray(x)).tether).r))
        found.append(np.array([r[:, :, j - 1, i - 1].T for i, j in ELEMENTS]))
    return tuple(found)


def interpolated(x: np.ndarray) -> np.ndarray:
    """S(x) e at the same points."""
    lengths = {pair: sail.LENGTHS[pair[0] - 1] for pair in ELEMENTS}
    return np.array(
        [
            [
                forms.shape_matrix(xi * lengths[pair], lengths[pair]) @ element_vector(x, *pair)
                for xi in GAUSS
            ]
            for pair in ELEMENTS
        ]
    )


@holds("PGV", "16", "position in an element")
def position():
    return relative_error(interpolated(sail.states()[0].q), at_points()[0])


@holds("PGV", "17", "matrix of shape functions")
def shape_function_matrix():
    """3 x 12; every block a multiple of the unit matrix. The package's functions act on l r_x."""
    length, xi = 0.7, np.linspace(0.0, 1.0, 7)
    table = sail.sail().tethers.shape_table(xi, 0) * [1.0, length, 1.0, length]
    judge = [np.kron(row, np.eye(3)) for row in table]
    return relative_error([forms.shape_matrix(x * length, length) for x in xi], judge)


@holds("PGV", "18", "shape functions")
def shape_functions():
    """The four cubics with value and slope 1 at one end in turn, solved for; and the package's."""
    length, xi = 0.7, np.linspace(0.0, 1.0, 7)
    powers = np.arange(4)

    def ends(x):
        values = x**powers
        slopes = powers * x ** np.maximum(powers - 1, 0)
        return [values, slopes]

    cubics = np.linalg.inv(np.array([*ends(0.0), *ends(length)]))
    judge = (xi[:, None] * length) ** powers @ cubics
    printed = np.array([forms.shape_matrix(x * length, length)[0, ::3] for x in xi])
    kept = sail.sail().tethers.shape_table(xi, 0) * [1.0, length, 1.0, length]
    return max(relative_error(printed, judge), relative_error(kept, printed))


@holds("PGV", "19", "nodal coordinates of an element")
def nodal_coordinates():
    """Position and slope of r(x) at both ends are the entries of e, in this order."""
    errors = []
    for i, j in ELEMENTS:
        length, e = sail.LENGTHS[i - 1], element_vector(sail.states()[0].q, i, j)
        scaled = e.reshape(4, 3) * np.array([1.0, length, 1.0, length])[:, None]
        values, slopes = (sail.sail().tethers.shape_table(np.array([0.0, 1.0]), d) @ scaled for d in (0, 1))
        ends = np.stack([values, slopes / length], axis=1)
        errors.append(relative_error(e, ends.reshape(-1)))
    return max(errors)


@holds("PGV", "20", "velocity in an element")
def velocity():
    return relative_error(interpolated(sail.states()[0].v), at_points()[1])


@functools.partial(jax.jit, compiler_options=sail.QUICKLY)
def momentum(v):
    return sail.flat(sail.unflat(v)._replace(tether=sail.sail().tethers.inertia(sail.unflat(v).tether)))


@holds("PGV", "21", "kinetic energy of an element")
def kinetic_energy():
    """The judge is the integral of the squared speed for each element, and v . M v of the package with the
    remote units for the whole tether."""
    v = sail.states()[0].v
    points, weights = np.polynomial.legendre.leggauss(8)
    printed, judge = [], []
    for i, j in ELEMENTS:
        length, density, rate = sail.LENGTHS[i - 1], sail.LINE_DENSITY[i - 1], element_vector(v, i, j)
        printed.append(0.5 * rate @ forms.cable_mass(density, length) @ rate)
        velocities = [forms.shape_matrix(0.5 * length * (1 + x), length) @ rate for x in points]
        judge.append(
            sum(0.25 * length * density * w * u @ u for w, u in zip(weights, velocities, strict=True))
        )
    tips = [forms.node_boolean(i, N, N, P)[:3] @ v for i in range(1, P + 1)]
    whole = sum(printed) + sum(0.5 * m * u @ u for m, u in zip(sail.TIP_MASS, tips, strict=True))
    kept = 0.5 * v[12:] @ np.asarray(momentum(jnp.asarray(v)))[12:]
    return max(relative_error(printed, judge), relative_error(whole, kept))


@holds("PGV", "22", "mass matrix of an element")
def mass_matrix():
    """The judges are the package's matrix, whose slopes are in metres, and the baseline's length for l =
    L_0/(n - 1)."""
    kept = np.asarray(sail.sail().tethers.mass_elements())
    errors = []
    for i in range(1, P + 1):
        length = sail.LENGTHS[i - 1]
        scale = np.repeat([1.0, length, 1.0, length], 3)
        printed = forms.cable_mass(sail.LINE_DENSITY[i - 1], length)
        errors.append(relative_error(printed, kept[:, :, 0, i - 1] * scale[:, None] * scale))
    structure, numbers = split(load_scene("baseline"))
    tethers = tethers_of(structure, numbers, True)
    errors += [relative_error(10e3 / (6 - 1), tethers.element_length[0])]
    errors += [relative_error(7653 * 4.28e-9, tethers.line_density[0])]
    return max(errors)
