"""Corotational axes of hub and nodes, with which the factors of an iteration are rotated."""

import jax.numpy as jnp
import numpy as np

from esail_jax.coordinates import Coordinates
from esail_jax.numerics.angles import rotation_by
from esail_jax.steppers.corotational_axes import Axes, turn


def unit_vectors(seed: int) -> np.ndarray:
    """A random unit vector for every node of every tether."""
    vectors = np.random.default_rng(seed).normal(size=(3, 8))
    return vectors / np.linalg.norm(vectors, axis=0)


def random_coordinates(seed: int) -> Coordinates:
    random = np.random.default_rng(seed)
    tether, hub = random.normal(size=(2, 3, 4, 2)), random.normal(size=(4, 3))
    return Coordinates(jnp.asarray(tether), jnp.asarray(hub))


HUB = rotation_by(jnp.array([0.3, -0.8, 0.5]))
LOOSE = np.array([[0.0] * 2 + [1.0] * 6, [1.0] * 8])
"""Mask of free coordinates. The positions of the roots, the first nodes of both tethers, are prescribed."""

BEFORE = Axes(jnp.eye(3), jnp.asarray(unit_vectors(0)), LOOSE)
AFTER = Axes(HUB, jnp.asarray(unit_vectors(1)), LOOSE)


def nodal(along) -> jnp.ndarray:
    """Reshapes directions by node and tether."""
    return along.reshape(3, 4, 2)


def test_directions_are_taken_along():
    """A vector along the tether before the rotation points along the tether after it, to rounding.

    This holds for every node coordinate but the position of the root, which rotates with the hub.
    """
    before, after = nodal(BEFORE.along), nodal(AFTER.along)
    turned = turn(BEFORE, AFTER).to_current(Coordinates(jnp.stack([before, before]), jnp.eye(4, 3)))
    assert np.allclose(turned.tether[:, :, 1:], np.stack([after] * 2)[:, :, 1:], rtol=0, atol=1e-14)
    assert np.allclose(turned.tether[1, :, 0], after[:, 0], rtol=0, atol=1e-14)
    assert np.allclose(turned.tether[0, :, 0], HUB @ before[:, 0], rtol=0, atol=1e-14)
    assert np.allclose(turned.hub, jnp.eye(4, 3) @ HUB.T, rtol=0, atol=1e-14)


def test_back_is_the_inverse_and_the_transpose_of_forth():
    """The rotation is orthogonal: x . forth(y) = back(x) . y and back(forth(y)) = y."""
    there, x, y = turn(BEFORE, AFTER), random_coordinates(2), random_coordinates(3)
    again = there.to_reference(there.to_current(y))
    assert np.allclose(again.tether, y.tether, rtol=0, atol=1e-13)
    assert np.allclose(again.hub, y.hub, rtol=0, atol=1e-13)

    def product(a, b):
        return (a.tether * b.tether).sum() + (a.hub * b.hub).sum()

    assert abs(product(x, there.to_current(y)) - product(there.to_reference(x), y)) < 1e-13


def test_no_shortest_turn_leaves_the_hub():
    """If a direction is reversed or zero, there is no unique shortest rotation, and vectors rotate with
    the hub."""
    for other in (-jnp.tensordot(HUB, BEFORE.along, 1), jnp.zeros_like(BEFORE.along)):
        y = random_coordinates(4)
        turned = turn(BEFORE, Axes(HUB, other, LOOSE)).to_current(y)
        assert np.allclose(turned.tether, y.rotate(HUB).tether, rtol=0, atol=1e-14)
