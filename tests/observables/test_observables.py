"""Observables that the papers do not define.

The oracles `pgv_g_angles.py` to `pgv_k_text.py` test the others.
"""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from esail_jax.equilibria.moving_frame import MovingFrame
from esail_jax.numerics.angles import euler_angles, rotation_of, smallest_eigenvector
from esail_jax.observables import chain, hint_at, sail
from esail_jax.observables.instant import Instant, Shift
from esail_jax.observables.meanings import MEANINGS
from esail_jax.observables.sail import total_angular_momentum
from esail_jax.scenes.loading import load_scene
from esail_jax.simulation.solution import Solution
from esail_jax.steppers.results import RESULTS
from oracles.ledger import relative_error
from oracles.pgv_h_roots import hub_force_and_torque
from oracles.sail_matrices import ELEMENT, WEIGHTS, XI, shapes
from oracles.sail_states import (
    B_P,
    NODES,
    ORIGIN,
    START_ENERGY,
    STATES,
    WORK,
    P,
    State,
    flat,
    look,
    model,
    node,
    random_placement,
    states,
)


def test_normal_of_a_symmetric_sail_has_a_derivative():
    """The eigenvector of the smallest eigenvalue has a derivative if the two other eigenvalues are equal.

    dn = -(1 - n n^T) dA n / (mu - lambda) for eigenvalues lambda, mu, mu. Evenly placed tips have such a
    matrix; the derivative of all three eigenvectors does not exist there. Forward and reverse mode, to
    rounding.
    """
    rng = np.random.default_rng(2)
    axes, change = np.linalg.qr(rng.normal(size=(3, 3)))[0], rng.normal(size=(3, 3))
    matrix, change = (jnp.asarray(x) for x in (axes @ np.diag([1.0, 5.0, 5.0]) @ axes.T, change + change.T))
    normal, moved = jax.jvp(smallest_eigenvector, (matrix,), (change,))
    np.testing.assert_allclose(abs(normal @ axes[:, 0]), 1.0, rtol=1e-14)
    expected = (np.outer(normal, normal) - np.eye(3)) @ change @ normal / 4.0
    np.testing.assert_allclose(moved, expected, atol=1e-14)
    pulled = jax.vjp(smallest_eigenvector, matrix)[1](jnp.arange(3.0))[0]
    np.testing.assert_allclose((pulled * change).sum(), jnp.arange(3.0) @ moved, rtol=1e-13)


FORCES = jnp.array([[3.0, -1.0, -2.0], [0.5, 0.5, -1.0], [4.0, -3.0, -1.0]])
"""Forces of three tethers in O, whose sum is zero."""


@pytest.mark.parametrize(
    ("added", "angle"),
    [
        (jnp.zeros(3), jnp.nan),
        (jnp.array([1e-13, 2e-13, -3e-13]), jnp.nan),
        (jnp.array([3e-6, 4e-6, 0.0]), 0.5 * jnp.pi),
        (jnp.array([0.0, 0.0, -1.0]), jnp.pi),
        (jnp.array([3.0, 4.0, 5.0]), 0.25 * jnp.pi),
    ],
)
def test_a_sum_that_is_rounding_has_no_angle(added, angle):
    """Forces that balance each other but for 1e-14 of their size have no direction: NaN, not the direction
    of the rounding. A millionth of their size has one. So it is in a batch."""

    def found(added):
        return sail.angle_of_sum(jnp.eye(3), FORCES + added[:, None] / 3.0)

    np.testing.assert_allclose(found(added), angle, rtol=1e-9)
    np.testing.assert_allclose(jax.vmap(found)(jnp.stack([added, added])), [angle, angle], rtol=1e-9)


def test_angles_of_nothing_and_their_derivatives():
    """No force has no direction. Where there is one the derivative is that of the formula, in both modes
    and in second order; it is never NaN beside an angle that is a number."""
    assert jnp.isnan(sail.angle_of_sum(jnp.eye(3), jnp.zeros((3, 3))))

    def angle(x):
        return sail.angle_of_sum(jnp.eye(3), jnp.zeros((3, 3)).at[0, 0].set(x).at[2, 1].set(2.0))

    for x in (0.0, 1.0):  # atan2(|x|, 2): the derivative at the kink is zero
        expected = 2.0 / (4.0 + x**2) if x else 0.0
        np.testing.assert_allclose(jax.grad(angle)(x), expected, rtol=1e-14)
        np.testing.assert_allclose(jax.jvp(angle, (x,), (1.0,))[1], expected, rtol=1e-14)
    np.testing.assert_allclose(jax.grad(jax.grad(angle))(1.0), -4.0 / 25.0, rtol=1e-14)


