"""The constraint violation of a saved instant, which the `numerics` of a run hold."""

import jax.numpy as jnp
import numpy as np
import pytest

from esail_jax import load_scene
from esail_jax.scenes.build import build
from esail_jax.scenes.structure import split
from esail_jax.simulation.look import violation
from esail_jax.steppers.stepper import Point
from esail_jax.system import Power


def test_it_is_the_largest_of_all_constraints():
    """On the constraints it is rounding. If one of the hub's points, 1 m from the centre, is 1 cm too far,
    its distance d from another one, sqrt(2) m away at right angles, violates the constraint
    (d^2 - 2)/(2 sqrt 2). A clamped tether turned against the hub violates the clamp far more."""
    scene = load_scene("baseline", {"tethers.count": 2, "tethers.elements": 1, "tethers.root": "clamped"})
    built = build(*split(scene))
    zero, q = jnp.zeros(()), built.q

    def at(q):
        return float(violation(built.system, Point(zero, q, built.v, Power(zero, zero), jnp.asarray(True))))

    assert at(q) < 1e-12
    longer = q._replace(hub=q.hub.at[2].multiply(1.01))
    assert at(longer) == pytest.approx((1.01**2 - 1.0) / (2.0 * np.sqrt(2.0)), rel=1e-9)
    turned = longer._replace(tether=q.tether.at[1, 0, 0, 1].add(0.1))
    assert at(turned) > 1.0
