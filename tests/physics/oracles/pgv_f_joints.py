"""[PGV] Sec. 2.4: spherical joints between hub and tethers, Eq. 53-55."""

import jax
import jax.numpy as jnp
import numpy as np

from esail_jax.scenes.build import build
from esail_jax.scenes.loading import load_scene
from esail_jax.scenes.structure import split

from . import pgv_a_forms as forms
from . import pgv_a_sail as sail
from .ledger import Errors, fails, holds, relative_error

M, N, P = sail.M, sail.N, sail.P


def package_gap(q) -> jax.Array:
    """Hub's point minus the tether's first node, tether by tether."""
    nodes = sail.unflat(q)
    return (sail.sail().roots.positions(nodes.hub) - nodes.tether[0, :, 0]).T.reshape(-1)


@holds(
    "PGV",
    "53",
    "spherical joint, both forms",
    note="x_i is measured from base point A; e_i1 is of element 1.",
)
def joint():
    q = np.random.default_rng(10).normal(size=M)
    judge = np.asarray(package_gap(jnp.asarray(q)))
    printed = []
    for i in range(1, P + 1):
        length, x_i = sail.LENGTHS[i - 1], sail.LOCAL[:, i - 1]
        g, s = forms.hub_shape_matrix(x_i, sail.ABC), forms.shape_matrix(0.0, length)
        printed.append(
            g @ q[:12] - s @ np.concatenate([forms.node_boolean(i, j, N, P) @ q for j in (1, 2)])
        )
    by_matrix = sail.joint_jacobian() @ q
    return max(relative_error(np.concatenate(printed), judge), relative_error(by_matrix, judge))


@fails(
    "PGV",
    "54",
    "position of the anchors",
    printed=r"x_i = [h_r/2, R_r cos(2 \pi i/p), R_r sin(2 \pi i/p)]^T, i = 1 ... p",
    right=r"x_i = [h_r/2, R_r cos(2 \pi (i - 1)/p), R_r sin(2 \pi (i - 1)/p)]^T: the azimuth zeta_i of "
    "Sec. 3.1, which Eq. 79 starts from. x = h_r/2 is right: the mid-plane, seen from base point A",
    consequence="With Eq. 79 the roots of the baseline start 0.52 m, 2 R_r sin(pi/p), from their anchors. "
    "With all tethers one azimuth further on, every lagging angle of Eq. 59 starts at 30 deg.",
)
def anchors():
    """The package's initial root positions from A in the body frame: five tethers on Table 1's
    hub."""
    structure, numbers = split(
        load_scene("baseline", {"tethers.count": 5, "tethers.elements": 1, "initial.elongation": "paper"})
    )
    model = jax.jit(build, static_argnums=0, compiler_options=sail.QUICKLY)(structure, numbers)
    hub = np.asarray(model.q.hub)
    axes = forms.edges(hub) @ forms.greek(2.0, 1.0)
    judge = axes.T @ (np.asarray(model.q.tether[0, :, 0]) - hub[0][:, None])

    def printed(first):
        angle = 2 * np.pi * (np.arange(5) + first) / 5
        return np.array([np.full(5, 2.0 / 2), np.cos(angle), np.sin(angle)])

    return Errors(relative_error(printed(1), judge), relative_error(printed(0), judge))


@holds("PGV", "55", "Jacobian of the spherical joints")
def joint_jacobian():
    judge = jax.jit(jax.jacfwd(package_gap))(jnp.zeros(M))
    return relative_error(sail.joint_jacobian(), judge)