@pytest.mark.parametrize("tilt", [0.0, 1e-15, jnp.pi - 1e-15, 1e-6, jnp.pi - 1e-6, 0.3, -0.3])
def test_a_normal_along_the_sun_line_has_no_precession_angle(tilt):
    """The normal (sin a cos d, sin a sin d, cos a) has the precession angle d = 2 rad, unless sin a is
    rounding, facing the Sun or away from it."""
    normal = jnp.array([jnp.sin(tilt) * jnp.cos(2.0), jnp.sin(tilt) * jnp.sin(2.0), jnp.cos(tilt)])
    expected = jnp.nan if abs(jnp.sin(tilt)) < 1e-12 else 2.0 if tilt > 0.0 else 2.0 - jnp.pi
    np.testing.assert_allclose(sail.precession(jnp.eye(3), normal), expected, rtol=1e-12)


@pytest.mark.parametrize("theta", [0.3, -1.2, 0.5 * np.pi, -0.5 * np.pi])
def test_rotation_and_angles_are_inverse(theta):
    """The matrix of the angles of a matrix is this matrix, also at gimbal lock, where the angles are not
    unique. It is the product of the three rotations."""

    def about(axis, angle):
        i, j = [(1, 2), (2, 0), (0, 1)][axis]
        turn = np.eye(3)
        turn[[i, j], [i, j]], turn[j, i], turn[i, j] = np.cos(angle), np.sin(angle), -np.sin(angle)
        return turn

    matrix = about(2, 2.5) @ about(1, theta) @ about(0, -0.7)
    np.testing.assert_allclose(rotation_of(jnp.array([2.5, theta, -0.7])), matrix, atol=1e-15)
    np.testing.assert_allclose(rotation_of(euler_angles(jnp.asarray(matrix))), matrix, atol=1e-15)


def test_a_name_that_a_run_lacks_is_answered_by_what_it_needs_or_by_near_names():
    """Also in a solution, which says first what was not saved. A word of several names gives them."""
    rows = {name: np.zeros(2) for name in ("voltage", "dissipated_power", "external_power")}
    solution = Solution(np.arange(2.0), rows, RESULTS.successful, None, {}, scene=load_scene("baseline"))
    for name, hint in (
        ("electric_power", " (only with `tethers.wire_radius`)"),
        ("node_position_I", " (saved on request, with `save`)"),
        ("volage", " (perhaps `voltage`)"),
        ("power", " (perhaps `dissipated_power` or `external_power`)"),
        ("xyz", ""),
    ):
        with pytest.raises(KeyError) as caught:
            solution[name]
        assert caught.value.args == (f"{name!r} is no observable of this run{hint}",)
    saved = dataclasses.replace(solution, save=("voltage",))
    with pytest.raises(KeyError, match=r"'coning_angle' .* not among those of `save`"):
        saved["coning_angle"]
    assert hint_at("tip_position_I", ["joint_position"], of_chain=True) == " (perhaps `joint_position`)"
    with pytest.raises(KeyError) as caught:
        solution.about("conning_angle")
    assert caught.value.args == ("'conning_angle' is no observable (perhaps `coning_angle`)",)


@pytest.mark.nightly
def test_smallest_distance_is_that_of_a_dense_search():
    """The smallest distance is the minimum over every remote unit and 10,001 points of every segment of
    the others."""
    share = np.linspace(0.0, 1.0, 10_001)[:, None]
    for state in states():
        places = np.array(
            [[B_P @ node(i, j) @ state.q for j in range(1, NODES + 1)] for i in range(1, P + 1)]
        )
        found = [
            np.linalg.norm(places[i, -1] - (start + share * (end - start)), axis=1).min()
            for i in range(P)
            for k in range(P)
            for start, end in zip(places[k, :-1], places[k, 1:], strict=True)
            if k != i
        ]
        np.testing.assert_allclose(state.seen["smallest_tether_distance"], min(found), rtol=1e-7)


