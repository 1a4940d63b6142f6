"""Small sails whose modes are known otherwise, and the comparison with a dense linearisation."""

import jax.numpy as jnp
import numpy as np

import esail_jax as esail
from esail_jax.equilibria import equilibrium
from esail_jax.equilibria import modes as dense_modes
from esail_jax.modal.steady_load import with_mean_loads
from esail_jax.scenes.method_choice import with_method
from esail_jax.scenes.structure import split
from support.quick import build_jitted, jit

SPIN = 4e-3
SMALL = {"tethers.count": 4, "tethers.elements": 2}
UNEQUAL = {
    "tethers.length": [1e4, 9e3, 1.1e4, 8e3],
    "remote_units.mass": [1.5, 1.2, 1.5, 2.0],
    "voltage.value": [2e4, 1.5e4, 2e4, 1.8e4],
}

RING = {
    "auxiliary_tethers.length": 14144.0,
    "auxiliary_tethers.area": 3e-9,
    "auxiliary_tethers.density": 1400.0,
    "auxiliary_tethers.youngs_modulus": 5e9,
    "auxiliary_tethers.axial_damping_time": 0.01,
}
"""Auxiliary tethers between the tips of four tethers of 10 km, as long as the chords of their circle."""


def built(name, overrides):
    """The system under its mean load, its start, and its angular velocity."""
    model = build_jitted(*split(with_method(esail.load_scene(name, overrides))))
    axes = model.system.rotation(jnp.zeros(()), model.q)
    return with_mean_loads(model.system, axes), model.q, axes[:, 0] * SPIN


def worst_of_matches(these, those):
    """The largest relative distance of one of `these` eigenvalues to the nearest of `those`."""
    return (np.abs(these[:, None] - those).min(1) / np.abs(these)).max()


def vibrating(values):
    """Selects eigenvalues above 2 Omega that are not overdamped, one of each conjugate pair."""
    return (np.abs(values) > 2.0 * SPIN) & (values.imag > 1e-4 * np.abs(values))


def compared_with_dense(overrides):
    """The worst difference between the table and the derivatives of the residual as one dense
    matrix with its own equilibrium and eigenvalues, and the numbers of modes of both."""
    system, start, spin = built("sun-facing", overrides)
    other = dense_modes(system, jit(equilibrium)(system, start, spin))
    table = esail.modes("sun-facing", overrides, converge=False)
    # The dense eigenvalues are exact to rounding of the largest one: slow motions are left out.
    theirs = other.eigenvalue[vibrating(other.eigenvalue)]
    ours = table.eigenvalue[vibrating(table.eigenvalue)]
    worst = max(worst_of_matches(theirs, ours), worst_of_matches(ours, theirs))
    return worst, len(ours), len(theirs)
