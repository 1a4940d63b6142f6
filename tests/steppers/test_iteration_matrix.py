"""The iteration matrix, assembled block by block, against derivatives of the whole residual.

A column of M + s (K + c C) and of the constraint gradients is s times the derivative of the equations of
motion, and the derivative of the constraints, along dq, dv = c dq, dvdot = dq / s and dlam = x / s. The
positions of the roots follow the hub; their equations act on the hub by the transposed map.
"""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from esail_jax import iteration_matrix
from esail_jax.coordinates import Coordinates
from esail_jax.numerics import bordered
from esail_jax.numerics.angles import rotation_by
from esail_jax.scenes.loading import load_scene
from esail_jax.scenes.structure import split
from esail_jax.steppers.generalized_alpha import GeneralizedAlpha
from oracles.dense import Dense
from support.quick import build_jitted, jit, quickly

TOLERANCE = 1e-10
"""Relative error of every column. Measured: at most 1e-15."""

TIME, S, C = jnp.asarray(30.0), jnp.asarray(1.0), jnp.asarray(2.0)
"""Time [s], s [s^2] and c [1/s]. The step is so long that mass, stiffness and damping are of equal size."""

SMALL = {"tethers.count": 3, "tethers.elements": 2}
BENT = SMALL | {
    "tethers.second_moment": 1e-4
}  # m^4; otherwise bending would be negligible beside stretching
SCENES = {
    "hub": ("baseline", True, BENT),
    "hub, clamped": ("baseline", True, BENT | {"tethers.root": "clamped"}),
    "no hub": ("baseline", False, BENT),
    "no hub, clamped": ("baseline", False, BENT | {"tethers.root": "clamped"}),
    "truss": ("truss", True, SMALL),
}


def random_state(system, q, v):
    """Random q, v, vdot and multipliers that violate the constraints; components differ in size."""
    random = np.random.default_rng(0)

    def moved(x, position, slope):
        sizes = np.array([position, slope])[: x.tether.shape[0], None, None, None]
        tether = x.tether + sizes * random.normal(size=x.tether.shape)
        hub = None if x.hub is None else x.hub + 0.05 * random.normal(size=x.hub.shape)
        return Coordinates(tether, hub)

    rest = jax.tree.map(jnp.zeros_like, q)
    lam = jax.tree.map(lambda x: x + random.normal(size=x.shape), system.no_multipliers())
    return moved(q, 20.0, 0.02), moved(v, 1.0, 1e-3), moved(rest, 0.1, 1e-4), lam


# Every scene compiles a program of its own and runs it once.
@jit
def assembled(system, q, v, lam):
    return iteration_matrix.tangent(system, TIME, q, v, lam, S, C)


@jit
def derivatives(system, state, columns):
    """The derivatives of all equations along the columns, in the layout of the solver."""

    def equations(q, v, vdot, lam):
        q, pull_back = jax.vjp(lambda q: system.place_roots(TIME, q), q)
        v, vdot = (system.place_roots(TIME, x, n) for n, x in ((1, v), (2, vdot)))
        residual, _ = system.residual(TIME, q, v, vdot, lam)
        return pull_back(residual.forces)[0], residual.constraints

    def along(column):
        dq, dlam = iteration_matrix.from_vector(system, column)
        tangents = dq, *(jax.tree.map(lambda x, f=f: f * x, dq) for f in (C, 1 / S))
        tangents = *tangents, jax.tree.map(lambda x: x / S, dlam)
        _, (forces, constraints) = jax.jvp(equations, state, tangents)
        return iteration_matrix.to_vector(system, jax.tree.map(lambda x: S * x, forces), constraints)

    return jax.vmap(along)(columns)


@pytest.mark.parametrize("name", quickly(SCENES, ("truss",)))
def test_tangent_is_the_derivative_of_the_residual(name):
    builtin, hub, overrides = SCENES[name]
    scene = load_scene(builtin).replace(overrides)
    if not hub:
        scene = dataclasses.replace(scene, hub=None)
    model = build_jitted(*split(scene))
    system = model.system
    state = q, v, _, lam = random_state(system, model.q, model.v)
    q, v = system.place_roots(TIME, q), system.place_roots(TIME, v, 1)
    matrix = jax.tree.map(np.asarray, assembled(system, q, v, lam))

    dense = Dense(matrix)
    columns = jax.tree.map(jnp.asarray, dense.unflatten(np.eye(dense.count)))
    rows = jax.tree.map(np.asarray, derivatives(system, state, columns))
    jacobian = np.stack(
        [dense.flatten(jax.tree.map(lambda x, j=j: x[j], rows)) for j in range(dense.count)], 1
    )
    jacobian = np.delete(np.delete(jacobian, dense.held, 0), dense.held, 1)

    error = np.abs(dense.independent(matrix) - jacobian).max(0) / np.abs(jacobian).max(0)
    assert error.max() < TOLERANCE


def test_one_factorisation_of_the_mass_serves_every_attitude():
    """One factorisation of the mass matrix gives the accelerations and multipliers at any attitude of the
    hub.

    The loads are unit loads; the hub is rotated by 1.0 rad about a skew axis. The reference is the mass
    matrix factored at that attitude. Rounding of two inverses: 1e-9.
    """
    model = build_jitted(*split(load_scene("baseline", SMALL)))
    system = model.system
    turn = rotation_by(jnp.array([0.3, -0.7, 0.6]))
    q = model.q.rotate(turn)
    loads = iteration_matrix.to_vector(
        system, jax.tree.map(jnp.ones_like, q), jax.tree.map(jnp.ones_like, system.no_multipliers())
    )

    @jit
    def solved(inertia):
        matrix, factors = iteration_matrix.factor_mass(system, TIME, q, inertia)
        return jnp.concatenate(
            [jnp.ravel(x) for x in jax.tree.leaves(bordered.solve(matrix, factors, loads))]
        )

    there, turned = solved(None), solved(jit(iteration_matrix.inertia_of)(system))
    assert np.abs(turned - there).max() < 1e-9 * np.abs(there).max()


def test_factors_of_a_step_serve_every_attitude():
    """The factors of generalized-alpha's iteration at one attitude, rotated by 1.0 rad, are those at the
    other.

    Inertia, elasticity, damping and rigidity do not depend on direction; the wind does, and is left out.
    Rounding of two inverses: 1e-9.
    """
    model = build_jitted(*split(load_scene("voltage-off", SMALL)))
    system = dataclasses.replace(model.system, loads=())
    stepper = GeneralizedAlpha(jnp.asarray(0.1), jnp.asarray(0.25))
    turn = rotation_by(jnp.array([0.3, -0.7, 0.6]))
    there = tuple(x.rotate(turn) for x in (model.q, model.v))
    lam = system.no_multipliers()
    forces = jax.tree.map(jnp.ones_like, model.q)
    gaps = jax.tree.map(jnp.ones_like, lam)

    @jit
    def solved(q, v, turned):
        found = stepper.factor(system, TIME, q, v, lam).solve(system, turned, forces, gaps)
        return jnp.concatenate([jnp.ravel(x) for x in jax.tree.leaves(found)])

    found, right = solved(model.q, model.v, turn), solved(*there, jnp.eye(3))
    assert np.abs(found - right).max() < 1e-9 * np.abs(right).max()