def test_energy_balance_counts_work_and_losses():
    for state in states():
        seen = state.seen
        assert (seen["external_work"], seen["dissipated_energy"]) == WORK
        energy = seen["kinetic_energy"] + seen["elastic_energy"]
        change = energy - START_ENERGY - WORK[0] + WORK[1]
        np.testing.assert_allclose(seen["energy_balance_error"], change, rtol=1e-12)


def test_external_power_is_the_thrust_times_the_velocity():
    for state in states():
        power = 0.0
        for i in range(1, P + 1):
            for j in range(1, NODES):
                ends = np.concatenate([node(i, j) @ state.v, node(i, j + 1) @ state.v]).reshape(4, 3)
                velocity = shapes(XI, ELEMENT[i - 1]).T @ ends
                force = state.seen["load"][:, :, j - 1, i - 1].T
                power += ELEMENT[i - 1] * WEIGHTS @ (force * velocity).sum(1)
        np.testing.assert_allclose(state.seen["external_power"], power, rtol=1e-12)


@pytest.mark.nightly
def test_clamped_roots_turn_the_hub_by_their_couples_too():
    """The torque of Euler's equations of the hub is minus the moment of the forces and couples on the
    roots."""
    rng, (system, _, start, *_) = np.random.default_rng(3), model({"tethers.root": "clamped"})
    # The clamps prescribe the outward direction, in which the tethers start.
    assert np.abs(system.constraints(jnp.zeros(()), start).clamp).max() < 1e-12
    placed = [random_placement(rng, system) for _ in range(STATES)]
    seen = look(system, ORIGIN, [x[0] for x in placed], [x[1] for x in placed])
    for (q, v, turn, omega), view in zip(placed, seen, strict=True):
        state = State(flat(q), flat(v), turn, omega, view)
        _, torque = hub_force_and_torque(state)
        assert relative_error(-state.orbital @ view["reaction_moment_O"], torque) < 1e-10


def test_every_observable_has_a_meaning():
    """Those of kinetic energy and work hold for sails and chains."""
    entries = (*sail.OBSERVABLES, *sail.ON_REQUEST, *chain.OBSERVABLES, chain.ENERGY_ERROR)
    assert {entry.name for entry in entries} == set(MEANINGS)
    assert all(entry.meaning.endswith(".") and entry.meaning[0].isupper() for entry in entries)


def test_a_hub_that_turns_back_does_not_change_the_sense_of_lagging():
    """The hub turns back for a while, where the sail as a whole turns on: the lag keeps its sign. It has
    the other sign if all of the sail turns the other way."""
    built, rng = model(), np.random.default_rng(3)
    q, _, turn, _ = random_placement(rng, built.system)
    axis = jnp.asarray(turn[:, 0])

    def turning(hub, tethers):
        around = MovingFrame(axis, jnp.zeros(3)).turned(built.system.centred(q))
        return around._replace(hub=hub * around.hub, tether=tethers * around.tether)

    rates = [turning(*x) for x in ((1.0, 1.0), (-0.01, 1.0), (-1.0, -1.0))]
    rates += [rates[0]] * (STATES - len(rates))
    on, back, other = (
        seen["lagging_angle"] for seen in look(built.system, ORIGIN, [q] * STATES, rates)[:3]
    )
    np.testing.assert_allclose(back, on, rtol=1e-12)
    np.testing.assert_allclose(other, -on, rtol=1e-12)


def test_total_angular_momentum_is_about_the_origin_of_I():
    """Where the origin of the coordinates moves relative to that of I, by s with the velocity w, it is that
    of positions r + s with velocities v + w: to rounding."""
    built, rng = model(), np.random.default_rng(4)
    system, zero = built.system, jnp.zeros(())
    q, *_ = random_placement(rng, system)
    v = jax.tree.map(lambda x: jnp.asarray(rng.normal(size=x.shape)), q)
    s, w = jnp.array([3e3, -2e3, 5e3]), jnp.array([0.7, 0.2, -0.4])

    def observed(shift):
        state = system, zero, q, v, q, system.no_multipliers(), system.no_power, zero, jnp.asarray(ORIGIN)
        return total_angular_momentum(Instant(*state, q, system.no_power, None, shift=shift))

    exact = system.angular_momentum(q.axpy(1.0, system.uniform(s)), v.axpy(1.0, system.uniform(w)))
    moving = observed(Shift(s, w, jnp.zeros(3)))
    assert np.abs(moving - exact).max() < 1e-12 * np.abs(exact).max()
    assert np.array_equal(observed(None), system.angular_momentum(q, v))
